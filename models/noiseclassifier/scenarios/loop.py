"""The simulation loop: one tick of control, then ten samples of drives and physics."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, Protocol, Self

import mujoco
import numpy as np

from noiseclassifier.scenarios.drives import Drives
from noiseclassifier.scenarios.errors import DivergedError
from noiseclassifier.scenarios.forces import Force
from noiseclassifier.scenarios.motions import STEP, STEPS, TICK, Event
from noiseclassifier.scenarios.world import set_collision
from noisemodel.types import Array

FASTEST = 50.0  # A joint that is faster than this has diverged, in [rad/s] or [m/s]
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
    """Reference of the joints at the end of a tick, which drives reach from the one before."""

    position: Array  # shape (joints,), in [rad]
    velocity: Array  # shape (joints,), in [rad/s]
    planned: Array  # velocity of the plan alone, shape (joints,), in [rad/s]
    torque: Array  # feed-forward torque of the model, shape (joints,), in [N m]
    lift: Array  # of the joints per height of each effector, shape (effectors, joints), in [rad/m]


class Control(Protocol):
    """A controller: from a plan and the sensors to references."""

    def tick(self, number: int, sensors: Array) -> Reference:
        """Advance by one tick, with the mean of each sensor over the tick before."""
        ...


@dataclass(frozen=True, eq=False)
class Scene:
    """A robot in its environment, ready to be simulated."""

    model: Any
    start: Array
    control: Control
    effectors: int
    settling: int
    noise: Array  # standard deviation of each sensor's noise per tick, shape (sensors,)
    changes: Mapping[int, Sequence[tuple[int, bool]]] = field(default_factory=dict)
    forces: tuple[Force, ...] = ()
    fallen: Callable[[Array], bool] = lambda _: False  # by the sensors' means over a tick

    @property
    def events(self) -> tuple[Event, ...]:
        """The events that forces from outside were the cause of so far."""
        return tuple(event for force in self.forces for event in force.events())


@dataclass(frozen=True, eq=False)
class Motion:
    """The recorded signals, before rounding; of a fixed base, the last two have no columns."""

    position: Array  # as the drives report it, shape (samples, joints), in [rad]
    velocity: Array  # as the drives report it, shape (samples, joints), in [rad/s]
    position_desired: Array  # reference of the drives, shape (samples, joints), in [rad]
    velocity_desired: Array  # reference of the drives, shape (samples, joints), in [rad/s]
    planned: Array  # velocities of the plan alone, shape (samples, joints), in [rad/s]
    commanded: Array  # velocities that the controller demands, shape (samples, joints), in [rad/s]
    torque: Array  # as the drives measure it, shape (samples, joints), in [N m]
    contact: Array  # true contact force of each effector, shape (samples, effectors), in [N]
    base_pose: Array  # place and quaternion (w, x, y, z), shape (samples, 7)
    base_velocity: Array  # linear in the world's axes, angular in its own, shape (samples, 6)

    @classmethod
    def empty(cls, samples: int, joints: int, effectors: int, *, floating: bool) -> Self:
        """Zeros for a recording."""
        base = [7, 6] if floating else [0, 0]
        return cls(*(np.zeros((samples, width)) for width in [*[joints] * 7, effectors, *base]))

    def since(self, sample: int) -> "Motion":
        """The signals from a sample on."""
        return Motion(*(getattr(self, field.name)[sample:] for field in fields(self)))


def _between(before: Reference, after: Reference) -> tuple[Array, Array, Array]:
    """Positions, velocities, and velocities of the plan, at the samples between two ticks."""
    ends = np.stack((before.position, after.position, before.velocity, after.velocity))
    planned = (1 - _S) * before.planned + _S * after.planned
    return _POSITION @ ends, _VELOCITY @ ends, planned


def record(
    scene: Scene,
    drives: Drives,
    *,
    encoder_error: Array,
    sensor_error: Array,
    overlay: Array | None = None,
) -> Motion:
    """Simulate a robot, with errors of encoders and sensors of shapes (samples or ticks, values).

    The overlay is added to the reference of the drives: heights of the effectors and their rates,
    shape (samples, effectors, 2), in [m] and [m/s].
    """
    model, control = scene.model, scene.control
    data = mujoco.MjData(model)
    data.qpos[:] = scene.start
    samples, joints = encoder_error.shape
    base = model.nq - joints
    motion = Motion.empty(samples, joints, scene.effectors, floating=base > 0)
    joint_position, joint_velocity = data.qpos[-joints:], data.qvel[-joints:]
    base_pose, base_velocity = data.qpos[:base], data.qvel[:-joints]
    effector_force, sensed = data.sensordata[: scene.effectors], data.sensordata
    readings, sensors = np.zeros((STEPS, model.nsensordata)), np.zeros(model.nsensordata)
    still, before = np.zeros(joints), None
    for tick, error in enumerate(sensor_error):
        now = slice(tick * STEPS, (tick + 1) * STEPS)
        for geom, present in scene.changes.get(tick - scene.settling, ()):
            set_collision(model, geom, present=present)
        reference = control.tick(tick, sensors + error)
        before = before or replace(reference, velocity=still, planned=still)  # robots start at rest
        targets, rates, motion.planned[now] = _between(before, reference)
        motion.commanded[now], before = rates, reference
        if overlay is not None:
            wave = np.einsum("seo,ej->osj", overlay[now], reference.lift)
            targets, rates = targets + wave[0], rates + wave[1]
        targets, rates, torque = drives.command(targets, rates, reference.torque)
        motion.position_desired[now], motion.velocity_desired[now] = targets, rates
        for step, sample in enumerate(range(now.start, now.stop)):
            position, velocity = drives.read(joint_position, encoder_error[sample])
            acting = drives.torque(position, velocity, targets[step], rates[step], torque)
            data.ctrl[:] = acting
            motion.position[sample], motion.velocity[sample] = position, velocity
            motion.torque[sample] = drives.measured(acting)
            if base:
                motion.base_pose[sample], motion.base_velocity[sample] = base_pose, base_velocity
            if scene.forces:
                data.qfrc_applied[:] = 0.0
                for force in scene.forces:
                    force.apply(data, (sample - scene.settling * STEPS) * STEP)
            mujoco.mj_step(model, data)
            readings[step], motion.contact[sample] = sensed, effector_force
        sensors = readings.mean(axis=0)
        time = (tick + 1 - scene.settling) * TICK
        fastest = np.abs(joint_velocity).max()
        if not fastest < FASTEST:  # also true of NaN
            raise DivergedError(time, f"a joint moved at {fastest:.3g} rad/s")
        if scene.fallen(sensors):
            raise DivergedError(time, "it fell")
    return motion.since(scene.settling * STEPS)
