"""The spectrogram that is shown: level over time and frequency."""

from dataclasses import dataclass

import numpy as np

from noisemodel.types import Array, Mask

WINDOW = 0.1024
"""Length of the window in [s]: the paper's 1024 samples at 10 kHz."""
COLUMNS = 400
RANGE_DB = 70.0


@dataclass(frozen=True)
class Spectrogram:
    """Levels of a noise signal.

    Attributes:
        time: Centres of the windows, shape (columns,), in [s].
        frequency: Shape (bins,), in [Hz]; the constant part is left out.
        level: Shape (bins, columns), in [dB] relative to the loudest, down to -70.
    """

    time: Array
    frequency: Array
    level: Array


def spectrogram(signal: Array, rate: float, *, start: float, valid: Mask) -> Spectrogram:
    """Compute the spectrogram of a noise signal for viewing.

    Args:
        signal: Noise, shape (samples,), in [rad/s].
        rate: Samples per second, in [Hz].
        start: Time of the first sample, in [s].
        valid: False in gaps, shape (samples,); windows that touch one are silent.

    Returns:
        At most 400 columns of Hann windows of about 0.1 s, each freed of its mean.
    """
    length = min(max(round(WINDOW * rate), 8), len(signal))
    hop = max(1, length // 4, -(-(len(signal) - length) // (COLUMNS - 1)))
    windows = np.lib.stride_tricks.sliding_window_view(signal, length)[::hop]
    whole = np.lib.stride_tricks.sliding_window_view(valid, length)[::hop].all(axis=1)
    hann = np.hanning(length + 1)[:-1]
    centred = windows - windows.mean(axis=1, keepdims=True)
    amplitude = np.abs(np.fft.rfft(centred * hann, axis=1)).T[1:] * whole
    loudest = amplitude.max(initial=0.0) or 1.0
    floor = 10 ** (-RANGE_DB / 20)
    columns = np.arange(len(windows), dtype=np.float64)
    bins = np.arange(1, length // 2 + 1, dtype=np.float64)
    return Spectrogram(
        time=start + (columns * hop + length / 2) / rate,
        frequency=bins * rate / length,
        level=20 * np.log10(np.maximum(amplitude / loudest, floor)),
    )
