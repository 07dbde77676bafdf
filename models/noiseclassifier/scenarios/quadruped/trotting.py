"""Plan of a gait over flat ground: the path of the body and the feet."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from noiseclassifier.scenarios.clock import TICK, times
from noiseclassifier.scenarios.contacts import Contact
from noiseclassifier.scenarios.defects.plan import Units
from noiseclassifier.scenarios.errors import UnknownGaitError
from noiseclassifier.scenarios.humanoid.walking import centre_of_mass
from noiseclassifier.scenarios.motions import Trot
from noiseclassifier.scenarios.quadruped import steps
from noiseclassifier.scenarios.quadruped.gait import GAITS, TROT, Gait, beats, loads, swings
from noiseclassifier.scenarios.quadruped.posing import poses
from noiseclassifier.scenarios.quadruped.robots import Quadruped
from noiseclassifier.scenarios.quadruped.standing import GRAVITY, Standing
from noiseclassifier.scenarios.quadruped.steering import steer
from noiseclassifier.scenarios.shapes import Ball, Box
from noisemodel.types import Array, Mask

REST = 0.5
"""Time of standing before and after the trot, in [s]."""
STAND = "stand"
"""Name of the gait without steps."""
CYCLES = 2.5
"""Least time from one pause to the next, in periods; a short run has fewer pauses."""


@dataclass(frozen=True, eq=False)
class Plan:
    """Plan of the motion of a quadruped, at every tick.

    Attributes:
        centre: Centre of mass, shape (ticks, 3), in [m].
        yaw: Direction of the body, shape (ticks,), in [rad].
        tilt: Roll and pitch of the body, shape (ticks, 2), in [rad].
        push: Planned horizontal force of a foot per vertical force on it, shape (ticks, 2).
        feet: Centres of the feet, shape (ticks, feet, 3), in [m].
        swing: Whether each foot is in the air, shape (ticks, feet).
        progress: Completed share of the path of each foot; 1 in stance, shape (ticks, feet).
        load: Planned share of the weight on each foot, shape (ticks, feet).
        size: Height of the centre of mass, in [m].
        weight: In [N].
    """

    centre: Array
    yaw: Array
    tilt: Array
    push: Array
    feet: Array
    swing: Mask
    progress: Array
    load: Array
    contacts: tuple[Contact, ...]
    effectors: tuple[Ball, ...]
    ground: tuple[Box, ...]
    size: float
    weight: float

    @property
    def time(self) -> Array:
        """Time of each tick, shape (ticks,), in [s]."""
        return times(len(self.yaw), TICK)

    @property
    def units(self) -> Units:
        """The height of the centre of mass, the weight, and their product."""
        return Units(length=self.size, force=self.weight, torque=self.size * self.weight)

    @property
    def duration(self) -> float:
        """Duration, in [s]."""
        return len(self.yaw) * TICK

    def after(self, ticks: int) -> "Plan":
        """The plan after some ticks of rest."""

        def rested(signal: Any) -> Any:
            return np.concatenate((np.repeat(signal[:1], ticks, axis=0), signal))

        return replace(
            self,
            centre=rested(self.centre),
            yaw=rested(self.yaw),
            tilt=rested(self.tilt),
            push=rested(self.push),
            feet=rested(self.feet),
            swing=rested(self.swing),
            progress=rested(self.progress),
            load=rested(self.load),
            contacts=tuple(contact.later(ticks * TICK) for contact in self.contacts),
        )


def trot(
    robot: Quadruped,
    standing: Standing,
    motion: Trot,
    rng: np.random.Generator,
    duration: float,
) -> Plan:
    """Plan of a gait from rest to rest.

    Args:
        duration: Duration of the plan, in [s].
    """
    shapes, steering, bending = rng.spawn(3)
    gait = _gait(motion.gait)
    height = robot.height * float(shapes.uniform(*motion.height))
    period = gait.period * robot.period * float(shapes.uniform(*motion.period))
    bouts = [
        beats(shapes, begin=begin, end=end, period=period, jitter=motion.jitter, gait=gait)
        for begin, end in _bouts(shapes, motion, duration, period)
    ]
    bouts = [bout for bout in bouts if bout]
    timing = tuple(beat for bout in bouts for beat in bout)
    time = times(round(duration / TICK), TICK)
    stop = timing[-1].touch if timing else duration
    speed = motion.speed / gait.period
    driven = replace(robot, speed=speed * robot.speed, turning=speed * robot.turning)
    spans = [(bout[0].begin, bout[-1].touch) for bout in bouts]
    way, yaw = steer(time, motion.way, driven, steering, bouts=spans)
    share = swings(time, timing, gait)
    progress = steps.progress(share)
    feet = np.zeros((len(time), len(robot.feet), 3))
    feet[..., 2] = standing.feet[:, 2] + height * steps.height(share)
    contacts = []
    for foot, group in enumerate(gait.groups):
        own = [beat for beat in timing if beat.group == group]
        places = steps.footholds(own, standing.feet[foot, :2], way=way, yaw=yaw, stop=stop)
        feet[:, foot, :2] = steps.path(time, own, places, progress[:, foot])
        contacts += steps.contacts(foot, own, places)
    load = loads(time, timing, gait)
    push = np.zeros((len(time), 2))
    if not gait.level and timing:
        zmp = np.einsum("tf,tfa->ta", load, feet[..., :2])
        way = centre_of_mass(zmp, float(np.sqrt(GRAVITY / standing.height)))
        push = (way - zmp) / standing.height
    bend = float(bending.uniform(*motion.posing))
    pose = poses(time, bending, bend, size=standing.height)
    if bend:
        load = load * (1 + _acceleration(pose.shift[:, 2:]) / GRAVITY)
        shift = turned(yaw, pose.shift[:, :2])
        way, push = way + shift, push + _acceleration(shift) / GRAVITY
    return Plan(
        np.column_stack((way, standing.height + pose.shift[:, 2])),
        yaw,
        pose.tilt,
        push,
        feet,
        share < 1,
        progress,
        load,
        contacts=tuple(sorted(contacts, key=lambda contact: contact.start)),
        effectors=robot.feet,
        ground=(Box(centre=(0.0, 0.0, -0.5), half=(20.0, 20.0, 0.5)),),
        size=standing.height,
        weight=standing.weight,
    )


def _gait(name: str) -> Gait:
    if name == STAND:
        return TROT
    if name not in GAITS:
        raise UnknownGaitError(name, (*GAITS, STAND))
    return GAITS[name]


def _bouts(
    rng: np.random.Generator, motion: Trot, duration: float, period: float
) -> list[tuple[float, float]]:
    """Start and end of each time of stepping, in [s]; none if the robot stands."""
    if motion.gait == STAND:
        return []
    pauses = [float(rng.uniform(*motion.pause)) for _ in range(motion.pauses)]
    while True:
        each = (duration - 2 * REST - sum(pauses)) / (1 + len(pauses))
        if not pauses:
            return [(REST, duration - REST)]
        if each > CYCLES * period:
            break
        pauses.pop()
    begins = REST + each * np.arange(1 + len(pauses)) + np.cumsum([0.0, *pauses])
    return [(begin, begin + each) for begin in begins.tolist()]


def _acceleration(path: Array) -> Array:
    """Second derivative along axis 0."""
    return np.asarray(np.gradient(np.gradient(path, TICK, axis=0), TICK, axis=0))


def turned(yaw: Array, plane: Array) -> Array:
    """Vectors of the body's axes in the world's, both of shape (ticks, 2)."""
    cosine, sine = np.cos(yaw), np.sin(yaw)
    x, y = plane.T
    return np.stack((cosine * x - sine * y, sine * x + cosine * y), axis=1)
