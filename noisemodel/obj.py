"""The triangles of an OBJ file: its points and faces, nothing else."""

import numpy as np

from noisemodel.polygons import fans
from noisemodel.types import Mesh


def read(data: bytes) -> Mesh:
    """Read all objects of a file; materials and what else it refers to are passed over.

    Args:
        data: The content of the file.

    Returns:
        Points, shape (points, 3), and triangles as indices of points, shape (triangles, 3).
        Polygons are cut into fans.

    Raises:
        ValueError: If a point or a face is no numbers, or a face names a point that is not there.
    """
    points: list[tuple[float, ...]] = []
    corners: list[int] = []
    counts: list[int] = []
    text = data.decode(errors="replace").replace("\\\r\n", " ").replace("\\\n", " ")
    for line in text.splitlines():
        word, *rest = line.partition("#")[0].split() or [""]
        if word == "v":
            if len(rest) < 3:
                raise ValueError(f"{line.strip()[:60]!r} is no point")
            points.append(tuple(map(float, rest[:3])))  # a weight or a colour may follow
        elif word == "f":
            named = [int(corner.partition("/")[0]) for corner in rest]
            # The first point is 1; -1 is the last one before this line.
            face = [number - 1 if number > 0 else len(points) + number for number in named]
            if 0 in named or min(face, default=0) < 0:
                raise ValueError(f"{line.strip()[:60]!r} names a point that is not there")
            corners += face
            counts.append(len(face))
    if max(corners, default=-1) >= len(points):
        raise ValueError(f"a face names point {max(corners) + 1} of {len(points)}")
    triangles = np.array(corners, dtype=np.int64)[fans(np.array(counts, dtype=np.int64))]
    return np.array(points, dtype=np.float64).reshape(-1, 3), triangles
