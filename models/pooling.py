"""Temporal pooling: statistics of log-band energies over the windows of a frame."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Literal, TypeAlias

import numpy as np

from models.profile import Profile, Resolution
from models.types import Array, Index

Spectrum: TypeAlias = Literal["norm", "loudest", "difference"]
"""What a spectrum is of: a norm, the loudest joint, or a difference."""

POOLED = 3
"""Statistics that `pool` computes of each log-band energy."""


def pooled(energies: Sequence[Array], profile: Profile) -> Array:
    """Statistics of the log-band energies of each frame.

    Args:
        energies: For each of the profile's resolutions, log-band energies of the frames' windows,
            shape (frames, time, energies).
        profile: Whether energies are relative to the level of the frame.

    Returns:
        Mean, maximum and standard deviation of each band, spectrum by spectrum; if the profile is
        relative, the level of the frame comes last, and is subtracted from the energies of the
        signals. Shape (frames, features).
    """
    rows = [
        _by_spectrum(pool(each), len(resolution.edges) - 1)
        for each, resolution in zip(energies, profile.resolutions, strict=True)
    ]
    if not profile.relative:
        return np.concatenate(rows, axis=1)
    means, above = _level(spectra(profile), profile.resolutions)
    described = np.concatenate((*rows, np.zeros((len(rows[0]), 1))), axis=1)
    level = np.add.reduce(described.take(means, 1), 1, keepdims=True) / len(means)
    described -= level * above
    return described


def pool(energies: Array) -> Array:
    """Mean, maximum and standard deviation over time of each log-band energy.

    Args:
        energies: Shape (frames, time, energies).

    Returns:
        Statistics, which do not depend on the order in time, shape (frames, 3, energies).
    """
    # A frame at a time is too little for NumPy's methods, which take longer than their ufuncs.
    frames, count, bands = energies.shape
    found = np.empty((frames, POOLED, bands))
    mean, most, deviation = found[:, 0], found[:, 1], found[:, 2]
    np.add.reduce(energies, 1, out=mean)
    mean /= count
    np.maximum.reduce(energies, 1, out=most)
    squares = energies - mean[:, None]
    squares *= squares
    np.add.reduce(squares, 1, out=deviation)
    deviation /= count
    np.sqrt(deviation, deviation)
    return found


def _by_spectrum(found: Array, bands: int) -> Array:
    """What `pool` gave, spectrum by spectrum, shape (frames, features)."""
    frames, numbers, count = found.shape
    apart = found.reshape(frames, numbers, count // bands, bands)
    return apart.swapaxes(1, 2).reshape(frames, numbers * count)


def spectra(profile: Profile) -> tuple[Spectrum, ...]:
    """Kinds of the spectra of a window, in the order of `features.log_band_energies`."""
    norms, joints = profile.norms, len(profile.signals) - profile.norms
    found: list[Spectrum] = ["norm"] * norms
    if profile.relative:
        found += ["difference"] * (norms - 1)
        found += ["loudest"] * joints
        found += ["difference"] * max(2 * joints - 1, 0)
    return tuple(found)


@lru_cache
def _level(kinds: tuple[Spectrum, ...], resolutions: tuple[Resolution, ...]) -> tuple[Index, Array]:
    """Weights by which features become relative to the level of the frame.

    Returns:
        Places of the means of the norms, of which the level of the frame is the mean, shape
        (means,); and how often that level is subtracted from each feature: once from the means and
        maxima of norms and loudest joints, minus once from the last feature, which thereby is the
        level itself, shape (features,).
    """
    means, above = [], []
    for each in resolutions:
        level = np.repeat((1.0, 1.0, 0.0), len(each.edges) - 1)  # mean, maximum, deviation
        mean = np.repeat((True, False, False), len(each.edges) - 1)
        means += [mean & (kind == "norm") for kind in kinds]
        above += [level * (kind != "difference") for kind in kinds]
    return np.flatnonzero(np.concatenate(means)), np.concatenate((*above, [-1.0]))
