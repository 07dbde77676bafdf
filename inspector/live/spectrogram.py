"""Columns of the spectrogram while samples come in."""

from typing import NamedTuple

import numpy as np

from inspector.levels import SPECTRUM
from inspector.recording.spectrogram import BANDS
from inspector.spectrogram import amplitudes, in_bands, window_length
from noisemodel.noise import decibel
from noisemodel.types import Array, Mask

COLUMNS_AT_ONCE = 4
"""Columns that are handed out at once, every tenth of a second."""


class Columns(NamedTuple):
    """Columns of a spectrogram."""

    time: Array
    """Centres of the windows, shape (columns,), in [s]."""
    level: Array
    """From 0 to 1, shape (bands, columns)."""


class SpectrogramStream:
    """Levels of frequency bands on a logarithmic axis, on the scale of whole runs.

    Args:
        rate: Samples per second, in [Hz].

    Attributes:
        edges: Of the bands, shape (bands + 1,), in [Hz].
        centres: Of the bands, shape (bands,), in [Hz].
    """

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._length = window_length(rate)
        self._hop = max(1, self._length // 4)
        self._frequency = rate / self._length * np.arange(1.0, self._length // 2 + 1)
        self.edges = np.geomspace(self._frequency[0], self._frequency[-1], BANDS + 1)
        self.centres = np.sqrt(self.edges[:-1] * self.edges[1:])
        self._samples = np.empty(0)
        self._valid = np.empty(0, dtype=bool)
        self._gap = False
        self._waiting: list[Columns] = []

    def push(self, noise: Array, valid: Mask, end: float) -> Columns | None:
        """Take samples.

        Args:
            noise: Shape (samples,), in [rad/s].
            valid: False in gaps, shape (samples,); windows that touch one are dark.
            end: Time after the last sample, in [s].

        Returns:
            Columns, once there are some.
        """
        samples = np.concatenate((self._samples, noise))
        valid = np.concatenate((self._valid, valid))
        count = max(0, (len(samples) - self._length) // self._hop + 1)
        used = count * self._hop
        if count:
            if self._gap:
                before = end - (len(samples) - self._length / 2 + self._hop) / self._rate
                dark = np.zeros((len(self.centres), 1))
                self._waiting.append(Columns(np.array([before]), dark))
                self._gap = False
            starts = self._hop * np.arange(count)
            times = np.asarray(end - (len(samples) - starts - self._length / 2) / self._rate)
            self._waiting.append(Columns(times, self._levels(samples, valid, count)))
        self._samples, self._valid = samples[used:], valid[used:]
        if sum(len(columns.time) for columns in self._waiting) < COLUMNS_AT_ONCE:
            return None
        return self.flush()

    def skip(self) -> None:
        """Begin anew after a gap, and leave it dark."""
        self._samples, self._valid = self._samples[:0], self._valid[:0]
        self._gap = True

    def flush(self) -> Columns | None:
        """Hand out what waits."""
        if not self._waiting:
            return None
        time = np.concatenate([columns.time for columns in self._waiting])
        level = np.concatenate([columns.level for columns in self._waiting], axis=1)
        self._waiting = []
        return Columns(time, level)

    def _levels(self, samples: Array, valid: Mask, count: int) -> Array:
        view = np.lib.stride_tricks.sliding_window_view
        windows = view(samples, self._length)[:: self._hop][:count]
        whole = np.asarray(view(valid, self._length)[:: self._hop][:count].all(axis=1))
        amplitude = amplitudes(windows).T * whole
        level = 2 * decibel(in_bands(self._frequency, amplitude, self.edges))
        return np.clip(SPECTRUM.place(level), 0.0, 1.0)
