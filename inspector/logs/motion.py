"""A run made of logs: signals in SI units, finite and in order, on one time base.

Degrees are converted, samples without a value and stretches in which a log froze become gaps,
clocks are synchronised, and missing velocities are differentiated. `limit_warnings` and
`contradictions` tell of a run that it is of another robot, in another unit, or at another rate.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from itertools import compress
from pathlib import Path
from typing import Any

import numpy as np

from inspector.errors import LogError
from inspector.logs import clocks, mapping
from inspector.logs.mapping import SAME_RATE, Log, ReadOptions, Stamps, Track, known_limits
from inspector.logs.names import BASE_SIGNALS, first_to_last, listed, tells_unit
from inspector.text import counted, plain
from noisemodel import Robot, Run
from noisemodel.hold import hold_length
from noisemodel.noise import in_both
from noisemodel.robot import Limits
from noisemodel.run import METHOD, base_velocity, derived, joint_velocity
from noisemodel.runfile import pieces
from noisemodel.types import Array, Mask, Real

LARGEST_RATE_RATIO = 1.5  # of the specified rate to the stamps' rate, or the inverse
CUT = 0.5  # time that is cut from a log without a note in its verdict, in [s]
MOST_SAMPLES_PER_STAMP = 20  # of the run, above which most of it is gaps


@dataclass(frozen=True, eq=False)
class Imported:
    """A run that was read from a log."""

    run: Run
    remarks: tuple[str, ...]  #: what was decided during the import, a sentence each
    name: str = ""  #: of the log and of the episode


def prepared(log: Log, options: ReadOptions, robot: Robot | None, beside: Log | None = None) -> Log:
    """A log's signals in SI units, finite, with increasing stamps, in place of its fields.

    The measured log ``beside`` one of desired motion tells its unit, where its columns do not.
    """
    path = log.path
    if log.units and not options.units:
        raise LogError(path, log.units)
    found, not_read, told = mapping.tracks_of(log, options, robot)
    remarks = [*log.remarks, *told]
    _refuse_quaternion(path, found, options)
    timed = clocks.in_seconds(path, found, options)
    tracks = [track for track in timed if len(track.values) > 1]
    if not any(track.joints for track in tracks):
        raise LogError(path, "1 sample; a run needs at least 2")
    if once := [label for track in timed if len(track.values) < 2 for label in track.labels]:
        remarks.append(f"logged once only, left out: {listed(once)}")
    tracks = [t for each in tracks if (t := _finite(path, each, remarks)) is not None]
    tracks, in_degrees, converted = _in_si(log, tracks, options.units, robot, beside)
    remarks += converted
    tracks, order = clocks.ordered(path, tracks)
    even = {stamps: clocks.even(stamps) for stamps in clocks.clocks_of(tracks)}
    tracks = _without_frozen(clocks.on_clocks(tracks, even), remarks)
    return replace(
        log,
        fields=(),
        tracks=tuple(tracks),
        names=(*(each.name for each in log.fields), *log.not_read),
        not_read=not_read,
        remarks=tuple(filter(None, (order, *remarks))),
        meta=dict(log.meta) | ({"units": options.units} if options.units else {}),
        in_degrees=in_degrees,
    )


def _refuse_quaternion(path: Path, tracks: Sequence[Track], options: ReadOptions) -> None:
    """Refuse four columns such as q0 to q3 that are one rotation, and no joints."""
    given = options.columns or any(each.signal == "position" for each in options.entries)
    for track in tracks:
        names = [re.fullmatch(r"q_?\[?[wxyz\d]\]?", label.lower()) for label in track.labels]
        if track.signal == "position" and len(names) == 4 and all(names) and not given:
            norm = np.linalg.norm(np.asarray(track.values, dtype=np.float64), axis=1)
            if (np.abs(norm - 1) < 1e-3).all():
                how = "if they are joints, name them: --map position.JOINT=COLUMN"
                problem = f"{listed(track.labels)} hold a quaternion (their norm is 1), not joints"
                raise LogError(path, f"{problem}; {how}")


# Values that are none

ABSURD = 1e6  # value of an angle or speed that no unit explains
FEW = 0.1  # share of samples that may hold such; a desired motion may run away to the end


def _finite(path: Path, track: Track, remarks: list[str]) -> Track | None:
    """Track with gaps where it holds no number, or one that no unit explains; None without any."""
    track = _believable(path, track, remarks)
    if np.isfinite(track.values).all():
        return track
    lacking = np.isnan(track.values)
    infinite = np.argwhere(np.isinf(track.values))
    if len(infinite):
        sample, column = map(int, infinite[0])
        held = f"column {track.labels[column]!r} holds {track.values[sample, column]}"
        raise track.fault(path, held, sample)
    empty = np.atleast_1d(lacking.all(axis=0))
    if empty.any():
        remarks.append(f"all nan, left out: {listed([*compress(track.labels, empty)])}")
        if empty.all() or not track.joints:
            return None
        track, lacking = _columns(track, ~empty), lacking[:, ~empty]
    missing = np.atleast_1d(lacking.any(axis=1))
    if not missing.any():
        return track
    labels = [*dict.fromkeys(compress(track.labels, np.atleast_1d(lacking.any(axis=0))))]
    first = track.stamps.time[np.argmax(missing)] - track.stamps.time[0]
    lost = f"{counted(int(missing.sum()), 'sample')} without a number"
    remarks.append(f"{lost}, marked as not valid: {listed(labels)}, the first at {first:.6g} s")
    places, values = np.arange(len(missing)), np.array(track.values)
    for column, nan in zip(values.T, lacking.T, strict=True):  # lest they spoil others
        column[nan] = np.interp(places[nan], places[~nan], column[~nan])
    return replace(track, values=values, missing=missing)


def _believable(path: Path, track: Track, remarks: list[str]) -> Track:
    """Track in which nan takes the place of values that no unit explains."""
    if track.quantity not in LARGEST:
        return track
    # Numbers of 16 bits cannot hold the limits that they are compared with.
    values = np.abs(track.values).astype(np.result_type(track.values, np.float32), copy=False)
    far = np.isfinite(values) & (values > ABSURD)
    if not far.any():
        return track
    sample, column = (int(each) for each in np.argwhere(far)[0])
    held = f"column {track.labels[column]!r} holds {track.values[sample, column]:.3g}"
    what = f"{held}, no {track.quantity} in any unit"
    if not track.is_desired and far.any(axis=1).mean() > FEW:
        raise track.fault(path, f"{what}; name the columns to read (--map)", sample)
    runaway = far.any(axis=0) & (values > LARGEST[track.quantity])
    samples = counted(int(runaway.any(axis=1).sum()), "sample")
    remarks.append(f"{what}: {samples} of {track.signal.replace('_', ' ')} left out")
    return replace(track, values=np.where(runaway, np.nan, track.values))


def _columns(track: Track, kept: Mask) -> Track:
    joints, labels = (tuple(compress(each, kept)) for each in (track.joints, track.labels))
    return replace(track, joints=joints, labels=labels, values=track.values[:, kept])


FROZEN = 0.2  # least time for which a frozen log repeats a row, in [s]
FROZEN_HOLDS = 5.0  # the same as a multiple of the time for which it holds values anyway
FROZEN_WAY = 0.05  # least way that joints should have gone in that time, in [rad] or [m]


def _without_frozen(tracks: list[Track], remarks: list[str]) -> list[Track]:
    """Tracks whose samples are missing where all rows are one, and joints should move."""
    for stamps in clocks.clocks_of(tracks):
        ours = [track for track in tracks if track.stamps is stamps and track.joints]
        measured = [track for track in ours if not track.is_desired]
        if not any(track.signal == "position" for track in measured):
            continue
        rows = [(track.values[1:] == track.values[:-1]).all(axis=1) for track in measured]
        rows += [~t.missing[1:] for t in measured if t.missing is not None]  # filled, not logged
        same, time = np.logical_and.reduce(rows), stamps.time
        edges = np.flatnonzero(np.diff(same, prepend=False, append=False)).reshape(-1, 2)
        usual = np.diff(time[np.append(True, ~same)]) if len(edges) else ()
        shortest = max(FROZEN, FROZEN_HOLDS * float(np.median(usual)) if len(usual) else 0.0)
        frozen = np.zeros(len(time), dtype=bool)
        for first, last in edges[time[edges[:, 1]] - time[edges[:, 0]] >= shortest].tolist():
            length, speed = float(time[last] - time[first]), 0.0
            for track in ours:
                if track.signal == "velocity":
                    speed = max(speed, float(np.abs(track.values[first]).max()))
                elif track.signal == "position_desired":
                    way = np.ptp(track.values[first : last + 1], axis=0).max()
                    speed = max(speed, float(way) / length)
            if speed * length > FROZEN_WAY:
                frozen[first + 1 : last + 1] = True
                where = f"{last - first} samples from {time[first] - time[0]:.6g} s on"
                why = f"repeat one, while joints should move at {speed:.2g} rad/s: the log froze"
                remarks.append(f"{where} {why}, marked as not valid")
        for place, track in enumerate(tracks):
            if track.stamps is stamps and frozen.any():
                missing = frozen if track.missing is None else frozen | track.missing
                tracks[place] = replace(track, missing=missing)
    return tracks


# Angles

# Values above which an angle is taken for degrees, in [rad] and [rad/s].
LARGEST = {"position": 4 * np.pi, "velocity": 100.0}
TURN = 2 * np.pi  # positions beyond, of half of the joints that move, are in degrees, in [rad]
FARTHEST = 720.0  # largest position of an arm's joint, in [deg]; wheels turn farther
NORMALISED = 100.0  # largest position that may be a share of a joint's range as well
STRAIGHT = 0.9  # share of its way that a joint is away from its start: wheels go on and on
# What is in degrees, by the ratio of logged velocities to the slope of positions.
MATCHES = {1.0: ("position", "velocity"), np.pi / 180: ("position",), 180 / np.pi: ("velocity",)}
CLOSE = 0.1  # largest relative deviation from such a ratio
STRETCHES = 50  # of a log, whose ways are compared
TURNING = ("revolute", "continuous")
GOES = 0.1  # least way of a joint whose desired motion is compared with it, in [rad]
AS_FAR = 1.5  # largest ratio of the ways of desired and measured motion in one unit

HINT = (
    "if it is in degrees, say --units degrees; if the joint is prismatic or a wheel, say --units"
    " radians, or name the robot (--robot)"
)


def _in_si(
    log: Log, tracks: Sequence[Track], units: str, robot: Robot | None, beside: Log | None
) -> tuple[list[Track], tuple[str, ...], list[str]]:
    """Tracks in radians that know which columns are angles, what was in degrees, and remarks."""
    kinds = {joint.name: joint.kind for joint in robot.joints} if robot else {}
    in_degrees = () if units else _in_degrees(tracks, kinds, guess=not log.in_radians)
    found, remarks = list[Track](), list[str]()
    if in_degrees:
        plural = {"position": "positions", "velocity": "velocities"}
        what = " and ".join(plural[each] for each in in_degrees)
        how = "converted to radians (if they are not, --units radians)"
        remarks.append(f"{what} look like degrees: {how}")
    measured = {each.signal: each for each in beside.tracks} if beside else {}
    also = beside.in_degrees if beside else ()
    for track in sorted(tracks, key=lambda each: each.is_desired):
        # A gripper is logged by LeRobot as a share of its way.
        gripper = [bool(log.units and re.search("gripper|finger", joint)) for joint in track.joints]
        if units == "degrees" and any(gripper):
            names = listed([*compress(track.joints, gripper)])
            remark = f"left out, since grippers have no angles: {names}"
            remarks += [] if remark in remarks else [remark]
            if all(gripper):
                continue
            track = _columns(track, ~np.array(gripper))
        angular, is_position = _angular(track, kinds), track.quantity == "position"
        labels = track.labels[: len(track.joints)]
        told = np.array([not units and tells_unit(label) for label in labels], dtype=bool)
        open_, degrees = angular & ~told, units == "degrees" or track.quantity in in_degrees
        other = measured.get(track.quantity, measured.get("position", measured.get("velocity")))
        if other and not units and (beside or track.is_desired) and open_.any():
            unit = _unit_by_way(_columns(track, open_), other)
            if unit and degrees != (unit == "degrees"):
                name = track.signal.replace("_", " ")
                remarks.append(f"{name}: in {unit}, as it goes as far as the measured motion")
            degrees = unit == "degrees" if unit else degrees or track.quantity in also
        if degrees and open_.any():
            track = replace(track, values=np.where(open_, np.deg2rad(track.values), track.values))
        if not units:
            _refuse_degrees(log.path, track, angular, kinds)
        if not beside:
            measured.setdefault(track.signal, track)
        found.append(replace(track, angles=(angular & is_position).tolist()))
    return found, in_degrees, remarks


def _unit_by_way(desired: Track, measured: Track) -> str:
    """Unit in which desired angles go as far as measured ones, in radians; empty if not known."""
    shared = [joint for joint in desired.joints if joint in measured.joints]
    ways = list[Array]()
    for track in (desired, measured):
        path = track.of(shared).astype(np.float64)
        if track.quantity == "velocity":
            path = np.cumsum(path[1:] * np.diff(track.stamps.time)[:, None], axis=0)
        ways.append(np.ptp(path, axis=0))
    times, units = _times_as_far(*ways), {"radians": 1.0, "degrees": 180 / np.pi}
    return next((u for u, size in units.items() if 1 / AS_FAR < times / size < AS_FAR), "")


def _times_as_far(wanted: Array, way: Array) -> float:
    """Median of the ways of desired motion by those of measured one; 0 if no joint moves."""
    moves = (way > GOES) & (wanted > 0)
    return float(np.median(wanted[moves] / way[moves])) if moves.any() else 0.0


def _angular(track: Track, kinds: Mapping[str, str]) -> Mask:
    """Whether each column is an angle or an angular rate; True for joints of unknown type."""
    moves = track.signal.startswith(("position", "velocity"))
    turning = [moves and kinds.get(joint, "revolute") in TURNING for joint in track.joints]
    return np.array(turning, dtype=bool)


def _in_degrees(tracks: Sequence[Track], kinds: Mapping[str, str], guess: bool) -> tuple[str, ...]:
    """What is in degrees, as positions and velocities tell whose names do not.

    By a ``guess``, positions are if half of the joints that move reach beyond a turn, to and fro.
    Velocities are if they match them. Without velocities, positions have to reach beyond
    ``NORMALISED``.
    """
    by_signal = {track.signal: track for track in reversed(tracks)}
    suffix = "" if "position" in by_signal else "_desired"
    position, velocity = (by_signal.get(f"{each}{suffix}") for each in ("position", "velocity"))
    if position is None:
        return ()
    both = filter(None, (position, velocity))
    told = {each.quantity for each in both if all(map(tells_unit, each.labels))}
    reach = _reach_to_and_fro(position, kinds) if guess and "position" not in told else 0.0
    if velocity is None:
        return ("position", "velocity") if reach > NORMALISED else ()
    ratio = _ratio(position, velocity)
    for known, quantities in MATCHES.items():
        if abs(ratio / known - 1) <= CLOSE and (reach or "position" not in quantities):
            return tuple(each for each in quantities if each not in told)
    return ()


def _reach_to_and_fro(track: Track, kinds: Mapping[str, str]) -> float:
    """Largest position, if half of the joints that move go beyond a turn, and back; else 0."""
    turns = np.array([kinds.get(joint) == "continuous" for joint in track.joints])
    values = np.unwrap(track.values.astype(np.float64), axis=0, period=360.0)  # if in degrees
    reach = np.abs(track.values).max(axis=0)
    way = np.abs(np.diff(values, axis=0)).sum(axis=0)
    moving = _angular(track, kinds) & ~turns & (way > 0)
    far = moving & (reach > TURN)
    back = np.ptp(values, axis=0) < STRAIGHT * way
    largest = float(reach.max(where=far, initial=0.0))
    enough = 2 * far.sum() >= moving.sum() and (far.sum() > 1 or largest > LARGEST["position"])
    return largest if enough and (far & back).any() and largest <= FARTHEST else 0.0


def _ratio(position: Track, velocity: Track) -> float:
    """Median over joints of velocities by the slope of positions; 0 if it is not known."""
    if position.stamps is not velocity.stamps:
        return 0.0
    shared = [joint for joint in position.joints if joint in velocity.joints]
    angle, speed = (track.of(shared).astype(np.float64) for track in (position, velocity))
    steps = np.diff(position.stamps.time)[:, None]
    summed = np.vstack((np.zeros(len(shared)), np.cumsum((speed[1:] + speed[:-1]) / 2 * steps, 0)))
    places = np.unique(np.linspace(0, len(angle) - 1, STRETCHES + 1).astype(int))
    ways, expected = np.diff(angle[places], axis=0), np.diff(summed[places], axis=0)
    jumps = np.maximum.reduceat(np.abs(np.diff(angle, axis=0)), places[:-1], axis=0)
    ways[jumps > np.ptp(angle, axis=0) / 2] = 0.0  # a wrapped angle, of whatever unit
    square = np.square(ways).sum(axis=0)
    known = square > 0
    if not known.any():
        return 0.0
    return float(np.median((expected * ways).sum(axis=0)[known] / square[known]))


def _refuse_degrees(path: Path, track: Track, angular: Mask, kinds: Mapping[str, str]) -> None:
    """Refuse angles that are too large for radians; continuous joints may turn as they like."""
    is_position = track.quantity == "position"
    for place in np.flatnonzero(angular).tolist():
        beyond = np.abs(track.values[:, place]) > LARGEST[track.quantity]
        turns = is_position and kinds.get(track.joints[place]) == "continuous"
        if beyond.any() and not turns:
            sample = int(np.argmax(beyond))
            held = f"column {track.labels[place]!r} holds {track.values[sample, place]:g}"
            raise track.fault(path, f"{held}, too much for radians; {HINT}", sample)


# The run


def run_of(logs: list[Log], options: ReadOptions, name: str) -> Imported:
    """Run of one log, or of a measured and a desired one, over the time that all signals cover."""
    _check_mapping(logs, options)
    if len(logs) > 1:
        logs[:] = _with_desired(*logs)
    main = _main(logs[0], options)
    every = [track for log in logs for track in log.tracks]
    tracks, said, offset = clocks.synchronise(logs[-1].path, every, main, options)
    remarks = [*_remarks(logs, tracks)]
    remarks += [f"{logs[-1].path.name}: {said}"] if said else []
    own = tracks[every.index(main)].stamps
    kept, notes = _covering(tracks, own, len(logs[0].tracks))
    time, valid = clocks.common_time(kept, own)
    if len(time) < 2 or not valid.any():
        others = [each.stamps for each in tracks if each.stamps is not own]
        raise LogError(logs[-1].path, clocks.no_overlap(others[-1] if others else own, own))
    start, step = own.start + Decimal(str(time[0])), 1 / own.clock.rate
    duration = float(time[-1] - time[0]) + step
    if (lost := float(own.time[-1]) - duration) > 0:
        extent = "both logs" if len(logs) > 1 else "all its signals"
        cut = f"cut to the {duration:.6g} s that {extent} cover"
        (notes if lost > CUT else remarks).append(cut)
    remarks += notes
    meta: dict[str, Any] = {
        **{key: value for log in logs for key, value in log.meta.items()},
        "source": [log.path.name for log in logs],
        "start": f"{start.normalize():f}",
        "jitter": {"rms": own.clock.jitter_rms, "max": own.clock.jitter_max},
    }
    meta |= {} if offset is None else {"offset": {"seconds": offset}}
    meta |= {"notes": notes} if notes else {}
    logs.clear()
    del every, tracks, main  # each signal is freed when it has been resampled
    parts: dict[str, Track] = {}
    while kept:
        track = kept.pop(0)
        track = replace(track, values=clocks.resampled(time, valid, track, mapping.UNIFORM * step))
        _add(parts, track)
    signals, differentiated, told = _signals_of(parts, time - time[0], valid)
    meta |= {"differentiated": differentiated} if differentiated else {}
    run = Run(time=time - time[0], valid=valid, robot=options.robot or None, meta=meta, **signals)
    if start:
        remarks.append(f"time starts at 0; the first stamp, {meta['start']} s, is in meta")
    return Imported(run, (*remarks, *told), name)


def _covering(tracks: Sequence[Track], own: Stamps, optional: int) -> tuple[list[Track], list[str]]:
    """Tracks without those of the first few that would cut the motion short, and what they lack."""
    moving = [t for t in tracks if t.stamps is own and t.signal in ("position", "velocity")]
    whole = int(clocks.common_time(moving, own)[1].sum())
    kept, told = list[Track](), dict[str, list[str]]()
    for place, track in enumerate(tracks):
        share, what = 1.0, ""
        if track not in moving and (track.stamps is not own or track.missing is not None):
            share = int(clocks.common_time([*moving, track], own)[1].sum()) / max(1, whole)
        if share < mapping.COVERS and place < optional:
            what = f"left out, there for {share:.0%} of the time"
        else:
            kept.append(track)
            rate = track.stamps.clock.nominal
            if not track.is_desired and (lost := _lost(own.clock.nominal, rate)):
                what = f"interpolated from {plain(rate, 4)} Hz{lost}" if track.joints else ""
        if what:
            what = f"{' of ' * bool(track.joints)}{first_to_last(track.joints)}: {what}"
            told.setdefault(what, []).append(track.signal.replace("_", " "))
    return kept, [f"{', '.join(signals)}{what}" for what, signals in told.items()]


def _add(parts: dict[str, Track], track: Track) -> None:
    """Add a track to the parts of a run, to the joints that its signal has there."""
    if before := parts.get(track.signal):
        values = np.hstack((before.values, track.values))
        track = replace(before, joints=before.joints + track.joints, values=values)
    parts[track.signal] = track


def _check_mapping(logs: Sequence[Log], options: ReadOptions) -> None:
    """Refuse a mapping of a column that none of the logs has."""
    names = {name for log in logs for name in log.names}
    times = {log.time for log in logs}
    for entry in options.entries:
        known = entry.is_pattern or entry.source in names or entry.part()[0] in names
        if not (entry.source in times if entry.signal == "time" else known):
            problem = f"there is no column {entry.source!r} to map"
            raise LogError(logs[0].path, f"{problem}; it has {listed(logs[0].names)}")


def _with_desired(measured: Log, desired: Log) -> list[Log]:
    """Both logs, with desired motion only from the second."""
    own = [track for track in measured.tracks if not track.is_desired]
    others = [track for track in desired.tracks if track.is_desired] or [
        replace(track, signal=f"{track.signal}_desired")
        for track in desired.tracks
        if track.signal in ("position", "velocity")
    ]
    found = []
    for log, tracks in ((measured, own), (desired, others)):
        kept = {id(track.values) for track in tracks}
        dropped = [name for t in log.tracks if id(t.values) not in kept for name in t.labels]
        found.append(replace(log, tracks=tuple(tracks), not_read=(*log.not_read, *dropped)))
    return found


def _main(log: Log, options: ReadOptions) -> Track:
    """The track whose stamps become the run's time: of the fastest the one with most joints."""
    moving = [track for track in log.tracks if track.signal in ("position", "velocity")]
    if not moving:
        only = ", only desired" if log.tracks else ""
        raise LogError(log.path, f"holds no measured motion{only}")
    fast = mapping.fastest(track.stamps for track in moving)
    track = max((t for t in moving if t.stamps in fast), key=lambda track: len(track.joints))
    time, nominal, rate = track.stamps.time, track.stamps.clock.nominal, options.rate
    if rate is not None and not 1 / LARGEST_RATE_RATIO <= rate / nominal <= LARGEST_RATE_RATIO:
        problem = f"the rate of the stamps is {nominal:g} Hz; a run of {rate:g} Hz cannot be made"
        raise LogError(log.path, f"{problem} of it")
    if time[-1] * nominal > MOST_SAMPLES_PER_STAMP * len(time):
        jump = int(np.argmax(steps := np.diff(time)))
        problem = f"time jumps by {steps[jump]:.6g} s; most of the log is gaps"
        raise track.fault(log.path, f"{problem}: remove what lies before", jump + 1)
    return track


def _remarks(logs: Sequence[Log], tracks: Sequence[Track]) -> Iterator[str]:
    """What was decided about clocks and columns, a sentence each with the name of its log."""
    places = iter(tracks)
    for log in logs:
        name = log.path.name
        own = [next(places) for _ in log.tracks]
        every = clocks.clocks_of(own)
        for stamps in every:
            signal = next(track.signal for track in own if track.stamps is stamps)
            whose = f"{name}, {signal}" if len(every) > 1 else name
            clock = stamps.clock
            if stamps.unit != "seconds":
                yield f"{whose}: stamps are in {stamps.unit}"
            if stamps.remark:
                yield f"{whose}: {stamps.remark}"
            if not clock.uniform:
                jitter = f"jitter {clock.jitter_rms * 1e3:.3g} ms rms"
                from_ = f"stamps of {clock.nominal:g} Hz, {jitter}"
                lost = _lost(clock.nominal, clock.rate)
                yield f"{whose}: resampled to {clock.rate:g} Hz ({from_}){lost}"
            if clock.gaps:
                total = sum(stop - start for start, stop in clock.gaps)
                what = f"{counted(len(clock.gaps), 'gap')}, {total:.3g} s in all, the first at"
                yield f"{whose}: {what} {clock.gaps[0][0]:.6g} s, marked as not valid"
        yield from (f"{name}: {remark}" for remark in log.remarks)
        if log.not_read:
            yield f"{name}: {counted(len(log.not_read), 'column')} not read: {listed(log.not_read)}"


def _lost(before: float, after: float) -> str:
    """What a lower rate leaves of a signal, however it is sampled; nothing if it is no lower."""
    return f": nothing above {plain(after / 2, 4)} Hz is left" if after < before / SAME_RATE else ""


def _signals_of(
    parts: dict[str, Track], time: Array, valid: Mask
) -> tuple[dict[str, Any], dict[str, str], list[str]]:
    """Signals of all joints, velocities differentiated where needed; what some lack is left out."""
    signals, differentiated, remarks = dict[str, Any](), dict[str, str](), list[str]()
    for suffix, names in (("", "joint_names"), ("_desired", "desired_joint_names")):
        velocity, position = f"velocity{suffix}", f"position{suffix}"
        known = [parts[signal].joints for signal in (velocity, position) if signal in parts]
        joints = tuple(dict.fromkeys(joint for each in known for joint in each))
        if not joints:
            continue
        logged = parts[velocity].joints if velocity in parts else ()
        if missing := tuple(joint for joint in joints if joint not in logged):
            values = parts[position].of(missing)
            if (hold := hold_length(values, valid)) > 1:
                rate, each = (len(time) - 1) / float(time[-1]), "target" if suffix else "value"
                held = f"each {each} is held for {hold:.3g} samples ({plain(rate / hold, 4)} Hz)"
                how = f"interpolated from {each} to {each}{_lost(rate, rate / hold)}"
                remarks.append(f"{position}: {held}; {how}")
            slopes = joint_velocity(time, values, valid)
            _add(parts, replace(parts[position], signal=velocity, joints=missing, values=slopes))
            of_joints = f" of {', '.join(missing)}" if logged else ""
            differentiated[velocity] = METHOD + of_joints
            remarks.append(f"{velocity}{of_joints}: differentiated from positions ({METHOD})")
        signals[names] = joints
        for signal in (velocity, position) if suffix else (velocity, position, "effort"):
            if signal not in parts:
                continue
            if lacking := [joint for joint in joints if joint not in parts[signal].joints]:
                remarks.append(f"{signal}: left out, missing for {', '.join(lacking)}")
            else:
                signals[signal] = parts[signal].of(joints)
    signals |= {name: parts[name].values for name in BASE_SIGNALS if name in parts}
    if "base_pose" in signals and "base_velocity" not in signals:
        signals["base_velocity"] = base_velocity(time, signals["base_pose"], valid)
        differentiated["base_velocity"] = METHOD
        remarks.append(f"base_velocity: differentiated from poses ({METHOD})")
    return signals, differentiated, remarks


# Limits of a robot: a moment beyond them is what a fault looks like; another robot, or another
# unit, exceeds them all along.

FAR_POSITION = 0.25  # share of a joint's range by which positions may be beyond its ends
FAR_VELOCITY = 1.5  # multiple of a joint's velocity limit that velocities may reach
LONG = 1.0  # time for which limits have to be exceeded, or a tenth of a shorter run, in [s]


def limit_warnings(run: Run) -> Iterator[str]:
    """Clauses on limits of its robot that a run exceeds by far, for a second or a tenth of it."""
    limits, problem = known_limits(run.robot)
    if problem:
        yield f"the joints are not checked: {problem}"
    if limits:
        watch = LimitWatch(run.joint_names, str(run.robot))
        for rows in pieces(run.velocity):
            valid = run.mask[rows]
            position = None if run.position is None else run.position[rows][valid]
            watch.add(position, run.velocity[rows][valid])
        yield from watch.warnings(min(LONG * run.rate, 0.1 * float(run.mask.sum())))


class LimitWatch:
    """Counts samples beyond the limits of a robot by far, for each joint that it knows."""

    def __init__(self, joints: Sequence[str], robot: str) -> None:
        known, _ = known_limits(robot)
        self._joints, self._robot = tuple(joints), robot
        self._limits = [known.get(joint, Limits()) for joint in joints]
        lower = np.array([each.lower for each in self._limits])
        upper = np.array([each.upper for each in self._limits])
        span = upper - lower
        slack = np.where(np.isfinite(span), FAR_POSITION * span, 0.0)
        fast = FAR_VELOCITY * np.array([each.velocity for each in self._limits])
        self._bounds = {"position": (lower - slack, upper + slack), "velocity": (-fast, fast)}
        self._counts = {name: np.zeros(len(joints), dtype=int) for name in self._bounds}
        self._farthest = {name: np.zeros(len(joints)) for name in self._bounds}

    def add(self, position: Real | None, velocity: Real) -> None:
        """Count the samples of a stretch, shape (samples, joints), in SI; nan is not counted."""
        for name, values in (("position", position), ("velocity", velocity)):
            lower, upper = self._bounds[name]
            if values is None or not (beyond := (values < lower) | (values > upper)).any():
                continue
            self._counts[name] += np.count_nonzero(beyond, axis=0)
            outside = np.vstack((self._farthest[name], np.where(beyond, values, 0.0)))
            outside = np.abs(outside) if name == "velocity" else outside
            farthest = np.abs(outside).argmax(axis=0)[None]
            self._farthest[name] = np.take_along_axis(outside, farthest, axis=0)[0]

    def warnings(self, samples: float) -> Iterator[str]:
        """Clauses on the joints that were beyond a limit for so many samples."""
        for name, counts in self._counts.items():
            beyond = np.flatnonzero(counts > max(samples, 1.0))
            if not len(beyond):
                continue
            worst = int(beyond[np.argmax(counts[beyond])])
            limits, unit = self._limits[worst], "rad" if self._limits[worst].turns else "m"
            allowed = f"{limits.lower:.3g} to {limits.upper:.3g}"
            if name == "velocity":
                allowed, unit = f"{limits.velocity:.3g}", f"{unit}/s"
            others = f" ({counted(len(beyond) - 1, 'more joint')} too)" if len(beyond) > 1 else ""
            yield (
                f"{self._joints[worst]} reaches {self._farthest[name][worst]:.3g} {unit}, far"
                f" beyond the {allowed} {unit} of {self._robot}{others}: another robot or unit?"
            )


# Velocities beside positions

# Warnings by the ratio of velocities to the slope of positions.
FACTORS: Mapping[float, str] = {
    180 / np.pi: "velocities look like degrees per second beside positions in radians",
    np.pi / 180: "positions look like degrees beside velocities in radians per second",
    30 / np.pi: "velocities look like turns per minute beside positions in radians",
}
NEAR_FACTOR = 0.02  # largest relative deviation, less than half the distance of two of them
STRETCH = 0.2  # time over which velocities are integrated and compared with positions, in [s]
AGREE = 0.2  # largest relative deviation of velocities from slopes: filters attenuate
RELATED, UNRELATED = 0.9, 0.3  # correlation from which a factor is one, and below which none is
WAY = 0.02  # least RMS of the way in a stretch of a joint that is compared, in [rad] or [m]
ENOUGH = 5  # fewest stretches


def contradictions(run: Run) -> Iterator[str]:
    """Clauses on velocities that are not the slopes of their positions, or in another unit."""
    yield from _of_desired(run)
    if run.position is None or derived(run, "velocity"):
        return
    way, summed = _ways(run, run.position)
    own, other = np.square(way).sum(axis=0), np.square(summed).sum(axis=0)
    both, clear = (way * summed).sum(axis=0), own > 0
    if not clear.any():
        return
    factor = np.where(clear, both / np.where(clear, own, 1.0), 1.0)
    median = float(np.median(factor[clear]))
    for known, warning in FACTORS.items():
        if abs(median / known - 1) <= NEAR_FACTOR:
            yield f"{warning} ({median:.4g} times their slope)"
            return
    if len(way) < ENOUGH:
        return
    moves = (own > len(way) * WAY**2) & (other > 0)
    correlation = both / np.sqrt(np.where(own * other > 0, own * other, 1.0))
    strange = moves & (correlation < UNRELATED)
    wrong = moves & (correlation >= RELATED) & (np.abs(factor - 1) > AGREE)
    if strange.any():
        related = f"the slopes of their positions (correlation {correlation[strange].max():.2g})"
        yield f"velocities of {_joints(run, strange)} have no relation to {related}"
    if wrong.any():
        least, most = (f"{each:.3g}" for each in (factor[wrong].min(), factor[wrong].max()))
        size = least if least == most else f"{least} to {most}"
        slopes = f"{size} times the slopes of their positions"
        yield f"velocities of {_joints(run, wrong)} are {slopes}: another unit, or another rate?"


def _of_desired(run: Run) -> Iterator[str]:
    """A clause on desired velocities that are measured ones in another unit."""
    if run.velocity_desired is None:
        return
    own, other = in_both(run)
    step = run.mask[:, None] / run.rate
    speeds = run.velocity_desired[:, other], run.velocity[:, own]
    times = _times_as_far(*(np.ptp(np.cumsum(each * step, axis=0), axis=0) for each in speeds))
    if any(abs(times / known - 1) <= CLOSE for known in FACTORS):
        yield f"desired velocities go {times:.3g} times as far as measured ones: another unit?"


def _joints(run: Run, chosen: Mask) -> str:
    names = [*compress(run.joint_names, chosen)]
    return "all joints" if len(names) == len(run.joint_names) > 1 else listed(names)


def _ways(run: Run, position: Real) -> tuple[Array, Array]:
    """Changes of positions, and integrals of velocities, over stretches without a gap."""
    length = max(2, round(STRETCH * run.rate))
    starts = np.arange(0, len(run.time) - length, length)
    gaps = np.concatenate(([0], np.cumsum(~run.mask)))
    starts = starts[gaps[starts + length + 1] == gaps[starts]]
    way = position[starts + length].astype(np.float64) - position[starts]
    count = len(run.time) // length
    whole = run.velocity[: count * length].reshape(count, length, way.shape[1])
    sums = whole.sum(axis=1, dtype=np.float64)[starts // length]
    ends = (run.velocity[starts + length].astype(np.float64) - run.velocity[starts]) / 2
    summed = (sums + ends) / run.rate  # trapezoids
    turn = 2 * np.pi  # of an angle that wraps: it stays within a turn, and jumps
    wraps = np.abs(np.ptp(position, axis=0) - turn) < 0.1 * turn
    return np.where(wraps, way - turn * np.round((way - summed) / turn), way), summed
