"""A run as a rerun recording, and the viewers that show it."""
