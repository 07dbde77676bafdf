"""A data set is simulated run by run: each missing run once, written atomically."""

import errno
import json
import sys
from dataclasses import replace
from itertools import islice

import pytest
import workers
from numpy.lib import format as npy
from simulated import nothing, stub

from noiseclassifier import scenarios
from noiseclassifier.scenarios import dataset
from noiseclassifier.scenarios.dataset import (
    Folder,
    Task,
    described,
    grouped_by_twin,
    make,
    scenario_tasks,
    statistics,
)
from noiseclassifier.scenarios.simulation import RECIPE
from noisemodel import Run, parallel

ALL = scenario_tasks(["panda", "ur5"], ["1", "2", "7"], seeds=2)


@pytest.fixture
def simulated(monkeypatch):
    return nothing(monkeypatch)


def files(path) -> set[str]:
    return {file.relative_to(path).as_posix() for file in path.rglob("*") if file.is_file()}


def test_robots_skip_scenarios_that_they_do_not_have_or_that_are_not_asked_for():
    tasks = scenario_tasks(["talos", "panda"], ["straight", "torque-jump", "1"], seeds=1)
    assert [task.name for task in tasks] == [
        "talos/straight-000",
        "talos/torque-jump-000",
        "panda/straight-000",
    ]
    tasks = scenario_tasks(["panda"], ["1", "2", "3", "4"], first=3, seeds=1)
    assert [task.scenario for task in tasks] == ["straight", "curve", "directions", "spot"]
    assert {task.seed for task in tasks} == {3}


@pytest.mark.parametrize(
    ("robots", "names", "problem"),
    [
        (["panda", "baxter"], [], "robot 'baxter' cannot be simulated"),
        (["panda"], ["7", "tow"], "no scenario 'tow'.*obstacle-toe"),
        (["talos", "panda"], ["torque-jump"], "no scenario is left for 'panda'; it has straight"),
        ([], [], "no robot is named; there are talos"),
    ],
)
def test_unknown_robots_and_scenarios_are_refused(robots, names, problem):
    with pytest.raises(scenarios.ScenarioError, match=problem):
        scenario_tasks(robots, names)


def test_runs_that_share_their_twin_are_one_group():
    tasks = scenario_tasks(["panda", "ur5"], seeds=2)
    groups = grouped_by_twin(tasks)
    assert sorted(task for group in groups for task in group) == sorted(set(tasks)) == sorted(tasks)
    twins = {
        (task.robot, task.seed, scenarios.SCENARIOS[task.scenario].cases["arm"].motion): number
        for number, group in enumerate(groups)
        for task in group
    }
    assert sorted(twins.values()) == list(range(len(groups)))
    assert max(map(len, groups)) > 10


def test_every_run_is_simulated_once_also_if_it_was_interrupted(simulated, tmp_path):
    place = Folder.opened(tmp_path / "data")
    assert "0 runs" in described(statistics(place))
    made = list(islice(make(place, ALL), 3))
    assert sorted(made) == place.kept()
    made += make(place, ALL)
    assert sorted(made) == sorted(ALL) == sorted(simulated.calls)
    assert files(place.path) == {"dataset.json", *(f"{task.name}.npz" for task in ALL)}
    assert Run.load(place.path / "panda/curve-001.npz").robot == "panda"
    for name in ("panda/straight-x", "panda/dance-000", "baxter/curve-000"):  # files of others
        (place.path / name).parent.mkdir(exist_ok=True)
        (place.path / f"{name}.npz").write_bytes(b"")
    assert place.kept() == sorted(ALL)
    assert list(make(Folder.opened(tmp_path / "data"), ALL)) == []
    assert len(simulated.calls) == len(ALL)


def test_a_run_that_fell_is_recorded_and_not_simulated_again(simulated, tmp_path):
    fallen = Task("panda", "obstacle-toe", 1)
    simulated.falls.add(fallen)
    place = Folder.opened(tmp_path)
    assert fallen in list(make(place, ALL))
    assert not place.file(fallen).exists()
    record = json.loads((tmp_path / "panda/obstacle-toe-001.fallen.json").read_text())
    assert (record["time"], record["problem"], record["seed"]) == (1.25, "it fell", 1)
    assert record["recipe"] == RECIPE
    assert list(make(place, ALL)) == []
    found = json.loads(json.dumps(statistics(place)))
    assert found["upright"]["panda"]["obstacle-toe"] == {"upright": 1, "runs": 2}
    assert found["upright"]["ur5"]["obstacle-toe"] == {"upright": 2, "runs": 2}
    assert found["classes"]["ur5"]["ok"] == {"blocks": 6, "seconds": 6.0}
    assert found["motion"] == pytest.approx(22.0, abs=0.01)
    assert found["bytes"] == sum((tmp_path / name).stat().st_size for name in files(tmp_path))
    text = described(found)
    assert text.startswith("12 runs, 1 of which fell and are left out; 0.01 h of motion, ")
    assert [line.split() for line in text.splitlines() if line.startswith(("panda", "ur5"))] == [
        ["panda", "5/6", "obstacle-toe", "(1)"],
        ["ur5", "6/6", "none"],
        ["panda", "ok", "5", "5.0", "50.0%"],
        ["panda", "oscillations", "5", "5.0", "50.0%"],
        ["ur5", "ok", "6", "6.0", "50.0%"],
        ["ur5", "oscillations", "6", "6.0", "50.0%"],
    ]


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"recipe": 1}, r"made with recipe 1, now it is \d+; name another folder"),
        ({"form": "samples"}, 'made with form "samples", now it is "scenarios"'),
        ({"duration": 3.0}, "made with duration 3.0, now it is null"),
        ({"format": "noise-dataset/2"}, 'made with format "noise-dataset/2"'),
        (None, r"dataset\.json: damaged"),
    ],
)
def test_a_folder_with_other_settings_is_refused(tmp_path, change, problem):
    Folder.opened(tmp_path)
    made = json.loads((tmp_path / "dataset.json").read_text())
    text = json.dumps({**made, **change}) if change else "{"
    (tmp_path / "dataset.json").write_text(text)
    with pytest.raises(scenarios.DatasetError, match=problem):
        Folder.opened(tmp_path)


def test_outputs_that_cannot_hold_a_data_set_are_refused(tmp_path):
    (tmp_path / "notes.txt").write_text("precious")
    for path, problem in (
        ("notes.txt", r"notes\.txt: no folder of a data set \(it has no dataset\.json\)"),
        ("", "no folder of a data set .*; name an empty folder"),
        ("notes.txt/data", "cannot be made"),
    ):
        with pytest.raises(scenarios.DatasetError, match=problem):
            Folder.opened(tmp_path / path)
    assert files(tmp_path) == {"notes.txt"}


def test_a_full_disk_is_one_line_and_leaves_no_partial_file(simulated, tmp_path, monkeypatch):
    place = Folder.opened(tmp_path)
    written, write = [], npy.write_array

    def full(stream, array, **settings):
        if str(array) == "noise-run/1":  # each run begins with its format
            written.append(array)
        if len(written) > 3:
            raise OSError(errno.ENOSPC, "No space left on device")
        write(stream, array, **settings)

    monkeypatch.setattr(npy, "write_array", full)
    with pytest.raises(
        scenarios.DatasetError,
        match=r"-000\.npz: cannot be written \(No space left on device\); the same command resumes",
    ):
        list(make(place, ALL))
    assert len(place.kept()) == 3
    assert len([name for name in files(tmp_path) if name.endswith(".npz")]) == 3
    monkeypatch.setattr(npy, "write_array", write)
    assert len(list(make(place, ALL))) == len(ALL) - 3


def test_a_damaged_run_is_named_and_made_again_once_it_is_deleted(simulated, tmp_path):
    place, damaged = Folder.opened(tmp_path), Task("ur5", "curve", 1)
    list(make(place, ALL))
    whole = place.file(damaged).read_bytes()
    place.file(damaged).write_bytes(whole[:5000])
    with pytest.raises(
        scenarios.DatasetError, match=r"ur5/curve-001\.npz: not a run file: .*; delete it, and"
    ):
        statistics(place)
    place.file(damaged).unlink()
    assert list(make(place, ALL)) == [damaged]
    assert place.file(damaged).read_bytes() == whole


def test_without_mujoco_nothing_is_simulated_but_a_complete_data_set_is_read(
    simulated, tmp_path, monkeypatch
):
    place = Folder.opened(tmp_path)
    list(make(place, ALL[:2]))
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(scenarios.ScenarioError, match=r"pip install 'noise-inspector\[sim\]'"):
        list(make(place, ALL))
    assert list(make(place, ALL[:2])) == []
    assert len(simulated.calls) == 2


@pytest.mark.slow
def test_several_processes_make_the_same_files_as_one(tmp_path):
    tasks = scenario_tasks(["panda"], ["2", "7"], seeds=1)
    places = [Folder.opened(tmp_path / str(jobs), duration=3.0) for jobs in (1, 2)]
    for jobs, place in enumerate(places, start=1):
        assert sorted(make(place, tasks, jobs=jobs)) == sorted(tasks)
    one, two = ([place.file(task).read_bytes() for task in tasks] for place in places)
    assert one == two


def test_a_run_that_kills_its_worker_is_named_and_all_others_are_made(tmp_path, monkeypatch):
    place, deadly = Folder.opened(tmp_path), ALL[1]
    workers.simulate(monkeypatch)
    monkeypatch.setattr(
        dataset,
        "simulate",
        lambda *task, duration: workers.die() if Task(*task) == deadly else stub(*task),
    )
    made = []
    with pytest.raises(
        scenarios.DatasetError, match=f"{deadly.name}: {parallel.DIED}; the same command"
    ):
        made.extend(make(place, ALL, jobs=2))
    assert place.missing(ALL) == [deadly]


@pytest.mark.slow
def test_an_error_in_another_process_is_one_line(tmp_path):
    place = replace(Folder.opened(tmp_path), duration=1.0)
    tasks = scenario_tasks(["panda"], ["2", "3"], seeds=1)
    with pytest.raises(
        scenarios.DatasetError, match="duration 1 s: expected at least 3 s; the same command"
    ):
        list(make(place, tasks, jobs=2))
