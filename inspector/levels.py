"""Levels above 10 Hz in decibels, in steps of 50 ms, and the scales that all pictures share.

Levels are absolute. What the colours span follows the run, of several runs the loudest; while
samples come in, it is fixed.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inspector import colors
from noisemodel.extended import LinkNoise, vibrating_pieces
from noisemodel.noise import REFERENCE_POWER, decibel
from noisemodel.types import Array, Mask, Real

STEP = 0.05
"""Time over which a level is taken, in [s]."""
RANGE_DB = 60.0
"""Range of a scale that follows a run, in [dB]."""
FLOOR_DB = -100.0
"""Least level of a velocity, below any encoder's, in [dB re 1 rad/s]; lower levels are raised."""


@dataclass(frozen=True)
class Scale:
    """Levels that colours show.

    Attributes:
        low: Level of the darkest colour, in [dB].
        high: Level of the lightest one, in [dB].
        unit: Such as "dB re 1 rad/s".
        step: From one tick to the next, in [dB].
        palette: Colours of places from 0 to 1.
    """

    low: float
    high: float
    unit: str
    step: float = 20.0
    palette: Callable[[Array], NDArray[np.uint8]] = colors.heat

    def place(self, level: Array) -> Array:
        """Levels as shares of the scale: 0 at its low end and 1 at its high end, not clipped."""
        return np.asarray((level - self.low) / (self.high - self.low))

    def colours(self, level: Array, *, shades: int = 0) -> NDArray[np.uint8]:
        """Colour levels: the louder, the lighter.

        Args:
            level: Any shape, in [dB]; -inf is the darkest.
            shades: Number of colours; as many as there are levels if 0. Few change rarely.

        Returns:
            Red, green, blue and opacity, shape (…, 4).
        """
        place = np.clip(self.place(level), 0.0, 1.0)
        return self.palette(np.round(place * (shades - 1)) / (shades - 1) if shades else place)

    def following(self, level: Array) -> "Scale":
        """The scale of a run: 60 dB up to its loudest level, so that not all of it is dark.

        A run more than 30 dB below this scale looks quiet all the same.

        Args:
            level: Any shape, in [dB]; what is not finite does not count.
        """
        loudest = float(np.max(level, initial=-np.inf, where=np.isfinite(level)))
        high = max(10.0 * np.ceil(loudest / 10.0), self.high - 30.0)
        return replace(self, low=float(high) - RANGE_DB, high=float(high))

    def down_to(self, low: float | None) -> "Scale":
        """The scale from a chosen level on, in [dB]; as it is if None."""
        return self if low is None else replace(self, low=low, high=max(self.high, low + self.step))

    @property
    def ticks(self) -> tuple[float, ...]:
        """Levels to be labelled, in [dB], from low to high."""
        return tuple(np.arange(self.low, self.high + self.step / 2, self.step).tolist())


JOINTS = Scale(-60.0, 0.0, "dB re 1 rad/s")
"""Velocity of a joint above 10 Hz; of joints that slide re 1 m/s."""
LINKS = Scale(60.0, 120.0, "dB re 1 pW")
"""Sound power of a link's vibration above 10 Hz. A link of 0.1 m² is at 136 dB at 1 m/s."""
SPECTRUM = Scale(-60.0, 0.0, "dB re 1 rad/s")
"""Amplitude of a joint's velocity in a spectrogram; its low end can be chosen."""


def velocity_levels(
    velocity: Real, valid: Mask, rate: float, *, start: float = 0.0
) -> tuple[Array, Array]:
    """The level of velocities above 10 Hz over time, of a noise or of each joint.

    Args:
        velocity: Shape (samples, joints), in [rad/s]; a noise is a single column.
        valid: False in gaps, shape (samples,).
        rate: Samples per second, in [Hz].
        start: Time of the first sample, in [s].

    Returns:
        Starts of the steps of 50 ms, shape (steps,), in [s], and levels of the root mean square of
        what is valid in each, shape (steps, joints), in [dB re 1 rad/s], at least -100; NaN in
        steps that lie in a gap.
    """
    size = max(1, round(STEP * rate))
    firsts = np.arange(0, len(valid), size)
    energy = np.zeros((len(firsts), velocity.shape[1]))
    for rows, fast in vibrating_pieces(velocity, valid, rate, size):
        here = np.arange(0, rows.stop - rows.start, size)
        first = rows.start // size
        energy[first : first + len(here)] = np.add.reduceat(np.square(fast), here, axis=0)
    count = np.add.reduceat(valid.astype(np.float64), firsts)[:, None]
    level = np.maximum(decibel(energy / np.maximum(count, 1.0)), FLOOR_DB)
    return start + firsts / rate, np.asarray(np.where(count > 0.0, level, np.nan))


def link_levels(noise: LinkNoise) -> tuple[Array, Array]:
    """The level of each link's vibration above 10 Hz over time.

    The whole motion would not do: a link that moves fast and smoothly would be the loudest.

    Returns:
        Starts of the steps of 50 ms (or of the bins, if these are longer), shape (steps,), in [s],
        and levels of the mean power in each, shape (steps, links), in [dB re 1 pW]; silence is at
        -inf.
    """
    width = float(np.median(np.diff(noise.time))) if len(noise.time) > 1 else STEP
    firsts = np.arange(0, len(noise.time), max(1, round(STEP / width)))
    counts = np.diff(np.append(firsts, len(noise.time)))
    mean = np.add.reduceat(noise.vibration, firsts, axis=0) / counts[:, None]
    return noise.time[firsts] - width / 2, decibel(mean / REFERENCE_POWER)
