import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from checks import holds
from samplelogs import JOINTS, TIMES, cut, motion, numbers, write_lerobot

from inspector import read_log, read_logs
from inspector.errors import LogError

POSITION, VELOCITY = numbers(), numbers(seed=1)
SINCE = np.arange(90) / 30
STATE = motion(SINCE)[0]


def wide(tmp_path, **columns):
    pq.write_table(pa.table(columns), tmp_path / "log.parquet")
    return tmp_path / "log.parquet"


@pytest.mark.parametrize(
    "stamps", [TIMES, (TIMES - TIMES[0]) * 1e-9, pa.array(TIMES, pa.timestamp("ns"))]
)
def test_columns_are_read_bit_for_bit(tmp_path, stamps):
    columns = {f"{joint}.velocity": VELOCITY[:, n] for n, joint in enumerate(JOINTS)}
    imported = read_log(wide(tmp_path, time=stamps, note=["fine"] * 400, **columns))
    holds(imported.run, joint_names=JOINTS, velocity=VELOCITY, rate=100.0)
    assert "log.parquet: 1 column not read: note" in imported.remarks


def test_units_in_the_names_of_columns_are_converted(tmp_path):
    columns = {"q1 [mrad]": 1e3 * POSITION[:, 0], "dq1_deg_s": np.rad2deg(VELOCITY[:, 0])}
    run = read_log(wide(tmp_path, time=TIMES, **columns)).run
    assert np.allclose(run.position[:, 0], POSITION[:, 0], rtol=1e-12)
    assert np.allclose(run.velocity[:, 0], VELOCITY[:, 0], rtol=1e-12)


def test_columns_of_lists_are_arrays_of_joints(tmp_path):
    path = wide(tmp_path, time=TIMES, joint_pos=list(POSITION), qd_logged=list(VELOCITY))
    run = read_log(path, mapping=["velocity=qd_logged"], joints=JOINTS).run
    holds(run, joint_names=JOINTS, position=POSITION, velocity=VELOCITY)


def test_what_does_not_fit_is_an_error_of_one_line(tmp_path):
    ragged = [row[: 2 + n % 2] for n, row in enumerate(POSITION)]
    message = "column 'joint_pos' has 1000 numbers in 400 rows of any length"
    with pytest.raises(LogError, match=message):
        read_log(wide(tmp_path, time=TIMES, joint_pos=ragged))
    path = wide(tmp_path, joint_pos=list(POSITION))
    with pytest.raises(LogError, match=r"there are no stamps; give the log's rate"):
        read_log(path)
    assert read_log(path, rate=100).run.rate == 100.0
    message = r"'joint_pos' has 3 columns, --joints names 2; take a part of it .*\[0:2\]"
    with pytest.raises(LogError, match=message):
        read_log(path, rate=100, joints=["a", "b"])
    merged = {"time": TIMES, "q1": np.where(np.arange(400) % 2, POSITION[:, 0], np.nan)}
    message = "column 'q1' is empty in 50% of the rows; columns with another clock must"
    with pytest.raises(LogError, match=message):
        read_log(wide(tmp_path, **merged))
    with pytest.raises(LogError, match=r"log.parquet: damaged or cut off \("):
        read_log(cut(path, 0.5))


@pytest.mark.parametrize("v3", [True, False])
def test_a_lerobot_data_set_is_a_run_per_episode(tmp_path, v3):
    states = [STATE, STATE[:60] * 2, STATE[:70] * 3]
    folder = write_lerobot(tmp_path / "set", states, names=list(JOINTS), v3=v3)
    file = sorted(folder.glob("data/*/*.parquet"))[0]  # a single one finds its info
    assert next(iter(read_logs(file))).run.joint_names == JOINTS
    runs = {imported.name: imported.run for imported in read_logs(folder)}
    assert list(runs) == ["set-0", "set-1", "set-2"]
    for run, state in zip(runs.values(), states, strict=True):
        state = state.astype(np.float32)
        holds(run, position=state, position_desired=np.roll(state, -1, axis=0))
        holds(run, joint_names=JOINTS, rate=30.0)
        assert set(run.meta["differentiated"]) == {"velocity", "velocity_desired"}
        assert run.meta["robot_type"] == "so101"
    assert not any("timestamp" in remark for remark in next(read_logs(folder)).remarks)


def test_one_episode_is_chosen_by_its_number(tmp_path):
    folder = write_lerobot(tmp_path / "set", [STATE, STATE[:60]], names=list(JOINTS))
    assert len(read_log(folder, episode="1").run.time) == 60
    with pytest.raises(LogError, match=r"holds 2 episodes \(0, 1\); choose one \(episode\)"):
        read_log(folder)
    with pytest.raises(LogError, match="there is no episode '7'; it has 0, 1"):
        read_log(folder, episode="7")


def test_stamps_that_the_rate_contradicts_are_taken_as_logged(tmp_path):
    folder = write_lerobot(tmp_path / "set", [STATE], names=list(JOINTS))
    info = folder / "meta" / "info.json"
    info.write_text(info.read_text().replace('"fps": 30', '"fps": 25'))
    assert read_log(folder).run.rate == pytest.approx(30.0, rel=1e-5)


def test_stamps_of_float32_do_not_make_a_long_episode_jitter(tmp_path):
    state = motion(np.arange(60_000) / 30)[0]
    run = read_log(write_lerobot(tmp_path / "set", [state], names=list(JOINTS))).run
    assert np.array_equal(run.position, state.astype(np.float32))


def test_unspecified_units_are_not_assumed_to_be_radians(tmp_path):
    names = [f"{joint}.pos" for joint in JOINTS]
    folder = write_lerobot(tmp_path / "set", [STATE * 30], names=names)
    message = (
        "LeRobot does not log the unit of its '.pos' features: specify --units degrees or radian"
    )
    with pytest.raises(LogError, match=message):
        read_log(folder)
    run = read_log(folder, units="degrees").run
    assert np.allclose(run.position, np.deg2rad(STATE * 30), rtol=1e-6)
    assert run.meta["units"] == "degrees"
    older = write_lerobot(tmp_path / "older", [STATE * 30], names=list(JOINTS))
    with pytest.raises(LogError, match="too much for radians; if it is in degrees, say --units d"):
        read_log(older)


def test_a_gripper_of_a_data_set_in_degrees_is_left_out(tmp_path):
    names = ["shoulder.pos", "gripper.pos"]
    folder = write_lerobot(tmp_path / "set", [STATE[:, :2] * 30], names=names)
    imported = read_log(folder, units="degrees")
    assert imported.run.joint_names == ("shoulder",)
    assert "set: left out, since grippers have no angles: gripper" in imported.remarks


def test_the_pose_of_an_end_effector_is_no_joint(tmp_path):
    folder = write_lerobot(tmp_path / "set", [STATE], names=["x", "y", "yaw"])
    with pytest.raises(LogError, match="holds x, y, yaw: the pose of an end effector, not joints"):
        read_log(folder)
    run = read_log(folder, mapping=["position=observation.state[2:3]"], joints=["j"]).run
    assert np.array_equal(run.position[:, 0], STATE[:, 2].astype(np.float32))
    assert run.position_desired is None


def test_a_data_set_without_names_is_read_as_positions_with_a_remark(tmp_path):
    imported = read_log(write_lerobot(tmp_path / "set", [STATE], names=None))
    assert imported.run.joint_names == ("joint_0", "joint_1", "joint_2")
    expected = "set: observation.state has no names; it is read as joint positions"
    assert expected in imported.remarks
