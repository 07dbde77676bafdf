"""Forces on a simulated robot from outside: payloads, obstacles, end stops, pushes."""

from collections.abc import Iterable
from typing import Any

import mujoco
import numpy as np

from noiseclassifier.scenarios.clock import STEP
from noiseclassifier.scenarios.contacts import APART, IMPACT
from noiseclassifier.scenarios.events import Event
from noiseclassifier.scenarios.loads import Collision, JointStop, Load, Payload, Push
from noiseclassifier.scenarios.loop import Force
from noiseclassifier.scenarios.paths import minimum_jerk
from noisemodel.types import Array

SLOWEST = 0.03
"""Least speed of an effector that collides, in [m/s]."""
PATIENCE = 0.5
"""How long an obstacle waits for an effector to be that fast, in [s]."""
LOOSE = 0.08
"""Time in which an obstacle breaks loose, in [s]."""
SLIDING = 0.25
"""Share of its force that it resists with from then on: drives that hold it off for long would be
saturated, and let the arm fly off at the end."""
RELEASED = 0.2
"""Least duration of a contact whose end is an event of its own, in [s]."""
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
