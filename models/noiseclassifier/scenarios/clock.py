"""The two clocks of every simulation: control ticks, and samples of drives and physics."""

import numpy as np

from noisemodel.types import Array

TICK = 1e-3
"""Time between two ticks of control, in [s]."""
STEPS = 10
"""Samples per tick."""
STEP = TICK / STEPS
"""Time between two samples, in [s]."""
RATE = round(1 / STEP)
"""Samples per second, in [Hz]."""


def times(count: int, step: float) -> Array:
    """Equidistant times from 0 on, shape (count,), in [s]."""
    return np.arange(count, dtype=np.float64) * step
