"""Offset and drift between two clocks, estimated by cross-correlation.

The cross-correlation of the desired and the measured velocities of the same joints gives the
offset; the residual offsets of short segments give the drift. An offset below ``LAG`` is
attributed to the controller, not to the clocks.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from inspector.logs.resample import TimedTrack
from noisemodel.types import Array

CORRELATION = 0.6
"""Least normalised correlation of an accepted offset."""

NEXT_BEST = 0.95
"""Largest correlation of the next best offset, as a share of the best."""

SHARE = 0.5
"""Least share of the shorter log that overlaps the longer one."""

LAG = 0.1
"""Largest delay of measured behind desired motion that is attributed to a controller, in [s]."""

HIGHEST_RATE = 1000.0
"""Highest rate at which motions are compared, in [Hz]."""

COARSE_RATE = 50.0
"""Rate of the first search, in [Hz]."""

SEGMENTS, SHORTEST = 12, 2.0
"""Largest number of segments that the drift is fitted to, and their least length, in [s]."""

SIGNIFICANT = 5.0
"""Least ratio of a drift to its standard error."""

LEAST_DRIFT = 20e-6
"""Least drift that is distinguished from none, as of quartz clocks, in [s/s]."""


@dataclass(frozen=True)
class Offset:
    """Offset of the desired clock to the measured one: t_measured = t + seconds + drift t.

    Attributes:
        seconds: Offset at the first desired stamp, in [s].
        drift: Change of the offset per second, in [s/s].
        correlation: Normalised correlation at this offset, at most 1.
        next_best: Normalised correlation at the next best offset.
        span: Duration of the desired log, in [s].
    """

    seconds: float
    drift: float
    correlation: float
    next_best: float
    span: float

    @property
    def is_unambiguous(self) -> bool:
        """Whether the correlation is high, and at no other offset nearly as high."""
        return self.correlation >= CORRELATION and self.next_best <= NEXT_BEST * self.correlation

    @property
    def exceeds_lag(self) -> bool:
        """Whether it is larger than a controller's lag."""
        ends = (self.seconds, self.seconds + self.drift * self.span)
        return bool(self.drift) or max(map(abs, ends)) > LAG

    def __str__(self) -> str:
        drift = f", drift {self.drift * 1e6:+.0f} ppm" if self.drift else ""
        return (
            f"offset {self.seconds:+.4f} s{drift} (correlation {self.correlation:.2f}, next best"
            f" {self.next_best:.2f})"
        )


def estimate(
    measured: Mapping[str, TimedTrack], desired: Mapping[str, TimedTrack]
) -> Offset | None:
    """Offset of the desired clock to the measured one.

    Args:
        measured: The measured tracks by signal, "position" or "velocity".
        desired: The desired tracks by signal.

    Returns:
        The offset; None if no joint moves in both.
    """
    pair = _common_tracks(measured, desired)
    if pair is None:
        return None
    rate = min(HIGHEST_RATE, *(track.clock.nominal for track in pair))
    joints = [joint for joint in pair[0].track.joints if joint in pair[1].track.joints]
    measured_motion, desired_motion = (_Motion.of(track, joints) for track in pair)
    coarse = min(rate, COARSE_RATE)
    seconds, correlation, next_best = _search(measured_motion, desired_motion, coarse)
    drift = 0.0
    span = float(desired_motion.time[-1] - desired_motion.time[0])
    for _ in range(3):
        residuals = _residuals(measured_motion, desired_motion, seconds, drift, rate)
        if not len(residuals):
            break
        seconds, drift = _fitted(residuals, seconds, drift)
    return Offset(seconds, drift, correlation, next_best, span)


@dataclass(frozen=True, eq=False)
class _Motion:
    """Velocities of some joints over time."""

    time: Array
    velocity: Array
    clock_stretches: tuple[slice, ...]

    @classmethod
    def of(cls, track: TimedTrack, joints: list[str]) -> "_Motion":
        columns = [track.track.joints.index(joint) for joint in joints]
        values = np.asarray(track.track.values[:, columns], dtype=np.float64)
        if track.track.signal.startswith("position"):
            values = np.gradient(np.unwrap(values, axis=0), track.time, axis=0)
        return cls(track.time, values, track.clock.stretches)

    def at(self, instants: Array) -> Array:
        """Linearly interpolated velocities, 0 in gaps and outside, shape (instants, joints)."""
        found = np.zeros((len(instants), self.velocity.shape[1]))
        for stretch in self.clock_stretches:
            known = self.time[stretch]
            part = slice(*np.searchsorted(instants, [known[0], known[-1]]))
            for joint, values in enumerate(self.velocity[stretch].T):
                found[part, joint] = np.interp(instants[part], known, values)
        return found


def _common_tracks(
    measured: Mapping[str, TimedTrack], desired: Mapping[str, TimedTrack]
) -> tuple[TimedTrack, TimedTrack] | None:
    """A measured and a desired track with a joint that moves in both, preferably velocities."""
    for one in ("velocity", "position"):
        for other in (one, "velocity", "position"):
            pair = measured.get(one), desired.get(other)
            if pair[0] is None or pair[1] is None:
                continue
            for joint in set(pair[0].track.joints) & set(pair[1].track.joints):
                columns = (
                    each.track.values[:, each.track.joints.index(joint)] for each in pair if each
                )
                if all(np.ptp(column) > 0 for column in columns):
                    return pair[0], pair[1]
    return None


def _search(
    measured_motion: _Motion, desired_motion: _Motion, rate: float
) -> tuple[float, float, float]:
    """Best offset in [s], its correlation, and that of the next best."""
    from scipy import fft

    one, other = (
        motion.at(np.arange(motion.time[0], motion.time[-1], 1 / rate))
        for motion in (measured_motion, desired_motion)
    )
    scale = np.sqrt((one**2).mean(axis=0) * (other**2).mean(axis=0))
    moving = scale > 0
    one, other = one[:, moving], other[:, moving] / scale[moving]
    length = fft.next_fast_len(len(one) + len(other), real=True)

    def crossed(a: Array, b: Array) -> Array:
        product = fft.rfft(a, length, axis=0) * np.conj(fft.rfft(b, length, axis=0))
        return np.asarray(fft.irfft(product.sum(axis=1), length))

    weight = 1 / scale[moving]
    ones = np.ones((len(one), 1)), np.ones((len(other), 1))
    energy = crossed((one**2 * weight).sum(axis=1, keepdims=True), ones[1])
    energy = energy * crossed(ones[0], (other**2 / weight).sum(axis=1, keepdims=True))
    overlap = crossed(*ones)
    least = SHARE * min(len(one), len(other))
    correlation = crossed(one, other) / np.sqrt(np.maximum(energy, 1e-9 * energy.max()))
    correlation = np.where(overlap >= least - 0.5, correlation, -1.0)
    best = int(np.argmax(correlation))
    lags = np.arange(length)
    distance = np.minimum((lags - best) % length, (best - lags) % length)
    edge = _edge(correlation, best, length)
    next_best = float(correlation[distance > edge].max(initial=-1.0))
    lag = best if best < len(one) else best - length
    seconds = lag / rate + float(measured_motion.time[0] - desired_motion.time[0])
    return seconds, float(correlation[best]), next_best


def _edge(correlation: Array, best: int, length: int) -> int:
    """Half-width of the peak in samples: where the correlation falls below half of it."""
    around = np.roll(correlation, length // 2 - best)
    below = np.flatnonzero(around < 0.5 * around[length // 2])
    below = np.abs(below - length // 2)
    return int(below.min(initial=length)) if len(below) else length


def _residuals(
    measured_motion: _Motion, desired_motion: _Motion, seconds: float, drift: float, rate: float
) -> Array:
    """Residual offset of each segment: time, offset and weight, shape (segments, 3)."""
    since = desired_motion.time - desired_motion.time[0]
    shifted = desired_motion.time + seconds + drift * since
    start = max(measured_motion.time[0], shifted[0]) + 2 * LAG
    stop = min(measured_motion.time[-1], shifted[-1]) - 2 * LAG
    count = min(SEGMENTS, int((stop - start) / SHORTEST))
    if count < 1:
        return np.empty((0, 3))
    moved = _Motion(shifted, desired_motion.velocity, desired_motion.clock_stretches)
    reach = int(np.ceil(2 * LAG * rate))
    found = []
    edges = np.linspace(start, stop, count + 1)
    for first, last in pairwise(edges):
        instants = np.arange(first, last, 1 / rate)
        longer = first + np.arange(-reach, len(instants) + reach) / rate
        residual, correlation = _match(measured_motion.at(instants), moved.at(longer), rate)
        if correlation >= CORRELATION:
            found.append(((first + last) / 2 - shifted[0], residual, correlation))
    return np.array(found).reshape(-1, 3)


def _match(segment: Array, longer: Array, rate: float) -> tuple[float, float]:
    """Offset in [s] of a segment within a longer one, and the correlation there."""
    from scipy import fft

    scale = np.sqrt((segment**2).sum(axis=0) * (longer**2).sum(axis=0))
    moving = scale > 0
    if not moving.any():
        return 0.0, 0.0
    weight = np.sqrt(1 / scale[moving])  # joints have equal weight, fast or slow
    segment, longer = segment[:, moving] * weight, longer[:, moving] * weight
    reach = (len(longer) - len(segment)) // 2
    length = fft.next_fast_len(len(longer), real=True)
    product = fft.rfft(longer, length, axis=0) * np.conj(fft.rfft(segment, length, axis=0))
    crossed = fft.irfft(product.sum(axis=1), length)[: 2 * reach + 1]
    energy = np.concatenate(([0.0], np.cumsum((longer**2).sum(axis=1))))
    energy = (energy[len(segment) :] - energy[: -len(segment)])[: 2 * reach + 1]
    near = crossed / np.sqrt(np.maximum((segment**2).sum() * energy, np.finfo(np.float64).tiny))
    peak = int(np.argmax(near))
    found = longer[peak : peak + len(segment)]
    gain = (segment * found).sum(axis=0) / np.maximum((found**2).sum(axis=0), 1e-300)
    slope = np.gradient(found * gain, 1 / rate, axis=0)
    # piece(t) = found(t - rest), to first order
    rest = ((found * gain - segment) * slope).sum() / (slope**2).sum()
    return (reach - peak) / rate + float(rest), float(near[peak])


def _fitted(residuals: Array, seconds: float, drift: float) -> tuple[float, float]:
    """Offset and drift fitted to the segments; a drift that is not significant is 0."""
    when, residual, weight = residuals.T
    total = residual + drift * when
    if len(residuals) >= 4:
        matrix = np.stack((np.ones(len(when)), when), axis=1) * weight[:, None]
        (constant, slope), *_ = np.linalg.lstsq(matrix, total * weight, rcond=None)
        spread = np.sqrt(np.sum((total - constant - slope * when) ** 2) / (len(when) - 2))
        error = spread / (np.std(when) * np.sqrt(len(when)))
        if abs(slope) > max(SIGNIFICANT * error, LEAST_DRIFT):
            return seconds + float(constant), float(slope)
    return seconds + float(np.average(total, weights=weight)), 0.0
