"""Fewer points for a plot, without losing a peak."""

import numpy as np

from noisemodel.types import Array, Real


def extremes(time: Array, values: Real, *, points: int) -> tuple[Array, Array]:
    """Keep the least and the greatest value of each bucket of samples.

    Args:
        time: Shape (samples,), in [s].
        values: Shape (samples, series).
        points: How many points each series may have at most.

    Returns:
        Times, shape (kept,), and values, shape (kept, series), kept ≤ points; everything, if
        there are not more samples than points.
    """
    if len(time) <= points or not values.shape[1]:
        return time, np.asarray(values, dtype=np.float64)
    size = -(-len(time) // (points // 2))
    starts = np.arange(0, len(time), size)
    whole = len(time) // size * size
    parts = [values[:whole].reshape(-1, size, values.shape[1]), values[None, whole:]]
    parts = [part for part in parts if part.size]
    thin = np.empty((2 * len(starts), values.shape[1]))
    thin[0::2] = np.concatenate([part.min(axis=1) for part in parts])
    thin[1::2] = np.concatenate([part.max(axis=1) for part in parts])
    halves = np.minimum(starts + size // 2, len(time) - 1)
    return time[np.stack((starts, halves), axis=1).ravel()], thin
