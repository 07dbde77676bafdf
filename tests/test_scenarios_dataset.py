"""A data set is simulated run by run: each missing run once, written atomically."""

import errno
import json
import sys
from collections import Counter
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
import workers
from numpy.lib import format as npy

from noiseclassifier import scenarios
from noiseclassifier.scenarios import dataset
from noiseclassifier.scenarios.dataset import (
    Folder,
    Task,
    choose,
    described,
    grouped_by_twin,
    make,
    scenario_tasks,
    statistics,
)
from noiseclassifier.scenarios.simulation import RECIPE
from noisemodel import Block, Run, parallel

ALL = scenario_tasks(choose(["panda", "ur5"], ["1", "2", "7"]), seeds=2)


@pytest.fixture
def simulated(monkeypatch):
    """Replace the simulation; `calls` lists its calls, `falls` has the runs that fall."""
    calls, falls = [], set()

    def simulate(robot, scenario, seed, *, duration=None):
        task = Task(robot, scenario, seed)
        calls.append(task)
        if task in falls:
            raise scenarios.SimulationError(robot, scenario, seed, 1.25, "it fell")
        return stub(task, duration or 7.0)

    simulate.calls, simulate.falls = calls, falls
    monkeypatch.setattr(dataset, "simulate", simulate)
    return simulate


def stub(task: Task, duration: float) -> Run:
    """A random run of one second."""
    generator = np.random.default_rng(task.seed)
    joints = scenarios.ROBOTS[task.robot].drives.joints
    signal = generator.normal(size=(10_000, len(joints))).astype(np.float32)
    return Run(
        time=np.arange(10_000) * 1e-4,
        joint_names=joints,
        velocity=signal,
        position=signal,
        velocity_desired=signal,
        robot=task.robot,
        blocks=(Block(0.0, 0.5, "ok"), Block(0.6, 0.7, "impact")),
        meta={"scenario": task.scenario, "seed": task.seed, "duration": duration},
    )


def files(path) -> set[str]:
    return {file.relative_to(path).as_posix() for file in path.rglob("*") if file.is_file()}


def test_robots_skip_scenarios_that_they_do_not_have():
    choice = choose(["talos", "panda"], ["straight", "torque-jump", "1"])
    assert choice == {"talos": ("straight", "torque-jump"), "panda": ("straight",)}


def test_scenarios_without_a_failure_can_be_chosen():
    assert choose(["panda"], healthy=True) == {"panda": ("straight", "curve", "directions", "spot")}


def test_unknown_robots_and_scenarios_are_refused():
    with pytest.raises(scenarios.ScenarioError, match="robot 'baxter' cannot be simulated"):
        choose(["panda", "baxter"])
    with pytest.raises(scenarios.ScenarioError, match="no scenario 'tow'.*obstacle-toe"):
        choose(["panda"], ["7", "tow"])
    with pytest.raises(scenarios.ScenarioError, match="no scenario '77'"):
        choose(["panda"], ["77"])
    with pytest.raises(
        scenarios.DatasetError,
        match="no scenario of torque-jump is left for 'panda'; it has straight, curve",
    ):
        choose(["talos", "panda"], ["torque-jump"])
    with pytest.raises(
        scenarios.DatasetError, match="no scenario of 7 is left for 'panda' without a failure"
    ):
        choose(["panda"], ["7"], healthy=True)
    with pytest.raises(scenarios.DatasetError, match="no robot is named; there are talos"):
        choose([])


@pytest.mark.parametrize(
    ("numbers", "problem"),
    [
        ({"seeds": 0}, "0 seeds, expected 1 or more"),
        ({"first": -1}, "the first seed is -1, expected 0 or more"),
    ],
)
def test_numbers_out_of_range_are_refused(numbers, problem):
    with pytest.raises(scenarios.DatasetError, match=problem):
        scenario_tasks({"panda": ("straight",)}, **numbers)


def test_runs_that_share_their_twin_are_one_group():
    tasks = scenario_tasks(choose(["panda", "ur5"]), seeds=2)
    groups = grouped_by_twin(tasks)
    assert sorted(task for group in groups for task in group) == sorted(tasks)
    assert len(set(tasks)) == len(tasks)
    twins = set()
    for group in groups:
        motions = {scenarios.SCENARIOS[task.scenario].cases["arm"].motion for task in group}
        (key,) = {(task.robot, task.seed, motion) for task in group for motion in motions}
        twins.add(key)
    assert len(twins) == len(groups)
    assert max(map(len, groups)) > 10


def test_every_run_is_simulated_once(simulated, tmp_path):
    place = Folder.opened(tmp_path / "data")
    made = list(make(place, ALL))
    assert sorted(made) == sorted(ALL) == sorted(simulated.calls)
    assert place.missing(ALL) == []
    names = {"dataset.json", "times.csv", *(f"{task.name}.npz" for task in ALL)}
    assert files(place.path) == names
    assert list(make(Folder.opened(tmp_path / "data"), ALL)) == []
    assert len(simulated.calls) == len(ALL)
    assert Run.load(place.path / "panda/curve-001.npz").robot == "panda"
    with (place.path / "times.csv").open("a") as times:  # damaged lines, and files of others
        times.write("panda/curve-000,99.00\nbaxter/curve-000,1.00\npanda/cur\n\n")
    (place.path / "panda" / "straight-x.npz").write_bytes(b"")
    assert place.times()[Task("panda", "curve", 0)] == 99.0
    assert set(place.times()) == set(place.kept()) == set(ALL)


def test_a_data_set_that_was_interrupted_resumes(simulated, tmp_path):
    place = Folder.opened(tmp_path)
    assert "0 runs" in described(statistics(place))
    assert len(list(islice(make(place, ALL), 4))) == 4
    assert len(place.kept()) == 4
    (place.file(ALL[-1]).parent / f".{place.file(ALL[-1]).stem}.npz.x1y2z3").write_bytes(b"half")
    assert len(list(make(place, ALL))) == len(ALL) - 4
    assert sorted(simulated.calls) == sorted(ALL)
    assert not [name for name in files(tmp_path) if "x1y2z3" in name]


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
    found = statistics(place)
    assert found["upright"]["panda"]["obstacle-toe"] == {"upright": 1, "runs": 2}
    assert found["upright"]["ur5"]["obstacle-toe"] == {"upright": 2, "runs": 2}
    assert "12 runs, 1 of which fell" in described(found)
    assert "5/6   obstacle-toe (1)" in described(found)


def test_complete_frames_of_a_block_count_and_one_for_a_shorter_block(
    simulated, tmp_path, monkeypatch
):
    lengths = (0.39, 0.4, 0.4999, 0.5, 1.25)
    starts = np.cumsum([0.0, *lengths])
    blocks = tuple(Block(a, a + b, "ok") for a, b in zip(starts, lengths, strict=False))
    monkeypatch.setattr(Folder, "read", lambda *_: (blocks, 7.0))
    place = Folder.opened(tmp_path)
    list(make(place, ALL[:1]))
    amount = statistics(place)["classes"]["panda"]["ok"]
    assert amount["blocks"] == 5
    assert amount["seconds"] == pytest.approx(sum(lengths))
    assert amount["frames"] == 1 + 1 + 1 + 2 + 9


def test_statistics_are_plain_data_too(simulated, tmp_path):
    place = Folder.opened(tmp_path)
    list(make(place, ALL))
    found = json.loads(json.dumps(statistics(place)))
    assert found["upright"]["panda"]["curve"] == {"upright": 2, "runs": 2}
    assert found["classes"]["ur5"]["ok"] == {"blocks": 6, "seconds": 3.0, "frames": 12}
    assert found["cpu"]["panda"]["simulated"] == pytest.approx(6.0, abs=0.01)
    assert found["cpu"]["panda"]["seconds"] > 0
    assert found["bytes"] == sum((tmp_path / name).stat().st_size for name in files(tmp_path))


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"recipe": 1}, r"made with recipe 1, now it is \d+; name another folder"),
        ({"form": "samples"}, 'made with form "samples", now it is "scenarios"'),
        ({"duration": 3.0}, "made with duration 3.0, now it is null"),
        ({"format": "noise-dataset/2"}, 'made with format "noise-dataset/2"'),
    ],
)
def test_a_folder_with_other_settings_is_refused(tmp_path, change, problem):
    Folder.opened(tmp_path)
    made = json.loads((tmp_path / "dataset.json").read_text())
    (tmp_path / "dataset.json").write_text(json.dumps({**made, **change}))
    with pytest.raises(scenarios.DatasetError, match=problem):
        Folder.opened(tmp_path)


def test_outputs_that_cannot_hold_a_data_set_are_refused(tmp_path):
    (tmp_path / "notes.txt").write_text("precious")
    with pytest.raises(scenarios.DatasetError, match=r"notes\.txt: is a file; name a folder"):
        Folder.opened(tmp_path / "notes.txt")
    with pytest.raises(scenarios.DatasetError, match="holds other files"):
        Folder.opened(tmp_path)
    with pytest.raises(scenarios.DatasetError, match="cannot be made"):
        Folder.opened(tmp_path / "notes.txt" / "data")
    with pytest.raises(scenarios.DatasetError, match="rate 20000 Hz: expected at most 10000 Hz"):
        Folder.opened(tmp_path / "data", rate=20_000.0)
    with pytest.raises(scenarios.DatasetError, match="duration 1 s: expected at least 3 s"):
        Folder.opened(tmp_path / "data", duration=1.0)
    (tmp_path / "odd").mkdir()
    (tmp_path / "odd" / "dataset.json").write_text("{")
    with pytest.raises(scenarios.DatasetError, match=r"dataset\.json: damaged"):
        Folder.opened(tmp_path / "odd")
    assert files(tmp_path) == {"notes.txt", "odd/dataset.json"}


def test_a_full_disk_is_one_line_and_leaves_no_partial_file(simulated, tmp_path, monkeypatch):
    place = Folder.opened(tmp_path)
    written, write = Counter(), npy.write_array

    def full(stream, array, **settings):
        if str(array) == "noise-run/1":  # each run begins with its format
            written["runs"] += 1
        if written["runs"] > 3:
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
    place.clear(overwrite=False)
    monkeypatch.setattr(npy, "write_array", write)
    assert len(list(make(place, ALL))) == len(ALL) - 3


def test_a_damaged_run_is_replaced_only_with_overwrite(simulated, tmp_path):
    place = Folder.opened(tmp_path)
    list(make(place, ALL))
    path = tmp_path / "ur5/curve-001.npz"
    whole = path.read_bytes()
    path.write_bytes(whole[:5000])
    with pytest.raises(
        scenarios.DatasetError,
        match=r"ur5/curve-001\.npz: not a run file: .*--overwrite replaces",
    ):
        place.clear(overwrite=False)
    assert path.stat().st_size == 5000
    place.clear(overwrite=True)
    assert list(make(place, ALL)) == [Task("ur5", "curve", 1)]
    assert path.read_bytes() == whole
    assert len(simulated.calls) == len(ALL) + 1


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
    tasks = scenario_tasks(choose(["panda"], ["2", "3", "7"]), seeds=1)
    places = [Folder.opened(tmp_path / str(jobs), duration=3.0) for jobs in (1, 2)]
    for jobs, place in enumerate(places, start=1):
        assert sorted(make(place, tasks, jobs=jobs)) == sorted(tasks)
    one, two = ((place.file(task).read_bytes() for task in tasks) for place in places)
    assert list(one) == list(two)
    assert set(places[1].times()) == set(tasks)


def test_a_run_that_kills_its_worker_is_named_and_all_others_are_made(tmp_path, monkeypatch):
    place, deadly = Folder.opened(tmp_path), ALL[1]
    workers.simulate(monkeypatch)
    monkeypatch.setattr(
        dataset,
        "simulate",
        lambda *task, duration: workers.die() if Task(*task) == deadly else stub(Task(*task), 7.0),
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
    tasks = scenario_tasks(choose(["panda"], ["2", "3"]), seeds=1)
    with pytest.raises(
        scenarios.DatasetError, match="duration 1 s: expected at least 3 s; the same command"
    ):
        list(make(place, tasks, jobs=2))
