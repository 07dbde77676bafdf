"""Defects of the ground."""

from dataclasses import dataclass, replace

import numpy as np

from noiseclassifier.scenarios.contacts import Contact
from noiseclassifier.scenarios.defects.plan import Plan, Range, begun
from noiseclassifier.scenarios.events import Event
from noiseclassifier.scenarios.faults import Faults
from noiseclassifier.scenarios.shapes import Box


@dataclass(frozen=True)
class Obstacles:
    """Boxes on the ground, unknown to the controller, where effectors touch down.

    Attributes:
        height: Height of a box, in [m].
        half: Half of its edge lengths along and across the effector, in [m].
    """

    height: Range
    half: Range
    offset: Range = (0.0, 0.0)
    effectors: tuple[int, ...] = ()
    share: float = 1.0
    most: int | None = None

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Put boxes at some of the planned contacts."""
        places = begun(plan, self.effectors)
        if self.most is not None and len(places) > self.most:
            places = places[: max(self.most, len(places) - 1)]
            chosen = np.sort(rng.choice(len(places), self.most, replace=False))
            places = [places[index] for index in chosen.tolist()]
        heights = rng.uniform(*self.height, len(places))
        there = rng.uniform(size=len(places)) < self.share
        there[:1] = True
        boxes = tuple(
            self._box(contact, height, plan)
            for contact, height, here in zip(places, heights.tolist(), there, strict=True)
            if here
        )
        return Faults(boxes=boxes, facts={"tops": [box.top for box in boxes]})

    def _box(self, contact: Contact, height: float, plan: Plan) -> Box:
        patch = plan.effectors[contact.effector].patch
        along, across = (share * half for share, half in zip(self.offset, patch, strict=True))
        cosine, sine = np.cos(contact.yaw), np.sin(contact.yaw)
        x, y, z = contact.place
        return Box(
            (
                float(x + cosine * along - sine * across),
                float(y + sine * along + cosine * across),
                z + height / 2,
            ),
            (*self.half, height / 2),
            yaw=contact.yaw,
            since=contact.approach,
            until=contact.stop if contact.approach > 0 else np.inf,
        )


@dataclass(frozen=True)
class GivingWay:
    """Ground that gives way under an effector: a box that vanishes.

    Attributes:
        depth: Height of the box, in [m].
        half: Half of its edge lengths, in [m].
        after: When it vanishes, after the start of a contact, in [s].
    """

    depth: Range
    half: Range
    after: Range

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Lower the ground, and put boxes where contacts are planned, for some time."""
        depth = float(rng.uniform(*self.depth))
        boxes, events = [], []
        for contact in begun(plan):
            end = contact.start + float(rng.uniform(*self.after))
            x, y, z = contact.place
            boxes.append(Box((x, y, z - depth / 2), (*self.half, depth / 2), until=end))
            events.append(
                Event("highaccelerations", "ground that gives way", end,
                      min(contact.lift, plan.duration), {"depth": depth})
            )  # fmt: skip
        deeper = tuple(
            replace(box, centre=(*box.centre[:2], box.centre[2] - depth)) for box in plan.ground
        )
        events = [event for event in events if event.start < event.stop]
        return Faults(
            ground=deeper, boxes=tuple(boxes), events=tuple(events), facts={"depth": depth}
        )
