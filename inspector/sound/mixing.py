"""Several signals mixed to one, so that their powers add.

In a plain sum two joints that oscillate in antiphase would cancel, but not in the noise:
p_hat² = sum of v². So the powers of the signals are added in every window and frequency bin, with
the phase of the loudest signal there. A single signal is not changed.
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
LOWEST_AUDIBLE = 20.0
"""Lowest audible frequency, in [Hz]."""
WINDOW = 0.0256
"""Length of a window, in [s]: short enough to keep the time of an impact."""
FADE = 0.05
"""Fade at both ends of a stretch without gaps, in [s]: the motion beyond is unknown."""
ORDER = 4


@dataclass(frozen=True)
class _Windows:
    """Windows that overlap by half, weighted for perfect reconstruction.

    Attributes:
        samples: Number of samples of the signal.
        length: Length of a window, even, in samples.
    """

    samples: int
    length: int

    @property
    def hop(self) -> int:
        return self.length // 2

    @property
    def weights(self) -> Array:
        # The squares of half sines that overlap by half sum to 1.
        return np.sin(np.pi * (np.arange(self.length) + 0.5) / self.length)

    @property
    def count(self) -> int:
        return -(-self.samples // self.hop) + 1

    def spectra(self, signal: Array) -> Spectra:
        """Spectrum of each window, shape (windows, bins), complex."""
        padded = np.zeros((self.count + 1) * self.hop)
        padded[self.hop : self.hop + self.samples] = signal
        cut = np.lib.stride_tricks.sliding_window_view(padded, self.length)[:: self.hop]
        return np.asarray(fft.rfft(cut * self.weights, axis=1))

    def signal(self, spectra: Spectra) -> Array:
        """Signal by overlap-add of the windows, shape (samples,)."""
        windows = fft.irfft(spectra, self.length, axis=1) * self.weights
        whole = np.zeros((self.count + 1, self.hop))
        whole[:-1] += windows[:, : self.hop]
        whole[1:] += windows[:, self.hop :]
        return whole.ravel()[self.hop : self.hop + self.samples]


def mix(
    signals: Iterable[Array], *, valid: Mask, rate: float, lowest: float = LOWEST_AUDIBLE
) -> Array:
    """Audible part of several signals, mixed to one.

    Args:
        signals: Each of shape (samples,).
        valid: False in gaps, which are silent, shape (samples,).
        rate: Sampling rate, in [Hz].
        lowest: Cutoff of the high-pass filter, in [Hz].

    Returns:
        Shape (samples,), in the unit of the signals.

    Raises:
        InspectorError: If the Nyquist frequency is not well above ``lowest``.
    """
    if rate <= 2.5 * lowest:
        raise InspectorError(
            f"a log of {rate:g} Hz has no content above {rate / 2:g} Hz, and frequencies below"
            f" {lowest:g} Hz are inaudible; play it faster"
            f" (`--speed {_audible_speed(lowest, rate)}`)"
        )
    windows = _Windows(len(valid), 2 * max(4, round(WINDOW * rate / 2)))
    shape = (windows.count, windows.length // 2 + 1)
    power, largest = np.zeros(shape), np.zeros(shape)
    loudest = np.zeros(shape, dtype=np.complex128)
    for signal in signals:
        spectra = windows.spectra(_audible(signal, valid, rate, lowest))
        each = np.square(spectra.real) + np.square(spectra.imag)
        power += each  # p_hat² = sum of v², Sygulla & Rixen, Sec. II-A, band by band
        np.copyto(loudest, spectra, where=each > largest)
        np.maximum(largest, each, out=largest)
    gain = np.sqrt(np.divide(power, largest, out=np.zeros(shape), where=largest > 0.0))
    return windows.signal(gain * loudest) * valid


def _audible(signal: Array, valid: Mask, rate: float, lowest: float) -> Array:
    """Signal without inaudible frequencies, faded in and out in each stretch without gaps."""
    filtered = np.zeros(len(signal))
    for stretch in stretches(valid, len(signal)):
        part = signal[stretch]
        high_passed = _high_passed(part, rate, lowest)
        faded = min(round(FADE * rate), len(part) // 2)
        rise = np.square(np.sin(0.5 * np.pi * np.arange(faded) / max(faded, 1)))
        high_passed[:faded] *= rise
        high_passed[len(part) - faded :] *= rise[::-1]
        filtered[stretch] = high_passed
    return filtered


def _high_passed(signal: Array, rate: float, lowest: float) -> Array:
    """Signal after a Butterworth high-pass filter forwards and backwards, with zero phase."""
    reach = min(round(3 * rate / lowest), len(signal) - 1)
    # odd reflection at both ends, without a step
    before = 2 * signal[0] - signal[reach:0:-1]
    after = 2 * signal[-1] - signal[-2 : -reach - 2 : -1]
    extended = np.concatenate((before, signal, after))
    extended -= np.linspace(extended[0], extended[-1], len(extended))
    size = _fast_length(len(extended))
    high_passed: Array = fft.irfft(fft.rfft(extended, size) * _gain(size, rate, lowest), size)
    return high_passed[reach : reach + len(signal)]


@lru_cache(maxsize=1)
def _gain(size: int, rate: float, lowest: float) -> Array:
    frequency = fft.rfftfreq(size, 1 / rate)
    gain: Array = 1 / (1 + (lowest / np.maximum(frequency, lowest / 100)) ** (2 * ORDER))
    return gain


@lru_cache(maxsize=1)
def _fast_length(least: int) -> int:
    """The next length that is a product of 2, 3 and 5, for a fast transform."""
    odd: list[int] = [3**threes * 5**fives for threes in range(20) for fives in range(14)]
    return min(each << (-(-least // each) - 1).bit_length() for each in odd)


def _audible_speed(lowest: float, rate: float) -> int:
    """Playing speed at which two octaves of a log are audible."""
    return int(np.ceil(8 * lowest / rate))
