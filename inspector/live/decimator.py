"""A lower sample rate while samples come in: `noisemodel.decimated`, as far as that can be."""

import numpy as np

from noisemodel.decimation import EDGE
from noisemodel.types import Array, Mask

BETA = 5.0
"""Of the Kaiser window, as that of SciPy's polyphase resampling."""


class Decimator:
    """Low-passes and decimates signals, and marks the samples for which it cannot.

    In the middle of a signal it returns what `noisemodel.decimated` does. That one extrapolates
    beyond the ends, which is impossible while samples come in: here the first ten samples are not
    valid, and the last ten are missing.

    Args:
        ratio: How many samples become one.
        columns: How many signals there are.
    """

    def __init__(self, ratio: int, columns: int) -> None:
        self._ratio, self.columns = ratio, columns
        reach = EDGE * ratio
        cutoff = np.sinc(np.arange(-reach, reach + 1) / ratio)
        taps = cutoff * np.kaiser(2 * reach + 1, BETA)
        self._taps = taps / taps.sum()  # a constant stays what it is
        self._samples = np.zeros((reach, columns))
        self._valid = np.zeros(reach, dtype=bool)

    def push(self, samples: Array, valid: Mask) -> tuple[Array, Mask]:
        """Take samples.

        Args:
            samples: Shape (samples, columns).
            valid: False in gaps, shape (samples,).

        Returns:
            What is complete now, shape (lower, columns), and which of it touches no gap.
        """
        samples = np.concatenate((self._samples, samples))
        valid = np.concatenate((self._valid, valid))
        length = len(self._taps)
        count = max(0, (len(samples) - length) // self._ratio + 1)
        used = count * self._ratio
        self._samples, self._valid = samples[used:], valid[used:]
        if not count:
            return samples[:0], valid[:0]
        view = np.lib.stride_tricks.sliding_window_view
        lower: Array = view(samples, length, axis=0)[:: self._ratio][:count] @ self._taps
        return lower, np.asarray(view(valid, length)[:: self._ratio][:count].all(axis=1))
