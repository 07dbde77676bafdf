"""Temporal pooling: statistics of log-band energies over the windows of a frame."""

from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Literal, TypeAlias

import numpy as np

from noiseclassifier.profile import Profile, Resolution
from noiseclassifier.signals import EFFORT
from noiseclassifier.types import Array, Index

Spectrum: TypeAlias = Literal["norm", "loudest", "difference"]
"""What a spectrum is of: a norm, the loudest joint, or a difference."""

RELATIVE = "relative"
"""What the names of features begin with that are relative to a reference."""
POOLED = 3
"""Statistics that `pool` computes of each log-band energy: mean, maximum and standard deviation.
Beside a reference, the last one adds nothing on robots left out, and is not computed."""


def pooled(energies: Sequence[Array], profile: Profile) -> Array:
    """Statistics of the log-band energies of each frame.

    Args:
        energies: For each of the profile's resolutions, log-band energies of the frames' windows,
            shape (frames, time, energies).
        profile: Whether energies are relative to the level of the frame.
    """
    rows = [
        _by_spectrum(pool(each, statistics(profile)), len(resolution.edges) - 1)
        for each, resolution in zip(energies, profile.resolutions, strict=True)
    ]
    if not profile.relative:
        return np.concatenate(rows, axis=1)
    means, above = _level(spectra(profile), profile.resolutions)
    described = np.concatenate((*rows, np.zeros((len(rows[0]), 1))), axis=1)
    level = np.add.reduce(described.take(means, 1), 1, keepdims=True) / len(means)
    described -= level * above
    return described


def statistics(profile: Profile) -> int:
    """Number of statistics of each log-band energy."""
    return POOLED - profile.reference


def columns(profile: Profile) -> tuple[str, ...]:
    """Names of the features of a profile with a reference, in order.

    A feature has one name at any rate: it consists of the signals, the window's kind, the statistic
    and the lower edge of the band, in [Hz], after `RELATIVE` where it is relative to the reference.
    """
    norms, joints = profile.signals[: profile.norms], profile.signals[profile.norms :]
    spectra = [
        name
        for signals in (norms, joints)
        for name in (*signals, *(f"{b} less {a}" for a, b in pairwise(signals) if b != EFFORT))
    ]
    plain = [
        f"{spectrum} {kind} {statistic} {edge:.4g}"
        for kind, resolution in zip(("long", "short"), profile.resolutions, strict=False)
        for spectrum in spectra
        for statistic in ("mean", "maximum")
        for edge in resolution.edges[:-1]
    ]
    return (*plain, *(f"{RELATIVE} {name}" for name in plain))


def pool(energies: Array, count: int = POOLED) -> Array:
    """Mean, maximum and standard deviation over time of each log-band energy.

    Args:
        count: How many of these statistics, 2 or 3.

    Returns:
        Statistics, which do not depend on the order in time, shape (frames, count, energies).
    """
    # A frame at a time is too little for NumPy's methods, which take longer than their ufuncs.
    frames, windows, bands = energies.shape
    found = np.empty((frames, count, bands))
    mean, most = found[:, 0], found[:, 1]
    np.add.reduce(energies, 1, out=mean)
    mean /= windows
    np.maximum.reduce(energies, 1, out=most)
    if count < POOLED:
        return found
    deviation = found[:, 2]
    squares = energies - mean[:, None]
    squares *= squares
    np.add.reduce(squares, 1, out=deviation)
    deviation /= windows
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
    if profile.differences:
        found += ["difference"] * (norms - 1)
        found += ["loudest"] * joints
        found += ["difference"] * max(profile.moving - 1 + profile.relative * joints, 0)
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
