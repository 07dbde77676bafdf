"""`inspector import`, from the command line."""

import numpy as np
import pytest
from commandline import call, complaint, printed
from csvlogs import log
from samplelogs import JOINTS, Talk, joint_states, motion, numbers, write_bag, write_lerobot

from noisemodel import Run

TALK = Talk()
POSITION, VELOCITY = numbers(), numbers(seed=1)


@pytest.fixture
def bag(tmp_path):
    states = joint_states(TALK, position=POSITION, velocity=VELOCITY)
    flag = [(states[0][0], TALK.make("std_msgs/Bool", data=True))]
    return write_bag(tmp_path / "bag", TALK, {"/joint_states": states, "/stop": flag})


def test_a_bag_is_imported(bag, tmp_path):
    out = printed("import", bag, "-o", tmp_path / "run.npz")
    assert out.endswith("run.npz: 4.00 s at 100 Hz\n")
    assert np.array_equal(Run.load(tmp_path / "run.npz").position, POSITION)


def test_contents_are_listed_and_nothing_written(bag, tmp_path):
    before = sorted(tmp_path.rglob("*"))
    out = printed("import", bag, log(tmp_path), "--list")
    assert "bag: ROS bag" in out
    assert "/joint_states  sensor_msgs/msg/JointState  400 messages  100.251 Hz  read" in out
    assert "/stop  std_msgs/msg/Bool  1 message  not read" in out
    assert "log.csv: CSV" in out
    assert "elbow.position  position of elbow" in out
    assert sorted(tmp_path.rglob("*")) == sorted([*before, tmp_path / "log.csv"])


def test_episodes_become_a_folder_of_runs(tmp_path):
    states = [motion(np.arange(90) / 30, seed=n)[0] for n in range(3)]
    folder = write_lerobot(tmp_path / "set", states, names=list(JOINTS))
    err = complaint("import", folder, "-o", tmp_path / "run.npz")
    assert "3 runs do not fit into one file; name a folder, or choose one (--episode)" in err
    out = printed("import", folder, "-o", tmp_path / "runs")
    assert sorted(p.name for p in (tmp_path / "runs").iterdir()) == [
        f"set-{n}.npz" for n in range(3)
    ]
    assert out.count("at 30 Hz") == 3
    printed("import", folder, "--episode", "1", "-o", tmp_path / "one.npz")
    assert len(Run.load(tmp_path / "one.npz").time) == 90
    assert "3 episodes at 30 Hz" in printed("import", folder, "--list")


def test_one_bad_log_does_not_stop_the_others(bag, tmp_path):
    (tmp_path / "bad.csv").write_text("time,a.velocity\n0,1\n1,x\n")
    (tmp_path / "gone.hdf5").write_bytes(b"\x89HDF\r\n\x1a\n")
    logs = [tmp_path / "bad.csv", tmp_path / "gone.hdf5", bag]
    status, out, err = call("import", *logs, "-o", tmp_path / "runs")
    assert status == 3
    assert "bag.npz: 4.00 s at 100 Hz" in out
    assert [line.split(": ")[0] for line in err.splitlines()] == ["inspector"] * 2
    assert [path.name for path in (tmp_path / "runs").iterdir()] == ["bag.npz"]


def test_a_mapping_is_saved_and_used_again(tmp_path):
    np.savez(tmp_path / "log.npz", clock=np.arange(400) / 100, dq=VELOCITY)
    options = ["--map", "time=clock", "--map", "velocity=dq", "--joints", ",".join(JOINTS)]
    read, kept = ("import", tmp_path / "log.npz"), tmp_path / "mapping.toml"
    printed(*read, *options, "-o", tmp_path / "a.npz", "--save-mapping", kept)
    printed(*read, "--mapping", kept, "-o", tmp_path / "b.npz")
    assert Run.load(tmp_path / "b.npz").joint_names == JOINTS


def test_two_logs_of_one_name_are_not_written_over_each_other(tmp_path):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        log(tmp_path / folder)
    logs = [tmp_path / "a" / "log.csv", tmp_path / "b" / "log.csv"]
    err = complaint("import", *logs, "-o", tmp_path / "runs")
    assert "log.npz: two logs would be written there; import them one by one" in err
    assert not (tmp_path / "runs").exists()
    err = complaint("import", *logs, "--desired", logs[0], "-o", tmp_path / "runs")
    assert "log.csv: belongs to one log, 2 are given" in err


def test_an_output_is_required(bag):
    assert "name the run file to write" in complaint("import", bag, status=2)


@pytest.mark.parametrize("missing", ["rosbags", "mcap"])
def test_a_library_that_is_not_installed_is_named(bag, tmp_path, monkeypatch, missing):
    monkeypatch.setattr("inspector.logs.read.find_spec", lambda name: name != missing or None)
    err = complaint("import", bag, "-o", tmp_path / "run.npz")
    expected = f"{missing} reads such logs and is not installed; pip install 'noise-inspector[ros]'"
    assert expected in err


def test_run_files_that_are_there_are_kept_unless_they_are_to_be_replaced(tmp_path):
    (tmp_path / "logs").mkdir()
    for name in "abc":
        log(tmp_path / "logs", name=f"{name}.csv")
    logs = tmp_path / "logs", "-o", tmp_path / "runs"
    assert call("import", *logs)[0] == 0
    (tmp_path / "runs" / "a.npz").write_text("mine")
    (tmp_path / "runs" / "b.npz").unlink()
    assert "a.npz: exists already" in complaint("import", *logs)
    assert (tmp_path / "runs" / "a.npz").read_text() == "mine"
    assert not (tmp_path / "runs" / "b.npz").exists()
    assert call("import", *logs, "--overwrite")[0] == 0
    assert Run.load(tmp_path / "runs" / "b.npz").joint_names == ("elbow",)
