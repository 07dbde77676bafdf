"""Tracks with clocks of their own, brought onto the clock of the measured motion."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path

import numpy as np

from inspector.errors import LogError
from inspector.logs.alignment import CORRELATION, RIVAL, Offset, estimate
from inspector.logs.angles import turns
from inspector.logs.log import Stamps, Track
from inspector.logs.resample import Clock, Clocked, clock_of
from noisemodel import Robot

CONFIDENCE = f"{CORRELATION:g} or more, the next best at most {RIVAL:.0%} of it"
"""The correlation that it takes for an estimated offset to be believed."""

HOW = "say --offset SECONDS, to be added to the desired stamps"


class ClockError(LogError):
    """Two clocks that cannot be brought together.

    Args:
        path: The log of the desired motion.
        problem: How the stamps lie.
        offset: What was estimated, if anything moved.
    """

    def __init__(self, path: Path, problem: str, offset: Offset | None) -> None:
        self.offset = offset
        why = (
            f"the motions do not tell ({offset}; expected {CONFIDENCE})"
            if offset
            else "no joint moves in both"
        )
        super().__init__(path, f"{problem}, and {why}; {HOW}")


@dataclass(frozen=True, eq=False)
class OneClock:
    """Tracks on one clock.

    Attributes:
        tracks: All of them; their time is 0 at the first stamp of the measured motion.
        remark: What was found out about the desired motion's clock; empty if it has none.
        offset: What its stamps were changed by, if they were.
    """

    tracks: tuple[Clocked, ...]
    remark: str = ""
    offset: Offset | None = None


def on_one_clock(
    path: Path,
    tracks: Sequence[Track],
    main: Stamps,
    *,
    rate: float | None = None,
    robot: Robot | None = None,
    offset: float | None = None,
) -> OneClock:
    """Bring tracks onto the clock of the measured motion.

    Args:
        path: The log of the desired motion, for errors.
        tracks: All tracks, measured and desired.
        main: The stamps that the run's time is made of.
        rate: The rate of the main stamps, if it is known, in [Hz].
        robot: The robot, if it is known.
        offset: What to add to desired stamps, in [s]; estimated unless given.

    Raises:
        ClockError: If the stamps share no time and nothing tells the offset.
    """
    clocks: dict[int, tuple[np.ndarray, Clock]] = {}
    for stamps in {id(track.stamps): track.stamps for track in tracks}.values():
        time = stamps.time + float(stamps.start - main.start)
        known = rate if stamps is main else None
        clocks[id(stamps)] = time, clock_of(time, known, held=stamps.held)
    clocked = tuple(
        Clocked(track, *clocks[id(track.stamps)], _angles(track, robot)) for track in tracks
    )
    own = {id(track.stamps) for track in tracks if not track.is_desired}
    foreign = [each for each in clocked if id(each.track.stamps) not in own]
    leading = next(each for each in clocked if each.track.stamps is main)
    if not foreign or all(np.array_equal(each.time, leading.time) for each in foreign):
        return OneClock(clocked)
    if offset is not None:
        given = Offset(offset, 0.0, 1.0, 0.0, float(np.ptp(foreign[0].time)))
        return OneClock(_moved(clocked, foreign, given), f"offset {offset:+g} s, as given", given)
    found = _estimated(clocked, foreign)
    together = foreign[0].time[0] <= leading.time[-1] and leading.time[0] <= foreign[0].time[-1]
    if found is None or not found.is_sure:
        if not together:
            raise ClockError(path, apart(foreign[0], leading), found)
        if found is None:
            return OneClock(clocked)
        remark = (
            f"its clock is taken for the measured one's, the motions do not tell ({found};"
            f" expected {CONFIDENCE}); {HOW}"
        )
        return OneClock(clocked, remark)
    if not found.is_of_clocks:
        return OneClock(clocked, f"{found}: a controller's lag, the stamps are left as they are")
    return OneClock(
        _moved(clocked, foreign, found), f"{found}: its stamps are moved by that", found
    )


def apart(desired: Clocked, measured: Clocked) -> str:
    """Say that two logs share no time."""
    return f"{_span(desired.track.stamps)} share no time with {_span(measured.track.stamps)}"


def _angles(track: Track, robot: Robot | None) -> list[bool]:
    return [track.signal.startswith("position") and turn for turn in turns(track, robot)]


def _span(stamps: Stamps) -> str:
    stop = stamps.start + Decimal(str(stamps.time[-1]))
    return f"the stamps from {stamps.start:f} s to {stop:f} s"


def _estimated(clocked: Sequence[Clocked], foreign: Sequence[Clocked]) -> Offset | None:
    measured = {each.track.signal: each for each in reversed(clocked) if not each.track.is_desired}
    desired = {each.track.signal.removesuffix("_desired"): each for each in reversed(foreign)}
    return estimate(measured, desired)


def _moved(
    clocked: Sequence[Clocked], foreign: Sequence[Clocked], offset: Offset
) -> tuple[Clocked, ...]:
    first = min(float(each.time[0]) for each in foreign)
    moved = []
    for each in clocked:
        if each in foreign:
            time = each.time + offset.seconds + offset.drift * (each.time - first)
            clock = clock_of(time, held=each.track.stamps.held)
            moved.append(replace(each, time=time, clock=clock))
        else:
            moved.append(each)
    return tuple(moved)
