"""The triangles of a mesh file: STL, OBJ or COLLADA.

trimesh reads STL and OBJ too, and the tests hold these readers to it, file by file. It is not used
here: it takes faces of an OBJ that count backwards for others, turns a mesh flat for one short
line, logs tracebacks over damaged files, and takes a second to import.
"""

import hashlib
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np

from noisemodel import collada, obj, stl
from noisemodel.bounds import beyond, limit
from noisemodel.cache import Arrays, cached
from noisemodel.errors import MeshError
from noisemodel.types import Array, Mesh

VERSION = 1
"""Version of the code that reads triangles; to be raised with every change of its results."""

TRIANGLE_BYTES = 134
"""Most bytes of a file by triangle that it may have: more than a binary STL has, 256 MiB in all."""

TAIL = 1024
"""Bytes at the end of a file among which its closing word is."""

READERS: Mapping[str, Callable[[bytes], Mesh]] = MappingProxyType(
    {".dae": collada.read, ".obj": obj.read, ".stl": stl.read}
)


def read(path: Path) -> Array:
    """Read a mesh, in the file's own numbers: its unit and its upward axis are ignored.

    Args:
        path: An STL (binary or ASCII), OBJ or COLLADA (DAE) file. All of its parts are read.

    Returns:
        Its triangles, shape (triangles, 3 corners, 3). Polygons are cut into fans.

    Raises:
        MeshError: If the file is of another kind, cut off or damaged, or has no triangles.
    """
    data = _content(path)
    if path.suffix.lower() == ".stl":  # as fast as what would be kept of it
        points, faces = _parsed(path, data)
        return points[faces]
    return _kept("mesh", path, data, lambda: _parsed(path, data))


def hull(path: Path) -> Array:
    """Wrap a mesh in its convex hull.

    Args:
        path: A file as in `read`.

    Returns:
        The triangles of the hull, shape (triangles, 3 corners, 3).

    Raises:
        MeshError: As in `read`, or if the mesh is flat.
    """
    return _kept("hull", path, _content(path), lambda: _wrapped(path, read(path)))


def check_whole(path: Path) -> None:
    """Refuse a file of a known kind that is cut off, without reading all of it.

    Raises:
        MeshError: If it is empty, cut off or not of the kind of its suffix, or cannot be read.
    """
    try:
        size = path.stat().st_size
        with path.open("rb") as stream:
            head = stream.read(stl.HEADER)
            stream.seek(max(0, size - TAIL))
            tail = stream.read()
    except OSError as error:
        raise MeshError(path, f"cannot be read ({error.strerror})") from error
    if not head.strip():
        raise MeshError(path, "is empty")
    kind = path.suffix.lower()
    if kind == ".obj" and b"\0" in head:
        raise MeshError(path, "is not text, as an OBJ is")
    if kind == ".dae" and b"</COLLADA>" not in tail:
        raise MeshError(path, "is cut off, </COLLADA> is missing")
    if kind == ".stl" and not stl.is_text(head, tail):
        count = stl.count(head)
        if size < stl.HEADER + stl.FACET.itemsize * count or len(head) < stl.HEADER:
            raise MeshError(path, f"is cut off, {count} triangles do not fit {size} bytes")


def _content(path: Path) -> bytes:
    if path.suffix.lower() not in READERS:
        known = ", ".join(READERS)
        raise MeshError(path, f"of kind {path.suffix!r}, expected {known}")
    check_whole(path)
    most = TRIANGLE_BYTES * limit("triangles")
    if (size := path.stat().st_size) > most:
        raise MeshError(
            path,
            f"has {size} bytes, {most} are read of {limit('triangles')} triangles,"
            f" {beyond('triangles')}; simplify it",
        )
    return path.read_bytes()


def _kept(what: str, path: Path, data: bytes, make: Callable[[], Mesh]) -> Array:
    content = hashlib.sha256(data).hexdigest()

    def arrays() -> Arrays:
        points, faces = make()
        return {"points": points, "faces": faces.astype(np.int32)}

    kept = cached(f"{what}-{VERSION}-{path.suffix.lower()[1:]}-{content}", arrays)
    triangles: Array = kept["points"][kept["faces"]]
    return triangles


def _parsed(path: Path, data: bytes) -> Mesh:
    try:
        points, faces = READERS[path.suffix.lower()](data)
    except (ValueError, LookupError, OverflowError, RecursionError) as error:
        # The readers' own words, or those of numpy on what is no number.
        raise MeshError(path, f"cannot be read ({' '.join(str(error).split())})") from error
    if len(faces) > limit("triangles"):
        raise MeshError(path, f"has {len(faces)} triangles, {beyond('triangles')}; simplify it")
    if not len(faces):
        raise MeshError(path, "has no triangles")
    if not np.isfinite(points[faces]).all():
        raise MeshError(path, "has corners that are not finite (NaN or infinity)")
    return points, faces


def _wrapped(path: Path, triangles: Array) -> Mesh:
    from scipy.spatial import ConvexHull, QhullError

    points = triangles.reshape(-1, 3)
    try:
        corners = ConvexHull(points).simplices
    except QhullError as error:
        raise MeshError(path, "is flat, it has no convex hull") from error
    used, faces = np.unique(corners, return_inverse=True)
    return points[used], faces.reshape(-1, 3)
