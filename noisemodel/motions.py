"""The robots of a comparison, and the motion that each of them makes."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np

from noisemodel.errors import NoiseModelError, RobotError, RunError, UnknownMotionError
from noisemodel.excitation import RATE, excitation
from noisemodel.robot import Robot
from noisemodel.run import Block, Run, is_robot_file, part, stretches
from noisemodel.speed import check_motion
from noisemodel.types import Array, Real

EXCITATION = "excitation"
MOTIONS: Mapping[str, Callable[..., Run]] = MappingProxyType({EXCITATION: excitation})
"""The built-in motions: each takes a robot, a seed and a rate in [Hz], and returns a run."""

Source: TypeAlias = Robot | Run | Path | str
"""A robot, its listed name or the path of its URDF or MJCF; or a run, or the path of a run file."""

Motion: TypeAlias = Run | tuple[Real, Real] | str
"""A run, a pair of q and v, or the name of a built-in motion."""

Motions: TypeAlias = Motion | Sequence[Motion] | Mapping[Any, Motion]
"""One motion for all robots, one for each in their order, or one by each robot's name."""


@dataclass(frozen=True, eq=False)
class Moving:
    """A robot and its motion.

    Attributes:
        robot: The robot.
        joints: How many joints the motion has.
        q: Configurations, shape (samples, nq).
        v: Velocities, shape (samples, nv).
        time: Of the samples, shape (samples,), in [s].
        rate: Sample rate, in [Hz].
        events: What should stand out.
        remarks: What is left out or assumed, a sentence each.
    """

    robot: Robot
    joints: int
    q: Real
    v: Real
    time: Array
    rate: float
    events: tuple[Block, ...] = ()
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Task:
    """A robot that has not been read yet, and what moves it.

    Attributes:
        name: The robot, or the run file.
        source: The robot, or the run that names it.
        motion: Its motion; None for a run, which brings its own.
        rate: Sample rate of a pair or a built-in motion, in [Hz].
        seed: Random seed of a built-in motion.
    """

    name: str
    source: Source
    motion: Motion | None
    rate: float | None
    seed: int

    def moving(self) -> Moving:
        """Read the robot and move it.

        Raises:
            MotionError: If a pair of q and v is not this robot's.
            NoiseModelError: If the robot or the run cannot be read, or the run does not suffice.
        """
        source, motion = self.source, self.motion
        if isinstance(source, Run):
            motion = source
        elif motion is None:
            assert not isinstance(source, Robot)
            motion = Run.load(source)
        if isinstance(motion, Run):
            return _measured(source, motion)
        if isinstance(motion, str):
            robot, remarks = _coupled(source)
            rate = RATE if self.rate is None else self.rate
            run = MOTIONS[motion](robot, seed=self.seed, rate=rate)
            return _of_run(robot, run, remarks)
        robot, (q, v) = _read(source), motion
        check_motion(robot, q, v)
        assert self.rate is not None
        time = np.arange(len(q)) / self.rate
        return Moving(robot, len(robot.joint_names), q, v, time, self.rate)


def tasks(
    robots: Source | Iterable[Source], motion: Motions, *, rate: float | None, seed: int
) -> list[Task]:
    """Match motions to robots; nothing is read yet.

    Args:
        robots: One or many.
        motion: What moves those that are no runs.
        rate: Sample rate of pairs and built-in motions, in [Hz].
        seed: Random seed of built-in motions.

    Returns:
        A task for each robot.

    Raises:
        UnknownMotionError: If a built-in motion does not exist.
        NoiseModelError: If there are no robots, not as many motions as robots, something of
            another type, or a rate that is missing or superfluous.
    """
    sources = [robots] if isinstance(robots, Source) else list(robots)
    if not sources:
        raise NoiseModelError("no robots to compare")
    for source in sources:
        if not isinstance(source, Source):
            raise NoiseModelError(
                f"a robot is of type {type(source).__name__}, expected a Robot, a listed name, the"
                " path of a URDF, or a run"
            )
    motions = _motions(motion, [_name(source) for source in sources if not _is_run(source)])
    if rate is not None and all(isinstance(one, Run) for one in motions):
        raise NoiseModelError(f"a rate of {rate:g} Hz is given, but runs have their own")
    if rate is None and any(_is_pair(one) for one in motions):
        raise NoiseModelError("a motion of q and v needs the rate of its samples, in Hz")
    if seed < 0:
        raise NoiseModelError(f"seed is {seed}, expected 0 or more")
    rest = iter(motions)
    return [
        Task(_name(source), source, None if _is_run(source) else next(rest), rate, seed)
        for source in sources
    ]


def _motions(motion: Motions, names: Sequence[str]) -> list[Motion]:
    """List the motion of each robot."""
    motions: list[Any]
    if isinstance(motion, Mapping):
        named = {_name(key): one for key, one in motion.items()}
        if set(named) != set(names):
            raise NoiseModelError(
                f"motions are for {', '.join(named) or 'no robot'},"
                f" expected one for each of {', '.join(names)}"
            )
        motions = [named[name] for name in names]
    elif isinstance(motion, list | tuple) and not _is_pair(motion):
        motions = list(motion)
        if len(motions) != len(names):
            raise NoiseModelError(f"{len(motions)} motions for {len(names)} robots")
    else:
        motions = [motion] * len(names)
    for one in motions:
        if isinstance(one, str) and one not in MOTIONS:
            raise UnknownMotionError(one, MOTIONS)
        if not isinstance(one, str | Run) and not _is_pair(one):
            raise NoiseModelError(
                f"a motion is of type {type(one).__name__}, expected a Run, a pair (q, v), or the"
                f" name of a built-in one: {', '.join(MOTIONS)}"
            )
    return motions


def _is_pair(motion: object) -> bool:
    """Whether a motion is a pair of arrays; a sequence of motions is none."""
    return (
        isinstance(motion, list | tuple)
        and len(motion) == 2
        and all(isinstance(array, np.ndarray) for array in motion)
    )


def _is_run(source: Source) -> bool:
    """Whether a source is a run or a run file."""
    if isinstance(source, Path):
        return not is_robot_file(source.name)
    return isinstance(source, Run) or (isinstance(source, str) and source.endswith(".npz"))


def _name(source: Source) -> str:
    if isinstance(source, Robot):
        return source.name
    return source.robot or "run" if isinstance(source, Run) else str(source)


def _read(source: Source, *, floating_base: bool | None = None, mimic: bool = False) -> Robot:
    if isinstance(source, str | Path):
        return Robot.load(source, floating_base=floating_base, mimic=mimic)
    assert isinstance(source, Robot)
    return source


def _coupled(source: Source) -> tuple[Robot, tuple[str, ...]]:
    """Read a robot with its mimic joints coupled, if they can be."""
    try:
        return _read(source, mimic=True), ()
    except RobotError:
        robot = _read(source)  # a mimic joint may name one that the URDF does not have
        return robot, ("Its mimic joints cannot be coupled: they move independently.",)


def _measured(source: Source, run: Run) -> Moving:
    """Move a robot as a run did in its longest stretch without gaps.

    Args:
        source: The robot, or the run or the run file that names it.
        run: The run.
    """
    if _is_run(source):
        if run.robot is None:
            raise RunError("the run names no robot; `inspector import --robot` adds one")
        source = run.robot
    if run.position is None:
        raise RunError("the run has no positions, which the extended noise needs")
    floating = run.base_pose is not None or run.base_velocity is not None
    robot = _read(source, floating_base=True if floating else None)
    remarks = []
    if not run.mask.all():
        run = _longest(run)
        remarks.append(f"The run has gaps: compared from {run.time[0]:.2f} s on.")
    missing = [joint for joint in robot.joint_names if joint not in run.joint_names]
    if missing:
        remarks.append(f"Not in the log, assumed stationary: {', '.join(missing)}.")
    return _of_run(robot, run, tuple(remarks))


def _of_run(robot: Robot, run: Run, remarks: tuple[str, ...]) -> Moving:
    q, v = robot.configuration(run)
    events = tuple(block for block in run.blocks if block.label != "ok")
    return Moving(robot, len(run.joint_names), q, v, run.time, run.rate, events, remarks)


def _longest(run: Run) -> Run:
    """Cut the longest stretch without a gap out of a run, with the blocks that lie in it."""
    parts = stretches(run.mask, len(run.time))
    longest = max(parts, key=lambda each: each.stop - each.start, default=slice(0, 1))
    time = run.time[longest]
    within = [b for b in run.blocks if b.start >= time[0] and b.stop <= time[-1]]
    return part(run, longest.start, longest.stop, blocks=tuple(within))
