"""The simulation loop: a tick of control, then ten samples of drives and physics; and outer forces.

Forces from outside are weights, obstacles in the air, end stops and hands.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import mujoco
import numpy as np

from noiseclassifier.scenarios.drives import Drives
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
    SimulationError,
    minimum_jerk,
)
from noiseclassifier.scenarios.world import set_collision
from noisemodel.types import Array

SLOWEST = 0.03  # least speed of an effector that collides, in [m/s]
PATIENCE = 0.5  # how long an obstacle waits for an effector to be that fast, in [s]
LOOSE = 0.08  # time in which an obstacle breaks loose, in [s]
# Share of its force that it resists with from then on: drives that hold it off for long would be
# saturated, and let the arm fly off at the end.
SLIDING = 0.25
RELEASED = 0.2  # least duration of a contact whose end is an event of its own, in [s]
# Damping of a contact per depth and stiffness, in [s/m] (Hunt and Crossley, Coefficient of
# restitution interpreted as damping in vibroimpact, J. Applied Mechanics 1975): no force at the
# moment of the contact, unlike a damper beside a spring.
DISSIPATION = 1.5
FASTEST = 50.0  # A joint that is faster than this has diverged, in [rad/s] or [m/s]
_S = np.arange(STEPS)[:, None] / STEPS
# Cubic Hermite polynomials at the samples of a tick: from the values and slopes at its ends.
_POSITION = np.hstack(
    (
        2 * _S**3 - 3 * _S**2 + 1,
        3 * _S**2 - 2 * _S**3,
        TICK * (_S**3 - 2 * _S**2 + _S),
        TICK * (_S**3 - _S**2),
    )
)
# Their slopes.
_VELOCITY = np.hstack(
    (6 * (_S**2 - _S) / TICK, 6 * (_S - _S**2) / TICK, 3 * _S**2 - 4 * _S + 1, 3 * _S**2 - 2 * _S)
)


# Forces from outside.


@dataclass(frozen=True)
class Force:
    """A force on the robot from outside, other than contact forces."""

    # Add to ``qfrc_applied`` of MuJoCo's data at a time since the recording began, in [s].
    apply: Callable[[Any, float], None]
    # The events that it was the cause of so far; of payloads and of pushes, which are planned.
    events: Callable[[], tuple[Event, ...]] = tuple


def force(model: Any, load: Load) -> Force:
    """The force of a load in a simulation."""
    kinds: dict[type, Any] = {Payload: _weight, Collision: _obstacle, JointStop: _stop, Push: _hand}
    made: Force = kinds[type(load)](model, load)
    return made


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


def _weight(model: Any, load: Payload) -> Force:
    """The weight of a payload."""
    point, gravity = _Point(model, load.frame), model.opt.gravity.copy()

    def apply(data: Any, time: float) -> None:
        if load.start < time < load.stop + load.rise:
            edges = np.array([time - load.start, time - load.stop]) / load.rise
            up, down = minimum_jerk(np.clip(edges, 0, 1))
            point.locate(data)
            point.push(data, load.mass * (up - down) * gravity)

    return Force(apply)


def _obstacle(model: Any, load: Collision) -> Force:
    """A face across the path, which is pushed away by a large force; touching it again is leaning.

    If the effector is slow at first, the face waits for it.
    """
    point, touches = _Point(model, load.frame), _Touches("collision with an obstacle")
    face, across, since, done = None, np.zeros(3), np.inf, False

    def apply(data: Any, time: float) -> None:
        nonlocal face, across, since, done
        if done or time < load.start:
            return
        place, velocity = point.locate(data)
        if face is None:
            speed = float(np.linalg.norm(velocity))
            done = time > load.start + PATIENCE
            if speed < SLOWEST or done:
                return
            face, across, since = place, velocity / speed, time
        loose, fade = minimum_jerk(
            np.clip((time - since) / np.array([LOOSE, LOOSE + load.hold]), 0, 1)
        )
        limit = load.limit * (1 - (1 - SLIDING) * loose) * (1 - fade)
        depth = float((place - face) @ across)
        done = fade == 1.0
        if depth <= 0:
            return
        force = load.stiffness * depth * max(1 + DISSIPATION * float(velocity @ across), 0.0)
        if force > limit:  # the obstacle moves on, and does not come back
            face = face + (depth - limit / load.stiffness) * across
            force = limit
        if force > 0:
            touches.add(time, force)
            point.push(data, -force * across)

    return Force(apply, lambda: touches.events(stiffness=load.stiffness, limit=load.limit)[:1])


def _stop(model: Any, load: JointStop) -> Force:
    """A spring and damper at the end of a joint's range; its release is an event of its own."""
    touches = _Touches("end stop of a joint")
    facts = {"joint": load.joint, "stiffness": load.stiffness}

    def apply(data: Any, time: float) -> None:
        depth = load.side * (data.qpos[load.joint] - load.angle)
        if depth <= 0 or time < 0:
            return
        rate = load.side * data.qvel[load.joint]
        torque = load.stiffness * float(depth) * max(1 + DISSIPATION * float(rate), 0.0)
        touches.add(time, torque)
        data.qfrc_applied[load.joint] -= load.side * torque

    return Force(apply, lambda: touches.events(**facts) + touches.releases(**facts))


def _hand(model: Any, load: Push) -> Force:
    """A hand on a link."""
    body = 1 + round(load.along * (model.nbody - 2))  # after the world
    most, no_torque = np.array(load.force), np.zeros(3)

    def apply(data: Any, time: float) -> None:
        if load.start < time < load.stop:
            since = np.array([time - load.start, time - load.stop + load.fall])
            up, down = minimum_jerk(np.clip(since / np.array([load.rise, load.fall]), 0, 1))
            place, applied = data.xipos[body], data.qfrc_applied
            mujoco.mj_applyFT(model, data, (up - down) * most, no_torque, place, body, applied)

    return Force(apply)


# The loop.


@dataclass(frozen=True, eq=False)
class Reference:
    """Reference of the joints at the end of a tick, which drives reach from the one before."""

    position: Array  # shape (joints,), in [rad]
    velocity: Array  # shape (joints,), in [rad/s]
    planned: Array  # velocity of the plan alone, shape (joints,), in [rad/s]
    torque: Array  # feed-forward torque of the model, shape (joints,), in [N m]
    lift: Array  # of the joints per height of each effector, shape (effectors, joints), in [rad/m]


@dataclass(frozen=True, eq=False)
class Scene:
    """A robot in its environment, ready to be simulated."""

    model: Any
    start: Array
    tick: Callable[[int, Array], Reference]  # by number and sensors' means over the tick before
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
class Recording:
    """The recorded signals, before rounding; of a fixed base, the last two have no columns."""

    position: Array  #: as the drives report it, shape (samples, joints), in [rad]
    velocity: Array  #: as the drives report it, shape (samples, joints), in [rad/s]
    position_desired: Array  #: reference of the drives, shape (samples, joints), in [rad]
    velocity_desired: Array  #: reference of the drives, shape (samples, joints), in [rad/s]
    planned: Array  #: velocities of the plan alone, shape (samples, joints), in [rad/s]
    commanded: Array  #: velocities that the controller demands, shape (samples, joints), in [rad/s]
    torque: Array  #: as the drives measure it, shape (samples, joints), in [N m]
    contact: Array  #: true contact force of each effector, shape (samples, effectors), in [N]
    base_pose: Array  #: place and quaternion (w, x, y, z), shape (samples, 7)
    base_velocity: Array  #: linear in the world's axes, angular in its own, shape (samples, 6)


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
) -> Recording:
    """Simulate a robot, with errors of encoders and sensors of shapes (samples or ticks, values).

    The overlay is added to the reference of the drives: heights of the effectors and their rates,
    shape (samples, effectors, 2), in [m] and [m/s].
    """
    model, data = scene.model, mujoco.MjData(scene.model)
    data.qpos[:] = scene.start
    samples, joints = encoder_error.shape
    base = model.nq - joints
    widths = [*[joints] * 7, scene.effectors, *([7, 6] if base else [0, 0])]
    motion = Recording(*(np.zeros((samples, width)) for width in widths))
    joint_position, joint_velocity = data.qpos[-joints:], data.qvel[-joints:]
    base_pose, base_velocity = data.qpos[:base], data.qvel[:-joints]
    effector_force, sensed = data.sensordata[: scene.effectors], data.sensordata
    readings, sensors = np.zeros((STEPS, model.nsensordata)), np.zeros(model.nsensordata)
    still, before = np.zeros(joints), None
    for tick, error in enumerate(sensor_error):
        now = slice(tick * STEPS, (tick + 1) * STEPS)
        for geom, present in scene.changes.get(tick - scene.settling, ()):
            set_collision(model, geom, present=present)
        reference = scene.tick(tick, sensors + error)
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
            raise SimulationError(time, f"a joint moved at {fastest:.3g} rad/s")
        if scene.fallen(sensors):
            raise SimulationError(time, "it fell")
    start = scene.settling * STEPS
    return Recording(*(signal[start:] for signal in vars(motion).values()))
