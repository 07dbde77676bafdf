"""Features: the numbers by which a machine tells one frame from another.

Conventions: a spectrogram has the axes (frames, time, frequency). What there is of several signals
follows one after the other, among the levels of a window as well as in a feature vector. A feature
vector of NoisyTest and the paper runs over time first: all coefficients of the first band, then
those of the second.
"""

from collections.abc import Sequence
from functools import lru_cache
from math import prod

import numpy as np
from numpy.typing import NDArray

from models.errors import SignalError
from models.pooling import POOLED, pooled, spectra
from models.profile import Profile, Resolution
from models.types import Array, Index, Real


def features(frames: Real, profile: Profile) -> Array:
    """Describe each frame by the levels of its frequency bands and their course in time.

    Args:
        frames: Stretches of noise signal, shape (frames, length), or (frames, rows, length).
        profile: What to compute, and the length that frames must have.

    Returns:
        Features, not yet standardised, shape (frames, features).

    Raises:
        SignalError: If the frames have another shape or values that are not finite.
    """
    _check(frames, profile)
    rows = frames.shape[1] if frames.ndim > 2 else 1
    exact = rounded(frames, profile).reshape(len(frames), rows, profile.length)
    loudness = [
        levels(np.swapaxes(_stretches(exact, each.window, each.stride), 1, 2), profile, each)
        for each in profile.resolutions
    ]
    return course(loudness, profile)


def rounded(samples: Real, profile: Profile) -> Array:
    """Round samples as the profile asks for, and make 64-bit numbers of them.

    Args:
        samples: A noise signal, any shape.
        profile: Says whether samples are 32-bit numbers.
    """
    if profile.single_precision:
        samples = samples.astype(np.float32, copy=False)
    return samples.astype(np.float64, copy=False)


def levels(stretches: Array, profile: Profile, resolution: Resolution) -> Array:
    """Tell how loud each frequency band is in each window of a Fourier transform.

    Args:
        stretches: Samples of the windows, shape (..., rows, window).
        profile: What to compute.
        resolution: The one of the profile's that the windows are of.

    Returns:
        Logarithms of the bands' amplitudes, shape (..., levels): of each norm, and then, in a
        profile that is relative, what each norm's is above that of the one before; then the same
        of the loudest joint of each signal that goes joint by joint, and how far that one is above
        the mean of all joints.
    """
    rows = stretches.shape[:-2]
    if profile.bands != "log":
        amplitude = compress(_amplitude(stretches), comb=profile.bands == "comb")
        return np.log(amplitude + profile.floor).reshape(*rows, prod(amplitude.shape[-2:]))
    spectrum = _transform(stretches)
    squares = np.square(spectrum.real)
    squares += np.square(spectrum.imag)
    shares = _power_shares(profile.rate, resolution)
    # Side by side, windows of all signals are one product of matrices.
    power = squares.reshape(-1, len(shares)) @ shares
    np.sqrt(power, out=power)
    power += profile.floor
    bands = shares.shape[1]
    if profile.norms < len(profile.signals):
        return _with_joints(np.log(power).reshape(*rows, -1, bands), profile)
    own = stretches.shape[-2] * bands
    loudness = np.empty((*rows, 2 * own - bands if profile.relative else own))
    np.log(power.reshape(*rows, own), loudness[..., :own])
    if profile.relative:
        np.subtract(loudness[..., bands:own], loudness[..., : own - bands], loudness[..., own:])
    return loudness


def _with_joints(found: Array, profile: Profile) -> Array:
    """Lay out levels of all rows as `levels` says.

    Args:
        found: Shape (..., rows, bands).
        profile: Says how many rows are norms, and how many signals go joint by joint.
    """
    rows, bands = found.shape[:-2], found.shape[-1]
    norms, kinds = profile.norms, len(profile.signals) - profile.norms
    joints = found[..., norms:, :].reshape(*rows, kinds, -1, bands)
    loudness = np.empty((*rows, 2 * norms - 1 + 3 * kinds - 1, bands))
    own, loudest = loudness[..., : 2 * norms - 1, :], loudness[..., 2 * norms - 1 :, :]
    own[..., :norms, :] = found[..., :norms, :]
    np.subtract(own[..., 1:norms, :], own[..., : norms - 1, :], own[..., norms:, :])
    most, above = loudest[..., :kinds, :], loudest[..., -kinds:, :]
    np.maximum.reduce(joints, -2, out=most)
    np.subtract(most[..., 1:, :], most[..., :-1, :], loudest[..., kinds:-kinds, :])
    np.add.reduce(joints, -2, out=above)
    above /= joints.shape[-2]
    np.subtract(most, above, above)
    return loudness.reshape(*rows, -1)


def course(loudness: Sequence[Array], profile: Profile) -> Array:
    """Describe each frame by the course of its levels in time.

    Args:
        loudness: For each of the profile's resolutions, levels of the frames' windows, shape
            (frames, time, levels).
        profile: What to compute.

    Returns:
        Features, not yet standardised, shape (frames, features).
    """
    if profile.bands == "log":
        return pooled(loudness, profile)
    flat = dct(loudness[0]).reshape(len(loudness[0]), feature_count(profile))
    return flat.astype(np.float32).astype(np.float64) if profile.single_precision else flat


def feature_count(profile: Profile) -> int:
    """Say how many features a frame has."""
    if profile.bands == "log":
        bands = sum(len(each.edges) - 1 for each in profile.resolutions)
        return len(spectra(profile)) * POOLED * bands + profile.relative
    return profile.norms * (profile.bins // 3) * profile.transforms


def standard(plain: Array, profile: Profile) -> tuple[Array, Array]:
    """Learn what features are scaled by; 0 and 1 where they stay as they are.

    Args:
        plain: Features to learn from, shape (frames, features).
        profile: Says the least deviation.

    Returns:
        Mean and scale of each feature, shape (features,) each.
    """
    if not profile.least_deviation:
        return np.zeros(plain.shape[1]), np.ones(plain.shape[1])
    return plain.mean(axis=0), np.maximum(plain.std(axis=0), profile.least_deviation)


def spectrogram(frames: Array, *, window: int, stride: int) -> Array:
    """Amplitudes of the short-time Fourier transform (paper, Sec. III-A), not padded.

    Args:
        frames: Stretches of noise signal, shape (frames, length).
        window: Samples of the periodic Hann window.
        stride: Samples from one transform to the next.

    Returns:
        Amplitudes, shape (frames, time, frequency).
    """
    return _amplitude(_stretches(frames, window, stride))


def compress(spectrum: Array, *, comb: bool = False) -> Array:
    """Sum three bins into one band (the mean would shift every logarithm by the same log 3).

    Args:
        spectrum: Amplitudes, shape (frames, time, frequency), a multiple of three bins.
        comb: Whether to sum the bins that NoisyTest 0.0.1 sums, a third of the spectrum apart,
            in place of adjacent ones.

    Returns:
        Amplitudes of the bands, shape (frames, time, frequency / 3).
    """
    bands: Array = spectrum[..., _bins_of_bands(spectrum.shape[-1], comb=comb)].sum(axis=-2)
    return bands


def dct(loudness: Array) -> Array:
    """Describe the course of each band in time by its cosine transform of type II, orthonormal.

    Args:
        loudness: Levels of the bands, shape (..., time, frequency).

    Returns:
        Coefficients, shape (..., frequency, time). Distances between frames stay what they
        were: the transform is a rotation, so that no decision depends on it.
    """
    coefficients: Array = np.swapaxes(loudness, -1, -2) @ _cosines(loudness.shape[-2])
    return coefficients


def band_shares(rate: float, resolution: Resolution) -> Array:
    """Share of each bin in the mean power of each band between a resolution's edges.

    A bin stands for half a bin's width on each side of its frequency and counts by the part of it
    that lies in the band, so that a band narrower than a bin is never empty.

    Args:
        rate: Sample rate of the signal, in [Hz].
        resolution: With band edges.

    Returns:
        Shares, each column summing to 1, shape (frequency, bands).
    """
    width = rate / resolution.window
    centre = width * np.arange(resolution.window // 2 + 1)[:, None]
    low, high = np.array(resolution.edges[:-1]), np.array(resolution.edges[1:])
    overlap = np.minimum(centre + width / 2, high) - np.maximum(centre - width / 2, low)
    share = np.maximum(overlap, 0.0)
    normalised: Array = share / share.sum(axis=0)
    return normalised


def _stretches(frames: Array, window: int, stride: int) -> Array:
    return np.lib.stride_tricks.sliding_window_view(frames, window, axis=-1)[..., ::stride, :]


@lru_cache
def _power_shares(rate: float, resolution: Resolution) -> Array:
    """Make the matrix from squares of a transform to mean powers, shape (frequency, bands)."""
    amplitude = 2.0 / _hann(resolution.window).sum()
    shares: Array = amplitude**2 * band_shares(rate, resolution)
    return shares


def _transform(stretches: Array) -> NDArray[np.complex128]:
    return np.fft.rfft(stretches * _hann(stretches.shape[-1]), axis=-1)


def _amplitude(stretches: Array) -> Array:
    amplitude: Array = np.abs(_transform(stretches))
    return amplitude


@lru_cache
def _hann(window: int) -> Array:
    hann: Array = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(window) / window)
    return hann


@lru_cache
def _bins_of_bands(bins: int, *, comb: bool) -> Index:
    """List the three bins of each band, shape (3, bands)."""
    bands = bins // 3
    third = np.arange(3)[:, None]
    if not comb:
        return 3 * np.arange(bands) + third
    # NoisyTest writes the 0-1 matrix of bins and bands row by row, three ones and `bins` zeros in
    # turn, where `bands` zeros were meant: ones drift through the columns, and most bins get none.
    return 3 * (np.arange(3 * bands).reshape(3, bands) // 3) + third


@lru_cache
def _cosines(count: int) -> Array:
    """Make the matrix of the cosine transform, shape (time, coefficients)."""
    n, k = np.arange(count)[:, None], np.arange(count)
    # X_k = sqrt(2 / n_t) sum x_n cos(pi / n_t (n + 1/2) k), X_0 over sqrt(2): the paper's pi / 2 in
    # place of pi / n_t is a slip, being no orthonormal transform.
    basis: Array = np.sqrt(2.0 / count) * np.cos(np.pi / count * (n + 0.5) * k)
    basis[:, 0] /= np.sqrt(2.0)
    return basis


def _check(frames: Real, profile: Profile) -> None:
    count, norms = len(profile.signals), profile.norms
    shape: tuple[int | str, ...] = (profile.length,) if count == 1 else (count, profile.length)
    fit = frames.shape[1:] == shape
    if norms < count:
        shape = f"{norms} + {count - norms} joints", profile.length
        joints, rest = (
            divmod(frames.shape[1] - norms, count - norms) if frames.ndim == 3 else (0, 0)
        )
        fit = joints > 0 and not rest and frames.shape[2] == profile.length
    if not fit:
        raise SignalError(
            f"frames of shape {frames.shape}, expected (frames, {', '.join(map(str, shape))})"
            f" for profile {profile.name!r} at {profile.rate:g} Hz"
        )
    if not np.isfinite(frames).all():
        plain = frames.reshape(len(frames), -1)
        number = int(np.flatnonzero(~np.isfinite(plain).all(axis=1))[0])
        raise SignalError(f"frame {number} holds a value that is not finite")
