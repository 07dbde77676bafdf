"""Integrals over a link's surface that are exact: area, centroid, and two quadratic forms."""

from dataclasses import dataclass

import numpy as np

from noisemodel.types import Array


@dataclass(frozen=True)
class Moments:
    """What is exact about a surface; all is 0 where there is none.

    Attributes:
        area: In [m²].
        centroid: Mean position, shape (3,), in [m].
        mean_square: The mean-square speed of the surface under a twist nu is nu' M nu,
            shape (6, 6), in [1], [m] and [m²].
        mean_square_normal: The same for the speed normal to the surface.
    """

    area: float
    centroid: Array
    mean_square: Array
    mean_square_normal: Array


def moments(triangles: Array) -> Moments:
    """Integrate over triangles.

    Args:
        triangles: Corners, shape (triangles, 3, 3), in [m].

    Returns:
        Area, centroid and both quadratic forms.
    """
    triangles, areas, normals = faces(triangles)
    area = float(areas.sum())
    if area == 0.0:
        return Moments(0.0, np.zeros(3), np.zeros((6, 6)), np.zeros((6, 6)))
    points, weights = edge_points(triangles, areas)
    centroid = weights @ points
    second = (points * weights[:, None]).T @ points
    crossed = cross_matrix(centroid)
    inertia = np.trace(second) * np.eye(3) - second
    # <|v + w x r|²> = |v|² + 2 v.(w x <r>) + w.(tr<rr'> - <rr'>) w
    mean_square = np.block([[np.eye(3), -crossed], [crossed, inertia]])
    normals = np.repeat(normals, 3, axis=0)
    pull = np.hstack((normals, np.cross(points, normals)))  # n.(v + w x r) = pull.(v, w)
    return Moments(area, centroid, mean_square, (pull * weights[:, None]).T @ pull)


def faces(triangles: Array) -> tuple[Array, Array, Array]:
    """Leave out triangles without area; add areas, in [m²], and unit normals, shape (n, 3)."""
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    double = np.linalg.norm(across, axis=1)
    real = double > 0.0
    return triangles[real], 0.5 * double[real], across[real] / double[real, None]


def edge_points(triangles: Array, areas: Array) -> tuple[Array, Array]:
    """Take the middles of the edges, which integrate polynomials of degree 2 exactly.

    Returns:
        Points, shape (3 triangles, 3), in [m], and weights that sum to 1.
    """
    middles = 0.5 * (triangles + np.roll(triangles, -1, axis=1))
    return middles.reshape(-1, 3), np.repeat(areas / (3.0 * areas.sum()), 3)


def cross_matrix(vector: Array) -> Array:
    """Write the cross product with a vector as a matrix, shape (3, 3)."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
