"""Defects in the air: obstacles in the way of a tool, end stops of joints, hands that push."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from noiseclassifier.scenarios.clock import TICK
from noiseclassifier.scenarios.defects.plan import Plan, Range
from noiseclassifier.scenarios.events import Event
from noiseclassifier.scenarios.faults import Faults
from noiseclassifier.scenarios.loads import PUSH, Collision, JointStop, Push
from noisemodel.types import Array

MOVING = 0.05
"""Least speed of an effector that is to collide, in [m/s]."""
SLOW = 0.05
"""Highest speed of an effector that moves slowly, in [m/s]."""
ALONE = 0.6
"""Time without pushes at the begin and at the end of a run, in [s]."""


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


@dataclass(frozen=True)
class Pushes:
    """Hands that push links while the robot stands or moves slowly, each at another time.

    Attributes:
        every: Mean time between two pushes, in [s].
        force: Largest force, in [N], times the robot's unit of force.
        rise: Time in which it rises, and time in which it falls, in [s].
        hold: Time in between, in [s].
    """

    every: float = 2.5
    force: Range = (3.0, 40.0)
    rise: Range = (0.1, 1.0)
    hold: Range = (0.0, 0.4)
    along: Range = (0.3, 1.0)

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw pushes where the tool is slow; at least one, where it is slowest."""
        if not isinstance(plan, _Tool):
            return Faults()
        speed = np.linalg.norm(np.gradient(plan.position, TICK, axis=0), axis=1)
        edge = round(min(ALONE, plan.duration / 4) / TICK)
        count = max(1, round((plan.duration - 2 * ALONE) / self.every))
        drawn = []
        for span in np.array_split(np.arange(edge, len(speed) - edge), count):
            times = np.append(_log_between(self.rise, rng.uniform(size=2)), rng.uniform(*self.hold))
            times *= min(1.0, 0.9 * len(span) * TICK / times.sum())
            size = plan.units.force * float(_log_between(self.force, rng.uniform()))
            way, along, place = rng.normal(size=3), rng.uniform(*self.along), rng.uniform()
            fastest = sliding_window_view(speed[span], round(times.sum() / TICK)).max(axis=1)
            slow = np.flatnonzero(fastest <= max(SLOW, fastest.min()))
            first = slow[int(place * len(slow))]
            start, (x, y, z) = float(span[first] * TICK), size * way / np.linalg.norm(way)
            push = Push(
                along=float(along),
                start=start,
                stop=start + float(times.sum()),
                rise=float(times[0]),
                fall=float(times[1]),
                force=(float(x), float(y), float(z)),
            )
            drawn.append((fastest[first], push))
        slowest = min(one for one, _ in drawn)
        pushes = [push for fastest, push in drawn if fastest <= max(SLOW, slowest)]
        events = tuple(
            Event("impact", PUSH, push.start, push.stop,
                  {"force": float(np.linalg.norm(push.force)), "along": push.along})
            for push in pushes
        )  # fmt: skip
        return Faults(
            loads=tuple(pushes), events=events, facts={"starts": [push.start for push in pushes]}
        )


def _log_between(span: Range, share: Array | float) -> Array:
    low, high = np.log(span)
    return np.asarray(np.exp(low + share * (high - low)))


def _between(span: Range | Array, share: float) -> float:
    return float(span[0] + share * (span[1] - span[0]))
