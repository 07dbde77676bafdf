"""Clocks of logs: units and order of stamps, rates of logs without, and signals on one time base.

Stamps of separate clocks are aligned by cross-correlation of the desired and the measured
velocities of the same joints, which gives the offset; residual offsets of short segments give the
drift. An offset below ``LAG`` is attributed to the controller, not to the clocks.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from itertools import pairwise
from math import log
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inspector.errors import LogError
from inspector.logs.log import SAMPLES, UNIFORM, Stamps, Track
from inspector.logs.mapping import ReadOptions
from inspector.logs.names import TIME_UNITS, time_column, without_unit
from noisemodel.run import continuous_quaternions, resample
from noisemodel.types import Array, Indices, Mask, Real

UNITS = {"seconds": "1", "milliseconds": "1e-3", "microseconds": "1e-6", "nanoseconds": "1e-9"}
"""The units that stamps may have, in [s]."""
SLOWEST_SECONDS = 0.5
"""Median step up to which stamps are in seconds, in [s]."""
RATES = (20.0, 20e3)
"""Rates of logs, from which the unit of larger steps follows, in [Hz]."""
NEARLY = 4.0
"""Two units are ambiguous if a rate is within this factor of the ends of ``RATES``."""
EPOCH = (9e8, 5e9)
"""Time since 1970, from 1998 to 2128, by which absolute stamps tell their unit, in [s]."""
LATEST = 2**62
"""Stamps lie before, in [ns]; differences of later ones are no 64-bit integers."""

COMMON_RATES = (
    *(10, 15, 20, 24, 25, 30, 40, 50, 60, 80, 90, 100, 120, 125, 150, 200, 240, 250, 300, 333),
    *(400, 480, 500, 600, 800, 1000, 1200, 1500, 2000, 2400, 4000, 5000, 10_000),
)
NEAR_RATE = 0.02
"""A rate found from the values is one of these, in [Hz], if it differs by no more than that."""
LARGEST_STEP = 1.0
"""Larger steps of a position are a turn or a reset, in [rad] or [m]."""
FITS = 0.98
"""Least correlation of velocities with the steps of positions from which the rate is found."""
DISAGREE = 0.25
"""Relative difference from which a rate found from the values contradicts a stated one."""

MOST_UNORDERED = 0.1
"""Share of samples out of order above which a log is refused: it is several, or has no stamps."""
BLOCK = 500_000
"""Values that are interpolated at once, which takes about ten times their memory."""


def unit_of(
    path: Path, steps: NDArray[Any], rate: float | None, *, name: str = "", first: float = 0.0
) -> str:
    """Unit of stamps: by their column's name, the epoch, the log's rate, or their median step."""
    known = TIME_UNITS.get(without_unit(name)[1], "")
    start = {unit: first * float(UNITS[unit]) for unit in UNITS}
    absolute = any(EPOCH[0] < each < EPOCH[1] for each in start.values())
    if not known and not absolute and is_counter(steps, first):
        return SAMPLES
    rising = steps[steps > 0]
    step = float(np.median(rising)) if len(rising) else 0.0
    if rate is not None and step > 0:
        return min(UNITS, key=lambda unit: abs(log(step) + log(float(UNITS[unit])) + log(rate)))
    if known:
        return known
    if step <= SLOWEST_SECONDS and start["seconds"] < EPOCH[1]:
        return "seconds"
    rates = {unit: 1 / (step * float(UNITS[unit])) for unit in UNITS} if step else {}
    low, high = RATES[0] / NEARLY, RATES[1]
    possible = {
        unit: f"{each:g}"
        for unit, each in rates.items()
        if (low < each or unit == "nanoseconds") and each <= high and start[unit] < EPOCH[1]
    }
    found = [unit for unit in possible if start[unit] > EPOCH[0]] or list(possible)
    if len(found) == 1:
        return found[0]
    raise LogError(
        path,
        f"the stamps' median step is {step:g}; expected seconds or a unit that gives"
        f" {RATES[0]:g} Hz to {RATES[1]:g} Hz, but that is {' or '.join(found) or 'none'}; with"
        f" the log's rate it is recognised: --rate {next(iter(possible.values()), '100')}",
    )


def is_counter(steps: NDArray[Any], first: float) -> bool:
    """Whether stamps are whole numbers that grow by one, but for some holes."""
    return bool(
        len(steps)
        and float(first).is_integer()
        and (steps >= 1).all()
        and np.median(steps) == 1
        and (steps == np.rint(steps)).all()
    )


def counting(columns: Mapping[str, NDArray[Any]]) -> str:
    """Name of the first column that counts samples; empty if none does."""
    for name, values in columns.items():
        if values.dtype.kind in "iuf" and values.ndim == 1 and len(values) > 2:
            whole = values.astype(np.float64)
            if np.isfinite(whole).all() and is_counter(np.diff(whole), whole[0]):
                return name
    return ""


def stamps_of(path: Path, name: str, values: NDArray[Any], rate: float | None) -> Stamps:
    """Stamps from an array of numbers."""
    if values.dtype.kind == "M":
        values = values.astype("datetime64[ns]").astype(np.int64)
    if values.dtype.kind not in "iuf" or values.ndim != 1 or len(values) < 2:
        raise LogError(
            path,
            f"{name!r} holds {values.dtype} of shape {values.shape}; expected two stamps or more",
        )
    if not np.isfinite(values).all():
        sample = int(np.argmin(np.isfinite(values)))
        raise LogError(path, f"column {name!r} holds {values[sample]} (sample {sample + 1})")
    return stamps_since(
        path, name, Decimal(str(values[0])), (values - values[0]).astype(np.float64), rate
    )


def stamps_since(
    path: Path,
    name: str,
    first: Decimal,
    since: Array,
    rate: float | None,
    rows: Sequence[int] | None = None,
) -> Stamps:
    """Stamps from the first one, exact, and the differences to it, shape (samples,)."""
    unit = unit_of(path, np.diff(since), rate, name=name, first=float(first))
    if unit == SAMPLES:
        return Stamps(Decimal(0), since, rows, unit, name=name)
    size = UNITS[unit]
    return Stamps(
        start=first * Decimal(size),
        time=since if unit == "seconds" else since * float(size),
        rows=rows,
        unit=unit,
        name=name,
    )


def counted_stamps(
    path: Path,
    stamps: Stamps,
    options: ReadOptions,
    position: Real | None,
    velocity: Real | None,
    stated: tuple[str, float | None] = ("", None),
) -> Stamps:
    """Stamps in seconds of samples that are only counted: at a rate that is known or found."""
    found = None
    if position is not None and velocity is not None and position.shape == velocity.shape:
        holes = np.concatenate(([False], np.diff(stamps.time) != 1))
        found = rate_of(np.where(holes[:, None], np.nan, position), velocity)
    count = len(stamps.time)
    what = f"{stamps.name!r} counts samples" if stamps.name else "there are no stamps"
    name, number = stated
    if options.rate:
        rate = options.rate
        given = f"no stamps: {count} samples at" if not stamps.name else f"{what}:"
        remark = f"{given} {rate:g} Hz, as --rate says"
        if found and abs(found / rate - 1) > DISAGREE and not options.force:
            raise LogError(
                path,
                f"positions and velocities fit a rate of {found:g} Hz, not {rate:g} Hz: type"
                f" --rate {found:g}, or --force to take {rate:g} Hz all the same",
            )
    elif number and (found is None or abs(found / number - 1) <= DISAGREE):
        rate, remark = number, f"{what}: {number:g} Hz, by {name}"
    elif found:
        but = f" ({name} says {number:g} Hz)" if number else ""
        rate = found
        remark = (
            f"{what}: {found:g} Hz, at which positions and velocities fit{but}; --rate sets another"
        )
    else:
        how = "" if time_column([stamps.name]) else ", or name their column: --map time=COLUMN"
        raise LogError(path, f"{what}; give the log's rate, in samples per second: --rate HZ{how}")
    return replace(stamps, time=stamps.time / rate, unit="seconds", remark=remark)


def rate_of(position: Real, velocity: Real) -> float | None:
    """Sample rate at which velocities are the steps of positions, in [Hz].

    Returns:
        The common rate nearby, or else the rate to three digits; None if they do not fit.
    """
    position, velocity = position.astype(np.float64), velocity.astype(np.float64)
    if len(position) < 3:
        return None
    step = np.diff(position, axis=0)
    simpson = (velocity[2:] + 4 * velocity[1:-1] + velocity[:-2]) / 6
    correlation, rate = max(
        _slope((position[2:] - position[:-2]) / 2, simpson),
        _slope(step, velocity[1:]),  # of simulators, whose velocity comes first,
        _slope(step, velocity[:-1]),  # or whose position does
    )
    if correlation < FITS:
        return None
    for scale in (1.0, 180 / np.pi, np.pi / 180):  # one of them may be in degrees
        near = min(COMMON_RATES, key=lambda common: abs(common / (rate * scale) - 1))
        if abs(near / (rate * scale) - 1) <= NEAR_RATE:
            return float(near)
    return float(f"{rate:.3g}")


def _slope(steps: Real, speed: Real) -> tuple[float, float]:
    """Correlation of steps and velocities, and their ratio by least squares."""
    usable = np.isfinite(steps) & np.isfinite(speed) & (np.abs(steps) < LARGEST_STEP)
    steps, speed = steps[usable], speed[usable]
    both, own, other = (float(each) for each in (steps @ speed, steps @ steps, speed @ speed))
    return (both / np.sqrt(own * other), both / own) if own * other > 0 else (0.0, 0.0)


def ordered(path: Path, tracks: Sequence[Track]) -> tuple[tuple[Track, ...], dict[str, int], str]:
    """Tracks without the samples whose stamps are not later than all before.

    Tracks that share stamps still do afterwards.
    """
    kept: dict[int, tuple[Stamps, Mask]] = {}
    counts = {"duplicates": 0, "backward": 0}
    first = 0.0
    for track in {id(track.stamps): track for track in tracks}.values():
        stamps, time = track.stamps, track.stamps.time
        latest = np.maximum.accumulate(time)
        keep = np.concatenate(([True], time[1:] > latest[:-1]))
        wrong = np.flatnonzero(~keep)
        if len(wrong):
            if len(wrong) >= MOST_UNORDERED * len(time):
                after, before = (
                    stamps.start + Decimal(str(since))
                    for since in (time[wrong[0]], latest[wrong[0] - 1])
                )
                how = "stands still" if after == before else "runs backwards"
                raise track.fault(path, f"time {how}: {after} comes after {before}", int(wrong[0]))
            duplicates = int(np.sum(time[wrong] == latest[wrong - 1]))
            first = first if any(counts.values()) else float(latest[wrong[0] - 1])
            counts["duplicates"] += duplicates
            counts["backward"] += len(wrong) - duplicates
            rows = None if stamps.rows is None else np.asarray(stamps.rows)[keep].tolist()
            stamps = replace(stamps, time=time[keep], rows=rows)
        kept[id(track.stamps)] = stamps, keep
    if not any(counts.values()):
        return tuple(tracks), {}, ""
    found = []
    for track in tracks:
        stamps, keep = kept[id(track.stamps)]
        missing = None if track.missing is None else track.missing[keep]
        found.append(replace(track, stamps=stamps, values=track.values[keep], missing=missing))
    return (
        tuple(found),
        counts,
        (
            f"{counts['duplicates']} duplicate and {counts['backward']} backward stamps left out,"
            f" the first {first:.6g} s into the log"
        ),
    )


# Signals on one uniform time base


def common_time(tracks: Sequence[Track], main: Track) -> tuple[Array, Mask]:
    """Uniform time base of a run, over the time that all tracks cover.

    Returns:
        Time, shape (instants,), in [s], and whether each instant is outside of all gaps; no
        instants if the tracks do not overlap.
    """
    clock, known = main.stamps.clock, main.stamps.time
    slack = UNIFORM / clock.rate  # tolerance for rounding at the last sample
    time = known
    if not clock.uniform:
        time = np.arange(int(known[-1] * clock.rate + UNIFORM) + 1) / clock.rate
    starts = max(track.stamps.time[0] for track in tracks) - slack
    stops = min(track.stamps.time[-1] for track in tracks) + slack
    time = time[(time >= starts) & (time <= stops)]
    valid = np.ones(len(time), dtype=bool)
    for stamps in {id(track.stamps): track.stamps for track in tracks}.values():
        if _places(time, stamps, slack) is None:
            reached = np.zeros(len(time), dtype=bool)
            for stretch in stamps.clock.stretches:
                inside = stamps.time[stretch]
                if len(inside) > 1:
                    edges = np.searchsorted(time, [inside[0] - slack, inside[-1] + slack])
                    reached[edges[0] : edges[1]] = True
            valid &= reached
    for track in tracks:
        if track.missing is not None:
            valid &= ~_beside(time, track.stamps, track.missing, slack)
    return time, valid


def resampled(instants: Array, valid: Mask, track: Track, slack: float) -> Real:
    """Values of a track at the instants of a time base.

    Samples at an instant are taken as they are. Others, and all of a track whose samples are not
    uniform, are interpolated monotonically (PCHIP), without overshoot; quaternions take the shorter
    way and have norm 1.

    Returns:
        Values, 0 in gaps, shape (instants, columns).
    """
    places = _places(instants, track.stamps, slack)
    if places is not None:
        if valid.all() and places[-1] - places[0] == len(places) - 1:
            return track.values[places[0] : places[-1] + 1]  # no copy of a long log
        return np.where(valid[:, None], track.values[places], 0.0)
    if track.signal == "base_pose":
        pose = np.asarray(track.values, dtype=np.float64)
        pose = np.hstack((pose[:, :3], continuous_quaternions(pose[:, 3:])))
        found = _pchip(instants, track.stamps, pose, slack)
        length = np.linalg.norm(found[:, 3:], axis=1, keepdims=True)
        found[:, 3:] /= np.where(length > 0, length, 1.0)
    else:
        found = np.empty((len(instants), track.values.shape[1]))
        block = max(1, BLOCK // len(track.stamps.time))
        for first in range(0, found.shape[1], block):
            part = slice(first, first + block)
            values = np.asarray(track.values[:, part], dtype=np.float64)
            angles = track.angles[part]
            if any(angles):
                values = np.where(angles, np.unwrap(values, axis=0), values)
            found[:, part] = _pchip(instants, track.stamps, values, slack)
    found[~valid] = 0.0
    return found


def _places(instants: Array, stamps: Stamps, slack: float) -> Indices | None:
    """Index of the sample at each instant; None if an instant has none."""
    if not stamps.clock.uniform:
        return None
    places = np.searchsorted(stamps.time, instants - slack).clip(max=len(stamps.time) - 1)
    return places if (np.abs(stamps.time[places] - instants) <= slack).all() else None


def _beside(instants: Array, stamps: Stamps, missing: Mask, slack: float) -> Mask:
    """Whether a missing sample is at an instant, or next to one between samples."""
    after = np.searchsorted(stamps.time, instants - slack).clip(max=len(stamps.time) - 1)
    between = np.abs(stamps.time[after] - instants) > slack
    return np.asarray(missing[after] | (between & missing[np.maximum(after - 1, 0)]))


def _pchip(instants: Array, stamps: Stamps, values: Real, slack: float) -> Array:
    between = stamps.clock.stretches
    return resample(stamps.time, values, instants, between=between, slack=slack)[0]


# Two clocks

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

CONFIDENCE = f"{CORRELATION:g} or more, the next best at most {NEXT_BEST:.0%} of it"
"""Condition on the correlation for an estimated offset to be used."""
HOW = "specify --offset SECONDS, which is added to the desired stamps"


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
    drift: float = 0.0
    correlation: float = 1.0
    next_best: float = 0.0
    span: float = 0.0

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


def synchronise(
    path: Path,
    tracks: Sequence[Track],
    main: Track,
    *,
    rate: float | None = None,
    offset: float | None = None,
) -> tuple[tuple[Track, ...], str, Offset | None]:
    """Tracks on the clock of the measured motion, whose time starts at 0."""
    measured = {id(track.stamps) for track in tracks if not track.is_desired}
    start = main.stamps.start
    clocks = {
        id(track.stamps): replace(
            track.stamps,
            start=start,
            time=track.stamps.time + float(track.stamps.start - start),
            rate=rate if track.stamps is main.stamps else None,
        )
        for track in tracks
    }
    others = [track for track in tracks if id(track.stamps) not in measured]
    main_time = clocks[id(main.stamps)].time
    clocked = tuple(replace(track, stamps=clocks[id(track.stamps)]) for track in tracks)
    own = [clocks[key] for key in dict.fromkeys(id(track.stamps) for track in others)]
    if all(np.array_equal(stamps.time, main_time) for stamps in own):
        return clocked, "", None
    if offset is not None:
        given = Offset(offset)
        return _shifted(clocked, own, given), f"offset {offset:+g} s, as given", given
    desired = {each.quantity: each for each in reversed(clocked) if each.stamps in own}
    found = estimate({t.signal: t for t in reversed(clocked) if not t.is_desired}, desired)
    overlap = own[0].time[0] <= main_time[-1] and main_time[0] <= own[0].time[-1]
    if found is None or not found.is_unambiguous:
        if not overlap:
            why = "no joint moves in both"
            if found is not None:
                why = f"the offset cannot be estimated ({found}; expected {CONFIDENCE})"
            problem = no_overlap(others[0].stamps, main.stamps)
            raise LogError(path, f"{problem}, and {why}; {HOW}")
        if found is None:
            return clocked, "", None
        remark = (
            f"its clock is assumed to be the measured one's, since the offset cannot be estimated"
            f" ({found}; expected {CONFIDENCE}); {HOW}"
        )
        return clocked, remark, None
    if not found.exceeds_lag:
        return clocked, f"{found}: a controller's lag, the stamps are not changed", None
    return _shifted(clocked, own, found), f"{found}: its stamps are shifted by that", found


def no_overlap(desired: Stamps, measured: Stamps) -> str:
    """Message that the stamps of two logs do not overlap."""

    def span(stamps: Stamps) -> str:
        first, last = (stamps.start + Decimal(str(stamps.time[at])) for at in (0, -1))
        return f"the stamps from {first:f} s to {last:f} s"

    return f"{span(desired)} do not overlap with {span(measured)}"


def _shifted(
    tracks: Sequence[Track], clocks: Sequence[Stamps], offset: Offset
) -> tuple[Track, ...]:
    first = min(float(stamps.time[0]) for stamps in clocks)
    moved = {
        id(each): replace(
            each, time=each.time + offset.seconds + offset.drift * (each.time - first)
        )
        for each in clocks
    }
    return tuple(replace(t, stamps=moved.get(id(t.stamps), t.stamps)) for t in tracks)


def estimate(measured: Mapping[str, Track], desired: Mapping[str, Track]) -> Offset | None:
    """Offset of the desired clock to the measured one; None if no joint moves in both."""
    pair = _common_tracks(measured, desired)
    if pair is None:
        return None
    rate = min(HIGHEST_RATE, *(track.stamps.clock.nominal for track in pair))
    joints = [joint for joint in pair[0].joints if joint in pair[1].joints]
    one, other = (_velocities(track, joints) for track in pair)
    seconds, correlation, next_best = _search(one, other, min(rate, COARSE_RATE))
    drift, times = 0.0, pair[1].stamps.time
    for _ in range(3):
        residuals = _residuals(one, other, seconds, drift, rate)
        if not len(residuals):
            break
        seconds, drift = _fitted(residuals, seconds, drift)
    return Offset(seconds, drift, correlation, next_best, span=float(times[-1] - times[0]))


def _velocities(track: Track, joints: Sequence[str]) -> Track:
    """Velocities of some joints, differentiated if the track holds positions."""
    values = np.asarray(track.of(joints), dtype=np.float64)
    if track.signal.startswith("position"):
        values = np.gradient(np.unwrap(values, axis=0), track.stamps.time, axis=0)
    return replace(track, values=values)


def _at(motion: Track, instants: Array) -> Array:
    """Linearly interpolated velocities, 0 in gaps and outside, shape (instants, joints)."""
    found = np.zeros((len(instants), motion.values.shape[1]))
    for stretch in motion.stamps.clock.stretches:
        known = motion.stamps.time[stretch]
        part = slice(*np.searchsorted(instants, [known[0], known[-1]]))
        for joint, values in enumerate(motion.values[stretch].T):
            found[part, joint] = np.interp(instants[part], known, values)
    return found


def _common_tracks(
    measured: Mapping[str, Track], desired: Mapping[str, Track]
) -> tuple[Track, Track] | None:
    """A measured and a desired track with a joint that moves in both, preferably velocities."""
    for one in ("velocity", "position"):
        for other in (one, "velocity", "position"):
            first, second = measured.get(one), desired.get(other)
            if first is None or second is None:
                continue
            for joint in set(first.joints) & set(second.joints):
                if all(np.ptp(track.of([joint])) > 0 for track in (first, second)):
                    return first, second
    return None


def _search(measured: Track, desired: Track, rate: float) -> tuple[float, float, float]:
    """Best offset in [s], its correlation, and the next best's correlation."""
    from scipy import fft

    times = measured.stamps.time, desired.stamps.time
    one, other = (
        _at(motion, np.arange(time[0], time[-1], 1 / rate))
        for motion, time in zip((measured, desired), times, strict=True)
    )
    scale = np.sqrt((one**2).mean(axis=0) * (other**2).mean(axis=0))
    moving = scale > 0
    one, other = one[:, moving], other[:, moving] / scale[moving]
    length = fft.next_fast_len(len(one) + len(other), real=True)
    weight = 1 / scale[moving]
    ones = np.ones((len(one), 1)), np.ones((len(other), 1))
    energy = _crossed((one**2 * weight).sum(axis=1, keepdims=True), ones[1], length)
    energy = energy * _crossed(ones[0], (other**2 / weight).sum(axis=1, keepdims=True), length)
    overlap = _crossed(*ones, length)
    least = SHARE * min(len(one), len(other))
    correlation = _crossed(one, other, length) / np.sqrt(np.maximum(energy, 1e-9 * energy.max()))
    correlation = np.where(overlap >= least - 0.5, correlation, -1.0)
    best = int(np.argmax(correlation))
    # The peak reaches to where the correlation falls below half of it.
    around = np.roll(correlation, length // 2 - best)
    below = np.abs(np.flatnonzero(around < 0.5 * around[length // 2]) - length // 2)
    edge = int(below.min(initial=length))
    lags = np.arange(length)
    distance = np.minimum((lags - best) % length, (best - lags) % length)
    next_best = float(correlation[distance > edge].max(initial=-1.0))
    lag = best if best < len(one) else best - length
    seconds = lag / rate + float(times[0][0] - times[1][0])
    return seconds, float(correlation[best]), next_best


def _crossed(one: Array, other: Array, length: int) -> Array:
    """Sum of the products of all columns at each lag, of one behind the other first."""
    from scipy import fft

    product = fft.rfft(one, length, axis=0) * np.conj(fft.rfft(other, length, axis=0))
    return np.asarray(fft.irfft(product.sum(axis=1), length))


def _residuals(measured: Track, desired: Track, seconds: float, drift: float, rate: float) -> Array:
    """Residual offset of each segment: time, offset and weight, shape (segments, 3)."""
    known, time = measured.stamps.time, desired.stamps.time
    shifted = time + seconds + drift * (time - time[0])
    start = max(known[0], shifted[0]) + 2 * LAG
    stop = min(known[-1], shifted[-1]) - 2 * LAG
    count = min(SEGMENTS, int((stop - start) / SHORTEST))
    if count < 1:
        return np.empty((0, 3))
    moved = replace(desired, stamps=replace(desired.stamps, time=shifted))
    reach = int(np.ceil(2 * LAG * rate))
    found = []
    for first, last in pairwise(np.linspace(start, stop, count + 1)):
        instants = np.arange(first, last, 1 / rate)
        longer = first + np.arange(-reach, len(instants) + reach) / rate
        residual, correlation = _match(_at(measured, instants), _at(moved, longer), rate)
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
    crossed = _crossed(longer, segment, length)[: 2 * reach + 1]
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
