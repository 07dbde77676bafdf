"""Where one run lies on the time axis of another, from the motion that both made.

What is laid over each other is the envelope of the motion, the speed of all joints together: it
is there in every run, and does not need joints of the same names.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from noisemodel import Run
from noisemodel.runfile import pieces
from noisemodel.types import Array

CORRELATION = 0.6
"""Correlation of the envelopes below which an alignment is refused."""
ALIKE = 0.9
"""Correlation of envelopes from which two runs are of one motion: less is a motion like it."""
RIVAL = 0.95
"""Share of it that the next best lag may reach: steps and strokes resemble each other."""
STILL = 1e-9
"""Share of its size by which a motion has to change, to be more than rounding."""
SHARE = 0.5
"""Share of the shorter run that has to lie within the longer one."""


class Align(StrEnum):
    """How a run is laid beside another."""

    AUTO = "auto"
    START = "start"
    NONE = "none"


@dataclass(frozen=True)
class Alignment:
    """Where the run after starts on the time axis of the run before.

    Attributes:
        how: "auto" where their motions were laid over each other, "start" where their starts were,
            "none" where their clocks were taken as they are.
        lag: Samples that the run after starts later; negative if it starts earlier.
        seconds: The same in [s].
        correlation: Of the envelopes of their motions, at most 1; NaN where it was not computed.
        rival: That at the next best lag.
        refused: Whether "auto" was requested, and its correlation is too low or ambiguous.
    """

    how: Align
    lag: int
    seconds: float
    correlation: float = float("nan")
    rival: float = float("nan")
    refused: bool = False

    @property
    def alike(self) -> bool:
        """Whether both runs are known to be of one motion."""
        return self.how is Align.AUTO and self.correlation >= ALIKE

    def __str__(self) -> str:
        measured = f"correlation {self.correlation:.2f}, next best {self.rival:.2f}"
        if self.refused:
            return f"from the start: the motions do not determine the lag ({measured})"
        if self.how is Align.AUTO:
            return f"by the motion: after starts {self.seconds:+.4f} s from before ({measured})"
        if self.how is Align.START:
            return "from the start, as requested"
        return f"by the clocks, as requested: after starts {self.seconds:+.4f} s from before"


def align(before: Run, after: Run, how: Align = Align.AUTO) -> Alignment:
    """Find where a run lies on the time axis of another.

    Args:
        after: Another at the same rate; both have desired velocities, or none has.
        how: By their motion, from their starts, or by their clocks.
    """
    rate = before.rate
    if how is Align.START:
        return Alignment(how, 0, 0.0)
    if how is Align.NONE:
        lag = round(float(after.time[0] - before.time[0]) * rate)
        return Alignment(how, lag, lag / rate)
    lag, correlation, rival = _search(before, after)
    if correlation < CORRELATION or rival > RIVAL * correlation:
        return Alignment(Align.START, 0, 0.0, correlation, rival, refused=True)
    return Alignment(how, lag, lag / rate, correlation, rival)


def envelope(run: Run) -> Array:
    """Norm of the joint velocities, desired ones if there are any, shape (samples,).

    The desired motion is the better guide: a defect changes what is measured.
    """
    velocity = run.velocity if run.velocity_desired is None else run.velocity_desired
    power = np.empty(len(velocity))
    for rows in pieces(velocity):
        part = velocity[rows]
        power[rows] = np.einsum("ij,ij->i", part, part, dtype=np.float64)
    return np.sqrt(power)


def _search(before: Run, after: Run) -> tuple[int, float, float]:
    """Find the lag of the highest correlation, that, and the next best."""
    from scipy import fft

    lags = np.arange(1 - len(after.time), len(before.time))
    length = fft.next_fast_len(len(lags), real=True)
    first, second = (_powers(run, length) for run in (before, after))

    def crossed(power: int, other: int) -> Array:
        """Sum after[k]**other before[k + lag]**power over the k that both have, at each lag."""
        return np.asarray(fft.irfft(first[power] * np.conj(second[other]), length)[lags])

    count = np.maximum(np.round(crossed(0, 0)), 1.0)
    energies = [crossed(2, 0), crossed(0, 2)]
    least = [STILL * float(energy.max()) for energy in energies]
    spreads = [
        np.maximum(energy - total**2 / count, floor)
        for energy, total, floor in zip(
            energies, (crossed(1, 0), crossed(0, 1)), least, strict=True
        )
    ]
    # Pearson's correlation over what both have at each lag, gaps left out (Padfield, CVPR 2010).
    product = crossed(1, 1) - crossed(1, 0) * crossed(0, 1) / count
    scale = np.maximum(np.sqrt(spreads[0] * spreads[1]), np.finfo(np.float64).tiny)
    known = min(int(run.mask.sum()) for run in (before, after))
    enough = count >= min(SHARE * known, count.max())
    lags, correlation = lags[enough], (product / scale)[enough]
    best = int(np.argmax(correlation))
    below = np.flatnonzero(correlation < 0.5 * correlation[best])
    left = below[below < best].max(initial=-1)
    right = below[below > best].min(initial=len(correlation))
    beyond = np.concatenate((correlation[: left + 1], correlation[right:]))
    # A peak without an end is as high elsewhere: a motion that only speeds up determines no lag.
    rival = beyond.max(initial=-1.0) if len(beyond) else correlation[best]
    return int(lags[best]), float(correlation[best]), float(rival)


def _powers(run: Run, length: int) -> list[NDArray[np.complex128]]:
    """Transform what is known of a run, its envelope, and the square of that."""
    from scipy import fft

    speed, mask = envelope(run), run.mask
    size = float(np.sqrt(np.mean(speed[mask] ** 2))) if mask.any() else 0.0
    mean = float(speed[mask].mean()) if mask.any() else 0.0
    level = (speed - mean) * mask
    level[np.abs(level) < STILL * size] = 0.0  # rounding is no motion
    return [fft.rfft(signal, length) for signal in (mask.astype(np.float64), level, level**2)]
