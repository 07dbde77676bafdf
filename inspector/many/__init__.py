"""Several runs on one time axis: status, classes and level of each, the worst marked."""
