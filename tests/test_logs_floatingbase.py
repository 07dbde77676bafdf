"""Poses and velocities of a base, converted to the run's convention."""

from decimal import Decimal

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from inspector.logs.clocks import resampled
from inspector.logs.mapping import Stamps, Track, pose_of, velocity_of

TURNS = Rotation.random(50, rng=0)
POSES = np.hstack((np.zeros((50, 3)), TURNS.as_quat()))


def test_the_order_of_a_quaternion_is_converted():
    pose = np.hstack((POSES[:, :3], POSES[:, [6, 3, 4, 5]]))
    assert np.array_equal(pose_of(pose, "wxyz"), POSES)
    assert np.array_equal(pose_of(POSES, "xyzw"), POSES)


@given(st.integers(0, 1000))
@settings(max_examples=20, deadline=None)
def test_velocities_in_world_axes_are_converted_to_body_axes(seed):
    twist = np.random.default_rng(seed).standard_normal((50, 6))
    linear, angular = (TURNS.inv().apply(part) for part in (twist[:, :3], twist[:, 3:]))
    assert np.allclose(velocity_of(twist, "world", POSES), np.hstack((linear, angular)))
    assert np.allclose(velocity_of(twist, "mujoco", POSES), np.hstack((linear, twist[:, 3:])))
    assert np.array_equal(velocity_of(twist, "body", POSES), twist)


def test_poses_are_interpolated_the_short_way():
    time, between = np.arange(50) / 50, np.arange(480) / 490
    is_angular = Rotation.from_rotvec(np.stack((time, 2 * time, 0 * time), axis=1))
    signs = np.where(np.arange(50) % 3, 1.0, -1.0)[:, None]  # q and -q are one rotation
    poses = np.hstack((np.zeros((50, 3)), signs * is_angular.as_quat()))

    track = Track("base_pose", (), (), Stamps(Decimal(0), time), poses)
    found = resampled(between, np.ones(480, dtype=bool), track, 1e-6)
    error = Rotation.from_quat(found[:, 3:]) * Slerp(time, is_angular)(between).inv()
    assert error.magnitude().max() < 1e-4
    assert np.allclose(np.linalg.norm(found[:, 3:], axis=1), 1)
