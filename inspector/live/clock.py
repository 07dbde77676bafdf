"""Timestamps of samples: which are taken, and how many were lost before each."""

from typing import NamedTuple

import numpy as np

from inspector.live.warnings import Warnings
from noisemodel.types import Array, Mask

GAP_STEPS = 1.5
"""Steps after which a sample is taken to be missing; timestamps may jitter by less."""
RATE_TOLERANCE = 0.05
"""Share by which the rate of the timestamps may differ from the nominal one."""
LATEST = 1e19
"""Larger stamps are no times, not even in nanoseconds."""
RATE_STEPS = 20
"""Steps from which a rate is estimated."""


class Taken(NamedTuple):
    """Which samples a clock takes."""

    kept: Mask
    """False where time stands still or runs backwards, shape (samples,)."""
    lost: Array
    """Samples that are missing before each of those that are kept, shape (kept,)."""


class Clock:
    """Finds gaps in timestamps.

    Args:
        rate: Nominal samples per second, in [Hz].
        warnings: Where gaps are counted.
    """

    def __init__(self, rate: float, warnings: Warnings) -> None:
        self._rate, self._warnings = rate, warnings
        self._last: float | None = None
        self._checked = False

    def take(self, stamps: Array) -> Taken:
        """Check the timestamps of some samples.

        Args:
            stamps: Timestamps, shape (samples,), in [s].
        """
        finite = np.abs(stamps) < LATEST
        before = -np.inf if self._last is None else self._last
        latest = np.maximum.accumulate(np.where(finite, stamps, -np.inf))
        kept = finite & (stamps > np.maximum(before, np.append(-np.inf, latest[:-1])))
        self._note_dropped(stamps[finite & ~kept], int((~finite).sum()))
        times = stamps[kept]
        steps = self._rate * np.diff(times, prepend=times[:1] if self._last is None else before)
        lost = np.where(steps >= GAP_STEPS, np.round(steps) - 1.0, 0.0)
        if lost.any():
            first = int(np.argmax(lost > 0))
            line = f"gap at {times[first]:.3f} s: {lost[first]:.0f} samples are missing"
            self._warnings.note("missing samples", line, int(lost.sum()))
        self._check_rate(steps)
        if len(times):
            self._last = float(times[-1])
        return Taken(kept, lost)

    def _note_dropped(self, backwards: Array, unknown: int) -> None:
        if len(backwards):
            line = f"time stands still or runs backwards at {backwards[0]:.6g} s: left out"
            self._warnings.note("samples out of order", line, len(backwards))
        self._warnings.note("samples without time", "a time is no number: left out", unknown)

    def _check_rate(self, steps: Array) -> None:
        if self._checked or len(steps) <= RATE_STEPS:
            return
        self._checked = True
        step = float(np.median(steps))
        if abs(step - 1.0) > RATE_TOLERANCE:
            line = (
                f"timestamps have {self._rate / step:.4g} Hz, the nominal rate is"
                f" {self._rate:g} Hz: labels and spectrogram are wrong, set --rate"
            )
            self._warnings.note("wrong rate", line)
