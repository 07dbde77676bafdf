"""Pose and velocity of a floating base, converted to the run's convention.

The run has x, y, z and the quaternion x, y, z, w; its velocity is the body's own, linear, then
angular, in the body's axes, as Pinocchio has it.
"""

from collections.abc import Callable, Mapping

import numpy as np

from noisemodel.types import Array, Mask, Real

WIDTHS: Mapping[str, int] = {"base_pose": 7, "base_velocity": 6}


def pose_of(values: Real, convention: str) -> Array:
    """Pose in the run's order.

    Args:
        values: x, y, z and a quaternion, shape (samples, 7).
        convention: "wxyz" or "xyzw", the order of the quaternion.

    Returns:
        x, y, z and the quaternion x, y, z, w, shape (samples, 7), in [m].
    """
    order = [0, 1, 2, 4, 5, 6, 3] if convention == "wxyz" else slice(None)
    return np.asarray(values, dtype=np.float64)[:, order]


def velocity_of(values: Real, convention: str, pose: Array) -> Array:
    """Velocity of the base in body axes.

    Args:
        values: Linear, then angular velocity, shape (samples, 6).
        convention: "world" for world axes, "mujoco" for a linear velocity in world axes and an
            angular one in body axes (``qvel`` of a free joint), "body" for body axes.
        pose: The base's pose at the same samples, as the run has it, shape (samples, 7).

    Returns:
        Linear, then angular velocity in the body's axes, shape (samples, 6).
    """
    linear, angular = np.hsplit(np.asarray(values, dtype=np.float64), 2)
    if convention in ("world", "mujoco"):
        linear = _into_body(linear, pose)
    if convention == "world":
        angular = _into_body(angular, pose)
    return np.hstack((linear, angular))


def interpolated(pose: Array, interpolate: Callable[[Array], Array]) -> Array:
    """Interpolated poses, whose quaternions take the shorter way and have norm 1.

    Args:
        pose: x, y, z and quaternion x, y, z, w, shape (samples, 7).
        interpolate: Interpolates columns.

    Returns:
        Poses at the instants that ``interpolate`` gives, shape (instants, 7).
    """
    quaternion = pose[:, 3:]
    # q and -q are one rotation: take the sign nearer to the previous sample.
    flips = np.einsum("si,si->s", quaternion[1:], quaternion[:-1]) < 0
    signs = np.concatenate(([1.0], np.cumprod(np.where(flips, -1.0, 1.0))))
    found = interpolate(np.hstack((pose[:, :3], quaternion * signs[:, None])))
    length: Array = np.linalg.norm(found[:, 3:], axis=1, keepdims=True)
    return np.hstack((found[:, :3], found[:, 3:] / np.where(length > 0, length, 1.0)))


def not_normalised(pose: Array) -> Mask:
    """Whether the norm of each sample's quaternion is not near 1, shape (samples,)."""
    return np.asarray(np.abs(np.linalg.norm(pose[:, 3:], axis=1) - 1) > 0.01)


def _into_body(vectors: Array, pose: Array) -> Array:
    """Vectors rotated from world to body axes: v' = R(q)^T v."""
    axis, scalar = -pose[:, 3:6], pose[:, 6:]
    cross = 2 * np.cross(axis, vectors)
    rotated: Array = vectors + scalar * cross + np.cross(axis, cross)
    return rotated
