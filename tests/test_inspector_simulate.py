"""`inspector simulate`: one run, or a data set that resumes."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from commandline import call, printed, refused
from simulated import nothing, stub

from inspector.training import classified
from noiseclassifier import scenarios
from noiseclassifier.scenarios.dataset import Task
from noisemodel import Run, decimated

ROOT = Path(__file__).parents[1]
JOINTS = scenarios.ROBOTS["panda"].drives.joints


@pytest.fixture
def simulated(monkeypatch):
    return nothing(monkeypatch)


def many(*arguments):
    return ("simulate", "dataset", "--robots", "panda", *arguments)


def test_scenarios_are_listed_with_numbers_and_families():
    *lines, robots = printed("simulate", "--list").splitlines()
    assert [line.split()[:2] for line in lines] == [
        [str(line.number), name] for name, line in scenarios.SCENARIOS.items()
    ]
    assert all(any(family in line for family in ("humanoid", "arm")) for line in lines)
    assert "panda" in robots


@pytest.mark.parametrize("command", [["simulate"], ["simulate", "run"]])
@pytest.mark.parametrize("scenario", ["7", "obstacle-toe"])
def test_one_run_is_made_by_name_or_number(simulated, tmp_path, command, scenario):
    output = tmp_path / "run.npz"
    out = printed(*command, "panda", "--scenario", scenario, "--seed", 3, "-o", output)
    assert "oscillations from 1.00 s to 2.00 s" in out
    assert simulated.calls == [Task("panda", "obstacle-toe", 3)]
    assert Run.load(output).meta["seed"] == 3


def test_a_data_set_is_made_once_and_its_statistics_are_printed(simulated, tmp_path):
    simulated.falls.add(Task("panda", "obstacle-toe", 5))
    command = many("--seeds", 2, "--first-seed", 4, "--scenarios", "1,7", "-o", tmp_path)
    out = printed(*command)
    assert "3/4   obstacle-toe (1)" in out
    assert "4 runs, 1 of which fell" in out
    assert call(*command)[1] == out
    assert len(simulated.calls) == 4
    found = json.loads(printed(*command, "--json"))
    assert found["upright"]["panda"]["obstacle-toe"] == {"upright": 1, "runs": 2}
    assert len(simulated.calls) == 4


@pytest.mark.parametrize(
    ("arguments", "status", "problem"),
    [
        (["--robots", "panda,baxter"], 3, "robot 'baxter' cannot be simulated"),
        (["--scenarios", "24"], 3, "no scenario is left for 'panda'"),
        (["--seeds", "0"], 2, "greater than or equal to 1"),
        (["--first-seed", "-1"], 2, "greater than or equal to 0"),
        (["--duration", "1"], 2, "greater than or equal to 3"),
        (["--rate", "20000"], 2, "less than or equal to 10000"),
    ],
)
def test_wrong_settings_simulate_nothing(simulated, tmp_path, arguments, status, problem):
    found, out, err = call(*many(*arguments, "-o", tmp_path / "data"))
    assert (found, out) == (status, "")
    assert problem in " ".join(err.split())
    assert not (tmp_path / "data").exists()
    assert simulated.calls == []


def test_wrong_outputs_and_damaged_runs_are_one_line(simulated, tmp_path):
    (tmp_path / "file").write_text("precious")
    data = tmp_path / "data"
    call(*many("--seeds", 1, "--scenarios", 1, "-o", data))
    (data / "panda/straight-000.npz").write_bytes(b"PK")
    for path, problem in (
        (tmp_path / "file", "file: no folder of a data set"),
        (data, "straight-000.npz: not a run file"),
    ):
        assert problem in refused(*many("--seeds", 1, "--scenarios", 1, "-o", path))
    assert (tmp_path / "file").read_text() == "precious"


def test_without_the_simulator_one_line_names_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    for command in (("simulate", "panda", "-o", tmp_path / "r.npz"), many("-o", tmp_path / "data")):
        assert "pip install 'noise-inspector[sim]'" in refused(*command)
    assert not (tmp_path / "r.npz").exists()


def test_a_data_set_keeps_the_signals_of_its_runs_at_its_rate(simulated, tmp_path):
    run = stub("panda", "straight", 0)
    for rate in (10_000, 1000):
        data = tmp_path / str(rate)
        call(*many("--seeds", 1, "--scenarios", "1", "--rate", rate, "-o", data))
        kept = Run.load(data / "panda/straight-000.npz")
        wanted = decimated(run, rate) if rate < run.rate else run
        np.testing.assert_allclose(kept.velocity, wanted.velocity, rtol=1e-6)
        assert kept.velocity.dtype == np.float32
        assert kept.rate == pytest.approx(rate)
        ((recording, _),) = classified([data], rate)
        assert recording.name == "panda/straight-000"
