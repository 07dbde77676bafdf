"""The shapes that collide in a simulation."""

from dataclasses import dataclass
from typing import TypeAlias


@dataclass(frozen=True)
class Box:
    """A box that stands in the world.

    Attributes:
        centre: x, y, z of its centre, in [m].
        half: Half of its edge lengths, in [m].
        yaw: How far it is turned about the vertical, in [rad].
        since: When it appears, in [s]: a box where a foot stands would intersect the foot.
        until: When it vanishes, in [s].
    """

    centre: tuple[float, float, float]
    half: tuple[float, float, float]
    yaw: float = 0.0
    since: float = 0.0
    until: float = float("inf")

    @property
    def top(self) -> float:
        """Height of its upper face, in [m]."""
        return self.centre[2] + self.half[2]


@dataclass(frozen=True)
class Rod:
    """A rod with round ends on the z axis of a robot's frame, from the frame's origin outwards.

    Attributes:
        length: From the origin to the outermost point, in [m].
        radius: Radius of the rod and of its ends, in [m].
    """

    frame: str
    length: float
    radius: float

    @property
    def point(self) -> tuple[float, float, float]:
        """The point that the robot moves, in the frame's axes, in [m]."""
        return (0.0, 0.0, self.length)

    @property
    def patch(self) -> tuple[float, float]:
        """Half of the extent of the contact area, in [m]."""
        return (self.radius, self.radius)


@dataclass(frozen=True)
class Sole:
    """A flat sole whose lower face has its middle at a point of a robot's frame.

    Attributes:
        patch: Half of its length and of its width, in [m].
        point: Middle of the lower face, in the frame's axes, in [m].
        thickness: In [m].
    """

    frame: str
    patch: tuple[float, float]
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    thickness: float = 0.02


@dataclass(frozen=True)
class Ball:
    """A ball around the origin of a robot's frame.

    Attributes:
        radius: In [m].
    """

    frame: str
    radius: float

    @property
    def point(self) -> tuple[float, float, float]:
        """The point that the robot moves, in the frame's axes, in [m]."""
        return (0.0, 0.0, 0.0)

    @property
    def patch(self) -> tuple[float, float]:
        """Half of the extent of the contact area, in [m]."""
        return (self.radius, self.radius)


Effector: TypeAlias = Rod | Sole | Ball
"""A part of a robot that may be in contact with the environment."""
