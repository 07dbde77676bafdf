"""Values that stand still and jump: a slow signal, sampled faster by holding it."""

import numpy as np

from noisemodel.types import Mask, Real

FEWEST = 10
"""Jumps that are needed to speak of a rule."""

REGULAR = 0.8
"""Share of the jumps that come at the usual distance."""

LARGER = 1.5
"""How much larger than the smallest jump the usual one is: jumps of one and the same size are a
signal that is rounded."""


def held_for(signal: Real, valid: Mask) -> float:
    """Tell for how many samples a signal is held.

    Args:
        signal: Shape (samples, joints).
        valid: False in gaps, shape (samples,).

    Returns:
        Samples from jump to jump, 1.0 for a signal that is not held.
    """
    changes = (signal[1:] != signal[:-1]).any(axis=1)
    jumps = np.flatnonzero(changes & valid[1:] & valid[:-1])
    if len(jumps) < FEWEST:
        return 1.0
    distances = np.diff(jumps)
    usual = np.median(distances)
    regular = np.abs(distances - usual) <= max(1.0, 0.1 * usual)
    if usual < 2 or regular.mean() < REGULAR:
        return 1.0
    if _one_size(np.abs(signal[jumps + 1].astype(np.float64) - signal[jumps])):
        return 1.0
    return float(distances[regular].mean())


def _one_size(sizes: Real) -> bool:
    """Whether each joint jumps by one step, up or down."""
    sizes = np.where(sizes > 0, sizes, np.nan)
    moving = ~np.isnan(sizes).all(axis=0)
    usual, least = np.nanmedian(sizes[:, moving], axis=0), np.nanmin(sizes[:, moving], axis=0)
    return bool((usual < LARGER * least).all())
