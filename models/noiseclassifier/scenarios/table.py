"""The scenarios, and the faults of wide domains, as table.toml has them."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Any

from noiseclassifier.scenarios import faults
from noiseclassifier.scenarios.faults import Defect, Faults, Rng, no_defect
from noiseclassifier.scenarios.motions import (
    Motion,
    Picks,
    Plan,
    Reach,
    Stand,
    Trot,
    Walk,
    multiplied,
)
from noiseclassifier.scenarios.robots import settings

BANDS: tuple[tuple[int, int], ...] = (
    (20, 30), (30, 40), (40, 50), (50, 60), (60, 100), (100, 150), (150, 250), (250, 350),
    (900, 1000),
)  # fmt: skip
"""The paper's bands of oscillation, in [Hz]."""
MOTIONS = {"humanoid": Walk, "quadruped": Trot, "arm": Picks}  # motions of the scenarios, by family
_EACH = "each-band"


@dataclass(frozen=True)
class Case:
    """A scenario for one family of robots."""

    motion: Motion
    defect: Defect = no_defect
    description: str = ""


@dataclass(frozen=True)
class Scenario:
    """One line of the table."""

    number: int
    name: str
    description: str
    labels: tuple[str, ...]
    cases: Mapping[str, Case]

    @property
    def healthy(self) -> bool:
        """Whether it has no failure."""
        return self.labels == ("ok",)


def _defect(given: Mapping[str, Any], band: tuple[int, int]) -> Defect:
    """A kind of fault with its settings, of which some are in units of the robot."""
    own = dict(given)
    kind, units = getattr(faults, own.pop("kind")), own.pop("units", {})
    if "bands" in own:
        own["bands"] = BANDS if own["bands"] == "all" else (band,)

    def scaled(rng: Rng, plan: Plan) -> Faults:
        sizes = {
            name: multiplied(own[name], getattr(plan.units, unit)) for name, unit in units.items()
        }
        found: Faults = kind(rng, plan, **own | sizes)
        return found

    return scaled if units else partial(kind, **own)


def _defects(table: Mapping[str, Any]) -> dict[str, Defect]:
    return {own: _defect(each, band) for name, each in table.items() for own, band in _named(name)}


def _named(name: str) -> Iterator[tuple[str, tuple[int, int]]]:
    """A name, or one for each of the paper's bands."""
    for low, high in BANDS if _EACH in name else BANDS[:1]:
        yield name.replace(_EACH, f"{low}-{high}"), (low, high)


def _scenarios(given: Mapping[str, Any]) -> Iterator[Scenario]:
    for number, (name, band) in enumerate(_named(given["name"]), start=given["number"]):
        cases = {
            family: Case(
                MOTIONS[family](**each.get("motion", {})),
                _defect(each["fault"], band) if "fault" in each else no_defect,
                each.get("description", ""),
            )
            for family, each in given.items()
            if family in MOTIONS
        }
        description = given["description"].replace(_EACH, "{} to {}".format(*band))
        labels = ("ok", *given.get("labels", "").split())
        yield Scenario(number, name, description, labels, MappingProxyType(cases))


_TABLE = settings("table.toml")
SCENARIOS: Mapping[str, Scenario] = MappingProxyType(
    {line.name: line for given in _TABLE["scenario"] for line in _scenarios(given)}
)
"""All scenarios, by name."""
ON_DRIVES, THROUGHOUT = _defects(_TABLE["drives"]), _defects(_TABLE["throughout"])
"""Faults of drives of every family, for a while and from the first sample to the last, by name."""
FAULTS: Mapping[str, Mapping[str, Defect]] = MappingProxyType(
    {family: ON_DRIVES | _defects(own) for family, own in _TABLE["wide"].items()}
)
"""Faults of wide domains by family and name: of drives and commands, and the family's own."""


def suited(family: str, motion: Any) -> tuple[str, ...]:
    """Names of the faults of a family that can act in a motion."""
    idle: tuple[str, ...] = ()
    on_contact = ("obstacle", "giving-way", "force-gain", "force-jump")
    if isinstance(motion, Reach):
        idle = on_contact
    elif isinstance(motion, Picks):
        idle = ("joint-stop", *(on_contact if motion.way == "directions" else ()))
    elif isinstance(motion, Trot) and motion.gait == "stand":
        steps = ("underfoot", "step_down")
        idle = tuple(name for name, own in _TABLE["wide"][family].items() if own["kind"] in steps)
    elif isinstance(motion, Stand):
        idle = ("edge", *(name for name in FAULTS[family] if name.startswith("obstacle")))
    elif family == "humanoid" and not motion.walk.drop:
        idle = ("edge",)
    return tuple(name for name in FAULTS[family] if name not in idle)
