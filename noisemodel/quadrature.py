"""A thousand weighted points that approximate a surface where no exact integral is known."""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from noisemodel.moments import edge_points, faces
from noisemodel.types import Array

Rows: TypeAlias = NDArray[np.intp]

ALL: Rows = np.zeros(1, dtype=np.intp)
"""Where the only cell begins, if all points are in one."""

FINENESS = 2.0
"""Panels of the fine points go this many times into the surface's thickness."""

MOST = 1_000_000
"""Fine points of a surface; more are placed only where there are many triangles."""

SLENDEREST = 1e-3
"""Thinner than this share of its length, a surface counts as that thin."""

CORNERS = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=np.float64)
"""Of a tetrahedron: mean 0 and covariance 1 in all directions."""


@dataclass(frozen=True)
class Cloud:
    """Points that a mean over the surface is taken at.

    Attributes:
        points: Shape (points, 3), in [m].
        weights: Positive, sum 1, shape (points,).
    """

    points: Array
    weights: Array


def fine(triangles: Array) -> Cloud:
    """Place points so densely that means of speeds are right to 1e-4.

    Args:
        triangles: Corners, shape (triangles, 3, 3), in [m]; some have an area.

    Returns:
        Thousands of points; means of polynomials of degree 2 are exact.
    """
    triangles, areas, _ = faces(triangles)
    _, (covariance,) = _statistics(*edge_points(triangles, areas), ALL)
    spread = np.linalg.eigvalsh(covariance)
    # A slender link that spins about itself is resolved only by steps smaller than it is thick.
    thickness, length = np.sqrt(np.maximum([spread[:2].sum(), spread[2]], 0.0))
    step = max(thickness / FINENESS, SLENDEREST * length)
    step = min(step, 0.05 * np.sqrt(areas.sum()))  # enough points for any number of cells
    edges = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)
    sides = np.stack((edges.max(axis=1), edges.min(axis=1)), axis=1)
    while 4 * (panels := np.ceil(sides / step)).prod(axis=1).sum() > max(MOST, 8 * len(triangles)):
        step *= 2.0  # fans of a thousand slender triangles, such as no link has
    tip = edges.argmin(axis=1) + 2  # the corner opposite to the shortest edge
    order = (tip[:, None] + np.arange(3)) % 3
    triangles = np.take_along_axis(triangles, order[:, :, None], axis=1)
    small = (panels == 1).all(axis=1)
    points, weights = [], []
    for along, across in np.unique(panels[~small], axis=0).astype(int):
        alike = (panels == (along, across)).all(axis=1)
        own, share = _on_triangle(along, across)
        points.append(np.einsum("pc,tci->tpi", own, triangles[alike]).reshape(-1, 3))
        weights.append(np.outer(areas[alike], share).ravel())
    if small.any():
        own, share = edge_points(triangles[small], areas[small])
        points.append(own)
        weights.append(share * areas[small].sum())
    return Cloud(np.concatenate(points), np.concatenate(weights) / areas.sum())


def _on_triangle(along: int, across: int) -> tuple[Array, Array]:
    """Place points on lines through the first corner: two by two (Gauss) in each panel.

    Args:
        along: Panels from the first corner to the edge opposite to it.
        across: Panels along that edge.

    Returns:
        Shares of the three corners in each point, shape (points, 3), and weights of sum 1.
    """
    gauss = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
    far = ((np.arange(along)[:, None] + gauss) / along).ravel()[:, None]
    aside = ((np.arange(across)[:, None] + gauss) / across).ravel()
    shares = np.stack(np.broadcast_arrays(1.0 - far, far * (1.0 - aside), far * aside), axis=2)
    weights = np.broadcast_to(far, shares.shape[:2]).ravel()  # lines part with the distance
    return shares.reshape(-1, 3), weights / weights.sum()


def reduced(cloud: Cloud, *, halvings: int) -> Cloud:
    """Replace the points by few, cell by cell, and keep mean and covariance of each cell.

    So means of polynomials of degree 2 stay as they are, and weights stay positive: the mean
    speed over the new points, too, is at most their root mean square, which is exact.

    Args:
        cloud: Points, many times more than are wanted.
        halvings: How often every cell is cut in two.

    Returns:
        Up to 4 * 2**halvings points.
    """
    points, weights, starts = _cells(cloud, halvings)
    share = np.add.reduceat(weights, starts)
    center, covariance = _statistics(points, weights, starts)
    spread, axes = np.linalg.eigh(covariance)
    reach = axes * np.sqrt(np.maximum(spread, 0.0))[:, None, :]
    corners = center[:, None, :] + np.einsum("ck,nik->nci", CORNERS, reach)
    return Cloud(corners.reshape(-1, 3), np.repeat(share / len(CORNERS), len(CORNERS)))


def point_speeds(points: Array, twists: Array) -> Array:
    """Speed of points on a body that moves with a twist.

    Args:
        points: Shape (points, 3), in [m].
        twists: Linear, then angular velocity, shape (6, samples), in [m/s] and [rad/s].

    Returns:
        Shape (points, samples), in [m/s].
    """
    (x, y, z), (vx, vy, vz, wx, wy, wz) = points.T, twists
    # |v + w x r|² = |v|² + 2 r.(v x w) + |w|²|r|² - (w.r)²: one product of matrices for all
    shape = [np.ones_like(x), 2 * x, 2 * y, 2 * z, y * y + z * z, x * x + z * z, x * x + y * y]
    shape += [-2 * x * y, -2 * x * z, -2 * y * z]
    motion = [vx * vx + vy * vy + vz * vz, vy * wz - vz * wy, vz * wx - vx * wz, vx * wy - vy * wx]
    motion += [wx * wx, wy * wy, wz * wz, wx * wy, wx * wz, wy * wz]
    squares: Array = np.stack(shape, axis=1) @ np.stack(motion)
    np.maximum(squares, 0.0, out=squares)  # rounding, where the axis meets a point
    return np.sqrt(squares, out=squares)


def _cells(cloud: Cloud, halvings: int) -> tuple[Array, Array, Rows]:
    """Points sorted by cells, and where each cell begins.

    Cells are cut at their mean across their longest axis. The cloud is transformed to axes in
    which it is less slender: so a rod is cut around itself, too, and not only along.
    """
    points, weights = cloud.points @ _plumper(cloud), cloud.weights
    order, starts = np.arange(len(points)), np.zeros(1, dtype=np.intp)
    for _ in range(halvings):
        center, covariance = _statistics(points[order], weights[order], starts)
        cell = _cell(starts, len(points))
        longest = np.linalg.eigh(covariance)[1][:, :, 2]
        along = np.einsum("pi,pi->p", points[order] - center[cell], longest[cell])
        ahead = along > 0.0
        order = order[np.lexsort((ahead, cell))]
        sizes = np.diff(starts, append=len(points))
        behind = sizes - np.add.reduceat(ahead, starts, dtype=np.intp)
        starts = np.union1d(starts, (starts + behind)[(behind > 0) & (behind < sizes)])
    return cloud.points[order], weights[order], starts


def _plumper(cloud: Cloud) -> Array:
    """Find axes in which the cloud's lengths are to each other as their square roots are."""
    _, (covariance,) = _statistics(cloud.points, cloud.weights, ALL)
    spread, axes = np.linalg.eigh(covariance)
    plumper: Array = axes / np.maximum(spread, SLENDEREST**2 * spread[2]) ** 0.25
    return plumper


def _statistics(points: Array, weights: Array, starts: Rows) -> tuple[Array, Array]:
    """Mean, shape (cells, 3), and covariance, shape (cells, 3, 3), of the points in each cell."""
    share = np.add.reduceat(weights, starts)
    center = np.add.reduceat(points * weights[:, None], starts) / share[:, None]
    offset = points - center[_cell(starts, len(points))]
    products = offset[:, :, None] * (offset * weights[:, None])[:, None, :]
    return center, np.add.reduceat(products, starts) / share[:, None, None]


def _cell(starts: Rows, points: int) -> Rows:
    """Number the cell that each point lies in."""
    return np.repeat(np.arange(len(starts)), np.diff(starts, append=points))
