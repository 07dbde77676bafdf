"""`inspector diff`: scenarios before and after a change of code."""

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from commandline import call

EXAMPLE = Path(__file__).parents[1] / "examples" / "accept"


@pytest.fixture(scope="module")
def simulate():
    sys.path.insert(0, str(EXAMPLE))
    try:
        import simulate

        yield simulate
    finally:
        sys.path.remove(str(EXAMPLE))


@pytest.fixture(scope="module")
def runs(tmp_path_factory, simulate):
    """Folders of runs before, and after each change."""
    folder = tmp_path_factory.mktemp("runs")
    simulate.write(folder / "before")
    for change in simulate.CHANGES:
        simulate.write(folder / change, change)
    return folder


def compared(before, after, *options):
    status, out, err = call("diff", before, after, "--format", "json", *options)
    assert out, err
    found = json.loads(out)
    return status, found, {row["name"]: row for row in found["scenarios"]}


def test_a_harmless_change_is_the_same(runs):
    status, found, rows = compared(runs / "before", runs / "harmless")
    assert (status, found["verdict"]) == (0, "same")
    assert all(row["over_db"] < row["margin_db"] for row in rows.values())
    assert found["counts"]["findings"] == {"new": 0, "louder": 0, "resolved": 0}


def test_a_chatter_in_one_scenario_is_worse_and_says_where(runs):
    status, found, rows = compared(runs / "before", runs / "chatter")
    assert (status, found["verdict"]) == (1, "worse")
    assert [row["verdict"] for row in found["scenarios"]] == ["worse", "same", "same"]
    change = rows["pick"]["changes"][0]
    assert (change["joint"], change["band_hz"]) == ("elbow", [32.0, 64.0])
    assert rows["pick"]["margin_db"] < change["low"] <= change["change"] <= change["high"]
    assert {each["kind"] for each in rows["pick"]["findings"]} == {"new"}


def test_a_chatter_in_all_scenarios_is_worse_in_all_in_any_order(runs, tmp_path, simulate):
    names = {"pick": "c", "place": "a", "wave": "b"}
    for side in ("before", "after"):
        (tmp_path / side).mkdir()
        for name, letter in names.items():
            for number in (1, 2, 3):
                run = simulate.run(name, number + 3 * (side == "after"))
                if side == "after":
                    tone = 0.03 * np.sin(2 * np.pi * 62 * run.time)
                    run.velocity[:, 2] += tone
                run.save(tmp_path / side / f"{letter}-{number}.npz")
    _, _, rows = compared(tmp_path / "before", tmp_path / "after")
    assert {row["verdict"] for row in rows.values()} == {"worse"}
    alone = tmp_path / "alone"
    alone.mkdir()
    for path in (tmp_path / "after").glob("a-*"):
        shutil.copy(path, alone)
    (tmp_path / "one").mkdir()
    for path in (tmp_path / "before").glob("a-*"):
        shutil.copy(path, tmp_path / "one")
    _, _, (only) = compared(tmp_path / "one", alone)
    assert only["a"]["verdict"] == "worse"
    assert only["a"]["over_db"] == rows["a"]["over_db"]
    assert only["a"]["margin_db"] == rows["a"]["margin_db"]


def test_an_improvement_is_better_and_passes(runs):
    status, found, _ = compared(runs / "before", runs / "improvement")
    assert (status, found["verdict"]) == (0, "better")
    assert found["counts"]["findings"]["new"] == 0


def test_missing_renamed_cut_and_frozen_scenarios_fail_by_name(runs, tmp_path, simulate):
    status, found, rows = compared(runs / "before", runs / "missing")
    assert (status, found["verdict"], rows["wave"]["verdict"]) == (1, "missing", "missing")
    after = shutil.copytree(runs / "before", tmp_path / "after")
    for number in (1, 2, 3):
        (after / f"wave-{number}.npz").rename(after / f"greet-{number}.npz")
    simulate.run("pick", 1).cut(0.0, 2.0).save(after / "pick-1.npz", overwrite=True)
    run = simulate.run("place", 1)
    run.velocity[:] = 0
    run.position[:] = run.position[0]
    run.save(after / "place-1.npz", overwrite=True)
    status, _, rows = compared(runs / "before", after)
    assert status == 1
    assert rows["wave"]["verdict"] == "renamed"
    assert rows["wave"]["reason"] == "is called greet after"
    assert (rows["pick"]["verdict"], rows["place"]["verdict"]) == ("cut", "frozen")
    assert "2.0 of 6.0 s" in rows["pick"]["reason"]


def test_runs_that_come_are_told_and_pass(runs):
    status, _, rows = compared(runs / "missing", runs / "before")
    assert (status, rows["wave"]["verdict"]) == (0, "added")


def test_two_runs_are_a_pair_whatever_they_are_called(runs):
    status, _, rows = compared(runs / "before" / "pick-1.npz", runs / "chatter" / "pick-3.npz")
    assert (status, rows["pick"]["verdict"]) == (1, "worse")


def test_new_findings_fail_where_they_are_to(runs, tmp_path, simulate):
    after = shutil.copytree(runs / "harmless", tmp_path / "after")
    assert call("diff", runs / "before", after, "--fail-on", "new")[0] == 0
    shutil.copy(runs / "impact" / "place-2.npz", after / "place-2.npz")
    status, out, _ = call("diff", runs / "before", after, "--fail-on", "new")
    assert status == 1
    assert "1 new" in out.splitlines()[0]


def test_folders_without_a_scenario_in_common_are_one_line(runs, tmp_path, simulate):
    (tmp_path / "other").mkdir()
    simulate.SCENARIOS["sweep"] = 4
    try:
        simulate.run("sweep", 1).save(tmp_path / "other" / "sweep-1.npz")
    finally:
        del simulate.SCENARIOS["sweep"]
    status, out, err = call("diff", runs / "before", tmp_path / "other")
    assert (status, out) == (3, "")
    assert "have no run in common, neither by name nor by motion (pick, place, wave and" in err


def test_a_file_that_cannot_be_read_fails_unless_it_is_ignored(runs, tmp_path):
    after = shutil.copytree(runs / "before", tmp_path / "after")
    (after / "pick-2.npz").write_text("no archive")
    status, out, err = call("diff", runs / "before", after, "--format", "json")
    assert status == 3
    assert list(json.loads(out)["failed"]) == [str(after / "pick-2.npz")]
    assert "pick-2.npz: not a run file" in err
    assert call("diff", runs / "before", after, "--on-bad-input", "ignore")[0] == 0


@pytest.mark.parametrize("form", ["junit", "github", "markdown"])
def test_every_format_names_what_got_worse(runs, form):
    status, out, _ = call("diff", runs / "before", runs / "chatter", "--format", form)
    assert status == 1
    assert "pick" in out
    assert "elbow" in out


def test_the_json_fits_its_schema(runs):
    jsonschema = pytest.importorskip("jsonschema")
    schema = json.loads((EXAMPLE.parents[1] / "docs" / "noise-diff-1.schema.json").read_text())
    for change in ("chatter", "missing", "improvement"):
        jsonschema.validate(compared(runs / "before", runs / change)[1], schema)


def test_a_report_shows_the_worst_scenario(runs, tmp_path):
    pytest.importorskip("matplotlib")
    report = tmp_path / "report"
    _, found, _ = compared(runs / "before", runs / "chatter", "--report", report)
    assert sorted(path.name for path in report.iterdir()) == ["diff.json", "worst.png", "worst.rrd"]
    assert found["picture"] == str(report / "worst.png")
    assert (report / "worst.png").read_bytes().startswith(b"\x89PNG")
