"""The band of frequencies in which a failure lies."""

from collections.abc import Sequence

import numpy as np

from inspector.localisation.quiet import quiet
from models import Event
from noisemodel import Block, Run
from noisemodel.links import FAST
from noisemodel.types import Array, Real

SHORTEST, LONGEST = 0.1, 0.4
"""Windows of the spectrum, in [s]: as long as the failure, between these."""
MOST = 16
"""Windows that are looked at of a failure."""
USUAL = 90.0
"""Percentile of what quiet stretches have: a robot that walks hums now and then."""
SHARE = 0.7
"""Of the excess power that lies in the band."""


def band(
    run: Run, failure: Event | Block, failures: Sequence[Event | Block]
) -> tuple[float, float] | None:
    """Find the frequencies at which the joints vibrate more than they use to.

    The power spectrum of the measured velocities above 10 Hz, mean over the failure, less what
    one of ten quiet stretches exceeds, is the excess; the band is the narrowest that holds 70 %
    of it.

    Args:
        run: The run.
        failure: A finding, or an annotated block.
        failures: All failures of the run, found and annotated.

    Returns:
        Lowest and highest frequency, in [Hz], as sharp as the inverse of the failure's duration
        or 2.5 Hz; None if nothing exceeds the usual.
    """
    length = min(max(failure.stop - failure.start, SHORTEST), LONGEST, run.duration)
    size = max(2, round(length * run.rate))
    first, last = np.searchsorted(run.time, (failure.start, failure.stop))
    # A failure that is shorter than a window is looked at with what is around it.
    first = max(0, min(int(first), len(run.time) - size))
    starts = np.arange(first, max(first + 1, int(last) - size + 1), max(1, size // 2))
    if len(starts) > MOST:
        starts = starts[np.linspace(0, len(starts) - 1, MOST).astype(int)]
    during = [slice(start, start + size) for start in starts.tolist()]
    during = [part for part in during if run.mask[part].all()]
    if not during:
        return None
    usual = [_spectrum(run.velocity[part]) for part in quiet(run, failures, length=length)]
    excess = np.mean([_spectrum(run.velocity[part]) for part in during], axis=0)
    if usual:
        excess = excess - np.percentile(usual, USUAL, axis=0)
    frequency = np.arange(len(excess)) * run.rate / size
    excess = np.where(frequency >= FAST, np.maximum(excess, 0.0), 0.0)
    if not excess.sum() > 0.0:
        return None
    low, high = _narrowest(excess)
    return float(frequency[low]), float(frequency[high])


def _spectrum(velocity: Real) -> Array:
    """Power of all joints together, shape (frequency,)."""
    # A straight line is no vibration, and would leak into all frequencies.
    line = np.linspace(velocity[0], velocity[-1], len(velocity), dtype=np.float64)
    waves = np.fft.rfft((velocity - line).T * np.hanning(len(velocity)), axis=1)
    return np.asarray(np.square(np.abs(waves)).sum(axis=0))


def _narrowest(excess: Array) -> tuple[int, int]:
    """First and last bin of the shortest stretch that holds its share of the whole."""
    below = np.concatenate(([0.0], np.cumsum(excess)))
    wanted = below[:-1] + SHARE * below[-1]
    ends = np.searchsorted(below, wanted, side="left")
    starts = np.flatnonzero(ends < len(below))
    best = starts[np.argmin(ends[starts] - starts)]
    return int(best), int(ends[best]) - 1
