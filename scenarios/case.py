"""What a scenario is for one family of robots."""

from dataclasses import dataclass, field

from scenarios.defects import Defect, NoDefect
from scenarios.motions import Motion

BANDS: tuple[tuple[int, int], ...] = (
    (20, 30), (30, 40), (40, 50), (50, 60), (60, 100), (100, 150), (150, 250), (250, 350),
    (900, 1000),
)  # fmt: skip
"""The paper's bands of oscillation, in [Hz]."""


@dataclass(frozen=True)
class Case:
    """What a scenario is for one family of robots.

    Attributes:
        motion: What the robot does; without the defect, this is the run's twin.
        defect: What is wrong.
        description: What happens, where it is not what the scenario's own description says.
    """

    motion: Motion
    defect: Defect = field(default_factory=NoDefect)
    description: str = ""


def multisine(low: int, high: int) -> str:
    """Name of the scenario with oscillations in a band."""
    return f"multisine-{low}-{high}"
