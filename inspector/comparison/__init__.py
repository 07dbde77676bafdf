"""Comparisons of noise models as tables, pictures and recordings."""
