"""Humanoids that walk."""
