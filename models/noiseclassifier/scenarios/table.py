"""The scenarios, as data: motions, defects, and the classes that their runs may have.

Numbers 1 to 24 are those of the paper's table (Sygulla & Rixen, Table I), with its
parameters for humanoids; the others were added. Other families have equivalents where possible.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from noiseclassifier.scenarios.arm.cases import ARM
from noiseclassifier.scenarios.case import BANDS, Case, multisine
from noiseclassifier.scenarios.humanoid.cases import HUMANOID
from noiseclassifier.scenarios.quadruped.cases import QUADRUPED


@dataclass(frozen=True)
class Scenario:
    """One line of the table."""

    number: int
    name: str
    description: str
    labels: tuple[str, ...]
    cases: Mapping[str, Case]

    @property
    def families(self) -> tuple[str, ...]:
        """The families of robots that have it."""
        return tuple(self.cases)

    @property
    def healthy(self) -> bool:
        """Whether it has no failure."""
        return self.labels == ("ok",)


_OK = ("ok",)
_IMPACT = ("ok", "impact", "highaccelerations")
_FAST = ("ok", "highaccelerations", "oscillations", "impact")
_OSCILLATION = ("ok", "oscillations", "impact")

_LINES = (
    (1, "straight", "No defect: straight ahead, or from place to place.", _OK),
    (2, "curve", "No defect: in a curve.", _OK),
    (3, "directions", "No defect: sideways, backward, or in any direction.", _OK),
    (4, "spot", "No defect: on the spot.", _OK),
    (5, "obstacle-full", "An undetected obstacle under the whole foot.", _IMPACT),
    (6, "obstacle-heel", "An undetected obstacle under the heel.", _IMPACT),
    (7, "obstacle-toe", "An undetected obstacle under the toe.", _IMPACT),
    (8, "obstacle-left", "An undetected obstacle under the left side of a foot.", _IMPACT),
    (9, "obstacle-right", "An undetected obstacle under the right side of a foot.", _IMPACT),
    (10, "decalibrated", "An encoder has an offset.", _IMPACT),
    *(
        (
            11 + index,
            multisine(low, high),
            f"Sines of {low} to {high} Hz are superposed on the height of feet or tool.",
            _OSCILLATION,
        )
        for index, (low, high) in enumerate(BANDS)
    ),
    (20, "early-height", "Repeated early contact, at varied heights of the motion.", _IMPACT),
    (21, "early-duration", "Repeated early contact, at varied durations of the motion.", _IMPACT),
    (22, "platform", "Missing ground: a partial contact at an edge, a step down.", _FAST),
    (23, "force-jump", "The signal of a force sensor jumps.", _FAST),
    (24, "torque-jump", "The signal of a torque sensor, or of an attitude, jumps.", _FAST),
    (25, "limit-cycle", "Force control with too high gains becomes a limit cycle.", _OSCILLATION),
    (26, "faint-oscillation", "Sines in any of the bands, of 0.01 to 2 mm.", _OSCILLATION),
    (27, "reference-jump", "The planned motion jumps by millimetres.", _FAST),
)

_CASES = {"humanoid": HUMANOID, "quadruped": QUADRUPED, "arm": ARM}

_TABLE = tuple(
    Scenario(
        *line,
        MappingProxyType(
            {family: cases[line[1]] for family, cases in _CASES.items() if line[1] in cases}
        ),
    )
    for line in _LINES
)

SCENARIOS: Mapping[str, Scenario] = MappingProxyType({line.name: line for line in _TABLE})
"""All scenarios, by name."""
