import numpy as np
import pinocchio as pin
import pytest

from noisemodel import Run, RunFileError
from noisemodel.differentiate import METHOD, base_velocity, fill_in, joint_velocity, stretches
from noisemodel.ondemand import OnDemand

RATE = 1000.0
TIME = np.arange(2000) / RATE


def swing(time, frequency=5.0):
    """Position of a joint that swings, and its velocity."""
    phase = 2 * np.pi * frequency * time
    return np.sin(phase)[:, None], (2 * np.pi * frequency * np.cos(phase))[:, None]


def tumble(time):
    """Pose of a base that moves and turns at constant rates, and its body velocity."""
    twist = np.array([0.3, -0.2, 0.1, 1.0, 5.0, -2.0])
    motion = pin.Motion(twist)
    poses = [pin.SE3ToXYZQUAT(pin.exp6(motion * float(t))) for t in time]
    return np.array(poses), np.tile(twist, (len(time), 1))


def test_constant_speed_is_exact():
    position = np.outer(TIME, [2.0, -3.0])
    assert np.allclose(joint_velocity(TIME, position), [2.0, -3.0], rtol=0, atol=1e-9)


def test_standstill_has_no_velocity():
    assert np.allclose(joint_velocity(TIME, np.ones((2000, 3))), 0.0, atol=1e-11)


def test_a_swinging_joint_is_differentiated_to_a_thousandth():
    position, velocity = swing(TIME)
    error = np.abs(joint_velocity(TIME, position) - velocity).max()
    assert error < 1e-3 * np.abs(velocity).max()


def test_angles_that_wrap_give_no_spike():
    angle = np.outer(TIME, [20.0])
    wrapped = (angle + np.pi) % (2 * np.pi) - np.pi
    assert np.allclose(joint_velocity(TIME, wrapped), 20.0, rtol=0, atol=1e-8)


def test_nothing_is_differentiated_across_a_gap():
    position, velocity = swing(TIME)
    valid = (TIME < 0.5) | (TIME > 0.7)
    position[~valid] = 0.0
    found = joint_velocity(TIME, position, valid)
    assert np.array_equal(found[~valid], np.zeros((int((~valid).sum()), 1)))
    assert np.abs(found - velocity)[valid].max() < 1e-3 * np.abs(velocity).max()


def test_short_stretches_are_differentiated_by_differences():
    position = np.outer(TIME[:6], [2.0])
    valid = np.array([True, True, True, False, False, True])
    assert np.allclose(joint_velocity(TIME[:6], position, valid).T, [[2, 2, 2, 0, 0, 0]], atol=1e-9)


def test_stretches_lie_between_gaps():
    valid = np.array([0, 1, 1, 0, 1, 0, 1, 1, 1], dtype=bool)
    assert list(stretches(valid, 9)) == [slice(1, 3), slice(6, 9)]
    assert list(stretches(None, 9)) == [slice(0, 9)]


def test_a_tumbling_base_has_its_body_velocity():
    pose, twist = tumble(TIME)
    assert np.allclose(base_velocity(TIME, pose), twist, rtol=0, atol=1e-6)


def test_quaternions_that_flip_their_sign_give_no_spike():
    pose, twist = tumble(TIME)
    pose[700:1300, 3:] *= -1
    assert np.allclose(base_velocity(TIME, pose), twist, rtol=0, atol=1e-6)


def test_a_half_turn_between_two_samples_does_not_silence_the_rest():
    pose = np.tile([0, 0, 0, 0, 0, 0, 1.0], (20, 1))
    pose[5:, 3:] = [1.0, 0, 0, 0]
    pose[:, 0] = np.arange(20) / RATE
    linear = base_velocity(TIME[:20], pose)[:, :3]
    assert np.allclose(np.linalg.norm(linear, axis=1), 1.0, atol=1e-9)


def test_a_run_of_positions_alone_has_velocities_and_states_their_source(tmp_path):
    position, velocity = swing(TIME)
    pose, twist = tumble(TIME)
    np.savez(
        tmp_path / "run.npz", time=TIME, position=position, position_desired=position,
        base_pose=pose,
    )  # fmt: skip
    run = Run.load(tmp_path / "run.npz")
    for found in (run.velocity, run.velocity_desired):
        assert np.abs(found - velocity).max() < 1e-3 * np.abs(velocity).max()
    assert np.allclose(run.base_velocity, twist, rtol=0, atol=1e-6)
    assert run.meta["differentiated"] == {
        "velocity": METHOD,
        "velocity_desired": METHOD,
        "base_velocity": METHOD,
    }


def test_velocities_that_are_there_are_left_alone(tmp_path):
    position, velocity = swing(TIME)
    np.savez(tmp_path / "run.npz", time=TIME, position=position, velocity=2 * velocity)
    run = Run.load(tmp_path / "run.npz")
    assert np.array_equal(run.velocity, 2 * velocity)
    assert "differentiated" not in run.meta


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"position": np.ones((3, 2))}, r"position: shape \(3, 2\), expected \(2000, 2\)"),
        (
            {"position": np.where(TIME == 0.003, np.nan, 1.0)[:, None]},
            "position: nan in row 3, column 0; mark gaps with valid = false",
        ),
        (
            {"velocity": np.ones((2000, 1)), "base_pose": np.ones((2000, 6))},
            r"base_pose: shape \(2000, 6\), expected \(2000, 7\)",
        ),
        (
            {"velocity": np.ones((2000, 1)), "base_pose": np.zeros((2000, 7))},
            "the quaternion in row 0 has norm 0, expected 1",
        ),
    ],
)
def test_positions_that_cannot_be_differentiated_are_refused(tmp_path, arrays, message):
    np.savez(tmp_path / "run.npz", time=TIME, **arrays)
    with pytest.raises(RunFileError, match=message):
        Run.load(tmp_path / "run.npz")


@pytest.mark.parametrize("derivative", [joint_velocity, base_velocity])
def test_rows_that_are_differentiated_on_demand_are_those_of_the_whole(derivative):
    time, read = TIME[:60], []
    pose, _ = tumble(time)
    pose[30:, 3:] *= -1
    valid = np.ones(60, dtype=bool)
    valid[[7, 20, 23, 40, 41]] = False
    whole = derivative(time, pose, valid)

    def rows(first, stop):
        assert 0 <= first <= stop <= 60
        read.append((first, stop))
        return pose[first:stop]

    kept = derivative(time, OnDemand((60, 7), np.float64, rows), valid)
    assert isinstance(kept, OnDemand)
    assert (kept.shape, kept.dtype) == (whole.shape, np.float64)
    for first in range(0, 60, 3):
        for stop in (first + 1, first + 5, 60):
            found = kept[first:stop]
            np.testing.assert_allclose(found, whole[first:stop], atol=1e-9)
    assert max(stop - first for first, stop in read[::3]) <= 1 + 2 * 7
    without = derivative(time, OnDemand((60, 7), np.float64, rows))
    np.testing.assert_allclose(without[10:20], derivative(time, pose)[10:20], atol=1e-9)


def test_a_base_on_a_straight_and_level_way_has_the_velocity_along_its_own_axes():
    """A quarter turn about z: what is x in the world is -y of the base."""
    pose = np.tile([0, 0, 0, 0, 0, np.sqrt(0.5), np.sqrt(0.5)], (20, 1))
    pose[:, :3] = np.outer(TIME[:20], [2.0, 3.0, 5.0])
    expected = np.tile([3.0, -2.0, 5.0, 0, 0, 0], (20, 1))
    np.testing.assert_allclose(base_velocity(TIME[:20], pose), expected, atol=1e-9)
    np.testing.assert_allclose(base_velocity(TIME[:20], 1.005 * pose), 1.005 * expected, atol=1e-9)


@pytest.mark.parametrize("samples", [2, 3, 6, 7, 8])
def test_a_parabola_is_differentiated_exactly_by_seven_samples_and_inside_by_fewer(samples):
    time = np.arange(samples) / 4
    found = joint_velocity(time, 0.1 * time[:, None] ** 2)[:, 0]
    exact = slice(None) if samples >= 7 else slice(1, -1)
    np.testing.assert_allclose(found[exact], 0.2 * time[exact], atol=1e-12)
    assert (abs(found[0]) > 0.02) == (samples < 7)


def test_what_is_missing_is_filled_in_and_its_method_told():
    time, position = TIME[:20], np.outer(TIME[:20], [3.0])
    signals = {"time": time, "velocity": position, "position_desired": 2 * position}
    filled, how = fill_in(signals)
    assert set(filled) == {*signals, "velocity_desired"}
    np.testing.assert_allclose(filled["velocity_desired"], 6.0)
    assert how == {"velocity_desired": "Savitzky-Golay, window 7, order 3"}
    assert filled["velocity"] is position
    filled, how = fill_in({"time": time, "position": position, "valid": time != time[2]})
    assert filled["velocity"][:4, 0].round(9).tolist() == [3.0, 3.0, 0.0, 3.0]
    assert set(how) == {"velocity"}
