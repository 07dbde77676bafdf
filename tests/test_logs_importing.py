import numpy as np
import pytest
from csvlogs import TIME, jittered, log, swing, write

from inspector import read_log
from inspector.errors import LogError
from noisemodel import UnknownJointError, UnknownRobotError


def test_a_uniform_log_is_imported_bit_for_bit(tmp_path):
    imported = read_log(log(tmp_path))
    position, velocity = swing(TIME)
    run = imported.run
    assert np.array_equal(run.time, TIME)
    assert np.array_equal(run.position[:, 0], position)
    assert np.array_equal(run.velocity[:, 0], velocity)
    assert run.joint_names == ("elbow",)
    assert run.rate == 100.0
    assert run.mask.all()
    assert imported.remarks == ()
    assert run.meta["source"] == ["log.csv"]
    assert run.meta["start"] == "0"


def test_a_joint_without_positions_leaves_all_positions_out(tmp_path):
    imported = read_log(log(tmp_path, **{"wrist.velocity": TIME, "elbow.effort": TIME}))
    assert imported.run.joint_names == ("elbow", "wrist")
    assert imported.run.position is imported.run.effort is None
    assert imported.remarks == (
        "position: left out, missing for wrist",
        "effort: left out, missing for wrist",
    )


def test_joints_are_checked_against_the_robot(tmp_path):
    path = write(tmp_path / "log.csv", {"time": TIME, "panda_joint3.velocity": TIME})
    assert read_log(path, robot="panda").run.robot == "panda"
    with pytest.raises(UnknownJointError, match="no joint 'elbow' in robot 'panda'; it has panda"):
        read_log(log(tmp_path), robot="panda")
    with pytest.raises(UnknownRobotError, match="no robot 'pandda'"):
        read_log(path, robot="pandda")
    path = write(tmp_path / "log.csv", {"time": TIME, "q2": TIME, "q3": TIME})
    with pytest.raises(LogError, match="with 2, so 'q2' may be any joint; name it: --map SIGNAL"):
        read_log(path, robot="ur5")


def test_desired_motion_is_synchronised_to_the_measured_clock(tmp_path):
    measured = log(tmp_path, jittered() + 50)
    late = np.arange(1000) / 250 + 50.5
    desired = write(tmp_path / "desired.csv", {"time": late, "elbow.velocity": swing(late - 50)[1]})
    imported = read_log(measured, desired=desired)
    run = imported.run
    expected = swing(run.time + 0.5)[1]
    assert run.rate == 100.0
    assert np.abs(run.velocity_desired[:, 0] - expected).max() < 1e-2
    assert np.abs(run.velocity[:, 0] - expected).max() < 5e-3 * 2 * np.pi
    assert run.meta["source"] == ["log.csv", "desired.csv"]
    assert float(run.meta["start"]) == pytest.approx(50.5)
    assert "cut to the 3.49 s that both logs cover" in imported.remarks


def test_uniform_logs_of_one_clock_are_imported_bit_for_bit(tmp_path):
    desired = log(tmp_path, TIME[100:], name="desired.csv")
    run = read_log(log(tmp_path), desired=desired).run
    assert np.array_equal(run.velocity_desired, run.velocity)
    assert np.array_equal(run.position_desired[:, 0], swing(TIME)[0][100:])
    assert run.time[0] == 0.0


def test_a_desired_log_takes_precedence_over_desired_columns(tmp_path):
    measured = log(tmp_path, **{"elbow.velocity_desired": TIME})
    desired = log(tmp_path, name="desired.csv", **{"elbow.velocity_desired": -TIME})
    imported = read_log(measured, desired=desired)
    assert np.array_equal(imported.run.velocity_desired[:, 0], -TIME)
    assert imported.run.position_desired is None
    assert imported.remarks == (
        "log.csv: 1 column not read: elbow.velocity_desired",
        "desired.csv: 2 columns not read: elbow.position, elbow.velocity",
    )


def test_gaps_of_the_desired_motion_are_gaps(tmp_path):
    desired = log(tmp_path, np.delete(TIME, slice(200, 220)), name="desired.csv")
    run = read_log(log(tmp_path), desired=desired).run
    assert np.array_equal(np.flatnonzero(~run.mask), np.arange(200, 220))
    assert not run.velocity[~run.mask].any()


def test_logs_that_do_not_overlap_are_refused(tmp_path):
    desired = log(tmp_path, TIME + 1.7e9, name="desired.csv")
    message = r"desired.csv: the stamps from 1700000000.0 s to .* do not overlap with .* to 3.99 s"
    with pytest.raises(LogError, match=message):
        read_log(log(tmp_path), desired=desired)


@pytest.mark.parametrize("others", [{}, {"elbow.effort": TIME}])
def test_desired_motion_alone_is_refused(tmp_path, others):
    path = write(tmp_path / "log.csv", {"time": TIME, "target_qd_0": TIME} | others)
    with pytest.raises(LogError, match="holds no measured motion, only desired"):
        read_log(path)


def test_degrees_are_converted_but_not_of_prismatic_joints(tmp_path):
    columns = {
        "time": TIME,
        "panda_joint1.position": np.full(400, 90.0),
        "panda_joint1.velocity": np.full(400, 180.0),
        "panda_joint1.effort": np.full(400, 10.0),
        "panda_finger_joint1.position": np.full(400, 0.04),
        "panda_finger_joint1.velocity": np.full(400, 0.01),
        "panda_finger_joint1.effort": np.full(400, 1.0),
    }
    path = write(tmp_path / "log.csv", columns)
    run = read_log(path, robot="panda", units="degrees").run
    assert np.allclose(run.position[0], [np.pi / 2, 0.04], rtol=1e-15)
    assert np.allclose(run.velocity[0], [np.pi, 0.01], rtol=1e-15)
    assert np.array_equal(run.effort[0], [10.0, 1.0])
    assert read_log(path, units="degrees").run.position[0, 1] == pytest.approx(np.deg2rad(0.04))


@pytest.mark.parametrize(
    ("column", "value"), [("elbow.position", -90.0), ("elbow.velocity", 120.0)]
)
def test_degrees_in_place_of_radians_are_refused_with_their_row(tmp_path, column, value):
    path = log(tmp_path, **{column: np.where(TIME < 0.05, 0.0, value)})
    message = f"row 7: column '{column}' holds {value:g}, too much for radians; .* --units deg"
    with pytest.raises(LogError, match=message) as caught:
        read_log(path)
    assert caught.value.row == 7


def test_continuous_and_prismatic_joints_may_exceed_the_limit(tmp_path):
    position = np.linspace(0, 50, 400)
    joints = ("wheel_left_joint", "torso_lift_joint")
    columns = {f"{joint}.position": position for joint in joints}
    path = write(tmp_path / "log.csv", {"time": TIME} | columns)
    assert read_log(path, robot="tiago").run.position.max() == 50.0
