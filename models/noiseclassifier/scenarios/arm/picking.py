"""Picking motion of a tool: over a place, down, press, up; drawn by a seed."""

from dataclasses import dataclass, replace

import numpy as np

from noiseclassifier.scenarios.clock import TICK, times
from noiseclassifier.scenarios.contacts import Contact
from noiseclassifier.scenarios.defects.plan import Units
from noiseclassifier.scenarios.loads import Payload
from noiseclassifier.scenarios.motions import Picks
from noiseclassifier.scenarios.paths import bump, minimum_jerk
from noiseclassifier.scenarios.shapes import Box, Effector, Rod
from noisemodel.types import Array

NEAR = 0.002
"""Height over the table at which force control starts, in [m]."""
METRIC = Units()
"""Metres and newtons."""


@dataclass(frozen=True, eq=False)
class Plan:
    """Plan of the motion of a tool, at every tick.

    Attributes:
        position: Of the tool's tip, shape (ticks, 3), in [m].
        yaw: Turn of the tool about the vertical since the start, shape (ticks,), in [rad].
        force: Force to press with; NaN while force control is off, shape (ticks,), in [N].
        keep: Share of the last offset of the force control that remains, shape (ticks,).
    """

    position: Array
    yaw: Array
    force: Array
    keep: Array
    contacts: tuple[Contact, ...]
    effectors: tuple[Effector, ...]
    ground: tuple[Box, ...]
    units: Units = METRIC

    @property
    def time(self) -> Array:
        """Time of each tick, shape (ticks,), in [s]."""
        return times(len(self.yaw), TICK)

    @property
    def payloads(self) -> tuple[Payload, ...]:
        """None."""
        return ()

    @property
    def duration(self) -> float:
        """Duration, in [s]."""
        return len(self.yaw) * TICK

    def after(self, ticks: int) -> "Plan":
        """The plan after some ticks of rest."""
        return replace(
            self,
            position=np.pad(self.position, ((ticks, 0), (0, 0)), "edge"),
            yaw=np.pad(self.yaw, (ticks, 0), "edge"),
            force=np.pad(self.force, (ticks, 0), constant_values=np.nan),
            keep=np.pad(self.keep, (ticks, 0)),
            contacts=tuple(contact.later(ticks * TICK) for contact in self.contacts),
        )


@dataclass(frozen=True)
class Segment:
    """One movement from rest to rest, straight or bent."""

    duration: float
    position: tuple[float, float, float]
    yaw: float
    force: float = np.nan
    release: bool = False
    bend: tuple[float, float, float] = (0.0, 0.0, 0.0)


def pick(
    motion: Picks,
    rng: np.random.Generator,
    *,
    start: Array,
    tool: Rod,
    table: float,
    reach: tuple[tuple[float, float], tuple[float, float]],
    duration: float,
    units: Units = METRIC,
) -> Plan:
    """Plan of picks, one after the other.

    Args:
        start: Where the tip is at first, shape (3,), in [m].
        table: Height of the table, in [m].
        reach: Ranges of x and y on the table, in [m].
        duration: Duration of the plan, in [s].
    """
    segments = [Segment(0.2, (float(start[0]), float(start[1]), float(start[2])), 0.0)]
    contacts = []
    now = segments[0].duration
    spot = _place(rng, reach) if motion.way == "spot" else None
    while now < duration:
        one = (
            _one_flight(rng, table, reach)
            if motion.way == "directions"
            else _one_pick(motion, rng, table, spot or _place(rng, reach))
        )
        for segment in one:
            if not np.isnan(segment.force):
                lift = now + segment.duration
                place = (segment.position[0], segment.position[1], table)
                contacts.append(Contact(now, lift, lift + one[-1].duration, place))
            now += segment.duration
        segments += one
    ticks = round(duration / TICK)
    position, yaw, force, keep = (np.concatenate(part)[:ticks] for part in _sample(segments))
    return Plan(
        position,
        yaw,
        force * units.force,
        keep,
        contacts=tuple(contact for contact in contacts if contact.start < duration),
        effectors=(tool,),
        ground=(Box(centre=(0.5, 0.0, table - 0.05), half=(0.6, 1.0, 0.05)),),
        units=units,
    )


def _place(
    rng: np.random.Generator, reach: tuple[tuple[float, float], tuple[float, float]]
) -> tuple[float, float]:
    return float(rng.uniform(*reach[0])), float(rng.uniform(*reach[1]))


def _one_pick(
    motion: Picks, rng: np.random.Generator, table: float, place: tuple[float, float]
) -> list[Segment]:
    x, y = place
    above = table + float(rng.uniform(0.1, 0.2))
    yaw = float(rng.uniform(-0.5, 0.5))
    pace = float(rng.uniform(0.8, 1.25))
    hover = table + float(rng.uniform(*motion.hover))
    bend = (0.0, 0.0, 0.0)
    if motion.way == "curve":
        bend = (float(rng.uniform(-0.1, 0.05)), float(rng.uniform(-0.1, 0.1)), 0.05)
    near = (x, y, table + NEAR)
    return [
        Segment(1.1 * pace, (x, y, above), yaw, bend=bend),
        Segment(0.5 * pace, (x, y, hover), yaw),
        Segment(float(rng.uniform(0.15, 0.3)), near, yaw),
        Segment(float(rng.uniform(0.7, 1.0)), near, yaw, force=float(rng.uniform(*motion.force))),
        Segment(0.5 * pace, (x, y, above), yaw, release=True),
    ]


def _one_flight(
    rng: np.random.Generator, table: float, reach: tuple[tuple[float, float], tuple[float, float]]
) -> list[Segment]:
    """A movement over the table in any direction."""
    position = (*_place(rng, reach), table + float(rng.uniform(0.05, 0.3)))
    pause = Segment(float(rng.uniform(0.02, 0.3)), position, 0.0)
    return [Segment(float(rng.uniform(0.5, 1.3)), position, 0.0), pause]


def _sample(segments: list[Segment]) -> tuple[list[Array], list[Array], list[Array], list[Array]]:
    """Samples of position, yaw, force and keep, segment by segment."""
    positions, yaws, forces, keeps = [], [], [], []
    here, turned = np.array(segments[0].position), 0.0
    for segment in segments:
        ticks = round(segment.duration / TICK)
        share = minimum_jerk(np.arange(ticks) / ticks)
        there = np.array(segment.position)
        path = here + np.outer(share, there - here)
        if any(segment.bend):
            path += np.outer(bump(np.arange(ticks) / ticks), segment.bend)
        positions.append(path)
        yaws.append(turned + share * (segment.yaw - turned))
        onset = minimum_jerk(np.clip(np.arange(ticks) * TICK / 0.15, 0, 1))
        forces.append(segment.force * onset)
        keeps.append(1 - share if segment.release else np.zeros(ticks))
        here, turned = there, segment.yaw
    return positions, yaws, forces, keeps
