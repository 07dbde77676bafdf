"""How soft and how late the drives of a family may be without the robot falling."""

from dataclasses import dataclass

Range = tuple[float, float]


@dataclass(frozen=True)
class Limits:
    """Limits of what a domain draws for a family of robots.

    Attributes:
        stiffness: Scale of the nominal position gains, least and most.
        damping: Scale of the nominal velocity gains, least and most.
        delay: Longest delay from a reading to its torque, in [s].
        hold: Longest time for which targets are held, in [s].
    """

    stiffness: Range = (0.0, float("inf"))
    damping: Range = (0.0, float("inf"))
    delay: float = float("inf")
    hold: float = float("inf")
