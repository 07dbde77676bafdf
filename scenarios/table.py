"""The scenarios, as data: what goes wrong, on whom, and which labels may come of it."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from scenarios.defects import (
    Decalibration,
    Defect,
    ForceGain,
    ForceJumps,
    Multisine,
    NoDefect,
    Plates,
    ReferenceJumps,
)


@dataclass(frozen=True)
class Scenario:
    """One line of the table.

    Attributes:
        name: What it is called.
        description: What happens, in one sentence.
        families: The kinds of robot on which it has a meaning.
        labels: The classes that its runs may contain.
        defect: What is wrong.
    """

    name: str
    description: str
    families: tuple[str, ...]
    labels: tuple[str, ...]
    defect: Defect


_TABLE = (
    Scenario(
        "ok",
        "Picks from a table: nothing is wrong beyond what is imperfect about every robot.",
        ("arm",),
        ("ok",),
        NoDefect(),
    ),
    Scenario(
        "table",
        "The tool comes down on plates that nobody expected to lie on the table.",
        ("arm",),
        ("ok", "impact"),
        Plates(),
    ),
    Scenario(
        "decalibrated",
        "A shoulder encoder is off, so that the tool hits the table before it should.",
        ("arm",),
        ("ok", "impact"),
        Decalibration(),
    ),
    Scenario(
        "jump",
        "The planned motion jumps by millimetres, at once or within a few milliseconds.",
        ("arm",),
        ("ok", "highaccelerations", "impact"),
        ReferenceJumps(),
    ),
    Scenario(
        "sensor",
        "The force sensor's signal jumps while the tool presses on the table.",
        ("arm",),
        ("ok", "highaccelerations"),
        ForceJumps(),
    ),
    Scenario(
        "chatter",
        "The force control's gain is too high, so that pressing becomes a limit cycle.",
        ("arm",),
        ("ok", "oscillations"),
        ForceGain(),
    ),
    Scenario(
        "multisine",
        "Sines in a band drawn by the seed are superposed on the height of the tool.",
        ("arm",),
        ("ok", "oscillations"),
        Multisine(),
    ),
)

SCENARIOS: Mapping[str, Scenario] = MappingProxyType({line.name: line for line in _TABLE})
"""All scenarios, by name."""
