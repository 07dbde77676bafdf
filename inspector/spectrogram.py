"""Spectrogram for viewing: amplitude over time and frequency."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from noisemodel.types import Array, Mask

WINDOW = 0.1024
"""Length of the window in [s]: the paper's 1024 samples at 10 kHz."""
COLUMNS = 400
RANGE_DB = 70.0


@dataclass(frozen=True, eq=False)
class Spectrogram:
    """Amplitudes of a signal in windows.

    Attributes:
        time: Centres of the windows, shape (columns,), in [s].
        frequency: Shape (bins,), in [Hz]; the mean is left out.
        amplitude: Shape (bins, columns), in the unit of the signal; 0 in windows that touch a gap.
        valid: False for windows that touch a gap, shape (columns,).
    """

    time: Array
    frequency: Array
    amplitude: Array
    valid: Mask

    @cached_property
    def decibel(self) -> Array:
        """Levels of the amplitudes, shape (bins, columns), in [dB]; -inf where there is none."""
        with np.errstate(divide="ignore"):
            return np.asarray(20 * np.log10(self.amplitude))

    @cached_property
    def level(self) -> Array:
        """Shape (bins, columns), in [dB] relative to the largest amplitude, at least -70."""
        largest = self.amplitude.max(initial=0.0) or 1.0
        floor = 10 ** (-RANGE_DB / 20)
        return np.asarray(20 * np.log10(np.maximum(self.amplitude / largest, floor)))


def spectrogram(signal: Array, rate: float, *, start: float, valid: Mask) -> Spectrogram:
    """Compute the spectrogram of a signal for viewing.

    Args:
        signal: Such as noise, shape (samples,).
        rate: Samples per second, in [Hz].
        start: Time of the first sample, in [s].
        valid: False in gaps, shape (samples,).
    """
    length = min(window_length(rate), len(signal))
    hop = max(1, length // 4, -(-(len(signal) - length) // (COLUMNS - 1)))
    windows = np.lib.stride_tricks.sliding_window_view(signal, length)[::hop]
    whole = np.lib.stride_tricks.sliding_window_view(valid, length)[::hop].all(axis=1)
    columns = np.arange(len(windows), dtype=np.float64)
    bins = np.arange(1, length // 2 + 1, dtype=np.float64)
    return Spectrogram(
        time=start + (columns * hop + length / 2) / rate,
        frequency=bins * rate / length,
        amplitude=amplitudes(windows).T * whole,
        valid=np.asarray(whole),
    )


def in_bands(frequency: Array, amplitude: Array, edges: Array) -> Array:
    """The largest amplitude in each of several bands, such as the bands of a logarithmic axis.

    Args:
        frequency: In order, shape (bins,).
        edges: Of the bands, in order, in the unit of the frequency, shape (bands + 1,).
    """
    firsts = np.searchsorted(frequency, edges[:-1])
    lasts = np.searchsorted(frequency, edges[1:])
    middles = np.sqrt(edges[:-1] * edges[1:])
    nearest = np.abs(frequency[:, None] - middles).argmin(axis=0)
    rows = [
        amplitude[first:last].max(axis=0) if last > first else amplitude[near]
        for first, last, near in zip(firsts, lasts, nearest, strict=True)
    ]
    return np.stack(rows)


def window_length(rate: float) -> int:
    """Length of a window, in samples; at least 8."""
    return max(round(WINDOW * rate), 8)


def amplitudes(windows: Array) -> Array:
    """Amplitude spectra of Hann windows, each freed of its mean."""
    hann = _hann(windows.shape[1])
    centred = windows - windows.mean(axis=1, keepdims=True)
    return np.asarray(np.abs(np.fft.rfft(centred * hann, axis=1))[:, 1:] * 2 / hann.sum())


@lru_cache(maxsize=4)
def _hann(length: int) -> Array:
    """Periodic Hann window."""
    return np.hanning(length + 1)[:-1]
