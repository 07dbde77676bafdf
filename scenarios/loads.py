"""Forces on a robot from outside, as data."""

from dataclasses import dataclass
from typing import TypeAlias


@dataclass(frozen=True, kw_only=True)
class Payload:
    """A mass that an effector holds for some time: its weight, its inertia left out.

    Attributes:
        frame: Name of the effector's frame.
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
        frame: Name of the effector's frame.
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
        joint: Index of the joint.
        angle: Where it is, in [rad].
        side: 1 if it is met upwards, -1 if downwards.
        stiffness: In [N m/rad].
    """

    joint: int
    angle: float
    side: int
    stiffness: float


Load: TypeAlias = Payload | Collision | JointStop
"""A force on a robot from outside."""
