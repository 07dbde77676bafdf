"""Estimators: each decides on features, in NumPy, and knows how it is trained and stored."""
