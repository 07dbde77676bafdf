"""The loop that moves a robot: a tick of control, then ten samples of drives and physics."""

from dataclasses import dataclass, fields
from typing import Any, Protocol, Self

import mujoco
import numpy as np

from noisemodel.types import Array
from scenarios.clock import STEPS, TICK
from scenarios.drives import Drives
from scenarios.errors import DivergedError

FASTEST = 50.0
"""A joint that is faster than this has diverged, in [rad/s] or [m/s]."""

_S = np.arange(STEPS)[:, None] / STEPS
_POSITION = np.hstack(
    (
        2 * _S**3 - 3 * _S**2 + 1,
        3 * _S**2 - 2 * _S**3,
        TICK * (_S**3 - 2 * _S**2 + _S),
        TICK * (_S**3 - _S**2),
    )
)
"""Cubic Hermite polynomials at the samples of a tick: from the values and slopes at its ends."""
_VELOCITY = np.hstack(
    (6 * (_S**2 - _S) / TICK, 6 * (_S - _S**2) / TICK, 3 * _S**2 - 4 * _S + 1, 3 * _S**2 - 2 * _S)
)
"""Their slopes."""


@dataclass(frozen=True, eq=False)
class Reference:
    """What the joints are to do from one tick to the next.

    Attributes:
        position: At the two ticks, shape (2, joints), in [rad].
        velocity: At the two ticks, shape (2, joints), in [rad/s].
        planned: Velocity that the plan alone asks for, at the two ticks, shape (2, joints).
        torque: What the model predicts to need, shape (joints,), in [N m].
        lift: Movement of the joints per height of the tool, shape (joints,), in [rad/m].
    """

    position: Array
    velocity: Array
    planned: Array
    torque: Array
    lift: Array


class Control(Protocol):
    """Anything that turns a plan and the sensors into references."""

    def tick(self, number: int, sensors: Array) -> Reference:
        """Advance by one tick, with the mean of each sensor over the tick before."""
        ...


@dataclass(frozen=True, eq=False)
class Motion:
    """What was recorded, before rounding.

    Attributes:
        position: As the drives report it, shape (samples, joints), in [rad].
        velocity: As the drives report it, shape (samples, joints), in [rad/s].
        position_desired: What the drives follow, shape (samples, joints), in [rad].
        velocity_desired: What the drives follow, shape (samples, joints), in [rad/s].
        planned: Velocities of the plan alone, shape (samples, joints), in [rad/s].
        commanded: Velocities that the controller asks for, shape (samples, joints), in [rad/s].
        torque: Of the drives, shape (samples, joints), in [N m].
        sensors: True values of the sensors, shape (samples, sensors).
    """

    position: Array
    velocity: Array
    position_desired: Array
    velocity_desired: Array
    planned: Array
    commanded: Array
    torque: Array
    sensors: Array

    @classmethod
    def empty(cls, samples: int, joints: int, sensors: int) -> Self:
        """Make room for a recording."""
        widths = [joints] * (len(fields(cls)) - 1) + [sensors]
        return cls(*(np.zeros((samples, width)) for width in widths))

    def since(self, sample: int) -> "Motion":
        """Leave out what came before a sample."""
        return Motion(*(getattr(self, field.name)[sample:] for field in fields(self)))


def record(
    model: Any,
    start: Array,
    drives: Drives,
    control: Control,
    *,
    encoder_noise: Array,
    sensor_error: Array,
    overlay: Array,
    settling: int,
) -> Motion:
    """Move a robot.

    Args:
        model: The ``mujoco.MjModel``; its actuators are the joints.
        start: True joint positions at first, shape (joints,), in [rad].
        drives: The robot's drives.
        control: The robot's controller.
        encoder_noise: Shape (samples, joints), in [rad].
        sensor_error: Added to what the sensors tell the controller, shape (ticks, sensors).
        overlay: Height of the tool and its rate, added to what the drives follow,
            shape (samples, 2), in [m] and [m/s].
        settling: Ticks before the recording, in which the robot comes to rest.

    Returns:
        What was recorded.

    Raises:
        DivergedError: If a joint is too fast, or its position is no number any more.
    """
    data = mujoco.MjData(model)
    data.qpos[:] = start
    motion = Motion.empty(len(encoder_noise), len(start), model.nsensordata)
    sensors = np.zeros(model.nsensordata)
    for tick, error in enumerate(sensor_error):
        now = slice(tick * STEPS, (tick + 1) * STEPS)
        reference = control.tick(tick, sensors + error)
        ends = np.concatenate((reference.position, reference.velocity))
        motion.commanded[now] = _VELOCITY @ ends
        motion.planned[now] = (1 - _S) * reference.planned[0] + _S * reference.planned[1]
        wave = overlay[now, :, None] * reference.lift
        targets = motion.position_desired[now] = _POSITION @ ends + wave[:, 0]
        rates = motion.velocity_desired[now] = motion.commanded[now] + wave[:, 1]
        for step, sample in enumerate(range(now.start, now.stop)):
            position, velocity = drives.read(data.qpos, encoder_noise[sample])
            torque = drives.torque(position, velocity, targets[step], rates[step], reference.torque)
            data.ctrl[:] = torque
            mujoco.mj_step(model, data)
            motion.position[sample], motion.velocity[sample] = position, velocity
            motion.torque[sample], motion.sensors[sample] = torque, data.sensordata
        sensors = motion.sensors[now].mean(axis=0)
        fastest = np.abs(data.qvel).max()
        if not fastest < FASTEST:  # also true of no number
            time = (tick + 1 - settling) * TICK
            raise DivergedError(time, f"a joint moved at {fastest:.3g} rad/s")
    return motion.since(settling * STEPS)
