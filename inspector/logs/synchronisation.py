"""Tracks with separate clocks, synchronised to the clock of the measured motion."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path

import numpy as np

from inspector.errors import LogError
from inspector.logs.alignment import CORRELATION, NEXT_BEST, Offset, estimate
from inspector.logs.angles import is_angular
from inspector.logs.log import Stamps, Track
from inspector.logs.resample import Clock, TimedTrack, clock_of
from noisemodel import Robot

CONFIDENCE = f"{CORRELATION:g} or more, the next best at most {NEXT_BEST:.0%} of it"
"""Condition on the correlation for an estimated offset to be used."""

HOW = "specify --offset SECONDS, which is added to the desired stamps"


class ClockError(LogError):
    """Two clocks that cannot be synchronised.

    Args:
        path: The log of the desired motion.
        problem: What is wrong with the stamps.
        offset: The estimate, if a joint moved.
    """

    def __init__(self, path: Path, problem: str, offset: Offset | None) -> None:
        self.offset = offset
        why = (
            f"the offset cannot be estimated ({offset}; expected {CONFIDENCE})"
            if offset
            else "no joint moves in both"
        )
        super().__init__(path, f"{problem}, and {why}; {HOW}")


@dataclass(frozen=True, eq=False)
class Synchronised:
    """Tracks on one clock.

    Attributes:
        tracks: All of them; their time is 0 at the first stamp of the measured motion.
        remark: What was found about the desired motion's clock; empty if it has none of its own.
        offset: Offset that was applied to its stamps, if any.
    """

    tracks: tuple[TimedTrack, ...]
    remark: str = ""
    offset: Offset | None = None


def synchronise(
    path: Path,
    tracks: Sequence[Track],
    main: Stamps,
    *,
    rate: float | None = None,
    robot: Robot | None = None,
    offset: float | None = None,
) -> Synchronised:
    """Tracks on the clock of the measured motion.

    Args:
        path: The log of the desired motion, for errors.
        tracks: All tracks, measured and desired.
        main: The stamps that the run's time is made of.
        rate: The rate of the main stamps, if known, in [Hz].
        robot: The robot, if known.
        offset: Offset added to desired stamps, in [s]; estimated unless given.

    Raises:
        ClockError: If the stamps do not overlap and the offset cannot be estimated.
    """
    clocks: dict[int, tuple[np.ndarray, Clock]] = {}
    for stamps in {id(track.stamps): track.stamps for track in tracks}.values():
        time = stamps.time + float(stamps.start - main.start)
        known = rate if stamps is main else None
        clocks[id(stamps)] = time, clock_of(time, known, held=stamps.held)
    clocked = tuple(
        TimedTrack(track, *clocks[id(track.stamps)], _angles(track, robot)) for track in tracks
    )
    measured = {id(track.stamps) for track in tracks if not track.is_desired}
    others = [each for each in clocked if id(each.track.stamps) not in measured]
    main_track = next(each for each in clocked if each.track.stamps is main)
    if not others or all(np.array_equal(each.time, main_track.time) for each in others):
        return Synchronised(clocked)
    if offset is not None:
        given = Offset(offset, 0.0, 1.0, 0.0, float(np.ptp(others[0].time)))
        return Synchronised(
            _shifted(clocked, others, given), f"offset {offset:+g} s, as given", given
        )
    found = _estimated(clocked, others)
    overlap = others[0].time[0] <= main_track.time[-1] and main_track.time[0] <= others[0].time[-1]
    if found is None or not found.is_unambiguous:
        if not overlap:
            raise ClockError(path, no_overlap(others[0], main_track), found)
        if found is None:
            return Synchronised(clocked)
        remark = (
            f"its clock is assumed to be the measured one's, since the offset cannot be estimated"
            f" ({found}; expected {CONFIDENCE}); {HOW}"
        )
        return Synchronised(clocked, remark)
    if not found.exceeds_lag:
        return Synchronised(clocked, f"{found}: a controller's lag, the stamps are not changed")
    return Synchronised(
        _shifted(clocked, others, found), f"{found}: its stamps are shifted by that", found
    )


def no_overlap(desired: TimedTrack, measured: TimedTrack) -> str:
    """Message that the stamps of two logs do not overlap."""
    return f"{_span(desired.track.stamps)} do not overlap with {_span(measured.track.stamps)}"


def _angles(track: Track, robot: Robot | None) -> list[bool]:
    return [track.signal.startswith("position") and turn for turn in is_angular(track, robot)]


def _span(stamps: Stamps) -> str:
    stop = stamps.start + Decimal(str(stamps.time[-1]))
    return f"the stamps from {stamps.start:f} s to {stop:f} s"


def _estimated(clocked: Sequence[TimedTrack], others: Sequence[TimedTrack]) -> Offset | None:
    measured = {each.track.signal: each for each in reversed(clocked) if not each.track.is_desired}
    desired = {each.track.signal.removesuffix("_desired"): each for each in reversed(others)}
    return estimate(measured, desired)


def _shifted(
    clocked: Sequence[TimedTrack], others: Sequence[TimedTrack], offset: Offset
) -> tuple[TimedTrack, ...]:
    first = min(float(each.time[0]) for each in others)
    shifted = []
    for each in clocked:
        if each in others:
            time = each.time + offset.seconds + offset.drift * (each.time - first)
            clock = clock_of(time, held=each.track.stamps.held)
            shifted.append(replace(each, time=time, clock=clock))
        else:
            shifted.append(each)
    return tuple(shifted)
