"""Mean speed of a surface that turns about any axis through its origin, from a table."""

import numpy as np

from noisemodel.quadrature import Cloud, point_speeds
from noisemodel.types import Array

SIDE = 96
"""Cells along one side of the table; what lies between its nodes is right to about 3e-4."""

TINY = 1e-300
"""Keeps the direction of no rotation finite."""


def rounding(inertia: Array) -> Array:
    """Find the axes in which rotations of equal size have the same root-mean-square speed.

    In these axes a slender link is as round as a ball, so that one table fits all.

    Args:
        inertia: Mean-square speed of unit rotations, w' J w, shape (3, 3), in [m²].

    Returns:
        The matrix U with |U w|² = w' J w, shape (3, 3), in [m].
    """
    spread, axes = np.linalg.eigh(inertia)
    lengths = np.sqrt(np.maximum(spread, np.finfo(np.float64).eps * spread[2]))  # of a needle
    return np.asarray(lengths[:, None] * axes.T, dtype=np.float64)


def tabulate(cloud: Cloud, rounded: Array) -> Array:
    """Tabulate the ratio of the mean to the root-mean-square speed over all axes.

    Args:
        cloud: Points on the surface.
        rounded: The result of ``rounding``.

    Returns:
        The ratio in [0, 1] at direction (a, b, 1 - |a| - |b|), for a and b from -1 to 1,
        shape (97, 97); 0 where |a| + |b| is much above 1.
    """
    a, b = (
        grid.ravel() for grid in np.meshgrid(*2 * [np.linspace(-1, 1, SIDE + 1)], indexing="ij")
    )
    directions = np.stack((a, b, 1 - np.abs(a) - np.abs(b)))
    used = directions[2] > -4 / SIDE  # no lookup reaches further beyond z = 0
    directions = directions[:, used] / np.linalg.norm(directions[:, used], axis=0)
    turns = np.linalg.solve(rounded, directions)
    table = np.zeros((SIDE + 1) ** 2)
    table[used] = cloud.weights @ point_speeds(cloud.points, np.vstack((0.0 * turns, turns)))
    return table.reshape(SIDE + 1, SIDE + 1)


def turning_speed(table: Array, rounded: Array, angular: Array) -> Array:
    """Mean speed <|w x r|>, from the table.

    Args:
        table: The result of ``tabulate``, shape (97, 97).
        rounded: The result of ``rounding``, shape (3, 3), in [m].
        angular: Angular velocities, shape (3, samples), in [rad/s].

    Returns:
        Shape (samples,), in [m/s].
    """
    x, y, z = turned = rounded @ angular
    # A rotation and its reverse are as fast: all axes lie on half an octahedron, which laid flat
    # is the square |a| + |b| <= 1.
    scale = np.copysign(0.5 * SIDE, z) / np.maximum(np.abs(turned).sum(axis=0), TINY)
    a, b = x * scale + 0.5 * SIDE, y * scale + 0.5 * SIDE
    row, column = (np.minimum(place.astype(np.intp), SIDE - 1) for place in (a, b))
    a, b = a - row, b - column
    corner = row * (SIDE + 1) + column
    ratios = table.ravel()
    low = ratios.take(corner) * (1 - b) + ratios.take(corner + 1) * b
    high = ratios.take(corner + SIDE + 1) * (1 - b) + ratios.take(corner + SIDE + 2) * b
    ratio = low * (1 - a) + high * a
    speed: Array = np.sqrt(np.einsum("is,is->s", turned, turned)) * ratio
    return speed
