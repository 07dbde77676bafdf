"""Values that no robot has are one line that names them, and never a result."""

import os
import time
from pathlib import Path

import numpy as np
import pytest
from commandline import call, python

from inspector import read_log
from inspector.errors import LogError
from noisemodel import Robot, RobotError, Run, RunError

TIME = np.arange(40) / 1000


def csv(path, stamps, header="time,a.velocity", more="0.1"):
    path.write_text("\n".join([header, *(f"{stamp},{more}" for stamp in stamps)]) + "\n")
    return path


@pytest.mark.parametrize(
    "stamp", ["1e-99999999999999999999", "1e-40", "5e-324", "-1e-300", "1e99999999999999999999"]
)
def test_a_stamp_that_is_no_time_is_named(tmp_path, stamp):
    path = csv(tmp_path / "a.csv", [0, stamp, 1, 2])
    with pytest.raises(LogError, match=r"a.csv, row 3: "):
        read_log(path)


@pytest.mark.parametrize("command", ["classify", "audit", "noise", "view"])
def test_a_base_that_moves_without_joints_gives_a_result_or_one_line(tmp_path, command):
    pose = np.tile([0.0, 0, 0, 0, 0, 0, 1], (4000, 1))
    stamps = np.arange(4000) / 1000
    twist = np.sin(5.0 * stamps)[:, None] * np.ones(6)
    base = {"base_pose": pose, "base_velocity": twist}
    run = Run(time=stamps, velocity=np.zeros((4000, 0)), joint_names=(), **base)
    run.save(tmp_path / "run.npz")
    outputs = [("-o", tmp_path / f"a.{suffix}") for suffix in ("rrd", "html")]
    for output in outputs if command == "view" else [()]:
        status, _, err = call(command, tmp_path / "run.npz", *output)
        assert status in (0, 4)
        assert "Traceback" not in err


def test_a_log_of_thousands_of_columns_is_read_or_refused_at_once(tmp_path):
    for count, refused in ((9_000, False), (20_000, True)):
        header = "time,a.velocity," + ",".join(f"c{n}" for n in range(count))
        path = csv(tmp_path / "a.csv", TIME, header, "0.1" + ",0" * count)
        begin = time.process_time()
        if refused:
            with pytest.raises(LogError, match="20002 columns, the limit is 10000"):
                read_log(path)
        else:
            assert read_log(path).run.joint_names == ("a",)
        assert time.process_time() - begin < 10


def test_a_column_of_time_that_is_not_there_is_named(tmp_path):
    path = csv(tmp_path / "a.csv", TIME)
    with pytest.raises(LogError, match="there is no column 'nope' to map"):
        read_log(path, mapping=["time=nope"])
    np.savez(tmp_path / "a.npz", t=TIME, dof_vel=np.ones((40, 2)))
    with pytest.raises(LogError, match="'nope'|there are no stamps"):
        read_log(tmp_path / "a.npz", mapping=["time=nope"])
    with pytest.raises(LogError, match="there is no column 'nope' to map"):
        read_log(tmp_path / "a.npz", mapping=["time=nope"], rate=1000.0)


LINKS = "".join(f'<link name="l{n}"/>' for n in range(3))
JOINT = """<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><axis xyz="0 0 1"/>
<limit lower="0" upper="1" effort="1" velocity="1"/>{4}</joint>"""


def mimics(leader, more):
    first = JOINT.format("a", "revolute", "l0", "l1", f'<mimic joint="{leader}"/>')
    return LINKS + first + JOINT.format("b", "revolute", "l1", "l2", more)


@pytest.mark.parametrize("content", [mimics("a", ""), mimics("b", '<mimic joint="a"/>')])
def test_a_joint_that_mimics_itself_is_refused(tmp_path, content):
    (tmp_path / "r.urdf").write_text(f'<robot name="r">{content}</robot>')
    with pytest.raises(RobotError, match="joint 'a' mimics itself"):
        Robot.load(tmp_path / "r.urdf")


def test_a_name_of_a_joint_that_is_hostile_is_one_line(tmp_path):
    arrays = {"velocity": np.ones((40, 1)), "joint_names": np.array(["\ud800"])}
    np.savez(tmp_path / "run.npz", time=TIME, **arrays)
    with pytest.raises(RunError, match="joint_names: '\\\\ud800' is no name") as caught:
        Run.load(tmp_path / "run.npz")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["a" * 5000 + ".urdf", "a\0b", "\ud800", "/dev/zero"])
def test_a_name_that_no_file_can_have_is_no_robot(name):
    with pytest.raises(RobotError, match="no such URDF file|neither a URDF or MJCF file"):
        Robot.load(name)


LIVE = [f'{{"time": {n / 1000}, "velocity": [{n % 7 / 10}, 0.1]}}' for n in range(600)]


def test_no_row_ends_a_live_session(tmp_path):
    odd = [
        '{"velocity": []}',
        '{"time": [], "velocity": [0.1, 0.2]}',
        '{"time": 0.2995, "velocity": [1e308, -1e308]}',
        '{"time": 1e308, "velocity": [0.1, 0.2]}',
        '{"time": 5e-324, "velocity": [5e-324, 0.2]}',
        '{"time": 1e-320, "velocity": [0.1, 0.2]}',
        '{"time": 0.2996, "velocity": [1' + "0" * 400 + ", 0]}",
        '{"time": 1' + "0" * 5000 + ', "velocity": [0, 0]}',
        '{"velocity": ' + "[" * 100_000,
        '{"velocity": ["\\ud800"]}',
        "\x00\x1b]0;title\x07",
    ]
    path = tmp_path / "a.rrd"
    rows = "\n".join([*LIVE[:300], *odd, *LIVE[300:]])
    done = python("-m", "inspector", "live", "--rate", "1000", "--save", path, input=rows)
    assert done.returncode == 4, done.stderr  # no stretch is long enough for a label
    assert done.stdout.startswith("606 samples")
    assert "2 samples out of order" in done.stdout
    assert path.exists()


def test_a_file_whose_name_is_not_utf_8_is_printed_escaped(tmp_path):
    name = os.fsencode(tmp_path) + b"/\xff\xfe.csv"
    csv(Path(os.fsdecode(name)), np.arange(600) / 1000)
    done = python("-m", "inspector", "noise", os.fsdecode(name), status=0)
    assert r"\udcff\udcfe.csv: 0.60 s" in done.stdout
