"""The level of each link's vibration while samples come in, as in the recording of a whole run."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

import noisemodel as nm
from noisemodel.linkpower import by_moments, second_moments
from noisemodel.links import FAST, vibrating
from noisemodel.noise import REFERENCE_POWER, decibel
from noisemodel.types import Array

STEP = 0.2
"""Time over which a level is taken, in [s]."""


class Step(NamedTuple):
    """Levels of all links."""

    time: float
    """Start of the step, in [s]."""
    level: Array
    """Shape (links,), in [dB re 1 pW]; silence is at -inf."""


class LinkLevels:
    """Levels above 10 Hz of a robot's links, every 0.2 s, half a period of 10 Hz late.

    Args:
        robot: A robot's name, or the path of a URDF or an MJCF.
        joint_names: The joints that the samples are of.
        rate: Samples per second, in [Hz].
        floating: Whether the base moves.

    Attributes:
        links: Names of the links.

    Raises:
        RobotError: If the robot cannot be read.
        GeometryError: If its surface cannot be had.
    """

    def __init__(
        self, robot: str, joint_names: Sequence[str], rate: float, *, floating: bool
    ) -> None:
        self._robot = nm.Robot.load(robot, floating_base=True if floating else None)
        self._surface = nm.Surface.of(self._robot, "auto")
        self.links = self._surface.names
        by_name = {joint.name: joint for joint in self._robot.joints if joint.nv == 1}
        self._joints = [by_name[name] for name in joint_names]
        self._columns = [joint.first_v for joint in self._joints]
        self._size, self._half = max(1, round(STEP * rate)), max(1, round(rate / FAST / 2))
        self._rate = rate
        self.skip()

    def skip(self) -> None:
        """Begin anew after a gap."""
        self._velocity = np.empty((0, self._robot.nv))
        self._time, self._position = np.empty(0), np.empty((0, len(self._joints)))
        self._before = 0  # samples before the step that comes next

    def push(self, time: Array, signals: Mapping[str, Array]) -> list[Step]:
        """Take samples that follow each other.

        Args:
            time: Shape (samples,), in [s].
            signals: Velocities and positions, shape (samples, joints), and a base's velocity, shape
                (samples, 6), if there is one. A sample that is not finite begins anew.

        Returns:
            Levels of the steps that are complete now.
        """
        velocity = np.zeros((len(time), self._robot.nv))
        velocity[:, self._columns] = signals["velocity"]
        if self._robot.floating_base and "base_velocity" in signals:
            velocity[:, :6] = signals["base_velocity"]
        position = signals["position"]
        known = np.isfinite(velocity).all(axis=1) & np.isfinite(position).all(axis=1)
        if not known.all():
            last = int(np.flatnonzero(~known)[-1]) + 1
            self.skip()
            time, velocity, position = time[last:], velocity[last:], position[last:]
        self._time = np.concatenate((self._time, time))
        self._velocity = np.concatenate((self._velocity, velocity))
        self._position = np.concatenate((self._position, position))
        steps = []
        while len(self._time) >= self._before + self._size + self._half:
            steps.append(self._step())
        return steps

    def _step(self) -> Step:
        first, stop = self._before, self._before + self._size
        window = self._velocity[: stop + self._half]
        fast = vibrating(window, np.ones(len(window), dtype=bool), self._rate)[first:stop]
        moments = second_moments(fast, np.ones(self._size, dtype=bool), size=self._size)
        pose = self._pose(self._position[(first + stop) // 2])
        (power,) = by_moments(self._robot, self._surface, pose, [("normal", moments)])
        found = Step(float(self._time[first]), decibel(power[0] / REFERENCE_POWER))
        used = max(stop - self._half, 0)
        self._before = stop - used
        self._time, self._velocity = self._time[used:], self._velocity[used:]
        self._position = self._position[used:]
        return found

    def _pose(self, position: Array) -> Array:
        pose = self._robot.neutral[None].copy()
        for joint, angle in zip(self._joints, position.tolist(), strict=True):
            if joint.kind == "continuous":
                pose[0, joint.first_q : joint.first_q + 2] = np.cos(angle), np.sin(angle)
            else:
                pose[0, joint.first_q] = angle
        return pose
