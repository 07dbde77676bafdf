"""Many signals as one sound, in which their powers add.

A plain sum would be silent where two joints swing against each other, and the noise is not:
p_hat² = sum of v². So the powers of the signals are added in every window and band of frequency,
and the loudest signal there lends its phase. A signal that is alone comes out as it went in.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

import numpy as np
from numpy import fft
from numpy.typing import NDArray

from inspector.errors import InspectorError
from noisemodel.differentiate import stretches
from noisemodel.types import Array, Mask

Spectra: TypeAlias = NDArray[np.complex128]
LOWEST = 20.0
"""Where hearing begins, in [Hz]."""
WINDOW = 0.0256
"""Length of a window, in [s]: short enough that an impact stays where it is."""
FADE = 0.05
"""At both ends of a stretch without gaps, in [s]: how the motion goes on there nobody knows."""
ORDER = 4


@dataclass(frozen=True)
class _Windows:
    """Windows that overlap by half; cut out, weighed twice and put together they are the signal.

    Attributes:
        samples: Of the signal.
        length: Of a window, even, in samples.
    """

    samples: int
    length: int

    @property
    def hop(self) -> int:
        return self.length // 2

    @property
    def weights(self) -> Array:
        # The squares of half sines that overlap by half add up to 1.
        return np.sin(np.pi * (np.arange(self.length) + 0.5) / self.length)

    @property
    def count(self) -> int:
        return -(-self.samples // self.hop) + 1

    def spectra(self, signal: Array) -> Spectra:
        """Transform each window, shape (windows, bins), complex."""
        padded = np.zeros((self.count + 1) * self.hop)
        padded[self.hop : self.hop + self.samples] = signal
        cut = np.lib.stride_tricks.sliding_window_view(padded, self.length)[:: self.hop]
        return np.asarray(fft.rfft(cut * self.weights, axis=1))

    def signal(self, spectra: Spectra) -> Array:
        """Put windows together again, shape (samples,)."""
        windows = fft.irfft(spectra, self.length, axis=1) * self.weights
        whole = np.zeros((self.count + 1, self.hop))
        whole[:-1] += windows[:, : self.hop]
        whole[1:] += windows[:, self.hop :]
        return whole.ravel()[self.hop : self.hop + self.samples]


def mix(signals: Iterable[Array], *, valid: Mask, rate: float, lowest: float = LOWEST) -> Array:
    """Make one sound of what can be heard of several signals.

    Args:
        signals: Each of shape (samples,).
        valid: False in gaps, which are silent, shape (samples,).
        rate: Samples per second, in [Hz].
        lowest: What is below this is left out, in [Hz].

    Returns:
        Shape (samples,), in the unit of the signals.

    Raises:
        InspectorError: If a signal of this rate holds nothing above ``lowest``.
    """
    if rate <= 2.5 * lowest:
        raise InspectorError(
            f"a log of {rate:g} Hz holds nothing above {rate / 2:g} Hz and hearing begins at"
            f" {lowest:g} Hz; play it faster (`--speed {_enough(lowest, rate)}`)"
        )
    windows = _Windows(len(valid), 2 * max(4, round(WINDOW * rate / 2)))
    shape = (windows.count, windows.length // 2 + 1)
    power, most = np.zeros(shape), np.zeros(shape)
    loudest = np.zeros(shape, dtype=np.complex128)
    for signal in signals:
        spectra = windows.spectra(_audible(signal, valid, rate, lowest))
        each = np.square(spectra.real) + np.square(spectra.imag)
        power += each  # p_hat² = sum of v², Sygulla & Rixen, Sec. II-A, band by band
        np.copyto(loudest, spectra, where=each > most)
        np.maximum(most, each, out=most)
    gain = np.sqrt(np.divide(power, most, out=np.zeros(shape), where=most > 0.0))
    return windows.signal(gain * loudest) * valid


def _audible(signal: Array, valid: Mask, rate: float, lowest: float) -> Array:
    """Leave out what is too slow to be heard, stretch by stretch, and fade in and out."""
    fast = np.zeros(len(signal))
    for stretch in stretches(valid, len(signal)):
        part = signal[stretch]
        filtered = _high_passed(part, rate, lowest)
        faded = min(round(FADE * rate), len(part) // 2)
        rise = np.square(np.sin(0.5 * np.pi * np.arange(faded) / max(faded, 1)))
        filtered[:faded] *= rise
        filtered[len(part) - faded :] *= rise[::-1]
        fast[stretch] = filtered
    return fast


def _high_passed(signal: Array, rate: float, lowest: float) -> Array:
    """Apply the gain of a Butterworth filter, forwards and backwards: nothing moves in time."""
    reach = min(round(3 * rate / lowest), len(signal) - 1)
    # Turned about both ends, the signal goes on without a jump.
    before = 2 * signal[0] - signal[reach:0:-1]
    after = 2 * signal[-1] - signal[-2 : -reach - 2 : -1]
    longer = np.concatenate((before, signal, after))
    longer -= np.linspace(longer[0], longer[-1], len(longer))
    size = _quick(len(longer))
    filtered: Array = fft.irfft(fft.rfft(longer, size) * _gain(size, rate, lowest), size)
    return filtered[reach : reach + len(signal)]


@lru_cache(maxsize=1)
def _gain(size: int, rate: float, lowest: float) -> Array:
    frequency = fft.rfftfreq(size, 1 / rate)
    gain: Array = 1 / (1 + (lowest / np.maximum(frequency, lowest / 100)) ** (2 * ORDER))
    return gain


@lru_cache(maxsize=1)
def _quick(least: int) -> int:
    """Find the first length that is a product of 2, 3 and 5: quick to transform."""
    odd: list[int] = [3**threes * 5**fives for threes in range(20) for fives in range(14)]
    return min(each << (-(-least // each) - 1).bit_length() for each in odd)


def _enough(lowest: float, rate: float) -> int:
    """Say how much faster a log has to be played for two octaves of it to be heard."""
    return int(np.ceil(8 * lowest / rate))
