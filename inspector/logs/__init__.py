"""Robot logs read as runs: one reader per format, then the same steps for all of them."""
