"""Forces on a robot from outside, as data."""

from dataclasses import dataclass
from typing import TypeAlias

PUSH = "push of a hand"
"""Cause of the events of pushes, which velocities may not show."""


@dataclass(frozen=True, kw_only=True)
class Payload:
    """A mass that an effector holds for some time: its weight, its inertia left out.

    Attributes:
        start: When it is picked up, in [s].
        stop: When it is put down, in [s].
        mass: In [kg].
        rise: Time in which its weight appears and vanishes, in [s].
    """

    frame: str
    start: float
    stop: float
    mass: float
    rise: float = 0.08


@dataclass(frozen=True, kw_only=True)
class Collision:
    """An obstacle in the air, where an effector is at that time, that it pushes away.

    It breaks loose at its limit of force, then resists with less, and at last not at all.

    Attributes:
        start: When the effector meets it; if it is slow then, as soon as it is fast, in [s].
        hold: Time in which its resistance fades, in [s].
        stiffness: In [N/m].
        limit: Force at which it breaks loose, in [N].
    """

    frame: str
    start: float
    hold: float
    stiffness: float
    limit: float


@dataclass(frozen=True, kw_only=True)
class JointStop:
    """A mechanical end stop of a joint.

    Attributes:
        angle: Where it is, in [rad].
        stiffness: In [N m/rad].
    """

    joint: int
    angle: float
    side: int
    stiffness: float


@dataclass(frozen=True, kw_only=True)
class Push:
    """A hand that pushes at the centre of mass of a link.

    Attributes:
        start: When its force begins to rise, in [s].
        stop: When it has vanished, in [s].
        rise: Time in which it rises, in [s].
        fall: Time in which it falls, in [s].
        force: Its largest value, in the world's axes, in [N].
    """

    along: float
    start: float
    stop: float
    rise: float
    fall: float
    force: tuple[float, float, float]


Load: TypeAlias = Payload | Collision | JointStop | Push
"""A force on a robot from outside."""
