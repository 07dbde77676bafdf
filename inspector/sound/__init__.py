"""Noise that can be heard: signed signals, mixed by their powers, as sound files."""
