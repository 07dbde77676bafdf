"""Signs that a run is not of the robot that it names: its joints' names and their limits.

Every command that reads a run asks here: `check_joints` refuses names that the robot lacks, and
`limit_warnings` says where limits are exceeded by far and for long. A limit that is exceeded for a
moment is what a fault looks like; another robot, or another unit, exceeds it all along.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from noisemodel import RobotError, Run, UnknownJointError, UnknownRobotError
from noisemodel.robot import Limits, joint_limits
from noisemodel.runfile import pieces
from noisemodel.types import Mask, Real

FAR_POSITION = 0.25
"""Share of a joint's range by which positions may be beyond its ends."""
FAR_VELOCITY = 1.5
"""Multiple of a joint's velocity limit that velocities may reach."""
LONG = 1.0
"""Time for which limits have to be exceeded, in [s]; of short runs, a tenth of their duration."""


class WrongRobotError(UnknownJointError):
    """A run names a joint that its robot does not have."""

    def __init__(self, joint: str, robot: str, known: Sequence[str]) -> None:
        super().__init__(joint, robot, known)
        self.args = (f"{self}; is it another robot? (--robot NAME; --robot none for no robot)",)


def check_joints(joints: Sequence[str], robot: str | None) -> tuple[str, ...]:
    """Joints of a robot that a run lacks, which are assumed stationary.

    Args:
        robot: The robot that it names; nothing is checked if that cannot be read.
    """
    known = _known(robot)
    for joint in _named(joints, known):
        if known and joint not in known:
            raise WrongRobotError(joint, str(robot), tuple(known))
    return tuple(name for name in known if name not in _named(joints, known))


def named(run: Run) -> Run:
    """Give joints that a run numbers, since its file does not name them, its robot's names."""
    names = _named(run.joint_names, _known(run.robot))
    if names == run.joint_names or len(names) != len(run.joint_names):
        return run
    same = run.desired_joint_names == run.joint_names
    desired = names if same else run.desired_joint_names
    return replace(run, joint_names=names, desired_joint_names=desired)


def _named(joints: Sequence[str], known: Mapping[str, Limits]) -> tuple[str, ...]:
    """Names of joints; the robot's names replace mere numbers if it has as many joints."""
    numbered = all(joint == f"joint{place}" for place, joint in enumerate(joints, start=1))
    if numbered and len(joints) <= len(known) and not set(joints) & set(known):
        return tuple(known)[: len(joints)]
    return tuple(joints)


def limit_warnings(run: Run) -> Iterator[str]:
    """Clauses on limits that are exceeded by far, for a second or a tenth of the run.

    Args:
        run: A run of a robot that has its joints.
    """
    if problem := _unreadable(run.robot):
        yield f"the joints are not checked: {problem}"
    if limits := _known(run.robot):
        watch = LimitWatch(run.joint_names, str(run.robot), limits)
        for rows in pieces(run.velocity):
            valid = run.mask[rows]
            position = None if run.position is None else run.position[rows][valid]
            watch.add(position, run.velocity[rows][valid])
        yield from watch.warnings(min(LONG * run.rate, 0.1 * float(run.mask.sum())))


class LimitWatch:
    """Counts, joint by joint, samples of a motion that are far beyond the limits.

    Args:
        joints: Names of the columns; those that the robot lacks have no limits.
        limits: Its joints' limits; read from the robot unless given.
    """

    def __init__(
        self, joints: Sequence[str], robot: str, limits: Mapping[str, Limits] | None = None
    ) -> None:
        known = _known(robot) if limits is None else limits
        self._joints, self._robot = tuple(joints), robot
        self._limits = [known.get(joint, Limits()) for joint in joints]
        span = np.array([each.upper - each.lower for each in self._limits])
        slack = np.where(np.isfinite(span), FAR_POSITION * span, 0.0)
        self._lower = np.array([each.lower for each in self._limits]) - slack
        self._upper = np.array([each.upper for each in self._limits]) + slack
        self._fast = FAR_VELOCITY * np.array([each.velocity for each in self._limits])
        self._counts = {name: np.zeros(len(joints), dtype=int) for name in ("position", "velocity")}
        self._farthest = {name: np.zeros(len(joints)) for name in self._counts}

    def add(self, position: Real | None, velocity: Real) -> None:
        """Count the samples of a stretch.

        Args:
            position: Shape (samples, joints), in [rad] or [m]; nan is not counted.
            velocity: Shape (samples, joints), in [rad/s] or [m/s].
        """
        if position is not None:
            self._note("position", position, (position < self._lower) | (position > self._upper))
        self._note("velocity", velocity, np.abs(velocity) > self._fast)

    def warnings(self, samples: float) -> Iterator[str]:
        """Clauses on the joints that were beyond a limit for so many samples."""
        for name, counts in self._counts.items():
            beyond = np.flatnonzero(counts > max(samples, 1.0))
            if not len(beyond):
                continue
            worst = int(beyond[np.argmax(counts[beyond])])
            limits, rate = self._limits[worst], "/s" if name == "velocity" else ""
            unit = ("rad" if limits.turns else "m") + rate
            allowed = (
                f"{limits.velocity:.3g}" if rate else f"{limits.lower:.3g} to {limits.upper:.3g}"
            )
            others = f" ({len(beyond) - 1} more joints too)" if len(beyond) > 1 else ""
            yield (
                f"{self._joints[worst]} reaches {self._farthest[name][worst]:.3g} {unit}, far"
                f" beyond the {allowed} {unit} of {self._robot}{others}: another robot or unit?"
            )

    def _note(self, name: str, values: Real, beyond: Mask) -> None:
        self._counts[name] += np.count_nonzero(beyond, axis=0)
        if beyond.any():
            outside = np.where(beyond, values, 0.0)
            farthest = self._farthest[name]
            for each in (outside.max(axis=0), outside.min(axis=0)):
                farthest = np.where(np.abs(each) > np.abs(farthest), each, farthest)
            self._farthest[name] = np.abs(farthest) if name == "velocity" else farthest


def _known(robot: str | None) -> Mapping[str, Limits]:
    """Limits of a robot's joints by name; empty without a robot that can be read."""
    try:
        return {} if robot is None else joint_limits(robot)
    except RobotError:
        return {}


def _unreadable(robot: str | None) -> str:
    """Why the file of a robot cannot be read; empty for a mere name, which tells runs apart."""
    try:
        _ = None if robot is None else joint_limits(robot)
    except UnknownRobotError:
        return ""
    except RobotError as error:
        return str(error)
    return ""
