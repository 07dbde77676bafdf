import json

import numpy as np
import pytest
from commandline import call, complaint, printed

from inspector.library import demo_run


@pytest.fixture
def episode(tmp_path):
    """A 30 Hz episode of six joints in degrees, as LeRobot keeps them: positions and actions."""
    time = np.arange(600) / 30
    angle = np.outer(time, [0.7, 0.5, 0.9, 1.3, 0.4, 1.1]) + np.arange(6)
    position = np.rad2deg(0.9 * np.sin(angle)) + np.array([10, -50, 70, 30, 0, 20])
    position += np.random.default_rng(1).normal(0, 0.02, position.shape)
    path = tmp_path / "episode.npz"
    np.savez(path, time=time, position=position, position_desired=np.roll(position, -1, axis=0))
    return path


def test_the_audit_of_a_30_hz_episode_in_degrees_gives_its_limits(episode):
    out = printed("audit", episode, status=4)
    assert "30 Hz" in out
    assert "positions look like degrees (joint_2" in out
    assert "measured position of all joints is the desired one, 1 sample later" in out
    assert "velocities are differentiated positions" in out
    assert "impact: cannot tell: 30 Hz is below the rate of every model; needs 80 Hz" in out


def test_audits_as_json(episode):
    found = json.loads(printed("audit", demo_run(), episode, "--format", "json", status=4))
    assert found["format"] == "noise-audit/2"
    demo, slow = found["runs"]
    assert demo["warnings"] == []
    assert demo["bandwidth"]["usable"] == 5000
    assert {each["observability"] for each in demo["classes"]} == {"observable"}
    assert {each["needed"] for each in slow["classes"]} == {80}
    assert slow["warnings"][0].startswith("positions look like degrees")


def test_one_bad_file_does_not_stop_the_rest(tmp_path):
    (tmp_path / "bad.npz").write_bytes(b"PK\x03\x04 not really")
    status, out, err = call("audit", tmp_path / "bad.npz", tmp_path / "none.npz", demo_run())
    assert status == 3
    assert "impact: observable" in out
    bad, none = err.splitlines()
    assert bad.startswith(f"inspector: {tmp_path / 'bad.npz'}: not a run file")
    assert "cannot be read" in none
    status, out, _ = call("audit", tmp_path / "bad.npz", "--format", "json")
    assert status == 3
    assert "not a run file" in json.loads(out)["runs"][0]["message"]


@pytest.mark.parametrize("command", ["classify", "audit", "smoothness"])
def test_a_row_that_cannot_be_read_is_named_with_its_file_once(tmp_path, command):
    path = tmp_path / "log.csv"
    path.write_text("time,q1,dq1\n0,0,0\n0.01,0,none of it\n")
    err = complaint(command, path)
    assert f"{path}: row 3: column 'dq1'" in err
    assert err.count(str(path)) == 1


def test_view_prints_a_summary_of_the_audit(episode, tmp_path):
    out = printed("view", episode, "-o", tmp_path / "run.rrd")
    assert out.count("logged at 30 Hz") == 2  # in the headline, and why there are no labels
    assert "cannot be observed" not in out
    assert "Warnings: positions look like degrees" in out
