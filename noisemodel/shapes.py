"""The triangles of the simple shapes that a URDF has.

A box is exact. What is round is drawn with flat triangles whose corners lie on it, and so comes out
too small: the side of a cylinder by 0.04 % of its area, its ends by 0.16 %, a sphere by 0.12 % and
the ends of a capsule by 0.20 % (0.01 dB; a test holds these).
"""

from functools import cache

import numpy as np

from noisemodel.types import Array

SECTIONS = 64
"""Flat sides of a cylinder or capsule."""

SUBDIVISIONS = 4
"""How often an icosahedron's triangles are cut in four to make a sphere: 5120 triangles."""


def box(x: float, y: float, z: float) -> Array:
    """Draw a box around the origin.

    Args:
        x: Length along the x axis, in [m].
        y: Length along the y axis, in [m].
        z: Length along the z axis, in [m].

    Returns:
        Its triangles, shape (12, 3 corners, 3), in [m].
    """
    sides = []
    for axis in np.eye(3):
        across, along = np.roll(axis, 1), np.roll(axis, 2)
        for end in (-axis, axis):
            a, b = end - across - along, end + across - along
            c, d = end + across + along, end - across + along
            sides += [(a, b, c), (a, c, d)]
    return np.array(sides) * (0.5 * np.array((x, y, z)))


def cylinder(radius: float, length: float) -> Array:
    """Draw a cylinder with its two ends, along the z axis, around the origin.

    Args:
        radius: In [m].
        length: In [m].

    Returns:
        Its triangles, shape (triangles, 3 corners, 3), in [m].
    """
    half = 0.5 * length
    return _turned(np.array([(0, -half), (radius, -half), (radius, half), (0, half)]))


def capsule(radius: float, length: float) -> Array:
    """Draw a cylinder with a half sphere on either end, along the z axis, around the origin.

    The half spheres are cut along their circles of longitude and latitude: so they meet the
    cylinder's corners, which those of an icosahedron would not.

    Args:
        radius: In [m].
        length: Of the cylinder alone, in [m].

    Returns:
        Its triangles, shape (triangles, 3 corners, 3), in [m].
    """
    latitude = np.linspace(0, np.pi / 2, SECTIONS // 4 + 1)
    rim, height = radius * np.cos(latitude), radius * np.sin(latitude) + 0.5 * length
    rim[-1] = 0.0
    upper = np.stack((rim, height), axis=1)
    return _turned(np.concatenate((upper[::-1] * (1, -1), upper)))


def sphere(radius: float) -> Array:
    """Draw a sphere around the origin.

    Args:
        radius: In [m].

    Returns:
        Its triangles, shape (5120, 3 corners, 3), in [m].
    """
    return radius * _unit_sphere()


def _turned(profile: Array) -> Array:
    """Turn a line of points (radius, height), from end to end, about the z axis."""
    angle = 2 * np.pi * np.arange(SECTIONS) / SECTIONS
    circle = np.stack((np.cos(angle), np.sin(angle), np.ones(SECTIONS)), axis=1)
    rings = profile[:, None, [0, 0, 1]] * circle
    ahead = np.roll(rings, -1, axis=1)
    lower = np.stack((rings[:-1], ahead[:-1], ahead[1:]), axis=2)[profile[:-1, 0] > 0]
    upper = np.stack((rings[:-1], ahead[1:], rings[1:]), axis=2)[profile[1:, 0] > 0]
    return np.concatenate((lower, upper)).reshape(-1, 3, 3)


@cache
def _unit_sphere() -> Array:
    golden = (1 + 5**0.5) / 2
    corners = np.array([(0, y, z) for y in (-1, 1) for z in (-golden, golden)])
    corners = np.concatenate([np.roll(corners, turn, axis=1) for turn in range(3)])
    distance = np.linalg.norm(corners[:, None] - corners, axis=2)
    near = np.isclose(distance, 2.0)  # the icosahedron's edges are of length 2
    triangles = np.array(
        [
            corners[[i, j, k]]
            for i in range(len(corners))
            for j in range(i)
            for k in range(j)
            if near[i, j] and near[j, k] and near[i, k]
        ]
    )
    for _ in range(SUBDIVISIONS):
        a, b, c = np.moveaxis(triangles, 1, 0)
        ab, bc, ca = (_on_sphere(p + q) for p, q in ((a, b), (b, c), (c, a)))
        a, b, c = map(_on_sphere, (a, b, c))
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        triangles = np.concatenate([np.stack(part, axis=1) for part in parts])
    triangles.flags.writeable = False
    return triangles


def _on_sphere(points: Array) -> Array:
    unit: Array = points / np.linalg.norm(points, axis=-1, keepdims=True)
    return unit
