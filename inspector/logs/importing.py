"""What logs hold becomes a run: on one clock, resampled, differentiated where need be."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

import numpy as np

from inspector.errors import LogError
from inspector.logs.columns import listed
from inspector.logs.log import Stamps
from inspector.logs.motion import Piece, motion_of
from inspector.logs.reading import Reading
from inspector.logs.resample import UNIFORM, Clock, Clocked, clock_of, common_time, onto
from inspector.logs.side import Side, check_mapped, paired
from inspector.logs.twoclocks import OneClock, apart, on_one_clock
from noisemodel import Robot, Run
from noisemodel.types import Array, Mask

FARTHEST = 1.5
"""Factor by which a declared rate may miss that of the stamps."""

EMPTIEST = 20
"""Instants that a run may have for each sample of its log; most of it would be gaps."""


@dataclass(frozen=True, eq=False)
class Imported:
    """A run that was read from a log.

    Attributes:
        run: The run.
        remarks: What was decided on the way, for the person who imports, a sentence each.
        name: What to call it: the log's name, and the episode's.
        urdf: Text of the URDF that came with the log, where no robot was named.
    """

    run: Run
    remarks: tuple[str, ...]
    name: str = ""
    urdf: str = ""


def run_of(sides: list[Side], reading: Reading, robot: Robot | None, name: str) -> Imported:
    """Make a run of one log, or of one of the measured and one of the desired motion.

    The run's time starts at 0; its ``meta`` keeps the first stamp. Stamps that are not uniform are
    resampled to the reading's rate, or to the round rate that they are near to; gaps become
    ``valid`` False. The run is cut to the time that all signals cover. Velocities that are missing
    are differentiated from positions.

    Args:
        sides: The logs; the list is emptied, so that a long log need not be held twice.
        reading: What a person said of them.
        robot: The robot, if it is known.
        name: What to call the run.

    Raises:
        LogError: If the logs do not make a run.
    """
    check_mapped(sides, reading)
    if len(sides) > 1:
        sides[:] = paired(*sides)
    main = _main(sides[0], reading.rate)
    one = on_one_clock(
        sides[-1].path,
        [track for side in sides for track in side.tracks],
        main,
        rate=reading.rate,
        robot=robot,
        offset=reading.offset,
    )
    leading = next(each for each in one.tracks if each.track.stamps is main)
    time, valid = common_time(one.tracks, leading)
    if len(time) < 2 or not valid.any():
        others = [each for each in one.tracks if each.track.stamps is not main]
        raise LogError(sides[-1].path, apart(others[-1] if others else leading, leading))
    clock, covered = leading.clock, float(leading.time[-1])
    said = [*_remarks(sides, one)]
    meta = _meta(sides, one, main.start + Decimal(str(time[0])), clock)
    urdf = sides[0].urdf if robot and not reading.robot else ""
    tracks = list(one.tracks)
    sides.clear()
    del one, leading  # from here on each signal goes when it has been resampled
    motion = motion_of([*_pieces(tracks, time, valid, clock)], time - time[0], valid)
    if motion.differentiated:
        meta["differentiated"] = dict(motion.differentiated)
    run = Run(
        time=time - time[0],
        valid=valid,
        robot=reading.robot or None,
        meta=meta
        | ({"differentiated": dict(motion.differentiated)} if motion.differentiated else {}),
        **motion.signals,
    )
    if run.duration < covered:
        said.append(f"cut to the {run.duration:.6g} s that {_both(meta)} cover")
    if Decimal(meta["start"]):
        said.append(f"time starts at 0; the first stamp, {meta['start']} s, is kept in meta")
    return Imported(run, (*said, *motion.remarks), name, urdf)


def _main(side: Side, rate: float | None) -> Stamps:
    """Choose the stamps that the run's time is made of: those of the most joints."""
    widths: dict[int, int] = {}
    for track in side.tracks:
        if track.signal in ("position", "velocity"):
            key = id(track.stamps)
            widths[key] = max(widths.get(key, 0), len(track.joints))
    if not widths:
        raise LogError(side.path, "holds no measured motion, only desired")
    chosen = max(widths, key=lambda key: widths[key])
    track = next(track for track in side.tracks if id(track.stamps) == chosen)
    time = track.stamps.time
    nominal = clock_of(time).nominal
    if rate is not None and not 1 / FARTHEST <= rate / nominal <= FARTHEST:
        raise LogError(
            side.path,
            f"the stamps come at {nominal:g} Hz; a run of {rate:g} Hz cannot be had of it",
        )
    if time[-1] * nominal > EMPTIEST * len(time):
        steps = np.diff(time)
        jump = int(np.argmax(steps))
        raise track.fault(
            side.path, f"time jumps by {steps[jump]:.6g} s; most of the log is gaps", jump + 1
        )
    return track.stamps


def _pieces(tracks: list[Clocked], time: Array, valid: Mask, clock: Clock) -> Iterator[Piece]:
    """Resample one track after the other, and let each go."""
    while tracks:
        track = tracks.pop(0)
        values = onto(time, valid, track, slack=UNIFORM / clock.rate)
        yield Piece(track.track.signal, track.track.joints, values)


def _meta(sides: Sequence[Side], one: OneClock, start: Decimal, clock: Clock) -> dict[str, Any]:
    disorders = [disorder for side in sides for disorder in side.disorders]
    meta: dict[str, Any] = {
        **{key: value for side in sides for key, value in side.meta.items()},
        "source": [side.path.name for side in sides],
        "start": f"{start.normalize():f}",
        "jitter": {"rms": clock.jitter_rms, "max": clock.jitter_max},
    }
    if disorders:
        meta["stamps"] = {
            "duplicates": sum(each.duplicates for each in disorders),
            "backward": sum(each.backward for each in disorders),
        }
    if one.offset:
        meta["offset"] = {"seconds": one.offset.seconds, "drift": one.offset.drift}
    return meta


def _remarks(sides: Sequence[Side], one: OneClock) -> Iterator[str]:
    for side in sides:
        name = side.path.name
        clocks = _by_stamps(side, one.tracks)
        for track in clocks:
            whose = f"{name}, {track.track.signal}" if len(clocks) > 1 else name
            yield from (f"{whose}: {remark}" for remark in _of_clock(track))
        for disorder in side.disorders:
            yield f"{name}: {disorder}"
        yield from (f"{name}: {remark}" for remark in side.remarks)
        if side.left:
            yield f"{name}: {_counted(side.left, 'column')} not read: {listed(side.left)}"
    if one.remark:
        yield f"{sides[-1].path.name}: {one.remark}"


def _by_stamps(side: Side, tracks: Sequence[Clocked]) -> list[Clocked]:
    ours = {id(track.stamps) for track in side.tracks}
    found = {id(each.track.stamps): each for each in reversed(tracks)}
    return [each for key, each in reversed(found.items()) if key in ours]


def _of_clock(track: Clocked) -> Iterator[str]:
    stamps, clock = track.track.stamps, track.clock
    if stamps.unit != "seconds":
        yield f"stamps are in {stamps.unit}"
    if stamps.origin:
        yield stamps.origin
    if not clock.uniform:
        yield (
            f"resampled to {clock.rate:g} Hz (the stamps' nominal rate is"
            f" {clock.nominal:g} Hz; their steps are off by {clock.jitter_rms * 1e3:.3g} ms rms,"
            f" {clock.jitter_max * 1e3:.3g} ms at most)"
        )
    if clock.gaps:
        total = sum(stop - start for start, stop in clock.gaps)
        yield (
            f"{_counted(clock.gaps, 'gap')}, {total:.3g} s in all, the first at"
            f" {clock.gaps[0][0]:.6g} s, marked as not valid"
        )


def _both(meta: dict[str, Any]) -> str:
    return "both logs" if len(meta["source"]) > 1 else "all its signals"


def _counted(things: Sequence[object], word: str) -> str:
    return f"{len(things)} {word}{'' if len(things) == 1 else 's'}"
