"""A run made of prepared logs: synchronised, resampled, differentiated where necessary."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

import numpy as np

from inspector.errors import LogError
from inspector.logs.log import Stamps
from inspector.logs.motion import ResampledTrack, motion_of
from inspector.logs.options import ReadOptions
from inspector.logs.preparation import PreparedLog, check_mapping, with_desired
from inspector.logs.resample import UNIFORM, Clock, TimedTrack, clock_of, common_time, resampled
from inspector.logs.signals import listed
from inspector.logs.synchronisation import Synchronised, no_overlap, synchronise
from inspector.logs.targets import without_held_targets
from inspector.text import counted
from noisemodel import Robot, Run
from noisemodel.types import Array, Mask

LARGEST_RATE_RATIO = 1.5
"""Largest ratio of the specified rate to that of the stamps, or the inverse."""

MOST_SAMPLES_PER_STAMP = 20
"""Largest number of the run's samples per logged sample; above it most of the run is gaps."""


@dataclass(frozen=True, eq=False)
class Imported:
    """A run that was read from a log.

    Attributes:
        run: The run.
        remarks: What was decided during the import, a sentence each.
        name: Name of the log and of the episode.
        urdf: Text of the URDF in the log, if no robot was specified.
    """

    run: Run
    remarks: tuple[str, ...]
    name: str = ""
    urdf: str = ""


def run_of(
    logs: list[PreparedLog], options: ReadOptions, robot: Robot | None, name: str
) -> Imported:
    """Run of one log, or of one with the measured and one with the desired motion.

    The run's time starts at 0; its ``meta`` has the first stamp. Samples whose stamps are not
    uniform are resampled to the specified rate, or to the nearest round one; ``valid`` is False
    in gaps. The run is cut to the time that all signals cover. Missing velocities are
    differentiated from positions.

    Args:
        logs: The logs; the list is emptied, so that a long log is not held twice.
        options: How to read them.
        robot: The robot, if known.
        name: Name of the run.

    Raises:
        LogError: If no run can be made of the logs.
    """
    check_mapping(logs, options)
    if len(logs) > 1:
        logs[:] = with_desired(*logs)
    main = _main(logs[0], options.rate)
    synchronised = synchronise(
        logs[-1].path,
        [track for log in logs for track in log.tracks],
        main,
        rate=options.rate,
        robot=robot,
        offset=options.offset,
    )
    main_track = next(each for each in synchronised.tracks if each.track.stamps is main)
    targets, interpolated = without_held_targets(synchronised.tracks)
    time, valid = common_time(targets, main_track)
    if len(time) < 2 or not valid.any():
        others = [each for each in synchronised.tracks if each.track.stamps is not main]
        raise LogError(logs[-1].path, no_overlap(others[-1] if others else main_track, main_track))
    clock, covered = main_track.clock, float(main_track.time[-1])
    remarks = [*_remarks(logs, synchronised), *interpolated]
    meta = _meta(logs, synchronised, main.start + Decimal(str(time[0])), clock)
    urdf = logs[0].urdf if robot and not options.robot else ""
    tracks = list(targets)
    logs.clear()
    del synchronised, targets, main_track  # each signal is freed when it has been resampled
    motion = motion_of([*_resampled(tracks, time, valid, clock)], time - time[0], valid)
    if motion.differentiated:
        meta["differentiated"] = dict(motion.differentiated)
    run = Run(
        time=time - time[0],
        valid=valid,
        robot=options.robot or None,
        meta=meta,
        **motion.signals,
    )
    if run.duration < covered:
        remarks.append(f"cut to the {run.duration:.6g} s that {_extent(meta)} cover")
    if Decimal(meta["start"]):
        remarks.append(f"time starts at 0; the first stamp, {meta['start']} s, is in meta")
    return Imported(run, (*remarks, *motion.remarks), name, urdf)


def _main(log: PreparedLog, rate: float | None) -> Stamps:
    """Stamps that the run's time is made of: those of the most joints."""
    widths: dict[int, int] = {}
    for track in log.tracks:
        if track.signal in ("position", "velocity"):
            key = id(track.stamps)
            widths[key] = max(widths.get(key, 0), len(track.joints))
    if not widths:
        raise LogError(log.path, "holds no measured motion, only desired")
    chosen = max(widths, key=lambda key: widths[key])
    track = next(track for track in log.tracks if id(track.stamps) == chosen)
    time = track.stamps.time
    nominal = clock_of(time).nominal
    if rate is not None and not 1 / LARGEST_RATE_RATIO <= rate / nominal <= LARGEST_RATE_RATIO:
        raise LogError(
            log.path,
            f"the rate of the stamps is {nominal:g} Hz; a run of {rate:g} Hz cannot be made of it",
        )
    if time[-1] * nominal > MOST_SAMPLES_PER_STAMP * len(time):
        steps = np.diff(time)
        jump = int(np.argmax(steps))
        raise track.fault(
            log.path, f"time jumps by {steps[jump]:.6g} s; most of the log is gaps", jump + 1
        )
    return track.stamps


def _resampled(
    tracks: list[TimedTrack], time: Array, valid: Mask, clock: Clock
) -> Iterator[ResampledTrack]:
    """Resample one track after the other, and free each."""
    while tracks:
        track = tracks.pop(0)
        values = resampled(time, valid, track, slack=UNIFORM / clock.rate)
        yield ResampledTrack(track.track.signal, track.track.joints, values)


def _meta(
    logs: Sequence[PreparedLog], synchronised: Synchronised, start: Decimal, clock: Clock
) -> dict[str, Any]:
    unordered = [unordered for log in logs for unordered in log.unordered]
    meta: dict[str, Any] = {
        **{key: value for log in logs for key, value in log.meta.items()},
        "source": [log.path.name for log in logs],
        "start": f"{start.normalize():f}",
        "jitter": {"rms": clock.jitter_rms, "max": clock.jitter_max},
    }
    if unordered:
        meta["stamps"] = {
            "duplicates": sum(each.duplicates for each in unordered),
            "backward": sum(each.backward for each in unordered),
        }
    if synchronised.offset:
        meta["offset"] = {
            "seconds": synchronised.offset.seconds,
            "drift": synchronised.offset.drift,
        }
    return meta


def _remarks(logs: Sequence[PreparedLog], synchronised: Synchronised) -> Iterator[str]:
    for log in logs:
        name = log.path.name
        clocks = _by_stamps(log, synchronised.tracks)
        for track in clocks:
            whose = f"{name}, {track.track.signal}" if len(clocks) > 1 else name
            yield from (f"{whose}: {remark}" for remark in _of_clock(track))
        for unordered in log.unordered:
            yield f"{name}: {unordered}"
        yield from (f"{name}: {remark}" for remark in log.remarks)
        if log.not_read:
            yield f"{name}: {counted(len(log.not_read), 'column')} not read: {listed(log.not_read)}"
    if synchronised.remark:
        yield f"{logs[-1].path.name}: {synchronised.remark}"


def _by_stamps(log: PreparedLog, tracks: Sequence[TimedTrack]) -> list[TimedTrack]:
    ours = {id(track.stamps) for track in log.tracks}
    found = {id(each.track.stamps): each for each in reversed(tracks)}
    return [each for key, each in reversed(found.items()) if key in ours]


def _of_clock(track: TimedTrack) -> Iterator[str]:
    stamps, clock = track.track.stamps, track.clock
    if stamps.unit != "seconds":
        yield f"stamps are in {stamps.unit}"
    if stamps.remark:
        yield stamps.remark
    if not clock.uniform:
        yield (
            f"resampled to {clock.rate:g} Hz (the stamps' nominal rate is"
            f" {clock.nominal:g} Hz; their jitter is {clock.jitter_rms * 1e3:.3g} ms rms,"
            f" {clock.jitter_max * 1e3:.3g} ms at most)"
        )
    if clock.gaps:
        total = sum(stop - start for start, stop in clock.gaps)
        yield (
            f"{counted(len(clock.gaps), 'gap')}, {total:.3g} s in all, the first at"
            f" {clock.gaps[0][0]:.6g} s, marked as not valid"
        )


def _extent(meta: dict[str, Any]) -> str:
    return "both logs" if len(meta["source"]) > 1 else "all its signals"
