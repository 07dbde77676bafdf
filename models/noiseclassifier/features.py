"""Features: log-band energies of the frames, pooled over time.

Conventions: a spectrogram has the axes (frames, time, frequency). Signals follow one after the
other, among the log-band energies of a window as well as in a feature vector. A feature vector of
NoisyTest and the paper has the coefficients over time of the first band first, and then those of
the second.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from noiseclassifier.errors import SignalError
from noiseclassifier.pooling import pooled, spectra, statistics
from noiseclassifier.profile import Profile, Resolution
from noiseclassifier.types import Array, Index, Real


def features(frames: Real, profile: Profile) -> Array:
    """Features of each frame: its log-band energies, pooled over time.

    Args:
        frames: Stretches of noise signal, shape (frames, length), or (frames, rows, length).
        profile: What to compute, and the length that frames must have.

    Returns:
        Features, not yet standardised, shape (frames, features). Relative to a reference they are
        0, as those of the first frame of a signal.

    Raises:
        SignalError: If the frames have another shape or values that are not finite.
    """
    _check(frames, profile)
    rows = frames.shape[1] if frames.ndim > 2 else 1
    exact = rounded(frames, profile).reshape(len(frames), rows, profile.length).swapaxes(0, 1)
    energies = [
        log_band_energies(_windows(exact, each.window, each.stride), profile, each)
        for each in profile.resolutions
    ]
    found = temporal_pooling(energies, profile)
    return np.concatenate((found, 0.0 * found), axis=1) if profile.reference else found


def rounded(samples: Real, profile: Profile) -> Array:
    """Samples as 64-bit numbers, rounded to the precision of the profile.

    Args:
        samples: A noise signal, any shape.
    """
    if profile.single_precision:
        samples = samples.astype(np.float32, copy=False)
    return samples.astype(np.float64, copy=False)


def log_band_energies(windows: Array, profile: Profile, resolution: Resolution) -> Array:
    """Logarithm of the amplitude of each frequency band, in each window of a Fourier transform.

    Args:
        windows: Samples of the windows, shape (rows, ..., window).
        resolution: The one of the profile's that the windows are of.

    Returns:
        Shape (..., energies), in [Np]: of each norm, and then, in a relative profile, the
        difference of each norm from the one before; then the same of the loudest joint of each
        signal that goes joint by joint, and the difference of that joint from the mean of all
        joints. They do not depend on the windows beside, bit for bit.
    """
    spectrum = _transform(windows)
    if profile.bands == "log":
        squares = np.square(spectrum.real)
        squares += np.square(spectrum.imag)
        # A product for each window: the rounding of one for all depends on how many they are.
        power = squares[..., None, :] @ _power_shares(profile.rate, resolution)
        amplitude = np.sqrt(power[..., 0, :])
    else:
        amplitude = compress(np.abs(spectrum), comb=profile.bands == "comb")
    amplitude += profile.floor
    found = np.log(amplitude, out=amplitude)
    norms, joints = found[: profile.norms], found[profile.norms :]
    parts = [norms]
    if profile.differences:
        parts.append(norms[1:] - norms[:-1])
    if len(joints):
        joints = joints.reshape(len(profile.signals) - len(norms), -1, *found.shape[1:])
        loudest = np.maximum.reduce(joints, 1)
        moving = loudest[: profile.moving]
        parts += [loudest, moving[1:] - moving[:-1]]
        if profile.relative:
            # The order in which `add.reduce` sums up depends on the shape; this one does not.
            parts.append(loudest - np.add.reduceat(joints, [0], 1)[:, 0] / joints.shape[1])
    energies = np.concatenate(parts)
    *leading, last = range(1, energies.ndim)
    return energies.transpose(*leading, 0, last).reshape(*found.shape[1:-1], -1)


def temporal_pooling(energies: Sequence[Array], profile: Profile) -> Array:
    """Features of each frame: log-band energies of its windows, pooled over time.

    Args:
        energies: For each of the profile's resolutions, log-band energies of the frames' windows,
            shape (frames, time, energies).

    Returns:
        Features, not yet standardised, shape (frames, features).
    """
    if profile.bands == "log":
        return pooled(energies, profile)
    flat = dct(energies[0]).reshape(len(energies[0]), feature_count(profile))
    return flat.astype(np.float32).astype(np.float64) if profile.single_precision else flat


def feature_count(profile: Profile) -> int:
    """Number of features of a frame."""
    if profile.bands == "log":
        bands = sum(len(each.edges) - 1 for each in profile.resolutions)
        plain = len(spectra(profile)) * statistics(profile) * bands + profile.relative
        return (1 + profile.reference) * plain
    return profile.norms * (profile.bins // 3) * profile.transforms


def standard(plain: Real, profile: Profile) -> tuple[Array, Array]:
    """Mean and scale for the standardisation of features; 0 and 1 if they stay as they are.

    Args:
        plain: Features of the training set, NaN where they are missing, shape (frames, features).

    Returns:
        Mean and scale of each feature, shape (features,) each.
    """
    if not profile.least_deviation:
        return np.zeros(plain.shape[1]), np.ones(plain.shape[1])
    deviation: Array = np.nanstd(plain, axis=0, dtype=np.float64)
    mean: Array = np.nanmean(plain, axis=0, dtype=np.float64)
    return mean, np.maximum(deviation, profile.least_deviation)


def spectrogram(frames: Array, *, window: int, stride: int) -> Array:
    """Amplitudes of the short-time Fourier transform (paper, Sec. III-A), not padded.

    Args:
        frames: Stretches of noise signal, shape (frames, length).

    Returns:
        Amplitudes, shape (frames, time, frequency).
    """
    return np.abs(_transform(_windows(frames, window, stride)))


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


def dct(energies: Array) -> Array:
    """Cosine transform of each band over time, of type II, orthonormal.

    Args:
        energies: Log-band energies, shape (..., time, frequency).

    Returns:
        Coefficients, shape (..., frequency, time). Distances between frames stay what they
        were: the transform is a rotation, so that no decision depends on it.
    """
    coefficients: Array = np.swapaxes(energies, -1, -2) @ _cosines(energies.shape[-2])
    return coefficients


def band_shares(rate: float, resolution: Resolution) -> Array:
    """Share of each bin in the mean power of each band between a resolution's edges.

    A bin stands for half a bin's width on each side of its frequency and counts by the part of it
    that lies in the band, so that a band narrower than a bin is never empty.

    Args:
        rate: Sample rate of the signal, in [Hz].

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


def _windows(frames: Array, window: int, stride: int) -> Array:
    return np.lib.stride_tricks.sliding_window_view(frames, window, axis=-1)[..., ::stride, :]


@lru_cache
def _power_shares(rate: float, resolution: Resolution) -> Array:
    """Matrix from squares of a transform to mean powers, shape (frequency, bands)."""
    amplitude = 2.0 / _hann(resolution.window).sum()
    shares: Array = amplitude**2 * band_shares(rate, resolution)
    return shares


def _transform(windows: Array) -> NDArray[np.complex128]:
    return np.fft.rfft(windows * _hann(windows.shape[-1]), axis=-1)


@lru_cache
def _hann(window: int) -> Array:
    hann: Array = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(window) / window)
    return hann


@lru_cache
def _bins_of_bands(bins: int, *, comb: bool) -> Index:
    """The three bins of each band, shape (3, bands)."""
    bands = bins // 3
    third = np.arange(3)[:, None]
    if not comb:
        return 3 * np.arange(bands) + third
    # NoisyTest writes the 0-1 matrix of bins and bands row by row, three ones and `bins` zeros in
    # turn, where `bands` zeros were meant: ones drift through the columns, and most bins get none.
    return 3 * (np.arange(3 * bands).reshape(3, bands) // 3) + third


@lru_cache
def _cosines(count: int) -> Array:
    """Matrix of the cosine transform, shape (time, coefficients)."""
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
