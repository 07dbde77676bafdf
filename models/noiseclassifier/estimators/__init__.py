"""Estimators: decision values of features, in NumPy, with training and storage of each kind."""
