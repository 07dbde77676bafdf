"""Quiet stretches of a run, in which nothing failed: the reference for its failures."""

from collections.abc import Sequence

import numpy as np

from noiseclassifier import Event
from noisemodel import Block, Run

MOST = 16
"""Most stretches that are picked; a long run is not read whole."""


def quiet_stretches(
    run: Run, failures: Sequence[Event | Block], *, length: float, most: int = MOST
) -> list[slice]:
    """Pick stretches without failures or gaps, spread evenly over a run.

    Args:
        length: Length of a stretch, in [s].
    """
    size = max(1, round(length * run.rate))
    free = run.mask.copy()
    for failure in failures:
        first, last = np.searchsorted(run.time, (failure.start, failure.stop))
        free[first:last] = False
    count = len(free) // size
    starts = size * np.flatnonzero(free[: count * size].reshape(count, size).all(axis=1))
    if len(starts) > most:
        starts = starts[np.linspace(0, len(starts) - 1, most).astype(int)]
    return [slice(start, start + size) for start in starts.tolist()]
