"""What is expected of runs, and what becomes of their findings by it."""
