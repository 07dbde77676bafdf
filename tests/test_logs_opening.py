"""A run file or any log is opened by every command that takes runs."""

import json
import re
import shutil
import subprocess
import tempfile
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from commandline import TAKING_RUNS, call, complaint
from csvlogs import TIME, log, swing, write

import inspector
from inspector.errors import InspectorError, LogError
from inspector.library import demo_run
from inspector.logs.mapping import ReadOptions
from inspector.logs.read import Reading, Source, logs_in, open_run, open_source, sources
from noisemodel import Run, RunFileError, UnknownRobotError

READ = "read as 1 joint (elbow): position, velocity; angles taken for radians; 100 Hz"


@pytest.fixture
def run(tmp_path):
    return saved(tmp_path / "run.npz")


def saved(path, seconds=4.0, **fields):
    time = np.arange(round(seconds * 1000)) / 1000
    velocity = np.cos(time)[:, None]
    Run(**{"time": time, "velocity": velocity, "joint_names": ("elbow",)} | fields).save(path)
    return path


def test_a_log_is_opened_as_import_reads_it(tmp_path):
    opened = open_run(log(tmp_path))
    imported = inspector.read_log(tmp_path / "log.csv").run
    assert np.array_equal(opened.run.velocity, imported.velocity)
    assert opened.assumed == f"{READ}; no robot (--robot NAME)"


def test_only_angles_without_a_unit_in_the_header_are_said_to_be_taken_for_radians(tmp_path):
    path = write(tmp_path / "log.csv", {"time": TIME, "elbow_vel [deg/s]": np.cos(TIME)})
    assumed = open_run(path).assumed
    assert "; other angles taken for radians; " in assumed
    assert "elbow_vel [deg/s]: converted from deg/s, as their names say" in assumed


def test_a_run_file_is_opened_as_it_is_but_for_its_robot(tmp_path):
    run = saved(tmp_path / "run.npz", robot="anything")
    opened = open_run(run)
    assert (opened.assumed, opened.run.robot) == ("", "anything")
    assert np.array_equal(opened.run.velocity, Run.load(run).velocity)
    options = ReadOptions(robot="double_pendulum")
    assert open_run(run, Reading(options)).run.robot == "double_pendulum"
    assert open_run(run, Reading(without_robot=True)).run.robot is None
    with pytest.raises(UnknownRobotError, match="no robot 'pandda'"):
        open_run(run, Reading(ReadOptions(robot="pandda")))


def test_arrays_of_a_run_file_in_degrees_are_converted_on_request(tmp_path):
    time = np.arange(400) / 100
    np.savez(tmp_path / "a.npz", time=time, velocity=np.rad2deg(np.cos(time))[:, None])
    opened = open_run(tmp_path / "a.npz", Reading(ReadOptions(units="degrees")))
    assert np.abs(opened.run.velocity).max() == pytest.approx(1.0)
    assert "angles taken for degrees" in opened.assumed


def test_a_run_file_with_an_unknown_array_is_refused_not_read_in_part(tmp_path):
    np.savez(tmp_path / "a.npz", time=TIME, velocity=TIME[:, None], velocity_desird=TIME[:, None])
    with pytest.raises(RunFileError, match="did you mean 'velocity_desired'"):
        open_run(tmp_path / "a.npz")


def test_a_folder_is_its_logs_however_deep_and_other_files_are_named(tmp_path, run):
    (tmp_path / "deep" / "er").mkdir(parents=True)
    nested = log(tmp_path / "deep" / "er", name="b.csv")
    (tmp_path / "notes.md").write_text("notes")
    (tmp_path / ".hidden.csv").write_text("hidden")
    found, others = sources([tmp_path])
    assert [each.path for each in found] == [nested, run]
    assert [each.name for each in others] == ["notes.md"]


def test_a_folder_that_is_a_bag_or_a_data_set_is_one_log(tmp_path):
    files = ("bag/metadata.yaml", "cut/a.mcap", "episodes/meta/info.json", "two/a.db3", "two/b.db3")
    for name in files:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("{}")
    logs = ("bag", "cut", "episodes", "two/a.db3", "two/b.db3")
    assert logs_in(tmp_path)[0] == tuple(tmp_path / name for name in logs)


def test_a_single_run_is_not_chosen_from_several(tmp_path, run):
    log(tmp_path)
    told = f"holds 2 runs (log.csv, run.npz); name one, such as {tmp_path / 'log.csv'}"
    with pytest.raises(LogError, match=re.escape(told)):
        open_run(tmp_path)


@pytest.fixture
def episodes(tmp_path):
    h5py = pytest.importorskip("h5py")
    position, velocity = swing(TIME)
    with h5py.File(tmp_path / "data.hdf5", "w") as file:
        for name in ("demo_0", "demo_1"):
            group = file.create_group(f"data/{name}/obs")
            group["joint_pos"], group["joint_vel"] = position[:, None], velocity[:, None]
    return tmp_path / "data.hdf5"


def test_episodes_are_runs_of_their_own(episodes):
    reading = Reading(ReadOptions(rate=100.0))
    found, _ = sources([episodes], reading)
    assert found == (Source(episodes, "demo_0"), Source(episodes, "demo_1"))
    assert open_source(found[1], reading).run.rate == 100.0
    with pytest.raises(LogError, match=r"holds 2 runs \(demo_0, demo_1\); .*--episode"):
        open_run(episodes, reading)
    with pytest.raises(LogError, match="there is no episode 'demo_7'"):
        open_run(episodes, Reading(ReadOptions(rate=100.0), episodes=("demo_7",)))


def test_episodes_are_classified_one_by_one(episodes):
    _, out, err = call("classify", episodes, "--rate", 100)
    assert re.search(r"demo +ok +2 runs", out)  # two repetitions of one scenario are a row
    assert err.count("read as 1 joint") == 1  # once for those that were read alike
    assert "demo_0 and 1 more: read as" in err


def test_a_desired_log_belongs_to_one_log(tmp_path, run):
    measured, desired = log(tmp_path), log(tmp_path, name="desired.csv")
    opened = open_run(measured, Reading(desired=desired))
    assert opened.run.velocity_desired is not None
    with pytest.raises(InspectorError, match="belongs to one log, 2 are given"):
        sources([measured, run], Reading(desired=desired))
    status, _, err = call("view", run, run, "--desired", desired)
    assert (status, "belongs to one log, 2 are given" in err) == (2, True)


@pytest.mark.parametrize("jobs", [1, 2])
def test_of_a_mixed_folder_the_unreadable_is_named_and_the_rest_is_done(tmp_path, jobs):
    shutil.copy(demo_run(), tmp_path / "demo.npz")
    log(tmp_path)
    (tmp_path / "broken.csv").write_text("a,b\n1,2\n")
    (tmp_path / "notes.md").write_text("notes")
    saved(tmp_path / "short.npz", seconds=0.1)
    status, out, err = call("classify", tmp_path, "-j", jobs, "--format", "json")
    assert status == 3
    runs = {Path(each["run"]).name: each for each in json.loads(out)["runs"]}
    assert {name: each["status"] for name, each in runs.items()} == {
        "broken.csv": "bad-input",
        "demo.npz": "findings",
        "log.csv": "ok",
        "short.npz": "cannot-tell",
    }
    assert runs["log.csv"]["assumed"].startswith(READ)
    assert runs["demo.npz"]["assumed"] == ""
    assert "1 other file left out: notes.md" in err
    assert f"inspector: {tmp_path / 'broken.csv'}: no position or velocity" in err


@pytest.mark.parametrize("seconds", [0.002, 0.01, 0.3])
def test_a_run_too_short_for_a_frame_is_no_bad_input(tmp_path, seconds):
    short = saved(tmp_path / "short.npz", seconds=seconds)
    assert [call(command, short)[0] for command in ("classify", "audit")] == [4, 4]


@pytest.mark.parametrize("format_", ["json", "junit", "github"])
def test_what_was_assumed_does_not_pollute_what_programs_read(tmp_path, format_):
    _, out, err = call("classify", log(tmp_path), "--format", format_)
    assert err.startswith(f"{tmp_path / 'log.csv'}: {READ}; ")
    assert err.count("\n") == 1
    if format_ == "json":
        json.loads(out)
    elif format_ == "junit":
        ET.fromstring(out)
    else:
        assert not [line for line in out.splitlines() if line and not line.startswith("::")]


@pytest.mark.parametrize("command", [*TAKING_RUNS, ["import", "-o", "out.npz"]], ids=" ".join)
def test_every_command_that_takes_a_run_takes_a_log(tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    time = np.arange(2000) / 1000
    # NoisyTest's logs have this suffix, too
    write(tmp_path / "robot.log", {"time": time, "my velocity": np.cos(time)})
    name, *options = command
    status, out, err = call(name, "robot.log", *options, "--map", "velocity.elbow=my velocity")
    assert status == 0, err
    if name != "import":
        assert "read as 1 joint (elbow): velocity" in (out + err).replace("Read", "read")


def test_names_and_folders_that_are_too_long_are_one_line(tmp_path, monkeypatch):
    for command in (["classify"], ["audit"], ["import", "-o", "run.npz"]):
        err = complaint(command[0], tmp_path / ("a" * 300), *command[1:])
        assert err.count("\n") == 1
        assert "cannot be read (File name too long)" in err
    top = tempfile.mkdtemp()  # not in pytest's folder, which it cannot remove so deep
    try:
        monkeypatch.chdir(top)
        for _ in range(1500):
            Path("d").mkdir()
            monkeypatch.chdir("d")
        with pytest.raises(LogError, match=r"a folder without logs \(\.bag, \.csv"):
            sources([Path(top)])
    finally:
        monkeypatch.undo()
        subprocess.run(["rm", "-rf", top], check=True)
