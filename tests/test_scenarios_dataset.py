"""A data set is made run by run: what is missing, once, and never half."""

import errno
import json
import sys
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

import scenarios
from noisemodel import Block, Run, runfile
from scenarios import dataset, folder
from scenarios.balance import Balance
from scenarios.dataset import make
from scenarios.folder import Folder
from scenarios.sample import Sample
from scenarios.tasks import Task, Wish, choose, together

JOINTS = scenarios.ROBOTS["panda"].drives.joints
ALL = Wish(choice=choose(["panda", "ur5"], ["1", "2", "7"]), seeds=2).tasks()


@pytest.fixture
def simulated(monkeypatch):
    """Let nothing be simulated, and list what would have been; "fall" holds runs that fall."""
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
    """A run of nonsense, a second of which is recorded."""
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


def test_robots_pass_over_scenarios_that_they_do_not_have():
    choice = choose(["talos", "panda"], ["straight", "torque-jump", "1"])
    assert choice == {"talos": ("straight", "torque-jump"), "panda": ("straight",)}


def test_healthy_scenarios_alone_can_be_chosen():
    assert choose(["panda"], healthy=True) == {"panda": ("straight", "curve", "directions", "spot")}


def test_what_cannot_be_chosen_is_one_line():
    with pytest.raises(scenarios.UnsimulatedRobotError, match="robot 'baxter' cannot be simulated"):
        choose(["panda", "baxter"])
    with pytest.raises(scenarios.UnknownScenarioError, match="no scenario 'tow'.*obstacle-toe"):
        choose(["panda"], ["7", "tow"])
    with pytest.raises(scenarios.UnknownScenarioError, match="no scenario '77'"):
        choose(["panda"], ["77"])
    with pytest.raises(
        scenarios.DatasetError,
        match="no scenario of torque-jump is left for 'panda'; it has straight, curve",
    ):
        choose(["talos", "panda"], ["torque-jump"])
    with pytest.raises(
        scenarios.DatasetError, match="no scenario of 7 is left for 'panda' in which nothing goes"
    ):
        choose(["panda"], ["7"], healthy=True)
    with pytest.raises(scenarios.DatasetError, match="no robot is named; there are talos"):
        choose([])


@pytest.mark.parametrize(
    ("numbers", "problem"),
    [
        ({"seeds": 0}, "0 seeds are asked for, expected 1 or more"),
        ({"first": -1}, "the first seed is -1, expected 0 or more"),
        ({"hours": 0.0}, "0 hours are asked for, expected more than 0"),
        ({"hours": float("nan")}, "nan hours"),
        ({"seeds": 2, "hours": 1.0}, "2 seeds and 1 hours are asked for; name one of them"),
    ],
)
def test_numbers_that_cannot_be_are_refused(numbers, problem):
    with pytest.raises(scenarios.DatasetError, match=problem):
        Wish(choice={"panda": ("straight",)}, **numbers)


def test_runs_that_share_their_twin_are_made_together():
    tasks = Wish(choice=choose(["panda", "ur5"]), seeds=2).tasks()
    groups = together(tasks)
    assert sorted(task for group in groups for task in group) == sorted(tasks)
    assert len(set(tasks)) == len(tasks)
    twins = set()
    for group in groups:
        motions = {scenarios.SCENARIOS[task.scenario].cases["arm"].motion for task in group}
        (key,) = {(task.robot, task.seed, motion) for task in group for motion in motions}
        twins.add(key)
    assert len(twins) == len(groups)
    assert max(map(len, groups)) > 10


def test_hours_are_filled_evenly_over_robots_and_no_further():
    choice = choose(["panda", "ur5"], healthy=True)
    seconds = {}
    for task in Wish(choice=choice, hours=0.2, first=5).tasks():
        assert task.seed >= 5
        motion = scenarios.SCENARIOS[task.scenario].cases["arm"].motion
        seconds.setdefault(task.robot, []).append(motion.duration)
    for mine in seconds.values():
        assert 360 <= sum(mine) < 360 + sum(mine[:4])


def test_a_run_that_fell_fills_no_time():
    choice = choose(["panda"], healthy=True)
    wish = Wish(choice=choice, hours=100 / 3600)
    tasks = wish.tasks(duration=5.0)
    assert len(tasks) == 20
    more = wish.tasks(duration=5.0, fallen=tasks[:1])
    assert more[: len(tasks)] == tasks
    assert len(more) == 24
    with pytest.raises(scenarios.DatasetError, match="panda fell in 20 of 20 runs, so that 100 s"):
        wish.tasks(duration=5.0, fallen=more)


def test_all_is_made_once_and_nothing_is_redone(simulated, tmp_path):
    place = Folder.opened(tmp_path / "data")
    made = list(make(place, ALL))
    assert sorted(made) == sorted(ALL) == sorted(simulated.calls)
    assert place.missing(ALL) == []
    names = {"dataset.json", "times.csv", *(f"{task.name}.npz" for task in ALL)}
    assert files(place.path) == names
    assert list(make(Folder.opened(tmp_path / "data"), ALL)) == []
    assert len(simulated.calls) == len(ALL)
    assert Sample.load(place.path / "panda/curve-001.npz").name == "panda/curve-001"


def test_what_was_stopped_goes_on_where_it_was(simulated, tmp_path):
    place = Folder.opened(tmp_path)
    assert len(list(islice(make(place, ALL), 4))) == 4
    assert len(place.kept()) == 4
    assert len(list(make(place, ALL))) == len(ALL) - 4
    assert sorted(simulated.calls) == sorted(ALL)


def test_a_run_that_fell_is_recorded_counted_and_not_redone(simulated, tmp_path):
    fallen = Task("panda", "obstacle-toe", 1)
    simulated.falls.add(fallen)
    place = Folder.opened(tmp_path)
    assert fallen in list(make(place, ALL))
    assert not place.file(fallen).exists()
    record = json.loads((tmp_path / "panda/obstacle-toe-001.fallen.json").read_text())
    assert (record["time"], record["problem"], record["seed"]) == (1.25, "it fell", 1)
    assert record["recipe"] == folder.RECIPE
    assert list(make(place, ALL)) == []
    balance = Balance.of(place)
    assert balance.upright["panda"]["obstacle-toe"] == (1, 2)
    assert balance.upright["ur5"]["obstacle-toe"] == (2, 2)
    assert "1 of which fell" in str(balance)


def test_frames_are_counted_that_lie_whole_in_a_block_and_one_for_a_shorter_block(
    simulated, tmp_path, monkeypatch
):
    lengths = (0.39, 0.4, 0.4999, 0.5, 1.25)
    starts = np.cumsum([0.0, *lengths])
    blocks = tuple(Block(a, a + b, "ok") for a, b in zip(starts, lengths, strict=False))
    monkeypatch.setattr(Folder, "read", lambda *_: (blocks, 7.0))
    place = Folder.opened(tmp_path)
    list(make(place, ALL[:1]))
    amount = Balance.of(place).amounts["panda"]["ok"]
    assert amount.blocks == 5
    assert amount.seconds == pytest.approx(sum(lengths))
    assert amount.frames == 1 + 1 + 1 + 2 + 9


def test_the_tables_are_data_too(simulated, tmp_path):
    place = Folder.opened(tmp_path)
    list(make(place, ALL))
    balance = json.loads(json.dumps(Balance.of(place).as_dict()))
    assert balance["upright"]["panda"]["curve"] == {"upright": 2, "runs": 2}
    assert balance["classes"]["ur5"]["ok"] == {"blocks": 6, "seconds": 3.0, "frames": 12}
    assert balance["cpu"]["panda"]["simulated"] == 42.0
    assert balance["cpu"]["panda"]["seconds"] > 0
    assert balance["bytes"] == sum((tmp_path / name).stat().st_size for name in files(tmp_path))


def test_an_empty_data_set_has_empty_tables(tmp_path):
    assert "0 runs" in str(Balance.of(Folder.opened(tmp_path)))


def test_lines_of_times_that_are_damaged_are_passed_over(simulated, tmp_path):
    place = Folder.opened(tmp_path)
    list(make(place, ALL))
    with (tmp_path / "times.csv").open("a") as times:
        times.write("panda/curve-000,99.00\nbaxter/curve-000,1.00\npanda/cur\n\n")
    assert place.times()[Task("panda", "curve", 0)] == 99.0
    assert set(place.times()) == set(ALL)


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"recipe": 1}, r"made with recipe 1, now it is \d+; name another folder"),
        ({"form": "noisytest"}, 'made with form "noisytest", now it is "samples"'),
        ({"duration": 3.0}, "made with duration 3.0, now it is null"),
        ({"format": "noise-dataset/2"}, 'made with format "noise-dataset/2"'),
    ],
)
def test_a_folder_that_was_made_in_another_way_is_refused(tmp_path, change, problem):
    Folder.opened(tmp_path)
    made = json.loads((tmp_path / "dataset.json").read_text())
    (tmp_path / "dataset.json").write_text(json.dumps({**made, **change}))
    with pytest.raises(scenarios.DatasetError, match=problem):
        Folder.opened(tmp_path)


def test_outputs_that_are_no_folder_for_a_data_set_are_refused(tmp_path):
    (tmp_path / "notes.txt").write_text("precious")
    with pytest.raises(scenarios.DatasetError, match=r"notes\.txt: is a file; name a folder"):
        Folder.opened(tmp_path / "notes.txt")
    with pytest.raises(scenarios.DatasetError, match="holds something else"):
        Folder.opened(tmp_path)
    with pytest.raises(scenarios.DatasetError, match="cannot be made"):
        Folder.opened(tmp_path / "notes.txt" / "data")
    with pytest.raises(scenarios.DatasetError, match="no form 'csv' of data sets; there are samp"):
        Folder.opened(tmp_path / "data", form="csv")
    with pytest.raises(scenarios.DatasetError, match="duration 1 s: expected at least 3 s"):
        Folder.opened(tmp_path / "data", duration=1.0)
    (tmp_path / "odd").mkdir()
    (tmp_path / "odd" / "dataset.json").write_text("{")
    with pytest.raises(scenarios.DatasetError, match=r"dataset\.json: damaged"):
        Folder.opened(tmp_path / "odd")
    assert files(tmp_path) == {"notes.txt", "odd/dataset.json"}


def test_a_full_disk_is_one_line_and_leaves_nothing_half(simulated, tmp_path, monkeypatch):
    place = Folder.opened(tmp_path)
    written = []
    pack = runfile._pack

    def full(stream, arrays):
        if len(written) == 3:
            stream.write(b"half of it")
            raise OSError(errno.ENOSPC, "No space left on device")
        written.append(1)
        pack(stream, arrays)

    monkeypatch.setattr(runfile, "_pack", full)
    with pytest.raises(
        scenarios.DatasetError,
        match=r"-000\.npz: cannot be written \(No space left on device\); started again, it",
    ):
        list(make(place, ALL))
    assert len(place.kept()) == 3
    assert len([name for name in files(tmp_path) if name.endswith(".npz")]) == 3
    place.clear(overwrite=False)
    monkeypatch.setattr(runfile, "_pack", pack)
    assert len(list(make(place, ALL))) == len(ALL) - 3


def test_what_a_killed_run_left_is_removed_when_it_is_made_again(simulated, tmp_path):
    place = Folder.opened(tmp_path)
    (tmp_path / "panda").mkdir()
    (tmp_path / "panda" / ".straight-000.npz.x1y2z3").write_bytes(b"half")
    assert Task("panda", "straight", 0) in place.missing(ALL)
    list(make(place, ALL))
    assert not [name for name in files(tmp_path) if "x1y2z3" in name]


def test_a_damaged_sample_is_named_and_made_again_only_if_told(simulated, tmp_path):
    place = Folder.opened(tmp_path)
    list(make(place, ALL))
    path = tmp_path / "ur5/curve-001.npz"
    whole = path.read_bytes()
    path.write_bytes(whole[:5000])
    with pytest.raises(
        scenarios.SampleError, match=r"ur5/curve-001\.npz: no sample, or cut off.*--overwrite makes"
    ):
        place.clear(overwrite=False)
    assert path.stat().st_size == 5000
    place.clear(overwrite=True)
    assert list(make(place, ALL)) == [Task("ur5", "curve", 1)]
    assert path.read_bytes() == whole
    assert len(simulated.calls) == len(ALL) + 1


def test_without_mujoco_nothing_is_begun_but_a_finished_set_is_read(
    simulated, tmp_path, monkeypatch
):
    place = Folder.opened(tmp_path)
    list(make(place, ALL[:2]))
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(
        scenarios.MissingSimulatorError, match=r"pip install 'noise-inspector\[sim\]'"
    ):
        list(make(place, ALL))
    assert list(make(place, ALL[:2])) == []
    assert len(simulated.calls) == 2


def test_samples_of_other_robots_are_not_mistaken(simulated, tmp_path):
    place = Folder.opened(tmp_path)
    list(make(place, ALL))
    (tmp_path / "baxter").mkdir()
    (tmp_path / "baxter" / "straight-000.npz").write_bytes(b"")
    (tmp_path / "panda" / "straight-x.npz").write_bytes(b"")
    assert sorted(place.kept()) == sorted(ALL)


@pytest.mark.slow
def test_several_processes_make_the_same_files_as_one(tmp_path):
    tasks = Wish(choice=choose(["panda"], ["2", "3", "7"]), seeds=1).tasks()
    places = [Folder.opened(tmp_path / str(jobs), duration=3.0) for jobs in (1, 2)]
    for jobs, place in enumerate(places, start=1):
        assert sorted(make(place, tasks, jobs=jobs)) == sorted(tasks)
    one, two = ((place.file(task).read_bytes() for task in tasks) for place in places)
    assert list(one) == list(two)
    assert set(places[1].times()) == set(tasks)


@pytest.mark.slow
def test_what_goes_wrong_in_another_process_is_one_line_here(tmp_path):
    place = replace(Folder.opened(tmp_path), duration=1.0)
    tasks = Wish(choice=choose(["panda"], ["2", "3"]), seeds=1).tasks()
    with pytest.raises(
        scenarios.DatasetError, match="duration 1 s: expected at least 3 s; started"
    ):
        list(make(place, tasks, jobs=2))
