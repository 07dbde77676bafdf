"""Features: log-band energies of the frames of a signal, pooled over time.

Frame ``i`` holds the samples from ``i * hop`` up to ``i * hop + length``; a stretch at the end that
is shorter than a hop belongs to no frame (paper, Sec. III-A, Framing). `FrameFeatures` takes a
signal in chunks of any size; a whole signal is a single chunk. `features` takes frames alone.

Conventions: a spectrogram has the axes (frames, time, frequency). Signals follow one after the
other, among the log-band energies of a window as well as in a feature vector. A feature vector of
NoisyTest and the paper has the coefficients over time of the first band first, and then those of
the second.
"""

from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from typing import Any, NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from noiseclassifier.errors import SignalError
from noiseclassifier.profile import STATISTICS, Profile, Resolution, columns, spectra
from noiseclassifier.signals import BY_JOINT, Array, Index, Mask, Real, Signals, Tail, stacked

Scalar = TypeVar("Scalar", bound=np.generic)

# How many samples are transformed at once, of all rows: more leave the cache of the processor.
AT_ONCE = 2**17
CHUNK = 64  # frames that are evaluated at once, which bounds the memory that they take
# Frames' lengths of samples that are taken at once at least: few, which bounds the memory.
LENGTHS = 2
# Added to each spread, in [Np]: features of a robot that stands hardly vary at all.
LEAST_SPREAD = 0.15
MOST_RELATIVE = 15.0  # largest relative feature
NORMAL = 1.48  # standard deviation of a normal distribution, in median absolute deviations
# Frames that a running reference remembers at most, so that it follows slow changes: a minute.
MEMORY = 600
FIRST = 0.3  # spread before anything is known, in [Np]; it counts as ``FIRST_FRAMES`` frames
FIRST_FRAMES = 10
BOUND = 1.5  # spreads by which a frame moves a running location at most, times its share
# Frames that are kept of a whole signal at most, beside those that may be failures: 10 minutes.
KEPT = 6000
FEWEST = 10  # frames of the rest of a signal that make a reference
# A robot moves where it is faster than this share of what so many percent of the frames are below.
# From so many frames on, 3 s, its motion is a reference for itself.
SLOW, FAST, ALIKE = 0.1, 95, 30


class Frames(NamedTuple):
    """Frames of a signal."""

    starts: Index  # first sample of each, shape (frames,)
    features: Array  # not yet standardised, shape (frames, features)
    pace: Array  # mean amount of the first signal in each, shape (frames,), in [rad/s]


# Starts of windows, shape (windows,), and their energies, shape (windows, energies).
Windows: TypeAlias = tuple[Index, Array]


# --- frames alone


def frame(signal: NDArray[Scalar], *, length: int = 4000, hop: int = 1000) -> NDArray[Scalar]:
    """Overlapping frames of a signal.

    Args:
        signal: The noise signal, shape (samples,), or several, shape (signals, samples).
        length: Samples of a frame.
        hop: Samples from the start of one frame to the start of the next.

    Returns:
        A read-only view, shape (frames, length), or (frames, signals, length) of several.

    Raises:
        SignalError: If the signal has another shape or is shorter than one frame.
    """
    if signal.ndim not in (1, 2):
        raise SignalError(f"a signal of shape {signal.shape}, expected (samples,)")
    if signal.shape[-1] < length:
        raise SignalError(
            f"a signal of {signal.shape[-1]} samples is too short: one frame takes {length}"
        )
    windows = np.lib.stride_tricks.sliding_window_view(signal, length, axis=-1)
    return np.moveaxis(windows[..., ::hop, :], -2, 0)


def features(frames: Real, profile: Profile) -> Array:
    """Features of each frame: its log-band energies, pooled over time.

    Args:
        frames: Stretches of noise signal, shape (frames, length), or (frames, rows, length).
        profile: What to compute, and the length that frames must have.

    Returns:
        Features, not yet standardised, shape (frames, features). Relative to a reference they are
        0, as in the first frame of a signal.

    Raises:
        SignalError: If the frames have another shape or values that are not finite.
    """
    _check_frames(frames, profile)
    rows = frames.shape[1] if frames.ndim > 2 else 1
    parts = []
    for first in range(0, max(len(frames), 1), CHUNK):
        some = rounded(frames[first : first + CHUNK], profile)
        exact = some.reshape(len(some), rows, profile.length).swapaxes(0, 1)
        energies = [
            log_band_energies(_windows_of(exact, each.window, each.stride), profile, each)
            for each in profile.resolutions
        ]
        parts.append(temporal_pooling(energies, profile))
    found = np.concatenate(parts)
    return np.concatenate((found, 0.0 * found), axis=1) if profile.reference else found


def _check_frames(frames: Real, profile: Profile) -> None:
    count, norms = len(profile.signals), profile.norms
    shape: tuple[int | str, ...] = (profile.length,) if count == 1 else (count, profile.length)
    fit = frames.shape[1:] == shape
    if norms < count:
        shape = f"{norms} + {count - norms} joints", profile.length
        rows = frames.shape[1] - norms if frames.ndim == 3 else 0
        fit = rows > 0 and rows % (count - norms) == 0 and frames.shape[2] == profile.length
    if not fit:
        raise SignalError(
            f"frames of shape {frames.shape}, expected (frames, {', '.join(map(str, shape))})"
            f" for profile {profile.name!r} at {profile.rate:g} Hz"
        )
    if not np.isfinite(frames).all():
        plain = frames.reshape(len(frames), -1)
        number = int(np.flatnonzero(~np.isfinite(plain).all(axis=1))[0])
        raise SignalError(f"frame {number} holds a value that is not finite")


# --- from windows to features


def rounded(samples: Real, profile: Profile) -> Array:
    """Samples as 64-bit numbers, rounded to the precision of the profile."""
    if profile.bands == "comb":
        samples = samples.astype(np.float32, copy=False)
    return samples.astype(np.float64, copy=False)


def log_band_energies(windows: Array, profile: Profile, resolution: Resolution) -> Array:
    """Logarithm of the amplitude of each frequency band, in windows of shape (rows, ..., window).

    The shape is (..., energies), in [Np]: of each norm, and then, in a relative profile, the
    difference of each norm from the one before; then the same of the loudest joint of each signal
    that goes joint by joint, and the difference of that joint from the mean of all joints. They do
    not depend on the windows beside, bit for bit.
    """
    spectrum = _transform(windows)
    signals = len(profile.signals) - profile.norms
    if profile.bands == "log":
        pairs = spectrum.view(np.float64)  # real and imaginary parts in turn
        pairs *= pairs
        squares = pairs[..., ::2] + pairs[..., 1::2]
        # A product for each row: the rounding of one for all depends on how many they are.
        rows = np.moveaxis(squares, 0, -2)[..., None, :]
        amplitude = (rows @ _power_shares(profile.rate, resolution))[..., 0, :]
        if signals and not profile.relative:  # the loudest joint has the largest logarithm
            loudest = _loudest(amplitude[..., profile.norms :, :], signals)
            amplitude = np.concatenate((amplitude[..., : profile.norms, :], loudest), axis=-2)
        np.sqrt(amplitude, out=amplitude)
    else:
        amplitude = np.moveaxis(compress(np.abs(spectrum), comb=profile.bands == "comb"), 0, -2)
    amplitude += profile.floor
    found = np.log(amplitude, out=amplitude)
    norms, joints = found[..., : profile.norms, :], found[..., profile.norms :, :]
    parts = [norms]
    if profile.differences:
        parts.append(norms[..., 1:, :] - norms[..., :-1, :])
    if signals:
        loudest = _loudest(joints, signals) if profile.relative else joints
        moving = loudest[..., : profile.moving, :]
        parts += [loudest, moving[..., 1:, :] - moving[..., :-1, :]]
        if profile.relative:
            # The order in which `add.reduce` sums up depends on the shape; this one does not.
            each = joints.reshape(*loudest.shape[:-1], -1, loudest.shape[-1])
            parts.append(loudest - np.add.reduceat(each, [0], -2)[..., 0, :] / each.shape[-2])
    return np.concatenate(parts, axis=-2).reshape(*found.shape[:-2], -1)


def _loudest(joints: Array, signals: int) -> Array:
    """The loudest joint of each of some signals, of rows of shape (..., signals x joints, n)."""
    *leading, rows, bands = joints.shape
    each = joints.reshape(*leading, signals, rows // signals, bands)
    return np.asarray(np.maximum.reduce(each, -2))


def temporal_pooling(energies: Sequence[Array], profile: Profile) -> Array:
    """Features of frames, by the energies of each resolution, shape (frames, time, energies)."""
    if profile.bands != "log":
        flat = dct(energies[0]).reshape(len(energies[0]), feature_count(profile))
        return flat.astype(np.float32).astype(np.float64) if profile.bands == "comb" else flat
    count, rows = len(profile.statistics), []
    for each, resolution in zip(energies, profile.resolutions, strict=True):
        apart = pool(each, count).reshape(len(each), count, -1, resolution.bands)
        rows.append(apart.swapaxes(1, 2).reshape(len(each), -1))  # spectrum by spectrum
    if not profile.relative:
        return np.concatenate(rows, axis=1)
    means, above = _level(profile)
    described = np.concatenate((*rows, np.zeros((len(rows[0]), 1))), axis=1)
    level = np.add.reduce(described.take(means, 1), 1, keepdims=True) / len(means)
    described -= level * above
    return described


def pool(energies: Array, count: int = len(STATISTICS)) -> Array:
    """Mean, maximum and, of 3, standard deviation over time, shape (frames, count, energies)."""
    # A frame at a time is too little for NumPy's methods, which take longer than their ufuncs.
    frames, windows, bands = energies.shape
    found = np.empty((frames, count, bands))
    mean, most = found[:, 0], found[:, 1]
    np.add.reduce(energies, 1, out=mean)
    mean /= windows
    np.maximum.reduce(energies, 1, out=most)
    if count < len(STATISTICS):
        return found
    deviation = found[:, 2]
    squares = energies - mean[:, None]
    squares *= squares
    np.add.reduce(squares, 1, out=deviation)
    deviation /= windows
    np.sqrt(deviation, deviation)
    return found


@lru_cache
def _level(profile: Profile) -> tuple[Index, Array]:
    """Places of the features whose mean is the level of a frame; how often each is above it.

    The level is the mean of the means of the norms. It is subtracted once from the means and maxima
    of norms and loudest joints, and minus once from the last feature, which thereby is the level.
    """
    means, above = [], []
    for each in profile.resolutions:
        for name in spectra(profile):
            for statistic in profile.statistics:
                counts = " less " not in name and statistic != "deviation"
                means += [counts and statistic == "mean" and name not in BY_JOINT] * each.bands
                above += [float(counts)] * each.bands
    return np.flatnonzero(means), np.array([*above, -1.0])


def feature_count(profile: Profile) -> int:
    """Number of features of a frame."""
    if profile.bands == "log":
        return len(columns(profile))
    return profile.norms * (profile.bins // 3) * profile.transforms


def standard(plain: Real, profile: Profile) -> tuple[Array, Array]:
    """Mean and scale of each feature, NaN where it is missing, for the standardisation."""
    if not profile.least_deviation:
        return np.zeros(plain.shape[1]), np.ones(plain.shape[1])
    deviation: Array = np.nanstd(plain, axis=0, dtype=np.float64)
    mean: Array = np.nanmean(plain, axis=0, dtype=np.float64)
    return mean, np.maximum(deviation, profile.least_deviation)


# --- the Fourier transform and its bands


def spectrogram(frames: Array, *, window: int, stride: int) -> Array:
    """Amplitudes of the short-time Fourier transform (paper, Sec. III-A), not padded."""
    return np.abs(_transform(_windows_of(frames, window, stride)))


def compress(spectrum: Array, *, comb: bool = False) -> Array:
    """Sum three bins into one band (the mean would shift every logarithm by the same log 3).

    They are adjacent, or those that NoisyTest 0.0.1 sums, a third of the spectrum apart.
    """
    bands: Array = spectrum[..., _bins_of_bands(spectrum.shape[-1], comb=comb)].sum(axis=-2)
    return bands


def dct(energies: Array) -> Array:
    """Cosine transform over time, of type II, orthonormal: (..., time, frequency) to the reverse.

    Distances between frames stay what they were: no decision depends on this rotation.
    """
    coefficients: Array = np.swapaxes(energies, -1, -2) @ _cosines(energies.shape[-2])
    return coefficients


def band_shares(rate: float, resolution: Resolution) -> Array:
    """Share of each bin in the mean power of each band, columns of sum 1, shape (frequency, bands).

    A bin stands for half a bin's width on each side of its frequency and counts by the part of it
    that lies in the band, so that a band narrower than a bin is never empty.
    """
    width = rate / resolution.window
    centre = width * np.arange(resolution.window // 2 + 1)[:, None]
    low, high = np.array(resolution.edges[:-1]), np.array(resolution.edges[1:])
    overlap = np.minimum(centre + width / 2, high) - np.maximum(centre - width / 2, low)
    share = np.maximum(overlap, 0.0)
    return np.asarray(share / share.sum(axis=0))


def _windows_of(frames: Array, window: int, stride: int) -> Array:
    return np.lib.stride_tricks.sliding_window_view(frames, window, axis=-1)[..., ::stride, :]


@lru_cache
def _power_shares(rate: float, resolution: Resolution) -> Array:
    """Matrix from squares of a transform to mean powers, shape (frequency, bands)."""
    amplitude = 2.0 / _hann(resolution.window).sum()
    return np.asarray(amplitude**2 * band_shares(rate, resolution))


def _transform(windows: Array) -> NDArray[np.complex128]:
    tapered = np.multiply(windows, _hann(windows.shape[-1]), order="C")
    return np.fft.rfft(tapered, axis=-1)


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


# --- the reference that features are relative to
#
# How loud fault-free motion is differs from robot to robot by orders of magnitude. Relative to a
# reference, it differs far less: each feature less its location there, divided by its spread. The
# reference is the signal itself so far, and of a file also all of it. A failure that fills a whole
# signal is invisible relative to the signal itself; therefore the unchanged features stay beside. A
# spread is 1.48 times a median absolute deviation, the standard deviation of a normal distribution
# (P. J. Huber and E. M. Ronchetti, *Robust Statistics*, 2009, Sec. 5.1).


class RunningReference:
    """The reference that a signal itself is, as far as it has come.

    Location and spread are recursive M-estimates: each frame moves them by a bounded step, which
    falls with the number of frames (P. J. Huber and E. M. Ronchetti, *Robust Statistics*, 2009,
    Sec. 3.2; H. Robbins and S. Monro, *A Stochastic Approximation Method*, 1951). They know nothing
    of frames to come, so that a whole signal has the features of a stream.
    """

    def __init__(self) -> None:
        self._frames = 0
        self._location = self._spread = np.empty(0)

    def relative(self, features: Array) -> Array:
        """Features of the next frames relative to those so far, shape (frames, features)."""
        found = np.empty_like(features)
        for row, frame in enumerate(features):
            self._take(frame)
            found[row] = _relative(frame, self._location, self._spread)
        return found

    def _take(self, frame: Array) -> None:
        if not self._frames:
            self._location, self._spread = frame.copy(), np.full_like(frame, FIRST)
            self._frames = 1
            return
        self._frames = min(self._frames + 1, MEMORY)
        bound = BOUND * self._spread
        step = np.maximum(np.minimum(frame - self._location, bound), -bound)
        self._location += step / self._frames
        # E |x| of a normal distribution is 0.8 of its standard deviation.
        apart = np.minimum(np.abs(frame - self._location), 3.0 * self._spread) / 0.8
        self._spread += (apart - self._spread) / (self._frames + FIRST_FRAMES)


class WholeReference:
    """Features of a whole signal by which its findings are compared with all of it.

    Motion is compared with all motion, whatever the robot does before and after. Where it stands,
    or moves for less than 3 s, it is compared with all that is no finding. Kept are features of all
    frames that may be failures, and of others evenly spread, so that memory does not grow with the
    signal.
    """

    def __init__(self) -> None:
        self._step, self._count = 1, 0
        self._place, self._failure = np.empty(0, np.intp), np.empty(0, bool)
        self._pace = np.empty(0)
        self._features: Array | None = None

    def add(self, features: Array, failure: Mask, pace: Array) -> None:
        """Take the features of the next frames, shape (frames, features)."""
        place = self._count + np.arange(len(features))
        self._count += len(features)
        held = features[:0] if self._features is None else self._features
        self._place = np.concatenate((self._place, place))
        self._failure = np.concatenate((self._failure, failure))
        self._pace = np.concatenate((self._pace, pace))
        self._features = np.concatenate((held, features))
        if np.count_nonzero(~self._failure) > 2 * KEPT:
            self._step *= 2
        kept = self._failure | (self._place % self._step == 0)
        if not kept.all():
            self._place, self._failure = self._place[kept], self._failure[kept]
            self._pace, self._features = self._pace[kept], self._features[kept]

    def relative(self, flagged: Mask) -> tuple[Index, Array] | None:
        """Places of flagged frames, and their features unchanged and relative to the reference.

        None if there are no flagged frames with a reference.
        """
        own = flagged[self._place]
        if self._features is None or not own.any():
            return None
        evenly = self._place % self._step == 0  # failures, all of which are kept, count no more
        moves = self._pace > SLOW * np.percentile(self._pace[evenly], FAST)
        motion = moves & evenly
        enough = np.count_nonzero(motion) >= ALIKE
        found = [
            (self._place[rows], _beside(self._features[rows], self._features[reference]))
            for rows, reference in ((own & moves, motion if enough else ~own), (own & ~moves, ~own))
            if rows.any() and np.count_nonzero(reference) >= FEWEST
        ]
        if not found:
            return None
        places, features = zip(*found, strict=True)
        return np.concatenate(places), np.concatenate(features)


def _beside(features: Array, reference: Array) -> Array:
    """Features, unchanged and relative to those of a reference, shape (frames, features)."""
    location = np.median(reference, axis=0)
    spread = NORMAL * np.median(np.abs(reference - location), axis=0)
    return np.concatenate((features, _relative(features, location, spread)), axis=1)


def _relative(features: Array, location: Array, spread: Array) -> Array:
    found = (features - location) / (spread + LEAST_SPREAD)
    return np.maximum(np.minimum(found, MOST_RELATIVE, out=found), -MOST_RELATIVE, out=found)


# --- signals, whole or in chunks


def frame_features(signal: Signals, profile: Profile, valid: Mask | None = None) -> Frames:
    """Features of all frames of a whole signal but those that touch a gap."""
    return _joined([*features_of_pieces([(signal, valid)], profile)])


def features_of_pieces(
    pieces: Iterable[tuple[Signals, Mask | None]], profile: Profile
) -> Iterator[Frames]:
    """Features of all frames of a signal that comes in pieces, each with False in gaps."""
    frames = None
    for signal, valid in pieces:
        samples = stacked(signal, profile.signals)
        if frames is None:
            frames = FrameFeatures(profile, len(samples) if samples.ndim > 1 else 1)
        yield frames.push(samples, None if valid is None else np.asarray(valid, bool))
    assert frames is not None
    least = first_sample(profile) + profile.length
    if frames.count < least:
        raise SignalError(f"a signal of {frames.count} samples is too short: a frame takes {least}")
    yield frames.finish()


class FrameFeatures:
    """Features of the frames of a signal that comes in chunks of any size.

    The features of a frame come with its last sample, and do not depend on the chunks, bit for
    bit. Each Fourier transform is computed once, for all frames that share it. Memory does not
    grow.
    """

    def __init__(self, profile: Profile, rows: int) -> None:
        """Start a signal of so many norms and joints of the signals that go joint by joint."""
        self._profile, self._rows = profile, rows
        none = np.empty(0, dtype=np.intp)
        self._nothing = Frames(none, np.empty((0, feature_count(profile))), np.empty(0))
        self._no_windows = [
            (
                none,
                log_band_energies(np.zeros((rows, 1, each.window)), profile, each)[:0],
            )
            for each in profile.resolutions
        ]
        self._begin()

    def _begin(self) -> None:
        self.count = 0  # samples so far
        self._frame = first_sample(self._profile)  # start of the next frame
        self._base = 0  # number of the first sample that is held
        self._samples, self._valid = Tail(self._rows), Tail(dtype=np.bool_)
        self._windows = self._no_windows  # starts and energies, of frames to come
        self._relative = RunningReference()

    def push(self, samples: Real, valid: Mask | None = None) -> Frames:
        """Features of the frames that samples, shape (samples,) or (rows, samples), complete."""
        count = samples.shape[-1]
        if samples.ndim > 1 and len(samples) != self._rows:
            raise SignalError(f"{len(samples)} rows of norms and joints, expected {self._rows}")
        valid = np.ones(count, dtype=bool) if valid is None else valid
        if valid.shape != (count,):
            raise SignalError(
                f"samples of shape {samples.shape} and validity of shape {valid.shape},"
                " expected (samples,) for both"
            )
        if not np.isfinite(samples).all():
            plain = samples.reshape(-1, count)
            row, place = np.argwhere(~np.isfinite(plain))[0].tolist()
            raise SignalError(
                f"sample {self.count + place} of the signal is not finite ({plain[row, place]})"
            )
        exact = rounded(samples, self._profile).reshape(self._rows, count)
        at_once = max(LENGTHS * self._profile.length, 4 * AT_ONCE // self._rows)
        pieces = [slice(first, first + at_once) for first in range(0, count, at_once)]
        found = [self._take(exact[:, piece], valid[piece]) for piece in pieces]
        return _joined(found) if found else self._nothing

    def skip(self, samples: int) -> None:
        """Skip a gap as if so many samples were pushed that are not valid, however many."""
        length, hop = self._profile.length, self._profile.hop
        near = min(samples, length)
        self._lose(near)
        # All frames to come begin in the gap now, and so would all that are skipped.
        hops = (samples - near) // hop * hop
        self.count += hops
        self._frame += hops
        self._base += hops
        if hops:
            self._windows = self._no_windows
        self._lose(samples - near - hops)

    def finish(self) -> Frames:
        """End the signal; what is pushed next begins another one."""
        first, last = first_sample(self._profile), self.count - self._profile.length
        found = self._nothing
        # A last frame, flush with the end, covers the tail of a signal.
        if self._profile.bands == "log" and last > first and (last - first) % self._profile.hop:
            found = self._features(np.array([last]))
        self._begin()
        return found

    def _lose(self, samples: int) -> None:
        self._take(np.zeros((self._rows, samples)), np.zeros(samples, dtype=bool))

    def _take(self, samples: Array, valid: Mask) -> Frames:
        """Features of the frames that samples complete; they are held for the next ones."""
        length, hop = self._profile.length, self._profile.hop
        self.count += len(valid)
        self._samples.more(len(valid))[:] = samples
        self._valid.more(len(valid))[:] = valid
        if self.count < self._frame + length:
            return self._nothing
        frames = np.arange(self._frame, self.count - length + 1, hop)
        self._frame += len(frames) * hop
        found = self._features(frames)
        over = self._frame - hop - self._base  # no later frame begins before, also not a last one
        self._samples.drop(over)
        self._valid.drop(over)
        self._base += over
        return found

    def _features(self, frames: Index) -> Frames:
        """Features of those frames that no gap touches, by the samples that are held."""
        samples, valid, places = self._samples.samples, self._valid.samples, frames - self._base
        length = self._profile.length
        kept = [bool(valid[place : place + length].all()) for place in places]
        whole = frames[kept]
        if not len(whole):
            return self._nothing
        found, windows = [], []
        for known, resolution in zip(self._windows, self._profile.resolutions, strict=True):
            steps = resolution.stride * np.arange(resolution.transforms(length))
            wanted = whole[:, None] + steps
            starts, energies = self._transformed(wanted, samples, known, resolution)
            found.append(energies[np.searchsorted(starts, wanted)])
            again = starts >= self._frame
            windows.append((starts[again], energies[again]))
        self._windows = windows
        pooled = temporal_pooling(found, self._profile)
        if self._profile.reference:
            pooled = np.concatenate((pooled, self._relative.relative(pooled)), axis=1)
        first = np.lib.stride_tricks.sliding_window_view(np.abs(samples[0]), length)
        return Frames(whole, pooled, np.add.reduce(first[places[kept]], 1) / length)

    def _transformed(
        self, wanted: Index, samples: Array, known: Windows, resolution: Resolution
    ) -> Windows:
        """Known windows and those that start at wanted samples, in order, and their energies."""
        # Of few windows at a time, as a stream has them, sets are faster than arrays.
        unknown = set(wanted.ravel().tolist()) - set(known[0].tolist())
        fresh = np.array(sorted(unknown), dtype=np.intp)
        windows = np.lib.stride_tricks.sliding_window_view(samples, resolution.window, -1)
        at_once = max(1, AT_ONCE // (self._rows * resolution.window))
        parts = [known[1]]
        for first in range(0, len(fresh), at_once):
            places: Any = fresh[first : first + at_once] - self._base
            if (np.diff(places) == resolution.stride).all():  # a view is faster than a copy
                places = slice(places[0], places[-1] + 1, resolution.stride)
            parts.append(log_band_energies(windows[:, places], self._profile, resolution))
        starts = np.concatenate((known[0], fresh))
        order = starts.argsort()
        return starts[order], np.concatenate(parts)[order]


def first_sample(profile: Profile) -> int:
    """Number of the first sample of the first frame; NoisyTest loses one before."""
    return int(profile.bands == "comb")


def _joined(parts: list[Frames]) -> Frames:
    if len(parts) == 1:
        return parts[0]
    starts, features, pace = zip(*parts, strict=True)
    return Frames(np.concatenate(starts), np.concatenate(features), np.concatenate(pace))
