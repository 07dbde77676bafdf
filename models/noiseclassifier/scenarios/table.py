"""The scenarios, and the faults of wide domains, as table.toml has them."""

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

from noiseclassifier.scenarios import faults
from noiseclassifier.scenarios.faults import NO_DEFECT, ON_DRIVES, Ahead, Defect, Scaled, Underfoot
from noiseclassifier.scenarios.motions import Motion, Picks, Reach, Stand, Trot, Walk

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
    defect: Defect = field(default=NO_DEFECT)
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
    def families(self) -> tuple[str, ...]:
        """The families of robots that have it."""
        return tuple(self.cases)

    @property
    def healthy(self) -> bool:
        """Whether it has no failure."""
        return self.labels == ("ok",)


def _plain(value: Any) -> Any:
    """A value of a TOML file, its lists as tuples."""
    return tuple(map(_plain, value)) if isinstance(value, list) else value


def _defect(given: Mapping[str, Any], band: tuple[int, int]) -> Any:
    settings = {name: _plain(value) for name, value in given.items()}
    kind, units = settings.pop("kind"), settings.pop("units", None)
    if "bands" in settings:
        settings["bands"] = BANDS if settings["bands"] == "all" else (band,)
    if "defect" in settings:
        settings["defect"] = _defect(settings["defect"], band)
    defect = getattr(faults, kind)(**settings)
    return Scaled(defect, units) if units else defect


def _named(name: str) -> Iterator[tuple[str, tuple[int, int]]]:
    """A name, or one for each of the paper's bands."""
    for low, high in BANDS if _EACH in name else BANDS[:1]:
        yield name.replace(_EACH, f"{low}-{high}"), (low, high)


def _scenarios(given: Mapping[str, Any]) -> Iterator[Scenario]:
    for number, (name, band) in enumerate(_named(given["name"]), start=given["number"]):
        cases = {
            family: Case(
                MOTIONS[family](**{k: _plain(v) for k, v in each.get("motion", {}).items()}),
                _defect(each["fault"], band) if "fault" in each else NO_DEFECT,
                each.get("description", ""),
            )
            for family, each in given.items()
            if family in MOTIONS
        }
        description = given["description"].replace(_EACH, "{} to {}".format(*band))
        labels = ("ok", *given.get("labels", "").split())
        yield Scenario(number, name, description, labels, MappingProxyType(cases))


_TABLE = tomllib.loads(Path(__file__).with_name("table.toml").read_text(encoding="utf-8"))

SCENARIOS: Mapping[str, Scenario] = MappingProxyType(
    {line.name: line for given in _TABLE["scenario"] for line in _scenarios(given)}
)
"""All scenarios, by name."""
FAULTS: Mapping[str, Mapping[str, Defect]] = MappingProxyType(
    {
        family: MappingProxyType(
            ON_DRIVES
            | {
                own: _defect(fault, band)
                for name, fault in each.items()
                for own, band in _named(name)
            }
        )
        for family, each in _TABLE["wide"].items()
    }
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
        idle = tuple(
            name for name, each in FAULTS[family].items() if isinstance(each, Underfoot | Ahead)
        )
    elif isinstance(motion, Stand):
        idle = ("edge", *(name for name in FAULTS[family] if name.startswith("obstacle")))
    elif family == "humanoid" and not motion.walk.drop:
        idle = ("edge",)
    return tuple(name for name in FAULTS[family] if name not in idle)
