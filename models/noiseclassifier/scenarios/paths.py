"""Smooth paths from rest to rest."""

import numpy as np

from noisemodel.types import Array


def minimum_jerk(share: Array) -> Array:
    """Minimum-jerk path from rest to rest, over time from 0 to 1.

    Flash and Hogan, The coordination of arm movements, J. Neuroscience 1985.
    """
    return share**3 * (10 - 15 * share + 6 * share**2)


def bump(share: Array) -> Array:
    """Path away and back over time from 0 to 1, 1 in the middle, at rest at both ends."""
    return np.asarray(16 * share**2 * (1 - share) ** 2)
