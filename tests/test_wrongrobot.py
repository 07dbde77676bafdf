"""A run of another robot than it names is noticed by every command."""

import numpy as np
import pytest
from commandline import TAKING_RUNS, call, complaint, printed

import noisemodel as nm
from inspector.logs.mapping import WrongRobotError, check_joints
from inspector.logs.motion import limit_warnings
from noisemodel.robot import Limits, joint_limits, limits_of

PANDA = tuple(f"panda_joint{number}" for number in range(1, 8))


def panda(names=PANDA, factor=1.0, robot="panda", seconds=3.0):
    time = np.arange(round(seconds * 1000)) / 1000
    middle = np.array([0, 0, 0, -1.5, 0, 1.8, 0])
    swing = 0.3 * np.sin(2 * time)[:, None] * np.ones(7)
    return nm.Run(
        time=time,
        velocity=factor * 0.6 * np.cos(2 * time)[:, None] * np.ones(7),
        position=factor * (middle + swing),
        joint_names=names,
        robot=robot,
    )


@pytest.mark.parametrize("name", ["panda", "talos", "go2", "tiago", "double_pendulum_continuous"])
def test_limits_are_those_that_pinocchio_reads(name):
    assert dict(joint_limits(name)) == limits_of(nm.Robot.load(name))


def test_a_joint_without_a_limit_has_none(tmp_path):
    (tmp_path / "arm.urdf").write_text(
        "<robot name='arm'><link name='a'/><link name='b'/><joint name='j' type='continuous'>"
        "<parent link='a'/><child link='b'/><axis xyz='0 0 1'/></joint></robot>"
    )
    assert joint_limits(tmp_path / "arm.urdf") == {"j": Limits()}


def test_joints_that_the_run_lacks_are_assumed_stationary_and_others_are_refused():
    assert check_joints(PANDA, "panda") == ("panda_finger_joint1", "panda_finger_joint2")
    assert check_joints(("anything",), "my robot") == ()
    assert check_joints(("anything",), None) == ()
    with pytest.raises(WrongRobotError, match="no joint 'hip' in robot 'panda'; .*--robot NAME"):
        check_joints(("hip",), "panda")


def test_a_robot_with_its_own_motion_is_not_suspected_nor_for_a_fault_of_a_moment():
    run = panda()
    assert list(limit_warnings(run)) == []
    run.velocity[1000:1200] = 50.0
    assert list(limit_warnings(run)) == []
    assert list(limit_warnings(nm.Run.load("assets/runs/demo.npz"))) == []


def test_degrees_exceed_the_limits_of_a_robot():
    position, velocity = limit_warnings(panda(factor=180 / np.pi))
    assert "panda_joint" in position
    assert "rad, far beyond the" in position
    assert "rad/s, far beyond the 2.17 rad/s of panda (6 more joints too)" in velocity


def test_a_position_below_its_lower_limit_is_shown_with_its_sign():
    run = panda()
    run.position[:, 5] -= 3.0
    run.velocity[:, :2] = 50.0
    warning, velocity = limit_warnings(run)
    assert warning.startswith("panda_joint6 reaches -1.5 rad, far beyond the -0.0175 to 3.75 rad")
    assert "2.17 rad/s of panda (1 more joint too)" in velocity


COMMANDS = [*TAKING_RUNS, ["accept", "--reason", "good"]]


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_every_command_refuses_a_run_whose_joints_the_robot_lacks(tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    panda(robot="ur5").save(tmp_path / "run.npz")
    name, *options = command
    err = complaint(name, "run.npz", *options)
    assert "no joint 'panda_joint1' in robot 'ur5'; it has shoulder_pan_joint" in err
    assert "--robot NAME" in err


@pytest.mark.parametrize("command", COMMANDS[:-2], ids=" ".join)
def test_every_command_remarks_limits_that_are_exceeded_by_far(tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    panda(factor=180 / np.pi).save(tmp_path / "run.npz")
    name, *options = command
    _, out, err = call(name, "run.npz", *options)
    page = (tmp_path / "out.html").read_text() if "out.html" in options else ""
    assert "far beyond the" in out + err + page


def test_the_robot_that_a_run_names_can_be_overruled(tmp_path):
    panda(robot="ur5").save(tmp_path / "run.npz")
    assert call("classify", tmp_path / "run.npz", "--robot", "panda")[0] == 0
    assert call("classify", tmp_path / "run.npz", "--robot", "none")[0] == 0


def test_a_robot_whose_file_is_gone_is_said_and_the_run_is_classified(tmp_path):
    panda(robot=str(tmp_path / "gone.urdf")).save(tmp_path / "run.npz")
    assert "the joints are not checked" in printed("classify", tmp_path / "run.npz")


def test_joints_that_a_run_file_does_not_name_are_those_of_its_robot_in_order(tmp_path):
    run = panda()
    signals = {"velocity": run.velocity, "position": run.position}
    np.savez(tmp_path / "run.npz", time=run.time, robot="panda", **signals)
    out = printed("view", tmp_path / "run.npz", "-o", tmp_path / "run.rrd")
    assert "Joints are not named: taken for panda_joint1 to panda_joint7." in out
    assert "assumed stationary: panda_finger_joint1, panda_finger_joint2" in out
    np.savez(tmp_path / "ten.npz", time=run.time, velocity=np.zeros((3000, 10)), robot="panda")
    assert "no joint 'joint_0' in robot 'panda'" in complaint("classify", tmp_path / "ten.npz")
