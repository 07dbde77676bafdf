"""Fewer points for a plot, without losing a peak."""

import numpy as np

from noisemodel.runfile import rows_at_once
from noisemodel.types import Array, Real


def extremes(time: Array, values: Real, *, points: int) -> tuple[Array, Array]:
    """Keep the least and the greatest value of each bucket of samples.

    Args:
        time: Shape (samples,), in [s].
        points: How many points each series may have at most.

    Returns:
        Times, shape (kept,), and values, shape (kept, series), kept ≤ points; everything, if
        there are not more samples than points.
    """
    if len(time) <= points or not values.shape[1]:
        return time, np.asarray(values, dtype=np.float64)
    size = -(-len(time) // (points // 2))
    starts = np.arange(0, len(time), size)
    thin = np.empty((2 * len(starts), values.shape[1]))
    many = size * max(1, rows_at_once(values) // size)
    parts = [_buckets(values[first : first + many], size) for first in range(0, len(time), many)]
    thin[0::2] = np.concatenate([least for least, _ in parts])
    thin[1::2] = np.concatenate([greatest for _, greatest in parts])
    halves = np.minimum(starts + size // 2, len(time) - 1)
    return time[np.stack((starts, halves), axis=1).ravel()], thin


def _buckets(values: Real, size: int) -> tuple[Real, Real]:
    """Least and greatest values of the buckets of a piece, shape (buckets, series) each."""
    whole = len(values) // size * size
    parts = [values[:whole].reshape(-1, size, values.shape[1]), values[None, whole:]]
    parts = [part for part in parts if part.size]
    least = np.concatenate([part.min(axis=1) for part in parts])
    return least, np.concatenate([part.max(axis=1) for part in parts])
