"""Frequency band of a failure."""

from collections.abc import Sequence

import numpy as np

from inspector.localisation.quiet import quiet_stretches
from noiseclassifier import Event
from noisemodel import Block, Run
from noisemodel.extended import FAST
from noisemodel.types import Array, Real

SHORTEST, LONGEST = 0.1, 0.4
"""Windows of the spectrum, in [s]: as long as the failure, between these."""
MOST = 16
"""Most windows of a failure."""
PERCENTILE = 90.0
"""Percentile of the quiet stretches' spectra that is subtracted: vibration of a robot that walks
comes and goes."""
SHARE = 0.7
"""Share of the excess power that lies in the band."""


def band(
    run: Run, failure: Event | Block, failures: Sequence[Event | Block]
) -> tuple[float, float] | None:
    """Frequency band in which the joints vibrate more than in quiet stretches.

    The excess is the power spectrum of the measured velocities above 10 Hz, mean over the failure,
    less the 90th percentile of the quiet stretches' spectra. The band is the narrowest that holds
    70 % of it.

    Args:
        failures: All failures of the run, found and annotated.

    Returns:
        Lowest and highest frequency, in [Hz]; None without excess. The resolution is the inverse
        of the failure's duration, and 2.5 Hz at best.
    """
    length = min(max(failure.stop - failure.start, SHORTEST), LONGEST, run.duration)
    size = max(2, round(length * run.rate))
    first, last = np.searchsorted(run.time, (failure.start, failure.stop))
    # The window of a shorter failure extends beyond it.
    first = max(0, min(int(first), len(run.time) - size))
    starts = np.arange(first, max(first + 1, int(last) - size + 1), max(1, size // 2))
    if len(starts) > MOST:
        starts = starts[np.linspace(0, len(starts) - 1, MOST).astype(int)]
    during = [slice(start, start + size) for start in starts.tolist()]
    during = [part for part in during if run.mask[part].all()]
    if not during:
        return None
    reference = [
        _spectrum(run.velocity[part]) for part in quiet_stretches(run, failures, length=length)
    ]
    excess = np.mean([_spectrum(run.velocity[part]) for part in during], axis=0)
    if reference:
        excess = excess - np.percentile(reference, PERCENTILE, axis=0)
    frequency = np.arange(len(excess)) * run.rate / size
    excess = np.where(frequency >= FAST, np.maximum(excess, 0.0), 0.0)
    if not excess.sum() > 0.0:
        return None
    low, high = _narrowest(excess)
    return float(frequency[low]), float(frequency[high])


def _spectrum(velocity: Real) -> Array:
    """Power of all joints together, shape (frequency,)."""
    # A trend would leak into all frequencies.
    line = np.linspace(velocity[0], velocity[-1], len(velocity), dtype=np.float64)
    waves = np.fft.rfft((velocity - line).T * np.hanning(len(velocity)), axis=1)
    return np.asarray(np.square(np.abs(waves)).sum(axis=0))


def _narrowest(excess: Array) -> tuple[int, int]:
    """First and last bin of the narrowest band that holds `SHARE` of the whole."""
    below = np.concatenate(([0.0], np.cumsum(excess)))
    wanted = below[:-1] + SHARE * below[-1]
    ends = np.searchsorted(below, wanted, side="left")
    starts = np.flatnonzero(ends < len(below))
    best = starts[np.argmin(ends[starts] - starts)]
    return int(best), int(ends[best]) - 1
