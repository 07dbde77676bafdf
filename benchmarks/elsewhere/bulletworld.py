"""A PyBullet world with one robot, which can be pushed and hit by balls."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from benchmarks.elsewhere.faults import Push, Throw
from noiseclassifier.scenarios.motions import Event
from noisemodel.types import Array

FLIGHT = 0.08  # time between the appearance of a ball and its arrival, in [s]
RADIUS = 0.06  # of the balls, in [m]
APART = 0.1  # contacts farther apart are two events, in [s]


class World:
    """One robot in a simulation of its own.

    Args:
        rate: Steps per second, in [Hz].
        height: Height of its base, in [m]; a floating base if it is above 0.
    """

    def __init__(self, urdf: str, rate: float, height: float = 0.0) -> None:
        import pybullet
        import pybullet_data
        from pybullet_utils.bullet_client import BulletClient

        self.rate = rate
        with _silent():
            self.client: Any = BulletClient(pybullet.DIRECT)
        self.client.setAdditionalSearchPath(pybullet_data.getDataPath())
        self.client.setGravity(0.0, 0.0, -9.81)
        self.client.setTimeStep(1 / rate)
        if height:
            self.client.loadURDF("plane.urdf")
        flags = pybullet.URDF_USE_INERTIA_FROM_FILE
        self.robot = self.client.loadURDF(
            urdf, [0, 0, height], useFixedBase=not height, flags=flags
        )
        infos = [
            self.client.getJointInfo(self.robot, joint)
            for joint in range(self.client.getNumJoints(self.robot))
        ]
        self.names = {info[1].decode(): info[0] for info in infos}
        self.balls: dict[int, list[int]] = {}

    def close(self) -> None:
        """End the simulation."""
        self.client.disconnect()

    def states(self, joints: Sequence[int]) -> tuple[Array, Array, Array]:
        """Position, velocity and motor torque of joints, each of shape (joints,)."""
        states = self.client.getJointStates(self.robot, joints)
        return tuple(np.array([state[place] for state in states]) for place in (0, 1, 3))

    def place(self, link: int) -> tuple[Array, Array]:
        """Centre of mass of a link, -1 for the base, and its velocity, in [m] and [m/s]."""
        if link < 0:
            place = self.client.getBasePositionAndOrientation(self.robot)[0]
            return np.array(place), np.array(self.client.getBaseVelocity(self.robot)[0])
        state = self.client.getLinkState(self.robot, link, computeLinkVelocity=1)
        return np.array(state[0]), np.array(state[6])

    def step(self, tick: int, pushes: Sequence[Push], throws: Sequence[Throw]) -> None:
        """One step of the physics, with what acts from outside."""
        for push in pushes:
            if push.start <= tick < push.stop:
                place = self.place(push.link)[0].tolist()
                self.client.applyExternalForce(
                    self.robot, push.link, push.at(tick).tolist(), place, self.client.WORLD_FRAME
                )
        for throw in throws:
            if throw.start == tick:
                self._throw(throw)
        self.client.stepSimulation()
        for ball, contacts in self.balls.items():
            if self.client.getContactPoints(ball, self.robot):
                contacts.append(tick)

    def _throw(self, throw: Throw) -> None:
        """Start a ball so that it arrives where the link will be after ``FLIGHT``."""
        place, speed = self.place(throw.link)
        start = place + FLIGHT * (speed - throw.velocity) + 0.5 * 9.81 * FLIGHT**2 * np.eye(3)[2]
        shape = self.client.createCollisionShape(self.client.GEOM_SPHERE, radius=RADIUS)
        ball = self.client.createMultiBody(throw.mass, shape, basePosition=start.tolist())
        self.client.resetBaseVelocity(ball, throw.velocity.tolist())
        if throw.stiffness is not None:
            damping = 0.3 * np.sqrt(throw.mass * throw.stiffness)
            self.client.changeDynamics(
                ball, -1, contactStiffness=throw.stiffness, contactDamping=damping
            )
        self.balls[ball] = []

    def contacts(self) -> tuple[Event, ...]:
        """Contacts of the balls with the robot, as events."""
        events = []
        for contacts in self.balls.values():
            ticks = np.array(contacts, dtype=int)
            parts = np.split(ticks, np.flatnonzero(np.diff(ticks) > APART * self.rate) + 1)
            events += [
                Event(
                    "impact", "ball", float(part[0] / self.rate), float((part[-1] + 1) / self.rate)
                )
                for part in parts
                if len(part)
            ]
        return tuple(sorted(events, key=lambda event: event.start))


@contextmanager
def _silent() -> Iterator[None]:
    """Without what PyBullet prints when it starts, past Python."""
    kept, null = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(null)
