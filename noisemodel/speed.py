"""Mean speeds of a link's surface: the paper's equation and its alternatives."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TypeAlias

import numpy as np

from noisemodel.errors import MotionError, UnknownKindError
from noisemodel.joints import Joint
from noisemodel.kinematics import CHUNK, chunk_twists
from noisemodel.robot import Robot
from noisemodel.subspace import own_twist
from noisemodel.surface import LinkSurface, Surface, check_surface, point_speeds, turning_speed
from noisemodel.types import Array, Real

BLOCK = 256
"""Samples of all points of a link that fit into the cache."""


Weighing: TypeAlias = Callable[[int, Array], Array]
"""Takes a link and signals of its motion that are linear in velocities, and returns as many."""


def surface_speed(robot: Robot, surface: Surface, q: Real, v: Real, kind: str = "paper") -> Array:
    """Mean speed of the surface of every link.

    Args:
        robot: The robot.
        surface: Its surface.
        q: Configurations as Pinocchio has them, shape (samples, nq).
        v: Velocities as Pinocchio has them, shape (samples, nv).
        kind: "paper", the sum of the paper's terms "A", "B" and "C", or one of these; "mean",
            the exact mean that the sum is an upper bound of; "rms", the root of the mean-square
            speed; "normal", that of the mean-square speed normal to the surface.

    Returns:
        Shape (samples, links), in [m/s]; 0 for links without geometry.

    Raises:
        UnknownKindError: If there is no such kind.
        GeometryError: If the surface is that of another robot.
        MotionError: If ``q`` or ``v`` are of another shape or not finite.
    """
    check_kind(kind)
    check_surface(surface, robot)
    check_motion(robot, q, v)
    speeds = np.empty((len(surface.links), len(q)))
    for start in range(0, len(q), CHUNK):
        part = slice(start, start + CHUNK)
        speeds[:, part] = chunk_speeds(robot, surface, q[part], v[part], kind)
    return speeds.T


def chunk_speeds(
    robot: Robot,
    surface: Surface,
    q: Real,
    v: Real,
    kind: str,
    weighing: Weighing | None = None,
) -> Array:
    """Compute the mean speeds of all links in a few thousand samples.

    Args:
        robot: The robot.
        surface: Its surface.
        q: Configurations, shape (samples, nq).
        v: Velocities, shape (samples, nv).
        kind: One of ``KINDS``.
        weighing: What is done to each link's motion first.

    Returns:
        Shape (links, samples), in [m/s].
    """
    twists = np.empty((len(robot.joints) + 1, 6, len(q)))
    chunk_twists(robot.joints, q, v, out=twists)
    velocities = np.ascontiguousarray(v.T, dtype=np.float64)
    speeds = np.zeros((len(surface.links), len(q)))
    for place, (link, index) in enumerate(zip(surface.links, surface.joint, strict=True)):
        if link.area:
            joint, twist = robot.joints[index - 1], twists[index]
            velocity = velocities[joint.first_v : joint.first_v + joint.nv]
            if weighing is not None:
                weighed = weighing(place, np.vstack((twist, velocity)))
                twist, velocity = weighed[:6], weighed[6:]
            speeds[place] = KINDS[kind](link, joint, twist, velocity)
    return speeds


# Each of these takes the surface of a link, its joint, its twist, shape (6, samples), and the
# velocity of its joint, shape (nv, samples), and returns a mean speed, shape (samples,).


def _paper(link: LinkSurface, joint: Joint, twist: Array, velocity: Array) -> Array:
    own = own_twist(joint, velocity)
    carried = twist - own
    return _length(carried[:3]) + _turning(link, carried) + _driven(link, own)


def _a(_link: LinkSurface, joint: Joint, twist: Array, velocity: Array) -> Array:
    return _length((twist - own_twist(joint, velocity))[:3])  # A = |v_O|, Sec. II-A


def _b(link: LinkSurface, joint: Joint, twist: Array, velocity: Array) -> Array:
    return _turning(link, twist - own_twist(joint, velocity))  # B = <|w_parent x r|>


def _c(link: LinkSurface, joint: Joint, _twist: Array, velocity: Array) -> Array:
    return _driven(link, own_twist(joint, velocity))


def _mean(link: LinkSurface, _joint: Joint, twist: Array, _velocity: Array) -> Array:
    weights, points = link.points.weights, link.points.points
    return np.concatenate(
        [
            weights @ point_speeds(points, twist[:, start : start + BLOCK])
            for start in range(0, twist.shape[1], BLOCK)
        ]
    )


def _rms(link: LinkSurface, _joint: Joint, twist: Array, _velocity: Array) -> Array:
    return _root(link.mean_square, twist)


def _normal(link: LinkSurface, _joint: Joint, twist: Array, _velocity: Array) -> Array:
    return _root(link.mean_square_normal, twist)


KINDS: Mapping[str, Callable[[LinkSurface, Joint, Array, Array], Array]] = MappingProxyType(
    {
        "paper": _paper,
        "A": _a,
        "B": _b,
        "C": _c,
        "mean": _mean,
        "rms": _rms,
        "normal": _normal,
    }
)
"""The kinds of mean speed, and how each is computed."""


def _driven(link: LinkSurface, own: Array) -> Array:
    """C = |v_rel| + <|w_rel x r|>; for a joint with one axis the latter is |qdot| G."""
    turning = _turning(link, own) if np.isnan(link.lever) else _length(own[3:]) * link.lever
    return _length(own[:3]) + turning


def _turning(link: LinkSurface, twist: Array) -> Array:
    return turning_speed(link.turning, link.rounding, twist[3:])


def _length(vectors: Array) -> Array:
    length: Array = np.sqrt(np.einsum("is,is->s", vectors, vectors))
    return length


def _root(form: Array, twist: Array) -> Array:
    squares = np.einsum("is,is->s", form @ twist, twist)
    root: Array = np.sqrt(np.maximum(squares, 0.0))  # rounding, where nothing moves outwards
    return root


def check_kind(kind: str) -> None:
    """Refuse an unknown kind.

    Raises:
        UnknownKindError: If it is none of ``KINDS``.
    """
    if kind not in KINDS:
        raise UnknownKindError(kind, tuple(KINDS))


def check_motion(robot: Robot, q: Real, v: Real, *, names: tuple[str, str] = ("q", "v")) -> None:
    """Refuse a motion that is not this robot's, or not finite.

    Raises:
        MotionError: If an array is of another shape, or holds nan or inf.
    """
    for name, array, width in zip(names, (q, v), (robot.nq, robot.nv), strict=True):
        if array.shape != (len(q), width):
            raise MotionError(f"{name} has shape {array.shape}, expected ({len(q)}, {width})")
        finite = np.isfinite(array)
        if not finite.all():
            row, column = np.argwhere(~finite)[0]
            raise MotionError(
                f"{name}: {array[row, column]} in row {row}, column {column}; cut gaps out"
            )
