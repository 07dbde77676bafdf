"""The stamps of samples: which are taken, and how many were lost before each."""

from typing import NamedTuple

import numpy as np

from inspector.live.warnings import Troubles
from noisemodel.types import Array, Mask

LATE = 1.5
"""Steps after which a sample is taken to be missing; stamps may jitter by less."""
WRONG = 0.05
"""Share by which the stamps' rate may differ from what was said."""
ENOUGH = 20
"""Steps that tell a rate."""


class Taken(NamedTuple):
    """What a clock says of samples."""

    kept: Mask
    """False where time stands still or runs backwards, shape (samples,)."""
    lost: Array
    """Samples that are missing before each of those that are kept, shape (kept,)."""


class Clock:
    """Tells gaps by stamps.

    Args:
        rate: Nominal samples per second, in [Hz].
        troubles: Where gaps are noted.
    """

    def __init__(self, rate: float, troubles: Troubles) -> None:
        self._rate, self._troubles = rate, troubles
        self._last: float | None = None
        self._judged = False

    def take(self, stamps: Array) -> Taken:
        """Look at the stamps of a block.

        Args:
            stamps: Shape (samples,), in [s].
        """
        finite = np.isfinite(stamps)
        before = -np.inf if self._last is None else self._last
        latest = np.maximum.accumulate(np.where(finite, stamps, -np.inf))
        kept = finite & (stamps > np.maximum(before, np.append(-np.inf, latest[:-1])))
        self._note_dropped(stamps[finite & ~kept], int((~finite).sum()))
        times = stamps[kept]
        steps = self._rate * np.diff(times, prepend=times[:1] if self._last is None else before)
        lost = np.where(steps >= LATE, np.round(steps) - 1.0, 0.0)
        if lost.any():
            first = int(np.argmax(lost > 0))
            line = f"gap at {times[first]:.3f} s: {lost[first]:.0f} samples are missing"
            self._troubles.note("missing samples", line, int(lost.sum()))
        self._judge_rate(steps)
        if len(times):
            self._last = float(times[-1])
        return Taken(kept, lost)

    def _note_dropped(self, backwards: Array, unknown: int) -> None:
        if len(backwards):
            line = f"time stands still or runs backwards at {backwards[0]:.6g} s: left out"
            self._troubles.note("samples out of order", line, len(backwards))
        self._troubles.note("samples without time", "a time is no number: left out", unknown)

    def _judge_rate(self, steps: Array) -> None:
        if self._judged or len(steps) <= ENOUGH:
            return
        self._judged = True
        step = float(np.median(steps))
        if abs(step - 1.0) > WRONG:
            line = (
                f"stamps come at {self._rate / step:.4g} Hz, the rate was said to be"
                f" {self._rate:g} Hz: labels and spectrogram are wrong, say the right --rate"
            )
            self._troubles.note("wrong rate", line)
