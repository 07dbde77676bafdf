"""Where one run lies on the time axis of another."""
