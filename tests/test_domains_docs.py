"""The page about wide domains has what the code has."""

from dataclasses import fields
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from noiseclassifier.scenarios.domains import DISTRIBUTION, FIRST
from noiseclassifier.scenarios.domains.domain import TARGET_BITS, TARGET_CONTROL, TARGET_HOLD
from noiseclassifier.scenarios.domains.faults import FAULTS
from noiseclassifier.scenarios.robots import TARGETS, WIDE

PAGE = (Path(__file__).parents[1] / "docs" / "domains.md").read_text(encoding="utf-8")
FAMILIES = ("arm", "quadruped", "humanoid")


def rows(title):
    """Cells of the rows of the tables in a section of the page."""
    section = PAGE.split(f"## {title}\n")[1].split("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def test_the_table_has_exactly_the_values_of_the_distribution():
    wanted = [
        [
            f"`{each.name}`",
            *(f"{end:g}" for end in getattr(DISTRIBUTION, each.name)),
            *(each.metadata[key] for key in ("unit", "text", "source")),
        ]
        for each in fields(DISTRIBUTION)
    ]
    assert rows("The distribution")[1:] == wanted


@pytest.mark.parametrize("family", FAMILIES)
def test_the_table_has_every_robot_of_a_family_and_its_targets(family):
    names = [name for name, robot in WIDE.items() if robot.family == family]
    (row,) = [row for row in rows("Robots") if row[0] == family]
    assert row[1] == f"{len(names)}: " + ", ".join(f"`{name}`" for name in names)
    assert row[2] == ", ".join(f"`{name}`" for name in names if name in TARGETS)


def test_the_table_has_every_fault_of_drives_with_its_class():
    drives = WIDE["panda"].drives
    classes = {
        f"`{name}`": draw(np.random.default_rng(0), drives, 6.0).event.label
        for name, draw in FAULTS.items()
    }
    assert {row[0]: row[1] for row in rows("Faults") if row[0] in classes} == classes


@pytest.mark.parametrize("family", FAMILIES)
def test_the_table_has_every_fault_of_a_family(family):
    (row,) = [row for row in rows("Faults") if row[0] == family]
    named = {word for cell in row[1:] for word in cell.split("`")[1::2]}
    assert named == set(import_module(f"noiseclassifier.scenarios.{family}.domains").DEFECTS)


def test_the_page_says_what_is_never_learnt_from():
    section = PAGE.split("## Sources and targets\n")[1].split("\n## ")[0]
    for words in (
        ", ".join(f"`{robot}`" for robot in TARGETS),
        f"control is `{TARGET_CONTROL}`",
        f"{TARGET_BITS} bit or fewer",
        f"held {TARGET_HOLD} times or more",
    ):
        assert words in section
    assert f"seeds start at {FIRST}" in PAGE


def test_robots_are_learnt_from_if_their_licences_allow_it():
    page = (Path(__file__).parents[1] / "docs" / "robots.md").read_text(encoding="utf-8")
    cells = [[c.strip() for c in line.strip("|").split("|")] for line in page.splitlines()]
    said = {
        name.strip("` "): row[4]
        for row in cells
        if len(row) == 6 and row[4] in ("yes", "no")
        for name in row[0].split(",")
    }
    for name in WIDE:
        assert said[name] == ("no" if name in TARGETS else "yes"), name
