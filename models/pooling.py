"""Pooling: the course of levels in time, by what does not depend on when things happen."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Literal, TypeAlias

import numpy as np

from models.profile import Profile, Resolution
from models.types import Array

Spectrum: TypeAlias = Literal["norm", "loudest", "difference"]
"""What the levels of one spectrum are of: a norm, the loudest joint, or a difference."""

POOLED = 3
"""Numbers that `pool` keeps of each level."""


def pooled(loudness: Sequence[Array], profile: Profile) -> Array:
    """Describe each frame by its pooled levels.

    Args:
        loudness: For each of the profile's resolutions, levels of the frames' windows, shape
            (frames, time, levels).
        profile: Says whether levels are told from how loud the frame is on the whole.

    Returns:
        Mean, maximum and standard deviation of each band, spectrum by spectrum; if the profile is
        relative, the level of the whole frame comes last, and those of the signals are above it.
        Shape (frames, features).
    """
    rows = [
        _by_spectrum(pool(each), len(resolution.edges) - 1)
        for each, resolution in zip(loudness, profile.resolutions, strict=True)
    ]
    if not profile.relative:
        return np.concatenate(rows, axis=1)
    share, above = _whole(spectra(profile), profile.resolutions)
    described = np.concatenate((*rows, np.zeros((len(rows[0]), 1))), axis=1)
    described -= (described @ share)[:, None] * above
    return described


def pool(loudness: Array) -> Array:
    """Describe the course of each level in time by what does not depend on when things happen.

    Args:
        loudness: Shape (frames, time, levels).

    Returns:
        Mean, maximum and standard deviation of each level, shape (frames, 3, levels).
    """
    # A frame at a time is too little for NumPy's methods, which take longer than their ufuncs.
    frames, count, levels = loudness.shape
    found = np.empty((frames, POOLED, levels))
    mean, most, deviation = found[:, 0], found[:, 1], found[:, 2]
    np.add.reduce(loudness, 1, out=mean)
    mean /= count
    np.maximum.reduce(loudness, 1, out=most)
    squares = loudness - mean[:, None]
    squares *= squares
    np.add.reduce(squares, 1, out=deviation)
    deviation /= count
    np.sqrt(deviation, deviation)
    return found


def _by_spectrum(found: Array, bands: int) -> Array:
    """Lay out what `pool` gave spectrum by spectrum, shape (frames, features)."""
    frames, numbers, levels = found.shape
    apart = found.reshape(frames, numbers, levels // bands, bands)
    return apart.swapaxes(1, 2).reshape(frames, numbers * levels)


def spectra(profile: Profile) -> tuple[Spectrum, ...]:
    """Say what the spectra of a window are, in the order of its levels (`features.levels`)."""
    norms, joints = profile.norms, len(profile.signals) - profile.norms
    found: list[Spectrum] = ["norm"] * norms
    if profile.relative:
        found += ["difference"] * (norms - 1)
        found += ["loudest"] * joints
        found += ["difference"] * max(2 * joints - 1, 0)
    return tuple(found)


@lru_cache
def _whole(kinds: tuple[Spectrum, ...], resolutions: tuple[Resolution, ...]) -> tuple[Array, Array]:
    """Say how levels are told from the whole frame's.

    Returns:
        The share of each feature in the level of the whole frame, which is the mean of all means
        of the norms; and how often that level is subtracted from each: once from the means and
        maxima of norms and loudest joints, minus once from the last feature, which thereby is the
        level itself. Shape (features,) each.
    """
    share, above = [], []
    for each in resolutions:
        level = np.repeat((1.0, 1.0, 0.0), len(each.edges) - 1)  # mean, maximum, deviation
        mean = np.repeat((1.0, 0.0, 0.0), len(each.edges) - 1)
        share += [mean * (kind == "norm") for kind in kinds]
        above += [level * (kind != "difference") for kind in kinds]
    shares = np.concatenate((*share, [0.0]))
    return shares / shares.sum(), np.concatenate((*above, [-1.0]))
