"""The triangles of an STL file, binary or ASCII."""

import re

import numpy as np

from noisemodel.types import Mesh

HEADER = 84
"""Bytes before the facets of a binary file, the last four of them their number."""

FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read(data: bytes) -> Mesh:
    """Read all solids of a file.

    Args:
        data: The content of a file that is whole; what follows a binary one is passed over.

    Returns:
        Points, shape (points, 3), and triangles as indices of points, shape (triangles, 3).

    Raises:
        ValueError: If a facet has not three corners of three numbers each.
    """
    if is_text(data):
        rows = re.findall(rb"^[ \t]*vertex[ \t]+(.*)$", data, flags=re.MULTILINE | re.IGNORECASE)
        points = np.array([row.split() for row in rows], dtype=np.float64).reshape(-1, 3)
        if len(points) != 3 * data.lower().count(b"endfacet"):
            raise ValueError("a facet has not three corners")
    else:
        facets = np.frombuffer(data, FACET, count(data), offset=HEADER)
        points = facets["corners"].reshape(-1, 3).astype(np.float64)
    return points, np.arange(len(points)).reshape(-1, 3)


def is_text(head: bytes, tail: bytes | None = None) -> bool:
    """Whether a file is ASCII; some binary files begin with the same word.

    Args:
        head: The file, or its beginning.
        tail: Its end, unless ``head`` is all of it.
    """
    return head.startswith(b"solid") and b"endsolid" in (head if tail is None else tail)


def count(head: bytes) -> int:
    """Number of facets by the header of a binary file."""
    return int.from_bytes(head[HEADER - 4 : HEADER], "little")
