"""Pick-like motion of a tool: over a place, down, press, up; all drawn by a seed."""

from dataclasses import dataclass

import numpy as np

from noisemodel.types import Array
from scenarios.clock import TICK, times

HOVER = 0.01
"""Height over the table at which the tool slows down, in [m]."""
NEAR = 0.002
"""Height over the table from which it presses, in [m]."""


@dataclass(frozen=True)
class Touch:
    """A contact that is planned.

    Attributes:
        start: When the tool may first touch, in [s].
        lift: When it is to leave, in [s].
        stop: When it must have let go, in [s].
        place: x, y, z of the surface there, in [m].
    """

    start: float
    lift: float
    stop: float
    place: tuple[float, float, float]

    def later(self, delay: float) -> "Touch":
        """Move it in time."""
        return Touch(self.start + delay, self.lift + delay, self.stop + delay, self.place)


@dataclass(frozen=True, eq=False)
class Plan:
    """What a tool is to do, at every tick.

    Attributes:
        position: Of the tool's tip, shape (ticks, 3), in [m].
        yaw: Turn of the tool about the vertical since the start, shape (ticks,), in [rad].
        force: Force to press with; NaN while force control is off, shape (ticks,), in [N].
        keep: Share of the force control's last offset that is still kept, shape (ticks,).
        touches: The planned contacts.
    """

    position: Array
    yaw: Array
    force: Array
    keep: Array
    touches: tuple[Touch, ...]

    @property
    def time(self) -> Array:
        """Time of each tick, shape (ticks,), in [s]."""
        return times(len(self.yaw), TICK)

    @property
    def duration(self) -> float:
        """How long it lasts, in [s]."""
        return len(self.yaw) * TICK

    def after(self, ticks: int) -> "Plan":
        """Rest for some ticks before the plan begins."""
        return Plan(
            position=np.pad(self.position, ((ticks, 0), (0, 0)), "edge"),
            yaw=np.pad(self.yaw, (ticks, 0), "edge"),
            force=np.pad(self.force, (ticks, 0), constant_values=np.nan),
            keep=np.pad(self.keep, (ticks, 0)),
            touches=tuple(touch.later(ticks * TICK) for touch in self.touches),
        )


@dataclass(frozen=True)
class Segment:
    """One straight movement, from rest to rest."""

    duration: float
    position: tuple[float, float, float]
    yaw: float
    force: float = np.nan
    release: bool = False


def pick(
    rng: np.random.Generator,
    *,
    start: Array,
    table: float,
    reach: tuple[tuple[float, float], tuple[float, float]],
    duration: float,
) -> Plan:
    """Plan picks, one after the other, until the time is over.

    Args:
        rng: Source of chance.
        start: Where the tip is at first, shape (3,), in [m].
        table: Height of the table, in [m].
        reach: Ranges of x and y on the table, in [m].
        duration: How long the plan shall last, in [s].

    Returns:
        The plan; the beginning of a plan does not depend on its duration.
    """
    segments = [Segment(0.2, (float(start[0]), float(start[1]), float(start[2])), 0.0)]
    touches = []
    now = segments[0].duration
    while now < duration:
        one = _one_pick(rng, table, reach)
        press = now + sum(segment.duration for segment in one[:3])
        place = (one[3].position[0], one[3].position[1], table)
        lift = press + one[3].duration
        touches.append(Touch(press, lift, lift + one[4].duration, place))
        segments += one
        now += sum(segment.duration for segment in one)
    ticks = round(duration / TICK)
    position, yaw, force, keep = (np.concatenate(part)[:ticks] for part in _sample(segments))
    return Plan(position, yaw, force, keep, tuple(t for t in touches if t.start < duration))


def minimum_jerk(share: Array) -> Array:
    """Path over time of the smoothest movement from rest to rest, both from 0 to 1."""
    return share**3 * (10 - 15 * share + 6 * share**2)


def _one_pick(
    rng: np.random.Generator,
    table: float,
    reach: tuple[tuple[float, float], tuple[float, float]],
) -> list[Segment]:
    x, y = (float(rng.uniform(*span)) for span in reach)
    above = table + float(rng.uniform(0.1, 0.2))
    yaw = float(rng.uniform(-0.5, 0.5))
    pace = float(rng.uniform(0.8, 1.25))
    near = (x, y, table + NEAR)
    return [
        Segment(1.1 * pace, (x, y, above), yaw),
        Segment(0.5 * pace, (x, y, table + HOVER), yaw),
        Segment(float(rng.uniform(0.15, 0.3)), near, yaw),
        Segment(float(rng.uniform(0.7, 1.0)), near, yaw, force=float(rng.uniform(15, 30))),
        Segment(0.5 * pace, (x, y, above), yaw, release=True),
    ]


def _sample(segments: list[Segment]) -> tuple[list[Array], list[Array], list[Array], list[Array]]:
    """Sample position, yaw, force and keep, segment by segment."""
    positions, yaws, forces, keeps = [], [], [], []
    here, turned = np.array(segments[0].position), 0.0
    for segment in segments:
        ticks = round(segment.duration / TICK)
        share = minimum_jerk(np.arange(ticks) / ticks)
        there = np.array(segment.position)
        positions.append(here + np.outer(share, there - here))
        yaws.append(turned + share * (segment.yaw - turned))
        onset = minimum_jerk(np.clip(np.arange(ticks) * TICK / 0.15, 0, 1))
        forces.append(segment.force * onset)
        keeps.append(1 - share if segment.release else np.zeros(ticks))
        here, turned = there, segment.yaw
    return positions, yaws, forces, keeps
