"""Similarity of several noise estimates; a factor between two of them changes nothing."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from noisemodel.noise import decibel
from noisemodel.types import Array

DYNAMICS_DB = 100.0
"""What lies further below a signal's loudest line counts as this far below, in [dB]."""


def envelopes(powers: Array, stretch: int) -> Array:
    """Take the root mean square of the pressure in one stretch of time after the other.

    Args:
        powers: Squared pressures to any scale, shape (kinds, samples).
        stretch: Samples in a stretch; what is left over at the end is left out.

    Returns:
        Shape (kinds, stretches).
    """
    whole = powers.shape[1] // stretch * stretch
    stretches = powers[:, :whole].reshape(len(powers), -1, stretch)
    roots: Array = np.sqrt(stretches.mean(axis=2))
    return roots


def correlation(signals: Array) -> Array:
    """Correlate each signal with each.

    Args:
        signals: Shape (kinds, samples).

    Returns:
        Shape (kinds, kinds); nan where a signal does not change.
    """
    centered = signals - signals.mean(axis=1, keepdims=True)
    products = centered @ centered.T
    lengths = np.sqrt(np.diag(products))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlated: Array = products / np.outer(lengths, lengths)
    return correlated


def log_spectra(signal: Array, window: int) -> Array:
    """Take the spectra of windows that overlap by half.

    Args:
        signal: Shape (samples,).
        window: Length of the Hann window, in samples.

    Returns:
        Shape (frames, frequency), in [dB re the loudest line], never below -100.
    """
    frames = np.lib.stride_tricks.sliding_window_view(signal, window)[:: window // 2]
    power = np.abs(np.fft.rfft(frames * np.hanning(window), axis=1)) ** 2
    if not power.any():
        return np.full(power.shape, -DYNAMICS_DB)
    return np.maximum(decibel(power / power.max()), -DYNAMICS_DB)


def spectral_distances(spectra: Sequence[Array]) -> Array:
    """Take the mean square over time of the difference of log spectra.

    Args:
        spectra: Of each kind, shape (frames, frequency), in [dB].

    Returns:
        Shape (kinds, kinds, frequency), in [dB²].
    """
    squares = np.zeros((len(spectra), len(spectra), spectra[0].shape[1]))
    for one, other in combinations(range(len(spectra)), 2):
        difference = spectra[one] - spectra[other]
        difference -= difference.mean()  # a factor between the two
        squares[one, other] = squares[other, one] = np.mean(difference**2, axis=0)
    return squares


def contrasts(powers: Array, events: Sequence[tuple[int, int]]) -> Array:
    """Compare the mean power in events to that of the rest.

    Args:
        powers: Shape (kinds, samples).
        events: First sample and the one after the last of each.

    Returns:
        Shape (kinds,), in [dB]; nan where there are no events, or nothing else.
    """
    inside = np.zeros(powers.shape[1], dtype=bool)
    for start, stop in events:
        inside[start:stop] = True
    if inside.all() or not inside.any():
        return np.full(len(powers), np.nan)
    with np.errstate(invalid="ignore", divide="ignore"):
        return decibel(powers[:, inside].mean(axis=1) / powers[:, ~inside].mean(axis=1))
