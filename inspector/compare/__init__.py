"""Two runs or more on one time axis, and noise models beside each other."""
