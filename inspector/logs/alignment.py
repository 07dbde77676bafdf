"""Offset and drift between two clocks, from motion that both of them saw.

The desired and the measured velocities of the same joints are laid over each other where they
correlate best; the same again in short pieces shows how the clocks drift apart. What stays below
``LAG`` is a controller's, not a clock's.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import fft

from inspector.logs.resample import Clocked
from noisemodel.types import Array

CORRELATION = 0.6
"""Normalised correlation that two clocks must reach."""

RIVAL = 0.95
"""Share of it that the next best offset may reach."""

SHARE = 0.5
"""Share of the shorter log that must lie within the longer one."""

LAG = 0.1
"""Measured motion that trails its desired one by up to this is a controller's work, in [s]."""

FINEST = 1000.0
"""Rate at which motions are compared at most, in [Hz]."""

COARSE = 50.0
"""Rate at which they are compared first, in [Hz]."""

PIECES, SHORTEST = 12, 2.0
"""How many pieces show a drift, and how long each must be, in [s]."""

CERTAIN = 5.0
"""Standard errors above which a drift is one."""

LEAST_DRIFT = 20e-6
"""Drift below which quartz clocks cannot be told apart, in [s/s]."""


@dataclass(frozen=True)
class Offset:
    """How the desired clock stands to the measured one: t_measured = t + seconds + drift t.

    Attributes:
        seconds: What to add to desired stamps at the first of them, in [s].
        drift: By how much more with each second, in [s/s].
        correlation: How well the motions agree then, at most 1.
        rival: How well they agree at the next best offset.
        span: Duration of the desired log, in [s].
    """

    seconds: float
    drift: float
    correlation: float
    rival: float
    span: float

    @property
    def is_sure(self) -> bool:
        """Whether the motions agree, and nowhere else nearly as well."""
        return self.correlation >= CORRELATION and self.rival <= RIVAL * self.correlation

    @property
    def is_of_clocks(self) -> bool:
        """Whether it is more than a controller's lag."""
        ends = (self.seconds, self.seconds + self.drift * self.span)
        return bool(self.drift) or max(map(abs, ends)) > LAG

    def __str__(self) -> str:
        drift = f", drift {self.drift * 1e6:+.0f} ppm" if self.drift else ""
        return (
            f"offset {self.seconds:+.4f} s{drift} (correlation {self.correlation:.2f}, next best"
            f" {self.rival:.2f})"
        )


def estimate(measured: Mapping[str, Clocked], desired: Mapping[str, Clocked]) -> Offset | None:
    """Estimate how the desired clock stands to the measured one.

    Args:
        measured: By signal, "position" or "velocity", what was measured.
        desired: The same of what was desired.

    Returns:
        The offset; None where no joint moves in both.
    """
    pair = _shared(measured, desired)
    if pair is None:
        return None
    rate = min(FINEST, *(track.clock.nominal for track in pair))
    joints = [joint for joint in pair[0].track.joints if joint in pair[1].track.joints]
    there, here = (_Motion.of(track, joints) for track in pair)
    coarse = min(rate, COARSE)
    seconds, correlation, rival = _search(there, here, coarse)
    drift = 0.0
    span = float(here.time[-1] - here.time[0])
    for _ in range(3):
        pieces = _pieces(there, here, seconds, drift, rate)
        if not len(pieces):
            break
        seconds, drift = _line(pieces, seconds, drift)
    return Offset(seconds, drift, correlation, rival, span)


@dataclass(frozen=True, eq=False)
class _Motion:
    """Velocities of some joints, scaled to one size, and 0 in gaps."""

    time: Array
    velocity: Array
    clock_stretches: tuple[slice, ...]

    @classmethod
    def of(cls, track: Clocked, joints: list[str]) -> "_Motion":
        columns = [track.track.joints.index(joint) for joint in joints]
        values = np.asarray(track.track.values[:, columns], dtype=np.float64)
        if track.track.signal.startswith("position"):
            values = np.gradient(np.unwrap(values, axis=0), track.time, axis=0)
        return cls(track.time, values, track.clock.stretches)

    def at(self, instants: Array) -> Array:
        """Interpolate linearly, 0 in gaps and beyond, shape (instants, joints)."""
        found = np.zeros((len(instants), self.velocity.shape[1]))
        for stretch in self.clock_stretches:
            known = self.time[stretch]
            part = slice(*np.searchsorted(instants, [known[0], known[-1]]))
            for joint, values in enumerate(self.velocity[stretch].T):
                found[part, joint] = np.interp(instants[part], known, values)
        return found


def _shared(
    measured: Mapping[str, Clocked], desired: Mapping[str, Clocked]
) -> tuple[Clocked, Clocked] | None:
    """Find a measured and a desired track of the same joints, of velocities if there are any."""
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


def _search(there: _Motion, here: _Motion, rate: float) -> tuple[float, float, float]:
    """Find the best offset of all, its correlation, and that of the next best."""
    one, other = (
        motion.at(np.arange(motion.time[0], motion.time[-1], 1 / rate)) for motion in (there, here)
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
    away = np.minimum((lags - best) % length, (best - lags) % length)
    edge = _edge(correlation, best, length)
    rival = float(correlation[away > edge].max(initial=-1.0))
    lag = best if best < len(one) else best - length
    seconds = lag / rate + float(there.time[0] - here.time[0])
    return seconds, float(correlation[best]), rival


def _edge(correlation: Array, best: int, length: int) -> int:
    """Find how far the peak reaches: to where the correlation has fallen below a half of it."""
    around = np.roll(correlation, length // 2 - best)
    below = np.flatnonzero(around < 0.5 * around[length // 2])
    below = np.abs(below - length // 2)
    return int(below.min(initial=length)) if len(below) else length


def _pieces(there: _Motion, here: _Motion, seconds: float, drift: float, rate: float) -> Array:
    """Measure what is left of the offset in pieces: when, how much, how much weight."""
    since = here.time - here.time[0]
    shifted = here.time + seconds + drift * since
    start = max(there.time[0], shifted[0]) + 2 * LAG
    stop = min(there.time[-1], shifted[-1]) - 2 * LAG
    count = min(PIECES, int((stop - start) / SHORTEST))
    if count < 1:
        return np.empty((0, 3))
    moved = _Motion(shifted, here.velocity, here.clock_stretches)
    reach = int(np.ceil(2 * LAG * rate))
    found = []
    edges = np.linspace(start, stop, count + 1)
    for first, last in pairwise(edges):
        instants = np.arange(first, last, 1 / rate)
        wider = first + np.arange(-reach, len(instants) + reach) / rate
        left, correlation = _match(there.at(instants), moved.at(wider), rate)
        if correlation >= CORRELATION:
            found.append(((first + last) / 2 - shifted[0], left, correlation))
    return np.array(found).reshape(-1, 3)


def _match(piece: Array, wider: Array, rate: float) -> tuple[float, float]:
    """Find where a piece lies in a wider one: time ahead of its middle, and the correlation."""
    scale = np.sqrt((piece**2).sum(axis=0) * (wider**2).sum(axis=0))
    moving = scale > 0
    if not moving.any():
        return 0.0, 0.0
    weight = np.sqrt(1 / scale[moving])  # joints count alike, fast or slow
    piece, wider = piece[:, moving] * weight, wider[:, moving] * weight
    reach = (len(wider) - len(piece)) // 2
    length = fft.next_fast_len(len(wider), real=True)
    product = fft.rfft(wider, length, axis=0) * np.conj(fft.rfft(piece, length, axis=0))
    crossed = fft.irfft(product.sum(axis=1), length)[: 2 * reach + 1]
    energy = np.concatenate(([0.0], np.cumsum((wider**2).sum(axis=1))))
    energy = (energy[len(piece) :] - energy[: -len(piece)])[: 2 * reach + 1]
    near = crossed / np.sqrt(np.maximum((piece**2).sum() * energy, np.finfo(np.float64).tiny))
    peak = int(np.argmax(near))
    found = wider[peak : peak + len(piece)]
    gain = (piece * found).sum(axis=0) / np.maximum((found**2).sum(axis=0), 1e-300)
    slope = np.gradient(found * gain, 1 / rate, axis=0)
    # piece(t) = found(t - rest), to first order
    rest = ((found * gain - piece) * slope).sum() / (slope**2).sum()
    return (reach - peak) / rate + float(rest), float(near[peak])


def _line(pieces: Array, seconds: float, drift: float) -> tuple[float, float]:
    """Fit offset and drift to the pieces; a drift that is not certain is none."""
    when, left, weight = pieces.T
    total = left + drift * when
    if len(pieces) >= 4:
        matrix = np.stack((np.ones(len(when)), when), axis=1) * weight[:, None]
        (constant, slope), *_ = np.linalg.lstsq(matrix, total * weight, rcond=None)
        spread = np.sqrt(np.sum((total - constant - slope * when) ** 2) / (len(when) - 2))
        error = spread / (np.std(when) * np.sqrt(len(when)))
        if abs(slope) > max(CERTAIN * error, LEAST_DRIFT):
            return seconds + float(constant), float(slope)
    return seconds + float(np.average(total, weights=weight)), 0.0
