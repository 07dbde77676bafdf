from dataclasses import replace

import numpy as np
import pytest
from chains import BAR, chain

from noisemodel import Robot, Run, Surface, extended
from noisemodel.extended import link_noise, vibrating


def arm_run(rattling=None, *, rate=1000.0, seconds=4.0, **changes):
    """Move a UR5 slowly; one joint may rattle at 100 Hz from 2 s to 2.5 s."""
    time = np.arange(round(rate * seconds)) / rate
    names = Robot.load("ur5").joint_names
    velocity = 0.5 * np.cos(np.outer(time, np.linspace(0.5, 1.5, 6)))
    position = np.sin(np.outer(time, np.linspace(0.5, 1.5, 6)))
    if rattling is not None:
        during = (time >= 2.0) & (time < 2.5)
        velocity[during, rattling] += 0.2 * np.sin(2 * np.pi * 100 * time[during])
    fields = {
        "time": time,
        "velocity": velocity,
        "position": position,
        "joint_names": names,
        "robot": "ur5",
    }
    return Run(**(fields | changes))


def test_bins_hold_the_mean_power_of_the_extended_noise():
    run = arm_run()
    robot = Robot.load("ur5")
    noise = extended(robot, Surface.of(robot, "auto"), *robot.configuration(run), "normal")
    found = link_noise(run)
    # Within a bin the robot is taken to stand still: 1e-3 is 0.004 dB.
    np.testing.assert_allclose(found.power.mean(axis=0), noise.power.mean(axis=0), rtol=1e-3)
    np.testing.assert_allclose(found.total[7], noise.total[70:80].mean(), rtol=1e-3)
    assert found.time[7] == pytest.approx(0.075)
    assert found.links == noise.names


def test_the_terms_are_added_up_if_asked_and_are_those_of_the_extended_noise():
    run, robot = arm_run(seconds=0.3), Robot.load("ur5")
    assert link_noise(run).terms == {}
    assert link_noise(run).kind == "normal"
    terms = link_noise(run, "paper", terms=True).terms
    motion = (robot, Surface.of(robot, "auto"), *robot.configuration(run))
    for term in "ABC":
        power = extended(*motion, term).power.sum(axis=1)
        np.testing.assert_allclose(terms[term], power.reshape(-1, 10).mean(axis=1), rtol=1e-9)
    assert tuple(terms) == ("A", "B", "C")


def test_desired_velocities_without_positions_are_taken_where_the_robot_is():
    run = arm_run(seconds=0.2)
    once = link_noise(run)
    both = link_noise(arm_run(seconds=0.2, velocity_desired=2 * run.velocity))
    np.testing.assert_allclose(both.power, 5 * once.power, rtol=1e-9)
    np.testing.assert_allclose(both.vibration, once.vibration, rtol=1e-12)


def test_the_loudest_link_is_the_one_with_the_largest_peak():
    found = link_noise(arm_run(rattling=3))
    peaks = found.vibration.max(axis=0)
    assert [peaks[link] for link in found.loudest] == sorted(peaks, reverse=True)
    assert "wrist_1_joint" in found.movers[found.loudest[0]]
    assert 200 <= found.vibration[:, found.loudest[0]].argmax() < 250


def test_vibration_has_no_running_mean_of_a_tenth_of_a_second():
    velocity = np.random.default_rng(5).normal([1.0, -2.0], size=(300, 2))
    valid = np.ones(300, dtype=bool)
    valid[120] = False
    found = vibrating(velocity, valid, 1000.0)
    for start, stop in ((0, 120), (121, 300)):
        for sample in range(start, stop):
            reach = min(50, sample - start, stop - 1 - sample)
            mean = velocity[sample - reach : sample + reach + 1].mean(axis=0)
            np.testing.assert_allclose(found[sample], velocity[sample] - mean, atol=1e-12)
    assert not found[120].any()


def test_what_is_missing_is_said_in_a_sentence_each(tmp_path):
    robot = chain(tmp_path, "revolute", "revolute", shapes=[BAR, ""], floating_base=True)
    time = np.arange(200) / 1000
    pose = np.zeros((200, 7))
    pose[:, 6] = 1.0
    run = Run(
        time=time,
        velocity=np.ones((200, 1)),
        position=time[:, None],
        joint_names=("joint2",),
        robot=str(robot.path),
        base_pose=pose,
    )
    assert link_noise(run).remarks == (
        "Not in the log, assumed stationary: joint1.",
        "Links without geometry make no noise: link0, link2.",
        "The run has no base velocity: its base is assumed stationary.",
    )
    moving = replace(run, base_velocity=np.zeros((200, 6)))
    assert len(link_noise(moving).remarks) == 2


def test_a_robot_that_is_fixed_is_not_said_to_lack_the_motion_of_its_base():
    assert not any("base" in remark for remark in link_noise(arm_run()).remarks)


def test_the_desired_motion_adds_its_own_power():
    run = arm_run()
    both = arm_run(velocity_desired=run.velocity, position_desired=run.position)
    np.testing.assert_allclose(link_noise(both).power, 2 * link_noise(run).power, rtol=1e-12)


def test_each_link_names_the_joints_that_move_it():
    found = link_noise(arm_run())
    movers = dict(zip(found.links, found.movers, strict=True))
    assert movers["shoulder_link"] == {"shoulder_pan_joint"}
    assert movers["wrist_3_link"] == set(Robot.load("ur5").joint_names)


def test_slow_motion_is_no_vibration_and_fast_motion_is():
    time = np.arange(4000) / 1000
    valid = np.ones(4000, dtype=bool)
    slow = np.sin(2 * np.pi * 0.5 * time)[:, None]
    assert np.abs(vibrating(slow, valid, 1000.0))[100:-100].max() < 0.02
    fast = np.sin(2 * np.pi * 100 * time)[:, None]
    np.testing.assert_allclose(vibrating(fast, valid, 1000.0)[100:-100], fast[100:-100], atol=0.02)


def test_gaps_are_silent_and_do_not_ring():
    valid = np.ones(4000, dtype=bool)
    valid[1500:1600] = False
    velocity = np.where(valid[:, None], 1.0, 0.0) * np.ones((1, 6))
    found = link_noise(arm_run(velocity=velocity, valid=valid))
    assert found.power[150:160].max() == 0.0
    assert found.vibration.max() < 1e-20


def test_a_long_run_has_no_more_bins_than_a_short_one():
    assert len(link_noise(arm_run(rate=100.0, seconds=120.0)).time) <= 4001


def test_joints_that_are_not_in_the_log_are_assumed_stationary():
    run = arm_run()
    part = Run(
        time=run.time,
        velocity=run.velocity[:, :5],
        position=run.position[:, :5],
        joint_names=run.joint_names[:5],
        robot="ur5",
    )
    assert "Not in the log, assumed stationary: wrist_3_joint" in link_noise(part).remarks[0]
