"""Zero-order hold: a slow signal that was sampled faster by holding its values."""

import numpy as np

from noisemodel.types import Mask, Real

FEWEST = 10
"""Fewest jumps that show a hold."""

REGULAR = 0.8
"""Least share of the jumps that come at the median distance."""

LARGER = 1.5
"""Least ratio of median to smallest jump: jumps of one size are quantisation."""


def hold_length(signal: Real, valid: Mask) -> float:
    """Length of the zero-order hold of a signal.

    Args:
        signal: Shape (samples, joints).
        valid: False in gaps, shape (samples,).

    Returns:
        Samples from jump to jump, 1.0 without a hold.
    """
    changes = (signal[1:] != signal[:-1]).any(axis=1)
    jumps = np.flatnonzero(changes & valid[1:] & valid[:-1])
    if len(jumps) < FEWEST:
        return 1.0
    distances = np.diff(jumps)
    middle = np.median(distances)
    regular = np.abs(distances - middle) <= max(1.0, 0.1 * middle)
    if middle < 2 or regular.mean() < REGULAR:
        return 1.0
    if _one_size(np.abs(signal[jumps + 1].astype(np.float64) - signal[jumps])):
        return 1.0
    return float(distances[regular].mean())


def _one_size(sizes: Real) -> bool:
    """Whether each joint jumps by one quantisation step, up or down."""
    sizes = np.where(sizes > 0, sizes, np.nan)
    moving = ~np.isnan(sizes).all(axis=0)
    middle, least = np.nanmedian(sizes[:, moving], axis=0), np.nanmin(sizes[:, moving], axis=0)
    return bool((middle < LARGER * least).all())
