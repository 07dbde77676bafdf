import numpy as np
import pytest
from test_audit_bandwidth import motion, noise, run_of

from inspector.audit import audit, excerpt
from inspector.audit.signals import copies, unit_warnings


def warnings(velocity, position=None, rate=1000.0):
    return list(unit_warnings(run_of(velocity, rate, position=position)))


@pytest.mark.parametrize("rate", [50.0, 1000.0])
@pytest.mark.parametrize("level", [0.0, 0.01])
def test_radians_give_no_warning(rate, level):
    _, position, velocity = motion(rate)
    assert warnings(velocity + noise(velocity.shape, level), position, rate) == []
    assert warnings(velocity, None, rate) == []


@pytest.mark.parametrize(
    ("by_position", "by_velocity", "by_desired", "message"),
    [
        (1, 180 / np.pi, 180 / np.pi, "degrees per second beside positions in radians"),
        (180 / np.pi, 1, 1, "positions look like degrees beside velocities in radians"),
        (1, 30 / np.pi, 30 / np.pi, "turns per minute beside positions in radians"),
        (180 / np.pi, 30 / np.pi, 30 / np.pi, "are 0.167 times the slopes of their positions: an"),
        (1, 1, 180 / np.pi, "desired velocities go 57.3 times as far as measured ones: another un"),
        (1, 1, np.pi / 180, "desired velocities go 0.0174 times as far as measured ones: another"),
    ],
)
def test_velocities_in_another_unit_give_a_warning(by_position, by_velocity, by_desired, message):
    _, position, velocity = motion(1000.0)
    given = {"position": by_position * position, "velocity_desired": by_desired * velocity}
    velocity = velocity + noise(velocity.shape, 0.01)
    assert message in next(unit_warnings(run_of(by_velocity * velocity, 1000.0, **given)))


def test_degrees_throughout_are_found_by_how_far_they_reach():
    _, position, velocity = motion(30.0)
    (message, *_) = warnings(np.rad2deg(velocity), np.rad2deg(position), 30.0)
    assert message == "positions look like degrees or normalised (joint0 reaches 63.03)"
    (message, *_) = warnings(np.rad2deg(velocity), 2 * np.rad2deg(position), 30.0)
    assert "or normalised" not in message
    small = 10 / 63.03  # a turn of the joint that moves most
    (message, *_) = warnings(small * np.rad2deg(velocity), small * np.rad2deg(position), 30.0)
    assert message.startswith("positions look like degrees or normalised (joint0 reaches 9.999")


def test_one_wheel_among_many_joints_gives_no_warning():
    time, position, velocity = motion(1000.0)
    position[:, 0], velocity[:, 0] = 9 * time, 9.0
    velocity[::2, 0] += 1e-3
    assert warnings(velocity, position) == []


def test_velocities_that_no_robot_reaches_give_a_warning():
    _, _, velocity = motion(1000.0)
    (message,) = warnings(np.rad2deg(velocity))
    assert "degrees or turns per minute (joint4 reaches" in message


@pytest.mark.parametrize("lag", [0, 1, 5, -3])
def test_a_copy_is_found_with_its_lag(lag):
    _, _, velocity = motion(30.0)
    measured = velocity + noise(velocity.shape)
    desired = np.roll(measured, -lag, axis=0)
    (copy,) = copies(run_of(measured, 30.0, velocity_desired=desired))
    assert (copy.signal, copy.lag, len(copy.joints)) == ("velocity", lag, 6)


def test_a_robot_that_follows_well_is_no_copy():
    _, _, velocity = motion(30.0)
    following = velocity + noise(velocity.shape, 1e-6)
    assert copies(run_of(following, 30.0, velocity_desired=velocity)) == ()
    still = np.zeros_like(velocity)
    assert copies(run_of(still, 30.0, velocity_desired=still)) == ()
    assert copies(run_of(velocity, 30.0)) == ()


def test_copies_are_found_by_name():
    _, _, velocity = motion(30.0)
    desired = {"velocity_desired": velocity[:, [3, 1]], "desired_joint_names": ("joint3", "joint0")}
    run = run_of(velocity, 30.0, **desired)
    assert [copy.joints for copy in copies(run)] == [("joint3",)]


def test_gaps_are_counted_and_measured():
    valid = np.ones(1000, dtype=bool)
    assert str(audit(run_of(np.zeros((1000, 1)), 100.0), {}).gaps) == "no gaps"
    valid[:10] = valid[500:530] = valid[999] = False
    found = audit(run_of(np.zeros((1000, 1)), 100.0, valid=valid), {}).gaps
    assert (found.count, found.total, found.longest) == (3, pytest.approx(0.41), pytest.approx(0.3))
    assert str(found) == "3 gaps, 0.41 s in all, 0.3 s the longest"


def test_the_fastest_part_of_a_long_run_is_examined():
    rate, samples = 1000.0, 500_000
    time = np.arange(samples) / rate
    velocity = np.cos(time)[:, None] * np.where(time < 400, 0.01, 1.0)[:, None]
    valid = np.ones(samples, dtype=bool)
    valid[-5:] = False
    velocity[~valid] = 0.0
    run = run_of(velocity, rate, valid=valid, velocity_desired=velocity)
    part = excerpt(run)
    assert len(part.time) == 60_000
    assert np.abs(part.velocity).max() == np.abs(velocity).max()
    assert part.time[0] >= 370.0
    (copy,) = copies(part)
    assert copy.lag == 0
    short = run_of(velocity[:1000], rate)
    assert excerpt(short) is short
