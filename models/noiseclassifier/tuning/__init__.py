"""Tuning: the points of a grid, each as good as a model trained by itself, many at once.

grid -> trial (features once) -> kernels (shared) -> search -> measures
"""
