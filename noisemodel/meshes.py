"""The triangles of a mesh file: STL, OBJ or COLLADA.

trimesh reads STL and OBJ too, and the tests hold these readers to it, file by file. It is not used
here: it takes faces of an OBJ that count backwards for others, turns a mesh flat for one short
line, logs tracebacks over damaged files, and takes a second to import. pycollada drops all geometry
whose material is broken and keeps 7 digits; with Assimp, upward axes turn what RViz takes as it is
written.
"""

import hashlib
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TypeAlias
from xml.etree import ElementTree as ET

import numpy as np

from noisemodel.files import Arrays, beyond, cached, limit, parsed_xml
from noisemodel.types import Array, Indices, MeshError

# Points, shape (points, 3), and triangles as indices of points, shape (triangles, 3).
Mesh: TypeAlias = tuple[Array, Indices]
# Elements by the address that others call them: # and their id.
Named: TypeAlias = Mapping[str, ET.Element]
VERSION = 2  # of the code that reads triangles; to be raised with every change of its results
TRIANGLE_BYTES = 134  # most bytes of a file by triangle: more than a binary STL has, 256 MiB in all
TAIL = 1024  # bytes at the end of a file among which its closing word is
HEADER = 84  # bytes before the facets of a binary STL, the last four of them their number
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])

MAX_NODES = 10_000  # of a COLLADA scene, each instance counted: they may double with each level
WITHOUT_SURFACE = {"source", "vertices", "lines", "linestrips", "extra"}


def read(path: Path) -> Array:
    """Triangles of all parts of an STL, OBJ or COLLADA file, shape (triangles, 3 corners, 3).

    They are in the file's own numbers, of COLLADA in [m] by its unit; its upward axis is ignored.
    """
    data, kind = _content(path), path.suffix.lower()
    if kind == ".stl":  # as fast as what would be kept of it
        points, faces = _parsed(path, data)
        return points[faces]

    def arrays() -> Arrays:
        points, faces = _parsed(path, data)
        return {"points": points, "faces": faces.astype(np.int32)}

    kept = cached(f"mesh-{VERSION}-{kind[1:]}-{hashlib.sha256(data).hexdigest()}", arrays)
    return np.asarray(kept["points"][kept["faces"]])


def check_whole(path: Path) -> None:
    """Refuse a file of a known kind that is cut off, without reading all of it."""
    try:
        size = path.stat().st_size
        with path.open("rb") as stream:
            head = stream.read(HEADER)
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
    if kind == ".stl" and not _is_text(head, tail):
        count = _facets(head)
        if size < HEADER + FACET.itemsize * count or len(head) < HEADER:
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


def _parsed(path: Path, data: bytes) -> Mesh:
    try:
        points, faces = READERS[path.suffix.lower()](data)
    except (ValueError, LookupError, OverflowError, RecursionError) as error:
        # The words of the reader, or of NumPy where a number is expected.
        raise MeshError(path, f"cannot be read ({' '.join(str(error).split())})") from error
    if len(faces) > limit("triangles"):
        raise MeshError(path, f"has {len(faces)} triangles, {beyond('triangles')}; simplify it")
    if not len(faces):
        raise MeshError(path, "has no triangles")
    if not np.isfinite(points[faces]).all():
        raise MeshError(path, "has corners that are not finite (NaN or infinity)")
    return points, faces


def _fans(counts: Indices) -> Indices:
    """Triangles 0 1 2, 0 2 3, … of polygons in a row, by the number of each one's corners.

    This is exact for convex polygons, and what mesh files have in them is meant to be that.
    """
    first = np.cumsum(counts) - counts
    triangles = np.maximum(counts - 2, 0)
    polygon = np.repeat(np.arange(len(counts)), triangles)
    step = np.arange(len(polygon)) - (np.cumsum(triangles) - triangles)[polygon]
    corners: Indices = np.stack((np.zeros_like(step), step + 1, step + 2), axis=1)
    return corners + first[polygon, None]


def _stl(data: bytes) -> Mesh:
    """Read all solids of an STL; what follows a binary one is passed over."""
    if _is_text(data, data):
        rows = re.findall(rb"^[ \t]*vertex[ \t]+(.*)$", data, flags=re.MULTILINE | re.IGNORECASE)
        points = np.array([row.split() for row in rows], dtype=np.float64).reshape(-1, 3)
        if len(points) != 3 * data.lower().count(b"endfacet"):
            raise ValueError("a facet has not three corners")
    else:
        facets = np.frombuffer(data, FACET, _facets(data), offset=HEADER)
        points = facets["corners"].reshape(-1, 3).astype(np.float64)
    return points, np.arange(len(points)).reshape(-1, 3)


def _is_text(head: bytes, tail: bytes) -> bool:
    """Whether an STL is ASCII; some binary files begin with the same word."""
    starts = re.match(rb"\s*solid", head, re.IGNORECASE)
    return bool(starts and re.search(rb"endsolid", tail, re.IGNORECASE))


def _facets(head: bytes) -> int:
    return int.from_bytes(head[HEADER - 4 : HEADER], "little")


def _obj(data: bytes) -> Mesh:
    """Read all objects of an OBJ; materials and what else it refers to are passed over."""
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
    triangles = np.array(corners, dtype=np.int64)[_fans(np.array(counts, dtype=np.int64))]
    return np.array(points, dtype=np.float64).reshape(-1, 3), triangles


def _collada(data: bytes) -> Mesh:
    """Read the geometry of a COLLADA file where its scene puts it, but no skins and no holes.

    ``unit`` scales it to [m] and ``up_axis`` is ignored, as in RViz.
    """
    root = parsed_xml(data)
    unit = root.find("{*}asset/{*}unit")
    metres = 1.0 if unit is None else float(unit.get("meter", 1.0))
    named = {
        f"#{element.attrib['id']}": element for element in root.iter() if "id" in element.attrib
    }
    scene = _target(named, _child(root, "scene/{*}instance_visual_scene"))
    points, faces = [np.empty((0, 3))], [np.empty((0, 3), dtype=np.int64)]
    count = triangles = 0
    whole = np.diag([metres, metres, metres, 1.0])
    for placed, corners in _instances(named, scene, whole, iter(range(MAX_NODES))):
        points.append(placed)
        faces.append(corners + count)
        count += len(placed)
        triangles += len(corners)
        if max(triangles, count) > limit("triangles"):
            raise ValueError(f"it has too many triangles or points, {beyond('triangles')}")
    return np.concatenate(points), np.concatenate(faces)


def _instances(
    named: Named, node: ET.Element, placement: Array, left: Iterator[int]
) -> Iterator[Mesh]:
    """Walk down from a node, one of those that are left; what a node contains moves with it."""
    if next(left, None) is None:
        raise ValueError(f"it has more than {MAX_NODES} nodes with their instances")
    with np.errstate(over="ignore", invalid="ignore"):
        placement = placement @ _transform(node)
    for child in node:
        match _word(child):
            case "node":
                yield from _instances(named, child, placement, left)
            case "instance_node":
                yield from _instances(named, _target(named, child), placement, left)
            case "instance_geometry":
                for points, faces in _geometry(named, _target(named, child)):
                    with np.errstate(over="ignore", invalid="ignore"):  # refused when it is read
                        placed = points @ placement[:3, :3].T + placement[:3, 3]
                    yield placed, faces
            case "instance_controller":
                raise ValueError("it has a skin (<instance_controller>), which is not supported")


def _transform(node: ET.Element) -> Array:
    """Multiply a node's transformations, in the order of the file, shape (4, 4)."""
    whole = np.eye(4)
    for element in node:
        part = np.eye(4)
        match _word(element):
            case "matrix":
                part = _numbers(element).reshape(4, 4)
            case "translate":
                part[:3, 3] = _numbers(element)
            case "scale":
                part[:3, :3] = np.diag(_numbers(element))
            case "rotate":  # Rodrigues
                *axis, degrees = _numbers(element)
                angle, (x, y, z) = np.deg2rad(degrees), np.array(axis) / np.linalg.norm(axis)
                cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
                part[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
            case "lookat" | "skew" as word:
                raise ValueError(f"it has a <{word}>, which is not supported")
        with np.errstate(over="ignore", invalid="ignore"):
            whole = whole @ part
    return whole


def _geometry(named: Named, geometry: ET.Element) -> Iterator[Mesh]:
    points: dict[str, Array] = {}  # most parts of a mesh share them
    for part in geometry.findall("{*}mesh/*"):
        if _word(part) in WITHOUT_SURFACE:
            continue
        inputs = {entry.get("semantic"): entry for entry in part.findall("{*}input")}
        vertex = inputs.get("VERTEX")
        if vertex is None:
            raise ValueError(f"a <{_word(part)}> has no input VERTEX")
        stride = 1 + max(int(entry.get("offset", 0)) for entry in part.findall("{*}input"))
        faces = _faces(part, int(vertex.get("offset", 0)), stride)
        source = vertex.get("source", "")
        if source not in points:
            points[source] = _positions(named, _target(named, vertex, "source"))
        if faces.size and not 0 <= faces.min() <= faces.max() < len(points[source]):
            raise ValueError(f"a <{_word(part)}> names a point that is not there")
        yield points[source], faces


def _positions(named: Named, vertices: ET.Element) -> Array:
    for entry in vertices.findall("{*}input"):
        if entry.get("semantic") == "POSITION":
            source = _target(named, entry, "source")
            accessor = _child(source, "technique_common/{*}accessor")
            first, count = int(accessor.get("offset", 0)), int(accessor.get("count", 0))
            width = int(accessor.get("stride", 1))
            numbers = _numbers(_target(named, accessor, "source"))
            return numbers[first : first + width * count].reshape(count, width)[:, :3]
    raise ValueError("<vertices> have no input POSITION")


def _faces(part: ET.Element, offset: int, stride: int) -> Indices:
    """Cut the polygons of a part into triangles, shape (triangles, 3)."""
    if part.find("{*}ph") is not None:
        raise ValueError("it has polygons with holes (<ph>), which are not supported")
    runs = [_indices(run, stride)[:, offset] for run in part.findall("{*}p")]
    corners = np.concatenate([np.empty(0, dtype=np.int64), *runs])
    match _word(part):
        case "triangles":
            return corners.reshape(-1, 3)
        case "polylist":
            counts = _indices(_child(part, "vcount"), 1)[:, 0]
            if counts.min(initial=0) < 0 or counts.sum() != len(corners):
                raise ValueError(f"a <polylist> of {counts.sum()} corners has {len(corners)}")
            return corners[_fans(counts)]
        case "polygons" | "trifans":
            return corners[_fans(np.array([len(run) for run in runs], dtype=np.int64))]
        case "tristrips":
            strips = [np.stack((run[:-2], run[1:-1], run[2:]), axis=1) for run in runs]
            return np.concatenate([np.empty((0, 3), dtype=np.int64), *strips])
        case word:
            raise ValueError(f"it has <{word}>, which is not supported")


def _word(element: ET.Element) -> str:
    return str(element.tag).rpartition("}")[2]  # without the namespace


def _child(element: ET.Element, path: str) -> ET.Element:
    child = element.find(f"{{*}}{path}")
    if child is None:
        raise ValueError(f"<{_word(element)}> has no <{path.rpartition('}')[2]}>")
    return child


def _target(named: Named, element: ET.Element, attribute: str = "url") -> ET.Element:
    address = element.get(attribute, "")
    if address not in named:
        raise ValueError(f"<{_word(element)}> refers to {address!r}, which is not there")
    return named[address]


def _numbers(element: ET.Element) -> Array:
    return np.fromstring(element.text or "", dtype=np.float64, sep=" ")


def _indices(element: ET.Element, width: int) -> Indices:
    return np.fromstring(element.text or "", dtype=np.int64, sep=" ").reshape(-1, width)


READERS: Mapping[str, Callable[[bytes], Mesh]] = MappingProxyType(
    {".dae": _collada, ".obj": _obj, ".stl": _stl}
)
