"""What pictures show of a signal: levels above 10 Hz in decibels, spectrograms, fewer points.

Levels are absolute. What the colours span follows the run, of several runs the loudest; while
samples come in, it is fixed.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from inspector import colors
from noisemodel.noise import REFERENCE_POWER, LinkNoise, decibel, vibrating_pieces
from noisemodel.runfile import pieces
from noisemodel.types import Array, Mask, Real

STEP = 0.05  # time over which a level is taken, in [s]
SPAN_DB = 60.0  # range of a scale that follows a run, in [dB]
# Least level of a velocity, below any encoder's, in [dB re 1 rad/s]; lower levels are raised.
FLOOR_DB = -100.0


@dataclass(frozen=True)
class Scale:
    """Levels that colours show."""

    low: float  # level of the darkest colour, in [dB]
    high: float  # of the lightest one, in [dB]
    unit: str  # such as "dB re 1 rad/s"
    step: float = 20.0  # from one tick to the next, in [dB]
    shades: int = 32  # colours of a row of levels: few change rarely
    palette: Callable[[Array], NDArray[np.uint8]] = colors.heat  # of places from 0 to 1

    def place(self, level: Array) -> Array:
        """Levels as shares of the scale: 0 at its low end and 1 at its high end, not clipped."""
        return np.asarray((level - self.low) / (self.high - self.low))

    def colours(self, level: Array, *, shades: int = 0) -> NDArray[np.uint8]:
        """Colour levels, the louder, the lighter, by so many ``shades`` or any: RGBA, (…, 4)."""
        place = np.clip(self.place(level), 0.0, 1.0)
        return self.palette(np.round(place * (shades - 1)) / (shades - 1) if shades else place)

    def following(self, level: Array) -> "Scale":
        """The scale of a run: 60 dB up to its loudest level, so that not all of it is dark.

        A run more than 30 dB below this scale looks quiet all the same; -inf does not count.
        """
        loudest = float(np.max(level, initial=-np.inf, where=np.isfinite(level)))
        high = max(10.0 * np.ceil(loudest / 10.0), self.high - 30.0)
        return replace(self, low=float(high) - SPAN_DB, high=float(high))

    @property
    def ticks(self) -> tuple[float, ...]:
        """Levels to be labelled, in [dB], from low to high."""
        return tuple(np.arange(self.low, self.high + self.step / 2, self.step).tolist())


# Velocity of a joint above 10 Hz; of joints that slide re 1 m/s.
JOINTS = Scale(-60.0, 0.0, "dB re 1 rad/s")
# Sound power of a link's vibration above 10 Hz. A link of 0.1 m² is at 136 dB at 1 m/s.
LINKS = Scale(60.0, 120.0, "dB re 1 pW")
# Amplitude of a joint's velocity in a spectrogram.
SPECTRUM = Scale(-60.0, 0.0, "dB re 1 rad/s")


def velocity_levels(
    velocity: Real, valid: Mask, rate: float, *, start: float = 0.0, together: bool = False
) -> tuple[Array, Array]:
    """The level of velocities above 10 Hz over time, of each joint, or of all as one column.

    Of all together it is the sum of their powers: in their norm, a joint that moves would hide the
    vibration of another.

    Returns the starts of steps of 50 ms, in [s], and levels of the root mean square of what is
    valid in each, shape (steps, joints), in [dB re 1 rad/s]; NaN in gaps.
    """
    size = max(1, round(STEP * rate))
    firsts = np.arange(0, len(valid), size)
    energy = np.zeros((len(firsts), velocity.shape[1]))
    for rows, fast in vibrating_pieces(velocity, valid, rate, size):
        here = np.arange(0, rows.stop - rows.start, size)
        first = rows.start // size
        energy[first : first + len(here)] = np.add.reduceat(np.square(fast), here, axis=0)
    energy = energy.sum(axis=1, keepdims=True) if together else energy
    count = np.add.reduceat(valid.astype(np.float64), firsts)[:, None]
    level = np.maximum(decibel(energy / np.maximum(count, 1.0)), FLOOR_DB)
    return start + firsts / rate, np.asarray(np.where(count > 0.0, level, np.nan))


def link_levels(noise: LinkNoise) -> tuple[Array, Array]:
    """The level of each link's vibration above 10 Hz over time.

    The whole motion would not do: a link that moves fast and smoothly would be the loudest. Returns
    the starts of steps of 50 ms, or of the bins if these are longer, in [s], and levels of the mean
    power in each, shape (steps, links), in [dB re 1 pW]; silence is at -inf.
    """
    width = float(np.median(np.diff(noise.time))) if len(noise.time) > 1 else STEP
    firsts = np.arange(0, len(noise.time), max(1, round(STEP / width)))
    counts = np.diff(np.append(firsts, len(noise.time)))
    mean = np.add.reduceat(noise.vibration, firsts, axis=0) / counts[:, None]
    return noise.time[firsts] - width / 2, decibel(mean / REFERENCE_POWER)


WINDOW = 0.1024  # length of the window in [s]: the paper's 1024 samples at 10 kHz
COLUMNS = 400  # most columns of a spectrogram


@dataclass(frozen=True, eq=False)
class Spectrogram:
    """Amplitudes of a signal in windows; of long ones, a column is the maximum of several."""

    time: Array  # centres of the columns, shape (columns,), in [s]
    frequency: Array  # shape (bins,), in [Hz]; the mean is left out
    amplitude: Array  # shape (bins, columns), in the unit of the signal; 0 where not valid
    valid: Mask  # false where all windows touch a gap, shape (columns,)

    @cached_property
    def decibel(self) -> Array:
        """Levels of the amplitudes, shape (bins, columns), in [dB]; -inf where there is none."""
        return 2 * decibel(self.amplitude)


def spectrogram(signal: Array, rate: float, *, start: float, valid: Mask) -> Spectrogram:
    """Compute the spectrogram of a signal for viewing; ``start`` is its first time, in [s]."""
    length = min(window_length(rate), len(signal))
    step = max(1, length // 4, -(-(len(signal) - length) // (COLUMNS - 1)))
    several = -(-step // length)  # windows of a column, so that no sample is between them
    hop = -(-step // several)
    windows = np.lib.stride_tricks.sliding_window_view(signal, length)[::hop]
    touched = np.lib.stride_tricks.sliding_window_view(~valid, length)[::hop]
    whole = ~np.max(touched, axis=1)
    firsts, size = np.arange(0, len(windows), several), several * max(1, COLUMNS // several)
    amplitude = np.empty((len(firsts), length // 2))
    for first in range(0, len(windows), size):  # not all at once: a long run has many
        loud = amplitudes(windows[first : first + size]) * whole[first : first + size, None]
        own = slice(first // several, (first + size) // several)
        amplitude[own] = np.maximum.reduceat(loud, np.arange(0, len(loud), several))
    middles = np.arange(len(amplitude)) * several * hop + ((several - 1) * hop + length) / 2
    time = np.asarray(start + middles / rate)
    frequency = np.arange(1, length // 2 + 1) * rate / length
    return Spectrogram(time, frequency, amplitude.T, np.logical_or.reduceat(whole, firsts))


def in_bands(frequency: Array, amplitude: Array, edges: Array) -> Array:
    """The largest amplitude in each of several bands, such as those of a logarithmic axis.

    Frequencies of shape (bins,) and edges of shape (bands + 1,) are in order.
    """
    firsts = np.searchsorted(frequency, edges)
    empty = firsts[:-1] == firsts[1:]
    middles = np.sqrt(edges[:-1] * edges[1:])[empty]
    found = np.empty((len(empty), *amplitude.shape[1:]))
    found[empty] = amplitude[np.abs(frequency[:, None] - middles).argmin(axis=0)]
    found[~empty] = np.maximum.reduceat(amplitude[: firsts[-1]], firsts[:-1][~empty])
    return found


def window_length(rate: float) -> int:
    """Length of a window, in samples; at least 8."""
    return max(round(WINDOW * rate), 8)


def amplitudes(windows: Array) -> Array:
    """Amplitude spectra of Hann windows, each freed of its mean under the window."""
    hann = np.hanning(windows.shape[1] + 1)[:-1]  # periodic
    centred = windows - (windows @ hann / hann.sum())[:, None]
    return np.asarray(np.abs(np.fft.rfft(centred * hann, axis=1))[:, 1:] * 2 / hann.sum())


def extremes(time: Array, values: Real, *, points: int) -> tuple[Array, Array]:
    """Keep the least and the greatest value of each bucket: times and values of ``points`` at most.

    Everything is kept if there are not more samples, shape (samples, series), than points.
    """
    if len(time) <= points or not values.shape[1]:
        return time, np.asarray(values, dtype=np.float64)
    size = -(-len(time) // (points // 2))
    starts = np.arange(0, len(time), size)
    thin = np.empty((len(starts), 2, values.shape[1]))
    for rows in pieces(values, size):
        buckets = slice(rows.start // size, -(-rows.stop // size))
        series = np.ascontiguousarray(values[rows].T)  # several times as fast for a few of them
        for which, extreme in enumerate((np.minimum, np.maximum)):
            found = extreme.reduceat(series, starts[buckets] - rows.start, axis=1)
            thin[buckets, which] = found.T
    halves = np.minimum(starts + size // 2, len(time) - 1)
    return time[np.stack((starts, halves), axis=1).ravel()], thin.reshape(-1, values.shape[1])
