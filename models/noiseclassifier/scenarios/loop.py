"""The simulation loop: one tick of control, then ten samples of drives and physics."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, Protocol, Self

import mujoco
import numpy as np

from noiseclassifier.scenarios.drives import Drives
from noiseclassifier.scenarios.errors import DivergedError
from noiseclassifier.scenarios.labels import APART, IMPACT
from noiseclassifier.scenarios.motions import (
    STEP,
    STEPS,
    TICK,
    Collision,
    Event,
    JointStop,
    Load,
    Payload,
    Push,
    minimum_jerk,
)
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
    """Reference of the joints from one tick to the next.

    Attributes:
        position: At the two ticks, shape (2, joints), in [rad].
        velocity: At the two ticks, shape (2, joints), in [rad/s].
        planned: Velocity of the plan alone, at the two ticks, shape (2, joints).
        torque: Feed-forward torque of the model, shape (joints,), in [N m].
        lift: Movement of the joints per height of each effector, shape (effectors, joints),
            in [rad/m].
    """

    position: Array
    velocity: Array
    planned: Array
    torque: Array
    lift: Array


class Control(Protocol):
    """A controller: from a plan and the sensors to references."""

    def tick(self, number: int, sensors: Array) -> Reference:
        """Advance by one tick, with the mean of each sensor over the tick before."""
        ...

    def fallen(self, sensors: Array) -> bool:
        """Whether the robot has fallen, by the sensors' means over the tick before."""
        ...


class Force(Protocol):
    """A force on the robot from outside, other than that of contacts."""

    def apply(self, data: Any, sample: int) -> None:
        """Add to ``data.qfrc_applied`` before a step, its sample counted from the recording."""
        ...

    def events(self) -> tuple[Event, ...]:
        """The events that it was the cause of so far."""
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

    @property
    def events(self) -> tuple[Event, ...]:
        """The events that forces from outside were the cause of so far."""
        return tuple(event for force in self.forces for event in force.events())


@dataclass(frozen=True, eq=False)
class Motion:
    """The recorded signals, before rounding.

    Attributes:
        base_pose: True pose of a floating base, as MuJoCo has it (quaternion w, x, y, z),
            shape (samples, 7), or (samples, 0).
        base_velocity: Its velocity, as MuJoCo has it (linear in the world's axes, angular in its
            own), shape (samples, 6), or (samples, 0).
    """

    position: Array  # as the drives report it, shape (samples, joints), in [rad]
    velocity: Array  # as the drives report it, shape (samples, joints), in [rad/s]
    position_desired: Array  # reference of the drives, shape (samples, joints), in [rad]
    velocity_desired: Array  # reference of the drives, shape (samples, joints), in [rad/s]
    planned: Array  # velocities of the plan alone, shape (samples, joints), in [rad/s]
    commanded: Array  # velocities that the controller demands, shape (samples, joints), in [rad/s]
    torque: Array  # as the drives measure it, shape (samples, joints), in [N m]
    contact: Array  # true contact force of each effector, shape (samples, effectors), in [N]
    base_pose: Array
    base_velocity: Array

    @classmethod
    def empty(cls, samples: int, joints: int, effectors: int, *, floating: bool) -> Self:
        """Zeros for a recording."""
        base = [7, 6] if floating else [0, 0]
        return cls(*(np.zeros((samples, width)) for width in [*[joints] * 7, effectors, *base]))

    def since(self, sample: int) -> "Motion":
        """The signals from a sample on."""
        return Motion(*(getattr(self, field.name)[sample:] for field in fields(self)))


def record(
    scene: Scene,
    drives: Drives,
    *,
    encoder_error: Array,
    sensor_error: Array,
    overlay: Array | None = None,
) -> Motion:
    """Simulate a robot.

    Args:
        encoder_error: Error of the encoders, shape (samples, joints), in [rad].
        sensor_error: Added to the sensor values of the controller, shape (ticks, sensors).
        overlay: Heights of the effectors and their rates, added to the reference of the
            drives, shape (samples, effectors, 2), in [m] and [m/s].
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
    readings = np.zeros((STEPS, model.nsensordata))
    sensors = np.zeros(model.nsensordata)
    for tick, error in enumerate(sensor_error):
        now = slice(tick * STEPS, (tick + 1) * STEPS)
        for geom, present in scene.changes.get(tick - scene.settling, ()):
            set_collision(model, geom, present=present)
        reference = control.tick(tick, sensors + error)
        ends = np.concatenate((reference.position, reference.velocity))
        targets, rates = _POSITION @ ends, _VELOCITY @ ends
        motion.commanded[now] = rates
        motion.planned[now] = (1 - _S) * reference.planned[0] + _S * reference.planned[1]
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
                    force.apply(data, sample - scene.settling * STEPS)
            mujoco.mj_step(model, data)
            readings[step], motion.contact[sample] = sensed, effector_force
        sensors = readings.mean(axis=0)
        time = (tick + 1 - scene.settling) * TICK
        fastest = np.abs(joint_velocity).max()
        if not fastest < FASTEST:  # also true of NaN
            raise DivergedError(time, f"a joint moved at {fastest:.3g} rad/s")
        if control.fallen(sensors):
            raise DivergedError(time, "it fell")
    return motion.since(scene.settling * STEPS)


SLOWEST = 0.03  # least speed of an effector that collides, in [m/s]
PATIENCE = 0.5  # how long an obstacle waits for an effector to be that fast, in [s]
LOOSE = 0.08  # time in which an obstacle breaks loose, in [s]
SLIDING = 0.25
"""Share of its force that it resists with from then on: drives that hold it off for long would be
saturated, and let the arm fly off at the end."""
RELEASED = 0.2  # least duration of a contact whose end is an event of its own, in [s]
DISSIPATION = 1.5
"""Damping of a contact per depth and stiffness, in [s/m] (Hunt and Crossley, Coefficient of
restitution interpreted as damping in vibroimpact, J. Applied Mechanics 1975): no force at the
moment of the contact, unlike a damper beside a spring."""


def forces(model: Any, loads: Iterable[Load]) -> tuple[Force, ...]:
    """Forces of a simulation."""
    return tuple(_force(model, load) for load in loads)


def _force(model: Any, load: Load) -> Force:
    if isinstance(load, Payload):
        return _Weight(model, load)
    if isinstance(load, Collision):
        return _Obstacle(model, load)
    return _Hand(model, load) if isinstance(load, Push) else _Stop(load)


class _Point:
    """The point that an effector moves: where it is, how fast, and a force on it."""

    def __init__(self, model: Any, frame: str) -> None:
        self._model, self._site = model, model.site(frame).id
        self._jacobian = np.zeros((3, model.nv))

    def locate(self, data: Any) -> tuple[Array, Array]:
        """Position, in [m], and velocity, in [m/s], each of shape (3,)."""
        mujoco.mj_jacSite(self._model, data, self._jacobian, None, self._site)
        return data.site_xpos[self._site].copy(), self._jacobian @ data.qvel

    def push(self, data: Any, force: Array) -> None:
        """Add a force, shape (3,), in [N], at the point where it was located."""
        data.qfrc_applied += self._jacobian.T @ force


class _Touches:
    """The contacts of one load, as events."""

    def __init__(self, cause: str) -> None:
        self._cause = cause
        self._touches: list[list[float]] = []  # start, last time, largest force, impulse

    def add(self, time: float, force: float) -> None:
        """Add a sample with a force."""
        if not self._touches or time - self._touches[-1][1] > APART:
            self._touches.append([time, time, 0.0, 0.0])
        touch = self._touches[-1]
        touch[1] = time
        if time < touch[0] + IMPACT:
            touch[2], touch[3] = max(touch[2], force), touch[3] + force * STEP

    def events(self, **facts: float) -> tuple[Event, ...]:
        """One impact per contact, with its largest force and its impulse."""
        return tuple(
            Event("impact", self._cause, start, min(max(last, start + STEP), start + IMPACT),
                  {"force": force, "impulse": impulse, **facts})
            for start, last, force, impulse in self._touches
        )  # fmt: skip

    def releases(self, **facts: float) -> tuple[Event, ...]:
        """The end of each contact of some duration: the joints catch up with their references."""
        return tuple(
            Event(
                "highaccelerations", f"release from the {self._cause}", last, last + IMPACT, facts
            )
            for start, last, _, _ in self._touches
            if last > start + RELEASED
        )


class _Weight:
    """The weight of a payload."""

    def __init__(self, model: Any, load: Payload) -> None:
        self._point, self._load = _Point(model, load.frame), load
        self._gravity = model.opt.gravity.copy()

    def apply(self, data: Any, sample: int) -> None:
        """Pull at the effector."""
        load, time = self._load, sample * STEP
        if not load.start < time < load.stop + load.rise:
            return
        edges = np.array([time - load.start, time - load.stop]) / load.rise
        up, down = minimum_jerk(np.clip(edges, 0, 1))
        self._point.locate(data)
        self._point.push(data, load.mass * (up - down) * self._gravity)

    def events(self) -> tuple[Event, ...]:
        """None: a payload is no fault."""
        return ()


class _Obstacle:
    """An obstacle in the air: a face across the path, which is pushed away by a large force."""

    def __init__(self, model: Any, load: Collision) -> None:
        self._point, self._load = _Point(model, load.frame), load
        self._face: Array | None = None
        self._across = np.zeros(3)
        self._since = np.inf
        self._done = False
        self._touches = _Touches("collision with an obstacle")

    def apply(self, data: Any, sample: int) -> None:
        """Push against the effector's motion."""
        load, time = self._load, sample * STEP
        if self._done or time < load.start:
            return
        place, velocity = self._point.locate(data)
        if self._face is None:
            speed = float(np.linalg.norm(velocity))
            self._done = time > load.start + PATIENCE
            if speed < SLOWEST or self._done:
                return
            self._face, self._across, self._since = place, velocity / speed, time
        loose, fade = minimum_jerk(
            np.clip((time - self._since) / np.array([LOOSE, LOOSE + load.hold]), 0, 1)
        )
        limit = load.limit * (1 - (1 - SLIDING) * loose) * (1 - fade)
        depth = float((place - self._face) @ self._across)
        self._done = fade == 1.0
        if depth <= 0:
            return
        rate = float(velocity @ self._across)
        force = load.stiffness * depth * max(1 + DISSIPATION * rate, 0.0)
        if force > limit:  # the obstacle moves on, and does not come back
            self._face = self._face + (depth - limit / load.stiffness) * self._across
            force = limit
        if force > 0:
            self._touches.add(time, force)
            self._point.push(data, -force * self._across)

    def events(self) -> tuple[Event, ...]:
        """An impact, if the effector met it; touching it again is leaning on it."""
        return self._touches.events(stiffness=self._load.stiffness, limit=self._load.limit)[:1]


class _Stop:
    """A spring and damper at the end of a joint's range."""

    def __init__(self, load: JointStop) -> None:
        self._load, self._touches = load, _Touches("end stop of a joint")

    def apply(self, data: Any, sample: int) -> None:
        """Push back."""
        load = self._load
        depth = load.side * (data.qpos[load.joint] - load.angle)
        if depth <= 0 or sample < 0:
            return
        rate = load.side * data.qvel[load.joint]
        torque = load.stiffness * float(depth) * max(1 + DISSIPATION * float(rate), 0.0)
        self._touches.add(sample * STEP, torque)
        data.qfrc_applied[load.joint] -= load.side * torque

    def events(self) -> tuple[Event, ...]:
        """An impact each time that the joint meets the stop, and its release if that is later."""
        facts = {"joint": self._load.joint, "stiffness": self._load.stiffness}
        return self._touches.events(**facts) + self._touches.releases(**facts)


class _Hand:
    """A hand on a link."""

    def __init__(self, model: Any, load: Push) -> None:
        self._model, self._load = model, load
        self._body = 1 + round(load.along * (model.nbody - 2))  # after the world
        self._force, self._no_torque = np.array(load.force), np.zeros(3)

    def apply(self, data: Any, sample: int) -> None:
        """Push."""
        load, time = self._load, sample * STEP
        if not load.start < time < load.stop:
            return
        since = np.array([time - load.start, time - load.stop + load.fall])
        up, down = minimum_jerk(np.clip(since / np.array([load.rise, load.fall]), 0, 1))
        mujoco.mj_applyFT(
            self._model,
            data,
            (up - down) * self._force,
            self._no_torque,
            data.xipos[self._body],
            self._body,
            data.qfrc_applied,
        )

    def events(self) -> tuple[Event, ...]:
        """None: a push is planned, and its event is known before."""
        return ()
