"""The triangles of a COLLADA file (DAE): its geometry and where its scene puts it, nothing else.

pycollada, the kept reader, drops all geometry whose material is broken and keeps 7 digits; with
Assimp, units and upward axes turn and scale what URDF readers take as it is written.
"""

from collections.abc import Iterator, Mapping
from typing import TypeAlias
from xml.etree import ElementTree as ET

import numpy as np

from noisemodel import xmltext
from noisemodel.bounds import beyond, limit
from noisemodel.polygons import fans
from noisemodel.types import Array, Indices, Mesh

Named: TypeAlias = Mapping[str, ET.Element]
"""Elements by the address that others call them: # and their id."""

MAX_NODES = 10_000
"""Nodes that a scene may have, instances of instances counted each: they double with each level."""

WITHOUT_SURFACE = {"source", "vertices", "lines", "linestrips", "extra"}


def read(data: bytes) -> Mesh:
    """Read all geometry of a file's scene.

    Args:
        data: The content of the file.

    Returns:
        Points, shape (points, 3), and triangles as indices of points, shape (triangles, 3), in
        the file's own numbers: ``unit`` and ``up_axis`` are ignored, as URDF readers do.

    Raises:
        ValueError: If the content is no whole COLLADA file, or has a kind of geometry that is not
            supported (skins, polygons with holes), or instances of more nodes or triangles than
            are read.
        RecursionError: If its nodes contain themselves.
    """
    root = xmltext.parsed(data)
    named = {
        f"#{element.attrib['id']}": element for element in root.iter() if "id" in element.attrib
    }
    scene = _target(named, _child(root, "scene/{*}instance_visual_scene"))
    points, faces = [np.empty((0, 3))], [np.empty((0, 3), dtype=np.int64)]
    count = 0
    triangles = 0
    for placed, corners in _instances(named, scene, np.eye(4), iter(range(MAX_NODES))):
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
            case "rotate":
                *axis, degrees = _numbers(element)
                part[:3, :3] = _rotation(np.array(axis), np.deg2rad(degrees))
            case "lookat" | "skew" as word:
                raise ValueError(f"it has a <{word}>, which is not supported")
        with np.errstate(over="ignore", invalid="ignore"):
            whole = whole @ part
    return whole


def _rotation(axis: Array, angle: float) -> Array:
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turn: Array = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return turn  # Rodrigues


def _geometry(named: Named, geometry: ET.Element) -> Iterator[Mesh]:
    points: dict[str, Array] = {}  # most parts of a mesh share them
    for part in geometry.findall("{*}mesh/*"):
        if _word(part) in WITHOUT_SURFACE:
            continue
        inputs = {entry.get("semantic"): entry for entry in part.findall("{*}input")}
        vertex = inputs.get("VERTEX")
        if vertex is None:
            raise ValueError(f"a <{_word(part)}> has no input VERTEX")
        stride = 1 + max(_integer(entry, "offset", 0) for entry in part.findall("{*}input"))
        faces = _faces(part, _integer(vertex, "offset", 0), stride)
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
            first, count, width = (
                _integer(accessor, name, default)
                for name, default in (("offset", 0), ("count", 0), ("stride", 1))
            )
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
            return corners[fans(counts)]
        case "polygons" | "trifans":
            return corners[fans(np.array([len(run) for run in runs], dtype=np.int64))]
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


def _integer(element: ET.Element, name: str, default: int) -> int:
    return int(element.get(name, default))


def _numbers(element: ET.Element) -> Array:
    return np.fromstring(element.text or "", dtype=np.float64, sep=" ")


def _indices(element: ET.Element, width: int) -> Indices:
    return np.fromstring(element.text or "", dtype=np.int64, sep=" ").reshape(-1, width)
