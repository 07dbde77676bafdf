"""Clocks of logs: units and order of stamps, rates of logs without, and signals on one time base.

Stamps of separate clocks are aligned by cross-correlation of the desired and the measured
velocities of the same joints, which gives the offset.
An offset below ``LAG`` is attributed to the controller, not to the clocks.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from math import log, log10
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inspector.errors import LogError
from inspector.logs.mapping import GAP, SAMPLES, UNIFORM, ReadOptions, Stamps, Track
from inspector.logs.names import TIME_UNITS, time_column, without_unit
from inspector.text import counted
from noisemodel import Run
from noisemodel.hold import jumps
from noisemodel.run import (
    METHOD,
    SAMPLED,
    SOURCES,
    continuous_quaternions,
    derived,
    resample,
    with_velocities,
)
from noisemodel.runfile import either_way
from noisemodel.types import Array, Indices, Mask, Real

# The units that stamps may have, in [s].
UNITS = {"seconds": "1", "milliseconds": "1e-3", "microseconds": "1e-6", "nanoseconds": "1e-9"}
SLOWEST_SECONDS = 0.5  # median step up to which stamps are in seconds, in [s]
RATES = (20.0, 20e3)  # rates of logs, from which the unit of larger steps follows, in [Hz]
NEARLY = 4.0  # two units are ambiguous if a rate is within this factor of the ends of ``RATES``
EPOCH = (9e8, 5e9)  # since 1970, of 1998 to 2128: absolute stamps tell their unit by it, in [s]
COMMON_RATES = (
    *(10, 15, 20, 24, 25, 30, 40, 50, 60, 80, 90, 100, 120, 125, 150, 200, 240, 250, 300, 333),
    *(400, 480, 500, 600, 800, 1000, 1200, 1500, 2000, 2400, 4000, 5000, 10_000),
)
NEAR_RATE = 0.02  # relative difference up to which a rate found from the values is one of these
LARGEST_STEP = 1.0  # larger steps of a position are a turn or a reset, in [rad] or [m]
FITS = 0.98  # least correlation of velocities with the steps of positions that tell the rate
DISAGREE = 0.1  # relative difference from which a rate of the values contradicts a stated one
LONGEST_DATES = 60.0  # longest step of stamps that are dates, in [s]
SLOW = 0.02  # median step from which stamps in seconds may be in milliseconds, in [s]
MOST_UNORDERED = 0.1  # share of samples out of order from which a log is several, or has no stamps
SHORTER = 10  # fewest steps' worth of rounding that tells rounded stamps from a lost sample
BLOCK = 500_000  # values that are interpolated at once, which takes about ten times their memory


def _unit_of(path: Path, name: str, first: float, steps: Array, rate: float | None) -> str:
    """Unit of stamps: by their column's name, the epoch, the log's rate, or their median step."""
    known = TIME_UNITS.get(without_unit(name)[1], "")
    start = {unit: first * float(UNITS[unit]) for unit in UNITS}
    absolute = any(EPOCH[0] < each < EPOCH[1] for each in start.values())
    by_one = len(steps) and float(first).is_integer() and np.median(steps) == 1
    counts = by_one and (steps >= 1).all() and (steps == np.rint(steps)).all()  # but for holes
    if not known and not absolute and counts:
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
    dates = start["seconds"] > EPOCH[0] and step < LONGEST_DATES
    possible = {
        unit: f"{each:g}"
        for unit, each in rates.items()
        if (low < each or unit == "nanoseconds" or (unit == "seconds" and dates))
        and each <= high
        and start[unit] < EPOCH[1]
    }
    absolutely = [unit for unit in possible if start[unit] > EPOCH[0]]
    # Stamps of a robot that has been on for weeks, in ms, are like dates a second apart.
    found = list(possible) if absolutely in ([], ["seconds"]) else absolutely
    if len(found) == 1:
        return found[0]
    unit = " or ".join(found) or "none that is known"
    rates_known = " or ".join(f"--rate {possible[each]}" for each in found) or "--rate 100"
    how = f"with the log's rate it is recognised: {rates_known}"
    raise LogError(path, f"the unit of stamps with a median step of {step:g} is {unit}; {how}")


def stamps_of(path: Path, name: str, values: NDArray[Any], rate: float | None) -> Stamps:
    """Stamps from an array of numbers."""
    dated = values.dtype.kind == "M"
    if dated:
        values = values.astype("datetime64[ns]").astype(np.int64)
    if values.dtype.kind not in "iuf" or values.ndim != 1 or len(values) < 2:
        held = f"{values.dtype} of shape {values.shape}"
        raise LogError(path, f"{name!r} holds {held}; expected two stamps or more")
    if not np.isfinite(values).all():
        sample = int(np.argmin(np.isfinite(values)))
        raise LogError(path, f"column {name!r} holds {values[sample]} (sample {sample + 1})")
    since = (values - values[0]).astype(np.float64)
    first = Decimal(str(values[0]))
    return stamps_since(path, name, first, since, rate, "nanoseconds" if dated else "")


def stamps_since(
    path: Path, name: str, first: Decimal, since: Array, rate: float | None, unit: str
) -> Stamps:
    """Stamps from the first one, exact, and the differences to it, shape (samples,)."""
    unit = unit or _unit_of(path, name, float(first), np.diff(since), rate)
    if unit == SAMPLES:
        return Stamps(Decimal(0), since, unit=unit, name=name)
    time = since if unit == "seconds" else since * float(UNITS[unit])
    return Stamps(first * Decimal(UNITS[unit]), time, unit=unit, name=name)


def in_seconds(path: Path, tracks: Sequence[Track], options: ReadOptions) -> list[Track]:
    """Tracks whose stamps are in seconds, where they counted samples."""
    by_signal = {track.signal: track for track in reversed(tracks)}
    position, velocity = by_signal.get("position"), by_signal.get("velocity")
    found = None
    if position and velocity and position.stamps is velocity.stamps:
        shared = [joint for joint in position.joints if joint in velocity.joints]
        stamps = position.stamps
        if shared and stamps.unit == SAMPLES:
            holes = np.concatenate(([False], np.diff(stamps.time) != 1))
            known = np.where(holes[:, None], np.nan, position.of(shared))
            found = rate_of(known, velocity.of(shared))
        elif shared and _may_be_milliseconds(stamps, options):
            found = rate_of(position.of(shared), velocity.of(shared))
    clocks = clocks_of(tracks)
    timed = {each: _timed(path, each, options, found) for each in clocks if each.unit == SAMPLES}
    if found is not None and not timed:
        why = f"at {found:g} Hz positions and velocities fit, if stamps are in milliseconds"
        for each in clocks:
            if abs(found * float(np.median(np.diff(each.time))) / 1000 - 1) <= DISAGREE:
                own = replace(each, start=each.start / 1000, time=each.time / 1000)
                timed[each] = replace(own, unit="milliseconds", remark=why)
    return on_clocks(tracks, timed)


def _may_be_milliseconds(stamps: Stamps, options: ReadOptions) -> bool:
    """Whether stamps were taken for seconds by their steps alone, which are long for these."""
    told = options.rate or TIME_UNITS.get(without_unit(stamps.name)[1])
    slow = len(stamps.time) > 1 and float(np.median(np.diff(stamps.time))) > SLOW
    return slow and not told and stamps.unit == "seconds" and stamps.start < Decimal(EPOCH[0])


def _timed(path: Path, stamps: Stamps, options: ReadOptions, found: float | None) -> Stamps:
    """Stamps in seconds of samples that are only counted: at a rate that is known or found."""
    what = f"{stamps.name!r} counts samples" if stamps.name else "there are no stamps"
    name, number = stamps.stated
    if options.rate:
        rate, by = options.rate, "as --rate says"
        if found and abs(found / rate - 1) > DISAGREE and not options.force:
            problem = f"positions and velocities fit a rate of {found:g} Hz, not {rate:g} Hz"
            how = f"type --rate {found:g}, or --force to take {rate:g} Hz all the same"
            raise LogError(path, f"{problem}: {how}")
    elif number and (found is None or abs(found / number - 1) <= DISAGREE):
        rate, by = number, f"by {name}"
    elif found:
        but = f" ({name} says {number:g} Hz)" if number else ""
        rate, by = found, f"at which positions and velocities fit{but}; --rate sets another"
    else:
        how = "" if time_column([stamps.name]) else ", or name their column: --map time=COLUMN"
        raise LogError(path, f"{what}; give the log's rate, in samples per second: --rate HZ{how}")
    remark = f"{what}: {rate:g} Hz, {by}"
    return replace(stamps, time=stamps.time / rate, unit="seconds", remark=remark)


def rate_of(position: Real, velocity: Real) -> float | None:
    """Sample rate at which velocities are the steps of positions, in [Hz]; None if none fits."""
    position, velocity = position.astype(np.float64), velocity.astype(np.float64)
    if len(position) < 3:
        return None
    step = np.diff(position, axis=0)
    simpson = (velocity[2:] + 4 * velocity[1:-1] + velocity[:-2]) / 6
    correlation, rate = max(
        slope((position[2:] - position[:-2]) / 2, simpson),
        slope(step, velocity[1:]),  # of simulators, whose velocity comes first,
        slope(step, velocity[:-1]),  # or whose position does
    )
    if correlation < FITS:
        return None
    for scale in (1.0, 180 / np.pi, np.pi / 180):  # one of them may be in degrees
        near = min(COMMON_RATES, key=lambda common: abs(common / (rate * scale) - 1))
        if abs(near / (rate * scale) - 1) <= NEAR_RATE:
            return float(near)
    return float(f"{rate:.3g}")


def slope(steps: Real, speed: Real) -> tuple[float, float]:
    """Correlation of steps and velocities, and their ratio by least squares."""
    usable = np.isfinite(steps) & np.isfinite(speed) & (np.abs(steps) < LARGEST_STEP)
    steps, speed = steps[usable], speed[usable]
    both, own, other = (float(each) for each in (steps @ speed, steps @ steps, speed @ speed))
    return (both / np.sqrt(own * other), both / own) if own * other > 0 else (0.0, 0.0)


def clocks_of(tracks: Sequence[Track]) -> list[Stamps]:
    """The stamps of tracks, each once: some share them."""
    return [*dict.fromkeys(track.stamps for track in tracks)]


def on_clocks(tracks: Sequence[Track], changed: Mapping[Stamps, Stamps]) -> list[Track]:
    """Tracks with other stamps in place of some."""
    return [replace(track, stamps=changed.get(track.stamps, track.stamps)) for track in tracks]


def even(stamps: Stamps) -> Stamps:
    """Stamps of a uniform clock that were rounded to a decimal, without the rounding.

    Their steps are of two lengths, a unit of the decimal apart, and they stay within that unit of
    a uniform clock's: a lost sample puts all that follow a step off.
    """
    steps = np.diff(stamps.time)
    usual = steps[steps <= GAP * np.median(steps)]
    mean, apart = (float(usual.mean()), float(np.ptp(usual))) if len(usual) else (0.0, 0.0)
    unit = 10.0 ** round(log10(apart)) if apart > UNIFORM * mean else 0.0
    # A shorter step would not be; one that is seldom longer may be a lost sample.
    if not unit or abs(apart / unit - 1) > 0.01 or len(usual) * (mean - unit) < SHORTER * unit:
        return stamps
    for digits in range(2, 10):
        rate = float(f"{1 / mean:.{digits}g}")
        count = np.where(steps <= GAP * mean, 1.0, np.rint(steps * rate))
        time = np.append(0.0, np.cumsum(count)) / rate
        if np.ptp(stamps.time - time) <= unit * (1 + UNIFORM):
            told = f"stamps rounded to {unit:g} s, taken for even ones of {rate:g} Hz"
            return replace(stamps, time=time, remark=stamps.remark or told)
    return stamps


def ordered(path: Path, tracks: Sequence[Track]) -> tuple[list[Track], str]:
    """Tracks, which share stamps as before, without samples out of order, and a remark."""
    found, places = list(tracks), list[float]()
    for stamps in clocks_of(tracks):
        time = stamps.time
        latest = np.maximum.accumulate(time)
        keep = np.concatenate(([True], time[1:] > latest[:-1]))
        wrong = np.flatnonzero(~keep)
        if not len(wrong):
            continue
        if len(wrong) >= MOST_UNORDERED * len(time):
            at = int(wrong[0])
            after, before = (stamps.start + Decimal(str(t)) for t in (time[at], latest[at - 1]))
            how = "stands still" if after == before else "runs backwards"
            track = next(track for track in tracks if track.stamps is stamps)
            raise track.fault(path, f"time {how}: {after} comes after {before}", at)
        places += latest[wrong - 1].tolist()
        rows = None if stamps.rows is None else np.asarray(stamps.rows)[keep].tolist()
        own = replace(stamps, time=time[keep], rows=rows)
        for place, track in enumerate(found):
            if track.stamps is stamps:
                missing = None if track.missing is None else track.missing[keep]
                values = track.values[keep]
                found[place] = replace(track, stamps=own, values=values, missing=missing)
    if not places:
        return found, ""
    what = f"{counted(len(places), 'sample')} whose stamps are not later than all before left out"
    return found, f"{what}, the first {places[0]:.6g} s into the log"


# Signals on one uniform time base


def common_time(tracks: Sequence[Track], main: Stamps) -> tuple[Array, Mask]:
    """Uniform time that all tracks cover, in [s], and whether it is outside of all gaps."""
    clock, time = main.clock, main.time
    slack = UNIFORM / clock.rate  # tolerance for rounding at the last sample
    if not clock.uniform:
        time = np.arange(int(time[-1] * clock.rate + UNIFORM) + 1) / clock.rate
    starts = max(track.stamps.time[0] for track in tracks) - slack
    stops = min(track.stamps.time[-1] for track in tracks) + slack
    time = time[(time >= starts) & (time <= stops)]
    valid = np.ones(len(time), dtype=bool)
    for stamps in clocks_of(tracks):
        if _places(time, stamps, slack) is None:
            reached = np.zeros(len(time), dtype=bool)
            for stretch in stamps.clock.stretches:
                inside = stamps.time[stretch]
                if len(inside) > 1:
                    edges = np.searchsorted(time, (inside[0] - slack, inside[-1] + slack))
                    reached[slice(*edges)] = True
            valid &= reached
    for track in tracks:
        if (missing := track.missing) is not None:  # at an instant, or next to one between samples
            stamps = track.stamps
            after = np.searchsorted(stamps.time, time - slack).clip(max=len(stamps.time) - 1)
            between = np.abs(stamps.time[after] - time) > slack
            valid &= ~(missing[after] | (between & missing[np.maximum(after - 1, 0)]))
    return time, valid


def resampled(instants: Array, valid: Mask, track: Track, slack: float) -> Real:
    """Values of a track at the instants of a time base, 0 in gaps, shape (instants, columns).

    Samples at an instant are taken as they are. Others, and all of a track whose samples are not
    uniform, are interpolated monotonically (PCHIP), without overshoot; quaternions take the shorter
    way and have norm 1.
    """
    places = _places(instants, track.stamps, slack)
    if places is not None:
        if valid.all() and places[-1] - places[0] == len(places) - 1:
            return track.values[places[0] : places[-1] + 1]  # no copy of a long log
        return np.where(valid[:, None], track.values[places], 0.0)
    known, stretches = track.stamps.time, track.stamps.clock.stretches
    every, is_pose = track.values, track.signal == "base_pose"
    if is_pose:
        turns = np.asarray(every[:, 3:], dtype=np.float64)
        every = np.hstack((every[:, :3], continuous_quaternions(turns)))
    found = np.empty((len(instants), every.shape[1]))
    block = max(1, BLOCK // len(known))
    for first in range(0, found.shape[1], block):
        part = slice(first, first + block)
        values, angles = np.asarray(every[:, part], dtype=np.float64), track.angles[part]
        if any(angles):
            values = np.where(angles, np.unwrap(values, axis=0), values)
        found[:, part], _ = resample(known, values, instants, between=stretches, slack=slack)
    if is_pose:
        length = np.linalg.norm(found[:, 3:], axis=1, keepdims=True)
        found[:, 3:] /= np.where(length > 0, length, 1.0)
    found[~valid] = 0.0
    return found


def _places(instants: Array, stamps: Stamps, slack: float) -> Indices | None:
    """Index of the sample at each instant; None if an instant has none."""
    if not stamps.clock.uniform:
        return None
    places = np.searchsorted(stamps.time, instants - slack).clip(max=len(stamps.time) - 1)
    return places if (np.abs(stamps.time[places] - instants) <= slack).all() else None


# Two clocks

CORRELATION = 0.6  # least normalised correlation of an accepted offset
NEXT_BEST = 0.95  # largest correlation of the next best offset, as a share of the best
SHARE = 0.5  # least share of the shorter log that overlaps the longer one
LAG = 0.1  # largest delay of measured behind desired motion that is a controller's, in [s]
DRIFT = 1e-3  # least change of the offset between the halves of a log that is said, in [s]
HIGHEST_RATE = 250.0  # highest rate at which motions are compared, in [Hz]

HOW = "specify --offset SECONDS, which is added to the desired stamps"


def synchronise(
    path: Path, tracks: Sequence[Track], main: Track, options: ReadOptions
) -> tuple[list[Track], str, float | None]:
    """Tracks on the measured motion's clock, which starts at 0; a remark; the offset, if any."""
    start = main.stamps.start
    times = {each: each.time + float(each.start - start) for each in clocks_of(tracks)}
    clocks = {each: replace(each, start=start, time=time) for each, time in times.items()}
    clocks[main.stamps] = replace(clocks[main.stamps], rate=options.rate)
    measured = {track.stamps for track in tracks if not track.is_desired}
    own = {stamps: each for stamps, each in clocks.items() if stamps not in measured}
    time = clocks[main.stamps].time
    if all(np.array_equal(each.time, time) for each in own.values()):
        return on_clocks(tracks, clocks), "", None
    if (offset := options.offset) is not None:
        said = f"offset {offset:+g} s, as given"
    else:
        logged, first = next(iter(own.items()))
        overlap = first.time[0] <= time[-1] and time[0] <= first.time[-1]
        apart = "" if overlap else f"{no_overlap(logged, main.stamps)}, and "
        offset, said = _estimated(path, on_clocks(tracks, clocks), [*own.values()], apart)
    if offset is not None:
        clocks |= {stamps: replace(each, time=each.time + offset) for stamps, each in own.items()}
    return on_clocks(tracks, clocks), said, offset


def _estimated(
    path: Path, tracks: Sequence[Track], own: Sequence[Stamps], apart: str
) -> tuple[float | None, str]:
    """Offset of the desired clock, None if it stays, and a remark; clocks ``apart`` need one."""
    measured = {track.signal: track for track in reversed(tracks) if not track.is_desired}
    desired = {track.quantity: track for track in reversed(tracks) if track.stamps in own}
    pairs = (
        (measured[one], desired[other])
        for one in ("velocity", "position")
        for other in (one, "velocity", "position")
        if one in measured and other in desired
    )
    found = next(filter(None, (_estimate(*pair) for pair in pairs)), None)
    unknown = "no joint moves in both"
    if not found and not apart:
        return None, ""
    if found:
        seconds, correlation, next_best, change = found
        said = f"offset {seconds:+.4f} s (correlation {correlation:.2f}, next best {next_best:.2f})"
        if correlation >= CORRELATION and next_best <= NEXT_BEST * correlation:
            if abs(seconds) <= LAG:
                return None, f"{said}: a controller's lag, the stamps are not changed"
            drifts = f"; the clocks drift: it is {change:+.4f} s larger in the second half"
            shown = drifts if abs(change) >= DRIFT else ""
            return seconds, f"{said}: its stamps are shifted by that{shown}"
        unknown = f"the offset cannot be estimated ({said})"
    if apart:
        raise LogError(path, f"{apart}{unknown}; {HOW}")
    assumed = "its clock is assumed to be the measured one's, since"
    return None, f"{assumed} {unknown}; {HOW}"


def no_overlap(desired: Stamps, measured: Stamps) -> str:
    """Message that the stamps of two logs do not overlap."""

    def span(stamps: Stamps) -> str:
        first, last = (stamps.start + Decimal(str(stamps.time[at])) for at in (0, -1))
        return f"the stamps from {first:f} s to {last:f} s"

    return f"{span(desired)} do not overlap with {span(measured)}"


def _estimate(measured: Track, desired: Track) -> tuple[float, float, float, float] | None:
    """Offset of the desired clock, its correlation, the next best, and its change; None at rest.

    The change is from half to half; offset and change in [s].
    """
    rate = min(HIGHEST_RATE, *(track.stamps.clock.nominal for track in (measured, desired)))
    joints = [joint for joint in measured.joints if joint in desired.joints]
    speeds = []
    for track in (measured, desired):
        values, time = np.asarray(track.of(joints), dtype=np.float64), track.stamps.time
        if track.signal.startswith("position"):
            values = np.gradient(np.unwrap(values, axis=0), time, axis=0)
        instants = np.arange(time[0], time[-1], 1 / rate)
        columns = [np.interp(instants, time, column) for column in values.T]
        speed = np.reshape(columns, (len(joints), len(instants)))
        for gap in track.stamps.clock.gaps:
            speed[:, slice(*np.searchsorted(instants, gap))] = 0.0
        speeds.append(speed)
    one, other = speeds
    scale = np.sqrt((one**2).sum(axis=1) * (other**2).sum(axis=1))[:, None]
    if not scale.any():
        return None
    weight = np.sqrt(1 / np.where(scale > 0, scale, np.inf))  # of joints, fast or slow
    one, other = one * weight, other * weight
    correlations = _correlation(one, other)
    best, top = _peak(correlations)
    distance, correlation = np.abs(np.arange(len(correlations)) - best), correlations[best]
    # The peak reaches to where the correlation falls below half of it.
    edge = distance[correlations < 0.5 * correlation].min(initial=len(correlations))
    next_best = float(correlations[distance > edge].max(initial=-1.0))
    half = one.shape[1] // 2
    halves = [_correlation(part, other) for part in (one[:, :half], one[:, half:])]
    (_, early), (_, late) = map(_peak, halves)
    sure = min(each.max(initial=-1.0) for each in halves) >= CORRELATION
    change = (late + half - early) / rate if sure else 0.0
    start = float(measured.stamps.time[0] - desired.stamps.time[0])
    return start + (top - other.shape[1] + 1) / rate, float(correlation), next_best, change


def _peak(correlations: Array) -> tuple[int, float]:
    """Lag of the largest correlation, and that of the top of a parabola through its neighbours."""
    best = int(np.argmax(correlations))
    before, after = correlations[[max(best - 1, 0), min(best + 1, len(correlations) - 1)]]
    bend = 2 * correlations[best] - before - after
    return best, float(best + (after - before) / (2 * bend)) if bend > 0 else float(best)


def _correlation(one: Array, other: Array) -> Array:
    """Normalised correlation at each lag of one behind the other, -1 where too little overlaps."""
    from scipy import fft

    count, width = one.shape[1], other.shape[1]
    length = fft.next_fast_len(count + width, real=True)
    product = fft.rfft(one, length) * np.conj(fft.rfft(other, length))
    lags = np.arange(1 - width, count)
    crossed = fft.irfft(product.sum(axis=0), length)[lags]
    start, stop = np.maximum(lags, 0), np.minimum(lags + width, count)
    of_one, of_other = (np.append(0.0, np.cumsum((each**2).sum(axis=0))) for each in (one, other))
    energy = (of_one[stop] - of_one[start]) * (of_other[stop - lags] - of_other[start - lags])
    tiny = np.finfo(np.float64).tiny
    found = crossed / np.sqrt(np.maximum(energy, max(1e-9 * energy.max(), tiny)))
    return np.where(stop - start >= int(SHARE * min(count, width)), found, -1.0)


# A hold: slow signals that were sampled faster

ALIGNED = 0.99  # least share of the jumps that come a multiple of the hold after each other


def without_hold(run: Run) -> Run:
    """The run at the rate of its values: one of each n samples, if each value is there n times.

    Velocities that were differentiated are so again, at that rate.
    """
    again = [name for name in (*SOURCES, "base_velocity") if derived(run, name) == METHOD]
    position = run.position if "velocity" in again else None
    hold, changed = jumps(run.velocity if position is None else position, run.mask)
    count = round(hold)
    if count < 2 or abs(hold - count) > 1e-3:
        return run
    places = np.flatnonzero(changed)
    phases = np.bincount((places + 1) % count, minlength=count)
    first = int(phases.argmax())
    if phases[first] < ALIGNED * len(places) or len(run.time) <= first + count:
        return run

    def every(signal: Any) -> Any:
        if signal is None:
            return None
        shape = (len(range(first, len(signal), count)), *signal.shape[1:])

        def read(start: int, stop: int) -> Any:
            rows = signal[first + count * start : first + count * stop : count]
            return np.ascontiguousarray(rows)

        return either_way([signal], shape, read, signal.dtype)

    fields: dict[str, Any] = {name: every(getattr(run, name)) for name in SAMPLED}
    kept = {name: each for name, each in fields.items() if each is not None and name not in again}
    fields |= {name: each for name, each in with_velocities(kept)[0].items() if name in again}
    return replace(run, **fields, stages={name: every(each) for name, each in run.stages.items()})
