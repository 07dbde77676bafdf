"""A scenario for one family of robots."""

from dataclasses import dataclass, field

from noiseclassifier.scenarios.defects import Defect, NoDefect
from noiseclassifier.scenarios.motions import Motion

BANDS: tuple[tuple[int, int], ...] = (
    (20, 30), (30, 40), (40, 50), (50, 60), (60, 100), (100, 150), (150, 250), (250, 350),
    (900, 1000),
)  # fmt: skip
"""The paper's bands of oscillation, in [Hz]."""


@dataclass(frozen=True)
class Case:
    """A scenario for one family of robots."""

    motion: Motion
    defect: Defect = field(default_factory=NoDefect)
    description: str = ""


def multisine(low: int, high: int) -> str:
    """Name of the scenario with oscillations in a band."""
    return f"multisine-{low}-{high}"
