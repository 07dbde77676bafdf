"""Defects at edges of the ground."""

from dataclasses import dataclass, replace

import numpy as np

from noiseclassifier.scenarios.defects.plan import Plan, Range
from noiseclassifier.scenarios.events import Event
from noiseclassifier.scenarios.faults import Faults


@dataclass(frozen=True)
class Overhang:
    """An edge of a platform nearer than planned: the last contact on it is partial."""

    share: Range

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Move the edge; a plan on flat ground stays as it is."""
        share = float(rng.uniform(*self.share))
        platform, *floor = plan.ground
        above = [contact for contact in plan.contacts if contact.place[2] == platform.top]
        if not floor or not above:
            return Faults(facts={"overhang": share})
        last = above[-1]
        edge = last.place[0] + (1 - 2 * share) * plan.effectors[last.effector].patch[0]
        nearer = replace(platform, centre=(edge - platform.half[0], *platform.centre[1:]))
        event = Event(
            "highaccelerations", "partial contact at an edge", last.start,
            min(last.lift, plan.duration), {"overhang": share, "effector": last.effector},
        )  # fmt: skip
        return Faults(
            ground=(nearer, *floor), events=(event,), facts={"overhang": share, "edge": edge}
        )


@dataclass(frozen=True)
class StepDown:
    """A step down at an edge across the path.

    Attributes:
        depth: Height of the step, in [m].
    """

    depth: Range
    when: Range = (0.3, 0.5)

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw depth and place of the edge: beyond all contacts so far, before the next one."""
        depth = float(rng.uniform(*self.depth))
        start = float(rng.uniform(*self.when)) * plan.duration
        contacts = sorted(plan.contacts, key=lambda contact: contact.start)
        yaw = contacts[0].yaw
        heading = np.array([np.cos(yaw), np.sin(yaw), 0.0])
        ways = np.array([contact.place for contact in contacts]) @ heading
        furthest = np.maximum.accumulate(ways)
        over = 1 + np.flatnonzero(np.diff(furthest) > 0)
        late = [index for index in over.tolist() if contacts[index].start >= start]
        first = late[0] if late else int(over[-1])
        reached, next_one = furthest[first - 1], furthest[first]
        between = np.unique(ways[(reached <= ways) & (ways <= next_one)])
        widest = int(np.argmax(np.diff(between)))  # other feet must not meet the edge either
        edge = float(between[widest : widest + 2].mean())
        ground = []
        for box in plan.ground:
            x, y, z = box.centre
            back = (edge - box.half[0]) * heading
            ground += [
                replace(box, centre=(float(back[0]), float(back[1]), z), yaw=yaw),
                replace(box, centre=(x, y, z - depth)),
            ]
        falls: dict[int, Event] = {}
        for contact, way in zip(contacts, ways.tolist(), strict=True):
            stop = min(contact.lift, plan.duration)
            if way > edge and contact.effector not in falls and contact.start < stop:
                falls[contact.effector] = Event(
                    "highaccelerations",
                    "ground that is not there",
                    contact.start,
                    stop,
                    {"depth": depth, "effector": contact.effector},
                )
        return Faults(
            ground=tuple(ground),
            events=tuple(falls.values()),
            facts={"depth": depth, "edge": edge},
        )
