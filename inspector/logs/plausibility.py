"""Signs that a run is not what it says: of another robot, in another unit, at another rate.

Every command that reads a run asks here. `check_joints` refuses names that the robot lacks;
`limit_warnings` says where limits are exceeded by far and for long, and `contradictions` where
velocities are not the slopes of their positions.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from inspector.logs.names import listed
from noisemodel import RobotError, Run, UnknownJointError, UnknownRobotError
from noisemodel.robot import Limits, joint_limits
from noisemodel.runfile import pieces
from noisemodel.types import Array, Mask, Real


class WrongRobotError(UnknownJointError):
    """A run names a joint that its robot does not have."""

    def __init__(self, joint: str, robot: str, known: Sequence[str]) -> None:
        super().__init__(joint, robot, known)
        self.args = (f"{self}; is it another robot? (--robot NAME; --robot none for no robot)",)


def known_limits(robot: str | None) -> tuple[Mapping[str, Limits], str]:
    """Limits of a robot's joints by name, or none, and why its file cannot be read."""
    try:
        return ({} if robot is None else joint_limits(robot)), ""
    except UnknownRobotError:  # a mere name, which tells runs apart
        return {}, ""
    except RobotError as error:
        return {}, str(error)


def check_joints(joints: Sequence[str], robot: str | None) -> tuple[str, ...]:
    """Joints of a robot that a run lacks, which are assumed stationary.

    Raises:
        WrongRobotError: If the run names a joint that the robot lacks; not if it cannot be read.
    """
    known, _ = known_limits(robot)
    names = _named(joints, known)
    if unknown := [name for name in names if known and name not in known]:
        raise WrongRobotError(unknown[0], str(robot), tuple(known))
    return tuple(name for name in known if name not in names)


def named(run: Run) -> Run:
    """Give joints that a run numbers, since its file does not name them, its robot's names."""
    names = _named(run.joint_names, known_limits(run.robot)[0])
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


# Limits of a robot: a moment beyond them is what a fault looks like; another robot, or another
# unit, exceeds them all along.

FAR_POSITION = 0.25  # share of a joint's range by which positions may be beyond its ends
FAR_VELOCITY = 1.5  # multiple of a joint's velocity limit that velocities may reach
# Time for which limits have to be exceeded, in [s]; of short runs, a tenth of their duration.
LONG = 1.0


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
        lower, upper, velocity = (
            np.array([(each.lower, each.upper, each.velocity) for each in self._limits])
            .reshape(-1, 3)
            .T
        )
        span = upper - lower
        slack = np.where(np.isfinite(span), FAR_POSITION * span, 0.0)
        self._lower, self._upper = lower - slack, upper + slack
        self._fast = FAR_VELOCITY * velocity
        self._counts = {name: np.zeros(len(joints), dtype=int) for name in ("position", "velocity")}
        self._farthest = {name: np.zeros(len(joints)) for name in self._counts}

    def add(self, position: Real | None, velocity: Real) -> None:
        """Count the samples of a stretch, shape (samples, joints), in SI; nan is not counted."""
        if position is not None:
            self._note("position", position, (position < self._lower) | (position > self._upper))
        self._note("velocity", velocity, np.abs(velocity) > self._fast)

    def _note(self, name: str, values: Real, beyond: Mask) -> None:
        self._counts[name] += np.count_nonzero(beyond, axis=0)
        if beyond.any():
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


# Velocities beside positions

# Warnings by the ratio of velocities to the slope of positions.
FACTORS: Mapping[float, str] = {
    180 / np.pi: "velocities look like degrees per second beside positions in radians",
    np.pi / 180: "positions look like degrees beside velocities in radians per second",
    30 / np.pi: "velocities look like turns per minute beside positions in radians",
}
# Largest relative deviation from a factor, less than half the distance of two of them.
NEAR_FACTOR = 0.02
STRETCH = 0.2  # time over which velocities are integrated and compared with positions, in [s]
# Largest relative deviation of a velocity from the slope of its position: filters attenuate.
AGREE = 0.2
# Correlation of the two from which a factor is one, and below which they have no relation.
RELATED, UNRELATED = 0.9, 0.3
# Root mean square of the way in a stretch from which a joint is compared, in [rad] or [m].
WAY = 0.02
ENOUGH = 5  # fewest stretches


def derived(run: Run, signal: str) -> bool:
    """Whether a run's ``meta`` states that a signal was differentiated at import."""
    differentiated = run.meta.get("differentiated")
    return isinstance(differentiated, Mapping) and signal in differentiated


def contradictions(run: Run) -> Iterator[str]:
    """Clauses on velocities that are not the slopes of their positions."""
    ways = None if run.position is None or derived(run, "velocity") else _ways(run)
    if ways is None:
        return
    way, summed = ways
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
        yield (
            f"velocities of {_joints(run, strange)} have no relation to the slopes of their"
            f" positions (correlation {float(correlation[strange].max()):.2g})"
        )
    if wrong.any():
        least, most = (f"{each:.3g}" for each in (factor[wrong].min(), factor[wrong].max()))
        size = least if least == most else f"{least} to {most}"
        yield (
            f"velocities of {_joints(run, wrong)} are {size} times the slopes of their positions:"
            " another unit, or another rate?"
        )


def _joints(run: Run, chosen: Mask) -> str:
    names = [name for name, is_one in zip(run.joint_names, chosen, strict=True) if is_one]
    return "all joints" if len(names) == len(run.joint_names) > 1 else listed(names)


def _ways(run: Run) -> tuple[Array, Array] | None:
    """Changes of positions, and integrals of velocities, over stretches without a gap."""
    assert run.position is not None
    length = max(2, round(STRETCH * run.rate))
    starts = np.arange(0, len(run.time) - length, length)
    gaps = np.concatenate(([0], np.cumsum(~run.mask)))
    starts = starts[gaps[starts + length + 1] == gaps[starts]]
    if not len(starts):
        return None
    way = run.position[starts + length].astype(np.float64) - run.position[starts]
    whole = run.velocity[: len(run.time) // length * length]
    sums = whole.reshape(-1, length, way.shape[1]).sum(axis=1, dtype=np.float64)[starts // length]
    ends = (run.velocity[starts + length].astype(np.float64) - run.velocity[starts]) / 2
    summed = (sums + ends) / run.rate  # trapezoids
    turn = 2 * np.pi  # of an angle that wraps: it stays within a turn, and jumps
    wraps = np.abs(np.ptp(run.position, axis=0) - turn) < 0.1 * turn
    return np.where(wraps, way - turn * np.round((way - summed) / turn), way), summed
