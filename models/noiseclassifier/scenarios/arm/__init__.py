"""Arms that pick from a table."""
