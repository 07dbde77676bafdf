"""Polygons cut into triangles."""

import numpy as np

from noisemodel.types import Indices


def fans(counts: Indices) -> Indices:
    """Cut polygons that lie one after the other into the fans of their first corners.

    This is exact for convex polygons, and what mesh files have in them is meant to be that.

    Args:
        counts: Number of each polygon's corners, shape (polygons,). Below 3 there is no triangle.

    Returns:
        The triangles 0 1 2, 0 2 3, … of every polygon, as indices of the corners of all polygons
        in a row, shape (triangles, 3).
    """
    first = np.cumsum(counts) - counts
    triangles = np.maximum(counts - 2, 0)
    polygon = np.repeat(np.arange(len(counts)), triangles)
    step = np.arange(len(polygon)) - (np.cumsum(triangles) - triangles)[polygon]
    corners: Indices = np.stack((np.zeros_like(step), step + 1, step + 2), axis=1)
    return corners + first[polygon, None]
