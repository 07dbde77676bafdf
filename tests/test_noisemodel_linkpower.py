import sys

import numpy as np
import pytest
from chains import BAR, chain, motion

from noisemodel import Robot, Run, Surface, extended
from noisemodel.extended import by_moments, by_samples, link_noise, second_moments

SIZE = 20


@pytest.fixture(scope="module")
def solo():
    """A quadruped: four legs that branch from a base that floats."""
    robot = Robot.load("solo12")
    return robot, Surface.of(robot, "auto")


def vibration(robot, samples, *, moving):
    generator = np.random.default_rng(0)
    v = generator.normal(size=(samples, robot.nv))
    q = np.tile(robot.neutral, (samples, 1))
    q[:, 7:] = generator.uniform(-1, 1, robot.nq - 7)
    if moving:
        time = np.arange(samples)[:, None] / 1000
        q[:, 7:] += 0.5 * np.sin(2 * np.pi * time + np.arange(robot.nq - 7))
    return q, v


def test_moments_of_a_constant_velocity_are_its_products():
    velocity = np.tile([2.0, -1.0], (50, 1))
    found = second_moments(velocity, np.ones(50, dtype=bool), size=SIZE)
    assert found.shape == (3, 2, 2)
    np.testing.assert_allclose(found, np.tile([[4.0, -2.0], [-2.0, 1.0]], (3, 1, 1)))


def test_gaps_count_neither_as_motion_nor_as_rest():
    valid = np.ones(60, dtype=bool)
    valid[10:40] = False
    found = second_moments(np.full((60, 1), 3.0), valid, size=SIZE)
    np.testing.assert_allclose(found.ravel(), [9.0, 0.0, 9.0])


def averaged(robot, surface, q, v, kind):
    """Power of bins, from second moments."""
    moments = second_moments(v, np.ones(len(v), dtype=bool), size=SIZE)
    (power,) = by_moments(robot, surface, q[SIZE // 2 :: SIZE], [(kind, moments)])
    return power


@pytest.mark.parametrize("kind", ["normal", "rms"])
def test_where_the_robot_stands_power_is_that_of_the_samples(solo, kind):
    robot, surface = solo
    q, v = vibration(robot, 120, moving=False)
    noise = extended(robot, surface, q, v, kind).power
    expected = noise.reshape(-1, SIZE, noise.shape[1]).mean(axis=1)
    np.testing.assert_allclose(averaged(robot, surface, q, v, kind), expected, rtol=1e-9)


def test_where_the_robot_moves_power_is_right_to_a_hundredth(solo):
    robot, surface = solo
    q, v = vibration(robot, 400, moving=True)
    noise = extended(robot, surface, q, v, "normal").power
    expected = noise.reshape(-1, SIZE, noise.shape[1]).mean(axis=1)
    found = averaged(robot, surface, q, v, "normal")
    np.testing.assert_allclose(found, expected, rtol=2e-2)
    np.testing.assert_allclose(found.mean(axis=0), expected.mean(axis=0), rtol=2e-3)


@pytest.mark.parametrize("offset", [0.0, 0.7])
@pytest.mark.parametrize("kind", ["normal", "paper"])
def test_the_noise_of_a_floating_robot_is_the_extended_one(solo, kind, offset):
    robot, surface = solo
    q, v = vibration(robot, 400, moving=True)
    q[:, :3] = [0.3, -0.2, 0.5]
    run = Run(
        time=np.arange(400) / 1000,
        velocity=v[:, 6:],
        position=q[:, 7:],
        velocity_desired=v[:, :5:-1],
        position_desired=q[:, :6:-1] + offset,
        joint_names=robot.joint_names,
        desired_joint_names=robot.joint_names[::-1],
        base_pose=q[:, :7],
        base_velocity=v[:, :6],
        robot="solo12",
    )
    found = link_noise(run, kind)
    desired = dict(zip(("q_desired", "v_desired"), robot.desired(run), strict=True))
    noise = extended(robot, surface, *robot.configuration(run), kind, **desired).power
    np.testing.assert_allclose(found.power.mean(axis=0), noise.mean(axis=0), rtol=5e-3)
    assert found.power.shape == (40, len(surface.names))


@pytest.mark.parametrize("lost", [8, 9])
@pytest.mark.parametrize("kind", ["normal", "paper"])
def test_a_bin_that_begins_in_a_gap_takes_the_pose_of_its_valid_part(solo, kind, lost):
    robot, _ = solo
    q, v = vibration(robot, 200, moving=False)
    v[:] = v[0]
    valid = np.ones(200, dtype=bool)
    valid[100 : 100 + lost] = False  # the middle of the bin from 100 to 110 is lost
    run = {"joint_names": robot.joint_names, "time": np.arange(200) / 1000, "robot": "solo12"}
    whole = Run(velocity=v[:, 6:], position=q[:, 7:], **run)
    signals = {"velocity": v[:, 6:] * valid[:, None], "position": q[:, 7:] * valid[:, None]}
    holed = Run(valid=valid, **signals, **run)
    found, expected = link_noise(holed, kind).power, link_noise(whole, kind).power
    np.testing.assert_allclose(found[10], expected[10])


@pytest.mark.parametrize("chunk", [4, 25, 1000])
def test_power_of_samples_is_averaged_in_bins_whatever_the_chunks(tmp_path, monkeypatch, chunk):
    monkeypatch.setattr(sys.modules["noisemodel.extended"], "CHUNK", chunk)
    robot = chain(tmp_path, "revolute", "prismatic")
    q, v = motion(robot, samples=95)
    valid = np.ones(95, dtype=bool)
    valid[[*range(20, 30), 33, 41, 42]] = False
    run = Run(
        time=np.arange(95) / 1000,
        velocity=v * valid[:, None],
        position=q * valid[:, None],
        joint_names=robot.joint_names,
        valid=valid,
    )
    surface = Surface.of(robot)
    power = extended(robot, surface, *robot.configuration(run), "paper").power * valid[:, None]
    parts = [slice(first, first + 10) for first in range(0, 95, 10)]
    expected = [power[part].sum(axis=0) / max(valid[part].sum(), 1) for part in parts]
    found = by_samples(robot, surface, run, "paper", np.array([*range(0, 95, 10), 95]))
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert not found[2].any()


def test_power_of_moments_is_that_of_each_link_with_a_surface_and_of_each_motion(tmp_path):
    robot = chain(tmp_path, "revolute", "prismatic", "revolute", shapes=[BAR, "", BAR])
    surface = Surface.of(robot)
    q, v = motion(robot, samples=5)
    motions = [("rms", v), ("normal", v), ("normal", -2 * v)]
    moments = [(kind, each[:, :, None] * each[:, None]) for kind, each in motions]
    for (kind, each), found in zip(motions, by_moments(robot, surface, q, moments), strict=True):
        np.testing.assert_allclose(found, extended(robot, surface, q, each, kind).power, rtol=1e-9)
        assert (found > 0).any(axis=0).tolist() == [True, False, True]


def test_the_last_bin_of_moments_may_be_shorter_and_counts_its_own_samples():
    random = np.random.default_rng(0)
    velocity, valid = random.normal(size=(47, 3)), np.ones(47, dtype=bool)
    valid[[3, 40, 44]] = False
    parts = [slice(0, 20), slice(20, 40), slice(40, 47)]
    expected = [np.cov(velocity[p][valid[p]].T, bias=True) for p in parts]
    means = [velocity[p][valid[p]].mean(axis=0) for p in parts]
    expected = [each + np.outer(mean, mean) for each, mean in zip(expected, means, strict=True)]
    np.testing.assert_allclose(second_moments(velocity, valid, size=SIZE), expected, rtol=1e-12)
