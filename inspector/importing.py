"""A CSV log becomes a run."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path

import numpy as np

from inspector import csvlog
from inspector.angles import refuse_degrees, to_radians, unwrapped
from inspector.columns import Mapped, listed, parse_mapping
from inspector.csvlog import Log
from inspector.errors import InspectorError, LogError
from inspector.motion import motion_of
from inspector.resample import Clock, Track, clock_of, together
from noisemodel import Robot, Run, UnknownJointError

FARTHEST = 1.5
"""Factor by which a declared rate may miss that of the stamps."""

EMPTIEST = 20
"""Instants that a run may have for each sample of its log; most of it would be gaps."""


@dataclass(frozen=True)
class Imported:
    """A run that was read from a log.

    Attributes:
        run: The run.
        remarks: What was decided on the way, for the person who imports, a sentence each.
    """

    run: Run
    remarks: tuple[str, ...]


def read_csv(
    path: str | Path,
    *,
    desired: str | Path | None = None,
    robot: str | Path | None = None,
    rate: float | None = None,
    mapping: Sequence[str] = (),
    degrees: bool = False,
) -> Imported:
    """Read a run from a wide CSV log, and its desired motion from another one.

    The run's time starts at 0; its ``meta`` keeps the first stamp. Stamps that are not uniform are
    resampled to ``rate``, or to the round rate that they are near to; gaps become ``valid`` False.
    With ``desired`` the run is cut to the time that both logs cover. Velocities that are missing
    are differentiated from positions.

    Args:
        path: The log of the measured motion (and, in columns named so, of the desired one).
        desired: A log of the desired motion with stamps of its own, of the same clock; its
            columns may be named like measured ones.
        robot: Listed name or URDF of the robot; the joints are checked against it, and numbered
            columns are named after its joints in order.
        rate: The log's rate, if it is known, in [Hz].
        mapping: What columns hold that have names of their own, for both logs:
            ``SIGNAL.JOINT=COLUMN`` or ``time=COLUMN``, as ``inspector.columns.parse_mapping`` has
            it.
        degrees: Whether angles are in degrees.

    Returns:
        The run and the remarks.

    Raises:
        InspectorError: If the mapping or the rate makes no sense.
        LogError: If a log cannot be read as a robot's motion.
        RobotError: If the robot cannot be read, or lacks a joint that a log names.
    """
    if rate is not None and not (np.isfinite(rate) and rate > 0):
        raise InspectorError(f"the rate is {rate:g} Hz; expected a number above 0")
    known, mapped = Robot.load(robot) if robot else None, parse_mapping(mapping)
    logs = [_read(Path(log), known, mapped, rate, degrees) for log in (path, desired) if log]
    _check_mapped(logs, mapped)
    if desired:
        logs = _paired(*logs)
    _check_measured(logs[0], rate)
    clocks = [clock_of(log.time, None if number else rate) for number, log in enumerate(logs)]
    time, valid, table = together(_tracks(logs, clocks))
    if len(time) < 2 or not valid.any():
        raise LogError(logs[-1].path, f"{_span(logs[-1])} share no time with {_span(logs[0])}")
    columns = [column for log in logs for column in log.columns]
    motion = motion_of(columns, table, time - time[0], valid)
    start = (logs[0].start + Decimal(str(time[0]))).normalize()
    run = Run(
        time=time - time[0],
        valid=valid,
        robot=str(robot) if robot else None,
        meta={
            "source": [log.path.name for log in logs],
            "start": f"{start:f}",
            "jitter": {"rms": clocks[0].jitter_rms, "max": clocks[0].jitter_max},
            **({"differentiated": dict(motion.differentiated)} if motion.differentiated else {}),
        },
        **motion.signals,
    )
    remarks = [said for pair in zip(logs, clocks, strict=True) for said in _remarks(*pair)]
    if run.duration < logs[0].time[-1]:
        remarks.append(f"cut to the {run.duration:.6g} s that both logs cover")
    if start:
        remarks.append(f"time starts at 0; the first stamp, {start:f} s, is kept in meta")
    return Imported(run, (*remarks, *motion.remarks))


def _read(
    path: Path, robot: Robot | None, mapped: Mapped, rate: float | None, degrees: bool
) -> Log:
    names = robot.joint_names if robot else None
    log = csvlog.read(path, mapped=mapped, joints=names, rate=rate)
    for column in log.columns:
        if robot and column.joint not in robot.joint_names:
            raise UnknownJointError(column.joint, robot.name, robot.joint_names)
    if degrees:
        return to_radians(log, robot)
    refuse_degrees(log, robot)
    return log


def _check_mapped(logs: Sequence[Log], mapped: Mapped) -> None:
    names = {name for log in logs for name in log.header}
    for column in mapped:
        if column not in names:
            raise LogError(
                logs[0].path,
                f"there is no column {column!r} to map; it has {listed(logs[0].header)}",
            )


def _check_measured(log: Log, rate: float | None) -> None:
    if not any(column.signal in ("position", "velocity") for column in log.columns):
        raise LogError(log.path, "holds no measured motion, only desired")
    nominal = clock_of(log.time).nominal
    if rate is not None and not 1 / FARTHEST <= rate / nominal <= FARTHEST:
        raise LogError(
            log.path, f"the stamps come at {nominal:g} Hz; a run of {rate:g} Hz cannot be had of it"
        )
    if log.time[-1] * nominal > EMPTIEST * len(log.time):
        steps = np.diff(log.time)
        jump = int(np.argmax(steps))
        raise LogError(
            log.path,
            f"time jumps by {steps[jump]:.6g} s; most of the log is gaps",
            log.rows[jump + 1],
        )


def _paired(measured: Log, desired: Log) -> list[Log]:
    """Put two logs on one clock; the desired motion comes from the second alone."""
    own = [column for column in measured.columns if not column.is_desired]
    others = [column for column in desired.columns if column.is_desired] or [
        replace(column, signal=f"{column.signal}_desired")
        for column in desired.columns
        if column.signal != "effort"
    ]
    shift = float(desired.start - measured.start)
    return [measured.keeping(own), replace(desired.keeping(others), time=desired.time + shift)]


def _tracks(logs: Sequence[Log], clocks: Sequence[Clock]) -> list[Track]:
    """Make angles continuous wherever they may be interpolated."""
    smooth = [
        log if number == 0 and clock.uniform else unwrapped(log)
        for number, (log, clock) in enumerate(zip(logs, clocks, strict=True))
    ]
    return [Track(log.time, log.table, clock) for log, clock in zip(smooth, clocks, strict=True)]


def _span(log: Log) -> str:
    return f"the stamps from {log.start:f} s to {log.start + Decimal(str(np.ptp(log.time))):f} s"


def _remarks(log: Log, clock: Clock) -> Iterator[str]:
    name = log.path.name
    if log.unit != "seconds":
        yield f"{name}: stamps are in {log.unit}"
    if not clock.uniform:
        yield (
            f"{name}: resampled to {clock.rate:g} Hz (the stamps' nominal rate is"
            f" {clock.nominal:g} Hz; their steps are off by {clock.jitter_rms * 1e3:.3g} ms rms,"
            f" {clock.jitter_max * 1e3:.3g} ms at most)"
        )
    if clock.gaps:
        total = sum(stop - start for start, stop in clock.gaps)
        yield (
            f"{name}: {_counted(clock.gaps, 'gap')}, {total:.3g} s in all, the first at"
            f" {clock.gaps[0][0]:.6g} s, marked as not valid"
        )
    if log.left:
        yield f"{name}: {_counted(log.left, 'column')} not read: {listed(log.left)}"


def _counted(things: Sequence[object], word: str) -> str:
    return f"{len(things)} {word}{'' if len(things) == 1 else 's'}"
