import csv
from pathlib import Path

import numpy as np
import pytest
from chains import chain
from commandline import call

from inspector.commands.inspect import write_numbers
from noisemodel import ROBOTS, Comparisons, compare
from noisemodel.compare import excitation

KINDS = ("simplified", "paper", "normal")


@pytest.fixture(scope="module")
def urdf(tmp_path_factory):
    return str(chain(tmp_path_factory.mktemp("arm"), "revolute", "revolute", "prismatic").path)


@pytest.fixture(scope="module")
def found(urdf):
    """One robot that makes the excitation of three seeds."""
    seeds = (compare(urdf, kinds=KINDS, seed=seed) for seed in (0, 1, 2))
    return Comparisons(tuple(one for (one,) in seeds))


def inspector(*arguments):
    return call("noise", "--compare", *arguments)


def test_the_csv_has_a_row_per_robot_and_kind(found, tmp_path):
    write_numbers(Comparisons(found.robots[:2]), tmp_path / "out.csv")
    with (tmp_path / "out.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["kind"] for row in rows] == [*KINDS, *KINDS]
    assert {row["reference"] for row in rows} == {"normal"}
    assert float(rows[0]["correlation"]) == pytest.approx(found[0].correlation[0, 2], abs=1e-4)
    assert sum(float(rows[0][f"share_{term}"]) for term in "ABC") == pytest.approx(1.0, abs=2e-4)
    assert [event.label for event in found[0].events][2] == "jerk"
    assert float(rows[1]["contrast_jerk_db"]) == pytest.approx(found[0].contrast[1, 2], abs=1e-4)
    bands = [name for name in rows[0] if name.startswith("distance_") and name != "distance_db"]
    assert bands[0] == "distance_0_20_db"
    assert bands[-1] == "distance_500_up_db"


def test_the_command_writes_everything_and_continues_after_a_robot_that_cannot_be_read(
    urdf, tmp_path
):
    arguments = ["--robots", f"{urdf},ur3_empty,robby", "--kind", ",".join(KINDS), "-j", "2"]
    status, out, err = inspector(*arguments, "--csv", tmp_path / "out.csv")
    assert status == 0
    assert "correlation" in out
    assert [line.split(": ")[1] for line in err.splitlines()] == ["ur3_empty", "robby"]
    assert len((tmp_path / "out.csv").read_text().splitlines()) == 1 + len(KINDS)


def test_the_command_prints_what_the_function_returns_of_robots_and_runs(urdf, tmp_path):
    run = tmp_path / "run.npz"
    excitation(chain(tmp_path, "revolute", "revolute")).save(run)
    status, out, _ = inspector(run, "--robots", f"{urdf},robby", "--kind", ",".join(KINDS))
    assert (status, out) == (0, f"{compare([run, urdf, 'robby'], kinds=KINDS)}\n")
    assert "run.npz" in out


def test_the_command_takes_each_robot_once_and_all_of_the_list(urdf, monkeypatch):
    given = []

    def listed(sources, **_):
        given.append(sources)
        return Comparisons((), ())

    monkeypatch.setattr("noisemodel.compare", listed)
    inspector("a.npz", "a.npz", "--robots", "panda, go2,panda,")
    inspector("--robots", "all")
    assert given == [[Path("a.npz"), "panda", "go2"], list(ROBOTS)]


def test_runs_without_robot_are_one_line_and_nothing_else_is_left(tmp_path):
    time = np.arange(1000) / 1000
    np.savez(tmp_path / "bare.npz", time=time, velocity=np.cos(time)[:, None])
    np.savez(tmp_path / "still.npz", time=time, velocity=np.cos(time)[:, None], robot="panda")
    status, out, err = inspector(tmp_path / "bare.npz", tmp_path / "still.npz")
    assert (status, out) == (3, "")
    first, second = err.splitlines()
    assert first.endswith("bare.npz: the run names no robot; `inspector import --robot` adds one")
    assert second.endswith("still.npz: the run has no positions, which the extended noise needs")


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        ([], 2, "name run files, or robots with --robots"),
        (["--robots", "panda", "--kind", "paper,loud"], 2, "no kind 'loud' of noise"),
        (["--robots", "panda", "--kind", "normal"], 2, "--kind names normal alone; name two kinds"),
        (["--robots", "panda", "--csv", "/no/such/folder/x.csv"], 5, "cannot be written"),
        (["--robots", "robby"], 3, "no robot 'robby'"),
    ],
)
def test_what_cannot_be_compared_is_one_line(arguments, status, message):
    found, out, err = inspector(*arguments)
    assert (found, out) == (status, "")
    assert message in err
    assert status == 2 or err.count("\n") == 1
