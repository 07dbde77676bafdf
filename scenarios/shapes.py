"""The shapes that touch one another in a simulation."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Box:
    """A box that stands in the world, its edges along the world's axes.

    Attributes:
        centre: x, y, z of its centre, in [m].
        half: Half of its edge lengths, in [m].
    """

    centre: tuple[float, float, float]
    half: tuple[float, float, float]

    @property
    def top(self) -> float:
        """Height of its upper face, in [m]."""
        return self.centre[2] + self.half[2]


@dataclass(frozen=True)
class Rod:
    """A rod with round ends on the z axis of a robot's frame, from the frame's origin outwards.

    Attributes:
        frame: Name of the frame.
        length: From the origin to the outermost point, in [m].
        radius: Radius of the rod and of its ends, in [m].
    """

    frame: str
    length: float
    radius: float
