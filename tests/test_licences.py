"""The licences of what ships, and of the robots that it was trained on."""

import re
import tomllib
from pathlib import Path

import pytest

import noisemodel
from noisemodel.robot import locate

ROOT = Path(__file__).parents[1]
NOTES = tomllib.loads((ROOT / "REUSE.toml").read_text(encoding="utf-8"))["annotations"]
# Licences that allow anyone any use and derived works.
FREE = ("Apache-2.0", "BSD", "BSD-2-Clause", "BSD-3-Clause", "MPL-2.0")
HEADERS = {
    "Attribution-NonCommercial-NoDerivs 3.0": "CC BY-NC-ND 3.0",
    "Apache License, Version 2.0": "Apache-2.0",
}
TEXTS = {
    "Apache License\n": "Apache-2.0",
    "BSD 3-Clause": "BSD-3-Clause",
    "Neither the name of": "BSD-3-Clause",
}
ROW = re.compile(r"^\| (`.+?) \| (\w+) \| ([^|]+) \| ([^|]+) \| (yes|no) \|", re.M)
ROWS = ROW.findall((ROOT / "docs" / "robots.md").read_text(encoding="utf-8"))


def paths(note):
    return [note["path"]] if isinstance(note["path"], str) else note["path"]


def expressions():
    return {name for each in NOTES for name in each["SPDX-License-Identifier"].split(" AND ")}


def test_each_licence_that_is_named_is_there_and_no_other():
    assert {path.stem for path in (ROOT / "LICENSES").iterdir()} == expressions()
    assert all(path.suffix == ".txt" for path in (ROOT / "LICENSES").iterdir())
    assert (ROOT / "LICENSES" / "MIT.txt").read_text() == (ROOT / "LICENSE").read_text()


def test_each_path_of_the_notes_names_a_file():
    for note in NOTES:
        for pattern in paths(note):
            assert list(ROOT.glob(pattern)), pattern


def test_pictures_of_robots_name_the_licence_of_the_robot():
    ours = {"MIT"}
    shown = {
        path: set(note["SPDX-License-Identifier"].split(" AND ")) - ours
        for note in NOTES
        for path in paths(note)
        if note["SPDX-License-Identifier"] != "MIT"
    }
    assert all(licences <= set(FREE) for licences in shown.values())
    texts = [
        path.read_text(encoding="utf-8") for path in [*ROOT.glob("docs/*.md"), ROOT / "README.md"]
    ]
    quoted = {name for text in texts for name in re.findall(r"assets/pictures/[\w.-]+", text)}
    assert set(shown) <= quoted, "a note on a picture that no page shows"


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[1])
def test_the_licence_of_a_robot_is_that_of_its_package(row):
    robots, package, licence, source, _ = row
    for robot in re.findall(r"`(\w+)`", robots):
        urdf = locate(robot)
        folder = urdf.parents[1]
        said = stated(folder, urdf)
        assert folder.name == package
        assert said == licence.split(" (")[0], (
            f"{robot}: {licence} in the table, {said} in {folder}"
        )
        assert ("its LICENSE" in source) == (folder / "LICENSE").exists()
        assert ("the header" in source) == bool(header(urdf))


def stated(folder, urdf):
    """What a package states of a robot, the URDF before the licence file before the README."""
    if found := header(urdf):
        return found
    if (folder / "LICENSE").exists():
        text = (folder / "LICENSE").read_text(encoding="utf-8")
        return next(name for words, name in TEXTS.items() if words in text)
    (line,) = re.findall(r"^licen[sc]e: *(.+?) *$", (folder / "README.md").read_text(), re.M | re.I)
    spelt = {"ASL 2.0": "Apache-2.0", "CC-BY-SA-4.0": "CC BY-SA 4.0"}
    return spelt.get(line, line.replace("CC-BY-NC-ND-", "CC BY-NC-ND "))


def header(urdf):
    text = urdf.read_text(encoding="utf-8", errors="replace")[:4000]
    return next((name for words, name in HEADERS.items() if words in text), "")


def test_nothing_is_learnt_from_a_robot_whose_licence_forbids_a_use():
    for robots, _, licence, _, learnt in ROWS:
        assert learnt == "no" or licence.split(" (")[0] in FREE, robots


def test_the_table_is_of_all_robots():
    named = [robot for row in ROWS for robot in re.findall(r"`(\w+)`", row[0])]
    assert sorted(named) == sorted(noisemodel.ROBOTS)
