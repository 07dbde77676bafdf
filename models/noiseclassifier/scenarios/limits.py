"""How soft, late and coarse drives may be before robots of a family fall."""

from dataclasses import dataclass
from typing import TypeAlias

Range: TypeAlias = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Drives with which a family's robots stay upright in at least four of five runs.

    Attributes:
        delay: Longest time from a reading to its torque, in [s].
        hold: Longest time for which targets are held, in [s].
        flexibility: Lowest natural frequency of rotors on elastic gears, in [Hz].
    """

    stiffness: Range = (0.0, float("inf"))
    damping: Range = (0.0, float("inf"))
    delay: float = float("inf")
    hold: float = float("inf")
    feedforward: float = 0.0
    flexibility: float = 0.0
