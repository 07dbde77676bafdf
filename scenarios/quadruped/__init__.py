"""Quadrupeds that trot."""
