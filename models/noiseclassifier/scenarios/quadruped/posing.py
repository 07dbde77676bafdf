"""Poses of the body over its feet: roll, pitch and shift, as sums of slow sines."""

from typing import NamedTuple

import numpy as np

from noiseclassifier.scenarios.paths import minimum_jerk
from noisemodel.types import Array

TILT = (0.15, 0.12)
"""Largest roll and pitch, in [rad]."""
SHIFT = (0.08, 0.06, 0.08)
"""Largest shift ahead, to the left and up, as a share of the height of the centre of mass."""
FREQUENCY = (0.2, 1.5)
"""Frequencies of the sines, in [Hz]."""
SINES = 3
"""Sines per axis."""
FADE = 0.8
"""Time of fading in and out, in [s]."""


class Poses(NamedTuple):
    """Pose of the body at every tick."""

    tilt: Array
    """Roll and pitch, shape (ticks, 2), in [rad]."""
    shift: Array
    """Ahead, to the left, up, shape (ticks, 3), in [m]."""


def poses(time: Array, rng: np.random.Generator, share: float, *, size: float) -> Poses:
    """Random poses, from and to the neutral one.

    Args:
        time: Shape (times,), in [s].
        size: Height of the centre of mass, in [m].
    """
    if not share:
        return Poses(np.zeros((len(time), 2)), np.zeros((len(time), 3)))
    largest = share * np.array((*TILT, *(size * shift for shift in SHIFT)))
    lowest, highest = FREQUENCY
    spread = (highest / lowest) ** rng.uniform(size=(SINES, len(largest)))
    rates = 2 * np.pi * lowest * spread
    phases = rng.uniform(0, 2 * np.pi, rates.shape)
    weights = rng.dirichlet(np.ones(SINES), len(largest)).T / (rates / rates.min(axis=0))
    inside = np.clip(np.minimum(time - time[0], time[-1] - time) / FADE, 0, 1)
    angles = time[:, None, None] * rates + phases
    waves = minimum_jerk(inside)[:, None] * (weights * np.sin(angles)).sum(axis=1) * largest
    return Poses(waves[:, :2], waves[:, 2:])
