"""The motion that a joint adds to its link: (v_rel, w_rel) = S qdot."""

import numpy as np

from noisemodel.joints import Joint
from noisemodel.types import Array


def subspace(joint: Joint) -> Array:
    """Find the twist of the link, in the joint's axes, at unit velocities of its joint alone.

    Args:
        joint: The joint.

    Returns:
        The matrix S, shape (6, nv).
    """
    own = np.zeros((6, joint.nv))
    own[joint.moves] = np.eye(joint.nv)
    if joint.turn is not None:
        own = np.vstack((joint.turn.T @ own[:3], joint.turn.T @ own[3:]))
    return joint.multiplier * own


def own_twist(joint: Joint, velocity: Array) -> Array:
    """Find the part of a link's twist that its own joint makes.

    Args:
        joint: The joint.
        velocity: Its velocity, of the leader for a joint that follows one, shape (nv, samples).

    Returns:
        Linear, then angular velocity in the joint's axes, shape (6, samples).
    """
    own: Array = subspace(joint) @ velocity
    return own


def turning_axis(joint: Joint) -> Array | None:
    """Find the axis that the link turns about.

    Args:
        joint: The joint.

    Returns:
        The axis, of length 1, or 0 where the joint only slides, shape (3,); None where it turns
        about any axis.
    """
    if joint.kind == "floating":
        return None
    axis = subspace(joint)[3:, -1]
    return axis / max(float(np.linalg.norm(axis)), np.finfo(np.float64).tiny)
