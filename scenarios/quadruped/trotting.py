"""Plan of a trot over flat ground: the path of the body and the feet."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from noisemodel.types import Array, Mask
from scenarios.clock import TICK, times
from scenarios.contacts import Contact
from scenarios.defects.plan import Units
from scenarios.motions import Trot
from scenarios.quadruped import steps
from scenarios.quadruped.gait import PAIRS, beats, loads, swings
from scenarios.quadruped.robots import Quadruped
from scenarios.quadruped.standing import Standing
from scenarios.quadruped.steering import steer
from scenarios.shapes import Ball, Box

REST = 0.5
"""Time of standing before and after the trot, in [s]."""


@dataclass(frozen=True, eq=False)
class Plan:
    """Plan of the motion of a quadruped, at every tick.

    Attributes:
        centre: Centre of mass, shape (ticks, 3), in [m].
        yaw: Direction of the body, shape (ticks,), in [rad].
        feet: Centres of the feet, shape (ticks, feet, 3), in [m].
        swing: Whether each foot is in the air, shape (ticks, feet).
        progress: Completed share of the path of each foot; 1 in stance, shape (ticks, feet).
        load: Planned share of the weight on each foot, shape (ticks, feet).
        contacts: The planned contacts, in the order of time.
        effectors: The feet.
        ground: The floor.
        size: Height of the centre of mass, in [m].
        weight: In [N].
    """

    centre: Array
    yaw: Array
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
    """Plan of a trot from rest to rest.

    Args:
        robot: The robot.
        standing: The robot before the motion.
        motion: The motion.
        rng: Random number generator.
        duration: Duration of the plan, in [s].

    Returns:
        The plan; until the robot stops, it does not depend on the duration.
    """
    shapes, steering = rng.spawn(2)
    height = robot.height * float(shapes.uniform(*motion.height))
    period = robot.period * float(shapes.uniform(*motion.period))
    timing = beats(shapes, begin=REST, end=duration - REST, period=period, jitter=motion.jitter)
    time = times(round(duration / TICK), TICK)
    stop = timing[-1].touch
    way, yaw = steer(time, motion.way, robot, steering, start=REST, stop=stop)
    share = swings(time, timing)
    progress = steps.progress(share)
    feet = np.zeros((len(time), len(robot.feet), 3))
    feet[..., 2] = standing.feet[:, 2] + height * steps.height(share)
    contacts = []
    for foot, pair in enumerate(PAIRS):
        own = [beat for beat in timing if beat.pair == pair]
        places = steps.footholds(own, standing.feet[foot, :2], way=way, yaw=yaw, stop=stop)
        feet[:, foot, :2] = steps.path(time, own, places, progress[:, foot])
        contacts += steps.contacts(foot, own, places)
    return Plan(
        np.column_stack((way, np.full(len(time), standing.height))),
        yaw,
        feet,
        share < 1,
        progress,
        loads(time, timing),
        contacts=tuple(sorted(contacts, key=lambda contact: contact.start)),
        effectors=robot.feet,
        ground=(Box(centre=(0.0, 0.0, -0.5), half=(20.0, 20.0, 0.5)),),
        size=standing.height,
        weight=standing.weight,
    )
