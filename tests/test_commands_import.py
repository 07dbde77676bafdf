"""`inspector import`, from the command line."""

import numpy as np
import pytest
from commandline import call
from csvlogs import log
from samplelogs import JOINTS, Talk, joint_states, motion, numbers, write_bag, write_lerobot

from noisemodel import Run

TALK = Talk()
POSITION, VELOCITY = numbers(), numbers(seed=1)


def importing(*arguments):
    return call("import", *arguments)


@pytest.fixture
def bag(tmp_path):
    states = joint_states(TALK, position=POSITION, velocity=VELOCITY)
    flag = [(states[0][0], TALK.make("std_msgs/Bool", data=True))]
    return write_bag(tmp_path / "bag", TALK, {"/joint_states": states, "/stop": flag})


def test_a_bag_is_imported(bag, tmp_path):
    status, out, err = importing(bag, "-o", tmp_path / "run.npz")
    assert (status, err) == (0, "")
    assert out.endswith("run.npz: 4.00 s at 100 Hz\n")
    assert np.array_equal(Run.load(tmp_path / "run.npz").position, POSITION)


def test_contents_are_listed_and_nothing_written(bag, tmp_path):
    before = sorted(tmp_path.rglob("*"))
    status, out, _ = importing(bag, log(tmp_path), "--list")
    assert status == 0
    assert "bag: ROS bag" in out
    assert "/joint_states  sensor_msgs/msg/JointState  400 messages  100.251 Hz  read" in out
    assert "/stop  std_msgs/msg/Bool  1 message  not read" in out
    assert "log.csv: CSV" in out
    assert "elbow.position  position of elbow" in out
    assert sorted(tmp_path.rglob("*")) == sorted([*before, tmp_path / "log.csv"])


def test_episodes_become_a_folder_of_runs(tmp_path):
    states = [motion(np.arange(90) / 30, seed=n)[0] for n in range(3)]
    folder = write_lerobot(tmp_path / "set", states, names=list(JOINTS))
    status, _, err = importing(folder, "-o", tmp_path / "run.npz")
    assert status == 3
    assert "3 runs do not fit into one file; name a folder, or choose one (--episode)" in err
    status, out, _ = importing(folder, "-o", tmp_path / "runs")
    assert status == 0
    assert sorted(p.name for p in (tmp_path / "runs").iterdir()) == [
        f"set-{n}.npz" for n in range(3)
    ]
    assert out.count("at 30 Hz") == 3
    status, _, _ = importing(folder, "--episode", "1", "-o", tmp_path / "one.npz")
    assert status == 0
    assert len(Run.load(tmp_path / "one.npz").time) == 90
    status, out, _ = importing(folder, "--list")
    assert "3 episodes at 30 Hz" in out


def test_one_bad_log_does_not_stop_the_others(bag, tmp_path):
    (tmp_path / "bad.csv").write_text("time,a.velocity\n0,1\n1,x\n")
    (tmp_path / "gone.hdf5").write_bytes(b"\x89HDF\r\n\x1a\n")
    logs = [tmp_path / "bad.csv", tmp_path / "gone.hdf5", bag]
    status, out, err = importing(*logs, "-o", tmp_path / "runs")
    assert status == 3
    assert "bag.npz: 4.00 s at 100 Hz" in out
    assert [line.split(": ")[0] for line in err.splitlines()] == ["inspector"] * 2
    assert [path.name for path in (tmp_path / "runs").iterdir()] == ["bag.npz"]


def test_a_mapping_is_saved_and_used_again(tmp_path):
    np.savez(tmp_path / "log.npz", clock=np.arange(400) / 100, dq=VELOCITY)
    options = ["--map", "time=clock", "--map", "velocity=dq", "--joints", ",".join(JOINTS)]
    kept = tmp_path / "mapping.toml"
    status, _, err = importing(
        tmp_path / "log.npz", *options, "-o", tmp_path / "a.npz", "--save-mapping", kept
    )
    assert (status, err) == (0, "")
    status, _, _ = importing(tmp_path / "log.npz", "--mapping", kept, "-o", tmp_path / "b.npz")
    assert status == 0
    assert Run.load(tmp_path / "b.npz").joint_names == JOINTS


def test_two_logs_of_one_name_are_not_written_over_each_other(tmp_path):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        log(tmp_path / folder)
    logs = [tmp_path / "a" / "log.csv", tmp_path / "b" / "log.csv"]
    status, _, err = importing(*logs, "-o", tmp_path / "runs")
    assert status == 3
    assert "log.npz: two logs would be written there; import them one by one" in err
    assert not (tmp_path / "runs").exists()
    status, _, err = importing(*logs, "--desired", logs[0], "-o", tmp_path / "runs")
    assert "log.csv: belongs to one log, 2 are given" in err


def test_an_output_is_required(bag):
    status, _, err = importing(bag)
    assert status == 2
    assert "name the run file to write" in err


@pytest.mark.parametrize("missing", ["rosbags", "mcap"])
def test_a_library_that_is_not_installed_is_named(bag, tmp_path, monkeypatch, missing):
    monkeypatch.setattr("inspector.logs.read.find_spec", lambda name: name != missing or None)
    status, _, err = importing(bag, "-o", tmp_path / "run.npz")
    assert status == 3
    expected = f"{missing} reads such logs and is not installed; pip install 'noise-inspector[ros]'"
    assert expected in err


def test_run_files_that_are_there_are_kept_unless_they_are_to_be_replaced(tmp_path):
    (tmp_path / "logs").mkdir()
    for name in "abc":
        log(tmp_path / "logs", name=f"{name}.csv")
    logs = tmp_path / "logs", "-o", tmp_path / "runs"
    assert importing(*logs)[0] == 0
    (tmp_path / "runs" / "a.npz").write_text("mine")
    (tmp_path / "runs" / "b.npz").unlink()
    status, _, err = importing(*logs)
    assert (status, "a.npz: exists already" in err) == (3, True)
    assert (tmp_path / "runs" / "a.npz").read_text() == "mine"
    assert not (tmp_path / "runs" / "b.npz").exists()
    assert importing(*logs, "--overwrite")[0] == 0
    assert Run.load(tmp_path / "runs" / "b.npz").joint_names == ("elbow",)
