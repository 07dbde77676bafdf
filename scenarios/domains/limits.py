"""How soft, late and coarse drives may be before robots of a family fall."""

from dataclasses import dataclass
from typing import TypeAlias

Range: TypeAlias = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Drives with which a family's robots stay upright in at least four of five runs.

    Attributes:
        stiffness: Scale of the position gains.
        damping: Scale of the velocity gains.
        delay: Longest time from a reading to its torque, in [s].
        hold: Longest time for which targets are held, in [s].
    """

    stiffness: Range
    damping: Range
    delay: float
    hold: float
