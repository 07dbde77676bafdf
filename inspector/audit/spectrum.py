"""Power spectral density of joint velocities, averaged over the stretches without a gap."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from noisemodel.differentiate import stretches
from noisemodel.types import Array, Mask, Real

SEGMENT = 0.4
"""Shortest segment that is transformed: the paper's frame (Sec. III-A), in [s]."""

FEWEST = 128
"""Fewest samples of a segment, so that slow logs have a spectrum too."""

MOST = 256
"""Most segments that are averaged, evenly spread, which limits the cost of long logs."""

PER_OCTAVE = 4
"""Bands of a smoothed spectrum in an octave."""


@dataclass(frozen=True, eq=False)
class Spectrum:
    """A one-sided power spectral density.

    Attributes:
        frequency: Above 0, rising, shape (frequency,), in [Hz].
        density: Of each joint, shape (frequency, joints), in [(rad/s)²/Hz].
        rate: Of the samples, in [Hz].
    """

    frequency: Array
    density: Array
    rate: float

    @property
    def total(self) -> Array:
        """Sum over the joints, as the noise counts them, shape (frequency,), in [(rad/s)²/Hz]."""
        return np.asarray(self.density.sum(axis=1))


def spectrum(velocity: Real, rate: float, valid: Mask) -> Spectrum | None:
    """Estimate the spectrum of joint velocities by Welch's method.

    Args:
        velocity: Shape (samples, joints), in [rad/s].
        rate: Sample rate, in [Hz].
        valid: False in gaps, shape (samples,).

    Returns:
        The spectrum without its value at 0 Hz; None if no stretch between gaps is long enough.
    """
    length = max(FEWEST, round(SEGMENT * rate))
    starts = [
        start
        for stretch in stretches(valid, len(valid))
        for start in range(stretch.start, stretch.stop - length + 1, length // 2)
    ]
    if not starts:
        return None
    chosen = np.unique(np.linspace(0, len(starts) - 1, min(MOST, len(starts))).round().astype(int))
    window = np.hanning(length + 1)[:-1]
    power = np.zeros((velocity.shape[1], length // 2 + 1))
    for index in chosen:
        segment = velocity[starts[index] : starts[index] + length].T.astype(np.float64, order="C")
        power += _square(np.fft.rfft(window * _detrended(segment)))
    # P. Welch, IEEE Trans. Audio Electroacoust. 15 (1967): one-sided, per hertz
    density: Array = 2.0 * power / (len(chosen) * rate * np.square(window).sum())
    frequency = np.arange(1.0, length // 2 + 1.0) * (rate / length)
    return Spectrum(np.asarray(frequency, dtype=np.float64), density.T[1:], rate)


def smoothed(
    frequency: Array, density: Array, middle: Callable[[Array], float]
) -> tuple[Array, Array]:
    """Level of a spectrum in quarters of an octave.

    Args:
        frequency: Above 0, rising, shape (frequency,), in [Hz].
        density: Shape (frequency,), in [(rad/s)²/Hz].
        middle: Mean or median of a band's values; the mean includes a single line, the median does
            not.

    Returns:
        Middle of each quarter that has a value, in [Hz], and its level, in [dB]; shape (bands,).
    """
    steps = np.round(np.log2(frequency / frequency[-1]) * PER_OCTAVE)
    places = np.unique(steps)
    level = [10.0 * np.log10(middle(density[steps == step]) + 1e-300) for step in places]
    return frequency[-1] * 2.0 ** (places / PER_OCTAVE), np.array(level)


def _detrended(segment: Array) -> Array:
    """Subtract the least-squares line, so that slow motion does not leak to higher frequencies."""
    ramp = np.linspace(-1.0, 1.0, segment.shape[1])
    slope = segment @ ramp / np.square(ramp).sum()
    return np.asarray(segment - segment.mean(axis=1)[:, None] - slope[:, None] * ramp)


def _square(amplitude: NDArray[np.complex128]) -> Array:
    return np.asarray(np.square(amplitude.real) + np.square(amplitude.imag))
