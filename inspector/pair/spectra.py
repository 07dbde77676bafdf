"""The spectra of two noises over time, on one scale."""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from inspector.pair.pair import Pair
from inspector.spectrogram import COLUMNS, RANGE_DB, WINDOW
from noisemodel.noise import decibel
from noisemodel.types import Array

Sample = TypeVar("Sample", np.float64, np.bool_)


@dataclass(frozen=True, eq=False)
class Spectra:
    """Amplitudes of both noises in windows that touch no gap of either.

    Attributes:
        time: Centres of the windows, shape (columns,), in [s].
        frequency: Shape (bins,), in [Hz]; the constant part is left out.
        amplitude: Before and after, shape (2, bins, columns), in [rad/s].
    """

    time: Array
    frequency: Array
    amplitude: Array

    @property
    def level(self) -> Array:
        """Before and after, shape (2, bins, columns), in [dB re 1 rad/s].

        What is quieter than the loudest of both by more than 70 dB is lifted to there.
        """
        loudest = self.amplitude.max(initial=0.0) or 1.0
        floor = loudest * 10 ** (-RANGE_DB / 20)
        return 2 * decibel(np.maximum(self.amplitude, floor))


def spectra(pair: Pair) -> Spectra:
    """Transform both noises in the same windows.

    Args:
        pair: The two runs.

    Returns:
        At most 400 columns of Hann windows of about 0.1 s, each freed of its mean.
    """
    samples = len(pair.time)
    length = min(max(round(WINDOW * pair.rate), 8), samples)
    hop = max(1, length // 4, -(-(samples - length) // (COLUMNS - 1)))
    clear = _windows(pair.valid, length, hop).all(axis=1)
    hann = np.hanning(length + 1)[:-1]
    amplitudes = []
    for _, side in pair.sides:
        windows = _windows(side.noise, length, hop)[clear]
        centred = windows - windows.mean(axis=1, keepdims=True)
        amplitudes.append(np.abs(np.fft.rfft(centred * hann, axis=1)).T[1:] * 2 / hann.sum())
    columns = np.flatnonzero(clear).astype(np.float64)
    return Spectra(
        time=pair.time[0] + (columns * hop + length / 2) / pair.rate,
        frequency=np.arange(1, length // 2 + 1, dtype=np.float64) * pair.rate / length,
        amplitude=np.stack(amplitudes),
    )


def _windows(signal: NDArray[Sample], length: int, hop: int) -> NDArray[Sample]:
    return np.lib.stride_tricks.sliding_window_view(signal, length)[::hop]
