"""Link twists of a whole run at once: forward kinematics with all samples in one array."""

from collections.abc import Sequence

import numpy as np

from noisemodel.errors import NoiseModelError
from noisemodel.joints import Joint
from noisemodel.robot import Robot
from noisemodel.types import Array, Real

CHUNK = 4096
"""Samples that are worked on at once: few enough for the cache, with little overhead of Python."""


def link_twists(robot: Robot, q: Real, v: Real) -> Array:
    """Compute the twist of every link, in every sample.

    Args:
        robot: The robot.
        q: Configurations as Pinocchio has them, shape (samples, nq).
        v: Velocities as Pinocchio has them, shape (samples, nv).

    Returns:
        Linear, then angular velocity of each joint's frame in its own axes, the universe first,
        as Pinocchio's ``data.v``, shape (samples, njoints, 6), in [m/s] and [rad/s]. In memory
        the samples lie next to each other.

    Raises:
        NoiseModelError: If ``q`` is not (samples, nq) or ``v`` not (samples, nv).
    """
    for name, array, width in (("q", q, robot.nq), ("v", v, robot.nv)):
        if array.shape != (len(q), width):
            raise NoiseModelError(f"{name} has shape {array.shape}, expected ({len(q)}, {width})")
    twists = np.empty((len(robot.joints) + 1, 6, len(q)))
    for start in range(0, len(q), CHUNK):
        part = slice(start, start + CHUNK)
        chunk_twists(robot.joints, q[part], v[part], out=twists[:, :, part])
    return twists.transpose(2, 0, 1)


def chunk_twists(joints: Sequence[Joint], q: Real, v: Real, *, out: Array) -> None:
    """Compute the link twists of a few thousand samples.

    Args:
        joints: The joints, parents first.
        q: Configurations, shape (samples, nq).
        v: Velocities, shape (samples, nv).
        out: Takes the twists in each joint's axes, shape (njoints, 6, samples),
            in [m/s] and [rad/s].
    """
    positions, velocities = (np.ascontiguousarray(a.T, dtype=np.float64) for a in (q, v))
    out[0] = 0.0  # the universe rests
    for index, joint in enumerate(joints, start=1):
        position = positions[joint.first_q : joint.first_q + joint.nq]
        velocity = velocities[joint.first_v : joint.first_v + joint.nv]
        if joint.multiplier != 1.0 or joint.offset != 0.0:
            position = joint.multiplier * position + joint.offset
            velocity = joint.multiplier * velocity
        twist = out[index]
        if joint.parent:
            np.matmul(joint.shift, out[joint.parent], out=twist)
            CARRY[joint.kind](joint.axis, twist, position)
        else:
            twist[:] = 0.0
        twist[joint.moves] += velocity
        if joint.turn is not None:
            twist[:3] = joint.turn.T @ twist[:3]
            twist[3:] = joint.turn.T @ twist[3:]


# Each of these takes the twist that the parent carries from the resting joint to the joint as it
# stands. They work in place: copies of these arrays would cost as much as the sums.


def _revolute(axis: int, twist: Array, position: Array) -> None:
    tangent = np.tan(0.5 * position[0])  # one tangent takes less time than a sine and a cosine
    double = 2.0 / (1.0 + tangent * tangent)
    _turn(axis, twist, double - 1.0, double * tangent)


def _continuous(axis: int, twist: Array, position: Array) -> None:
    _turn(axis, twist, *(position / np.hypot(*position)))


def _prismatic(axis: int, twist: Array, position: Array) -> None:
    left, right = (axis + 1) % 3, (axis + 2) % 3
    twist[left] += twist[3 + right] * position[0]  # v' = v + w x (axis q)
    twist[right] -= twist[3 + left] * position[0]


def _planar(axis: int, twist: Array, position: Array) -> None:
    x, y, cosine, sine = position
    twist[0] -= twist[5] * y  # v' = v + w x (x, y, 0)
    twist[1] += twist[5] * x
    twist[2] += twist[3] * y - twist[4] * x
    _turn(axis, twist, cosine, sine)


def _floating(_axis: int, twist: Array, position: Array) -> None:
    origin, vector, scalar = position[:3], position[3:6], position[6]
    twist[:3] += np.cross(twist[3:], origin, axis=0)
    for part in (twist[:3], twist[3:]):  # R(q)^T part
        across = 2 * np.cross(part, vector, axis=0)
        part += scalar * across + np.cross(across, vector, axis=0)


def _turn(axis: int, twist: Array, cosine: Array, sine: Array) -> None:
    """See a twist from axes that are turned about one of them."""
    left, right = twist[(axis + 1) % 3 :: 3], twist[(axis + 2) % 3 :: 3]
    ahead, back = sine * right, sine * left
    left *= cosine
    left += ahead
    right *= cosine
    right -= back


CARRY = {
    "revolute": _revolute,
    "continuous": _continuous,
    "prismatic": _prismatic,
    "planar": _planar,
    "floating": _floating,
}
