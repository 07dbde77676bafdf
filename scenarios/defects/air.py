"""Defects in the air: obstacles in the way of a tool, and end stops of joints."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from noisemodel.types import Array
from scenarios.clock import TICK
from scenarios.defects.plan import Plan, Range
from scenarios.faults import Faults
from scenarios.loads import Collision, JointStop

MOVING = 0.05
"""Least speed of an effector that is to collide, in [m/s]."""


@runtime_checkable
class _Tool(Protocol):
    position: Array


@runtime_checkable
class _Joints(Protocol):
    joints: Array


@dataclass(frozen=True)
class Collisions:
    """Obstacles in the air that a tool meets while it moves, each at another time.

    Attributes:
        every: Mean time between two collisions, in [s].
        stiffness: In [N/m], times the robot's unit of force.
        limit: Force at which an obstacle breaks loose, in [N], times the robot's unit of force.
        hold: Time in which its resistance fades, in [s].
    """

    every: float = 2.0
    stiffness: Range = (1e3, 1e5)
    limit: Range = (10.0, 150.0)
    hold: Range = (0.1, 0.5)

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw times at which the tool is to move, and obstacles; none where it does not."""
        if not isinstance(plan, _Tool):
            return Faults()
        speed = np.linalg.norm(np.gradient(plan.position, TICK, axis=0), axis=1)
        count = max(1, round(plan.duration / self.every))
        loads = []
        for span in np.array_split(np.arange(len(speed)), count):
            middle = span[len(span) // 8 : -(len(span) // 4)]
            moving = middle[speed[middle] > max(MOVING, 0.5 * speed[middle].max())]
            share, *values = rng.uniform(size=4).tolist()
            if not moving.size:
                continue
            stiffness, limit = (
                plan.units.force * float(np.exp(_between(np.log(span), value)))
                for span, value in zip((self.stiffness, self.limit), values, strict=False)
            )
            loads.append(
                Collision(
                    frame=plan.effectors[0].frame,
                    start=float(moving[int(share * len(moving))] * TICK),
                    hold=_between(self.hold, values[2]),
                    stiffness=stiffness,
                    limit=limit,
                )
            )
        return Faults(loads=tuple(loads), facts={"starts": [load.start for load in loads]})


@dataclass(frozen=True)
class JointStops:
    """An end stop of a joint that is nearer than the controller knows.

    Attributes:
        overshoot: How far beyond it the plan goes at most, in [rad].
        stiffness: In [N m/rad], times the robot's unit of torque.
        least: Least range of a joint's motion, in [rad].
    """

    overshoot: Range = (0.05, 0.4)
    stiffness: Range = (3e3, 3e4)
    least: float = 0.1

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw joint, side and angle; none where joints move little, or have no plan."""
        if not isinstance(plan, _Joints):
            return Faults()
        away = plan.joints - plan.joints[0]
        furthest = np.stack((-away.min(axis=0), away.max(axis=0)))  # down, up
        chosen = np.argwhere(furthest > self.least)
        index, share, hardness = rng.uniform(size=3).tolist()
        if not len(chosen):
            return Faults()
        side, joint = chosen[int(index * len(chosen))].tolist()
        way = float(furthest[side, joint])
        over = min(_between(self.overshoot, share), 0.7 * way)
        sign = 2 * side - 1
        stop = JointStop(
            joint=joint,
            angle=float(plan.joints[0, joint]) + sign * (way - over),
            side=sign,
            stiffness=plan.units.torque * float(np.exp(_between(np.log(self.stiffness), hardness))),
        )
        return Faults(loads=(stop,), facts={"joint": joint, "angle": stop.angle})


def _between(span: Range | Array, share: float) -> float:
    return float(span[0] + share * (span[1] - span[0]))
