"""The floating base, from MuJoCo's conventions to Pinocchio's."""

import numpy as np

from noisemodel.types import Array


def pinocchio_base(pose: Array, velocity: Array) -> tuple[Array, Array]:
    """Pose and velocity of a floating base as Pinocchio has them.

    Args:
        pose: Position and quaternion (w, x, y, z), shape (samples, 7).
        velocity: Linear in the world's axes, angular in the base's own, shape (samples, 6).
    """
    place, w, xyz = pose[:, :3], pose[:, 3:4], pose[:, 4:]
    linear = velocity[:, :3]
    # v' = R^T v, R of the quaternion: v + 2 w (v x u) + 2 (v x u) x u, u its vector part.
    turned = 2 * np.cross(linear, xyz)
    linear = linear + w * turned + np.cross(turned, xyz)
    return np.hstack((place, xyz, w)), np.hstack((linear, velocity[:, 3:]))
