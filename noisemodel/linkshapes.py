"""Visual and collision geometry of a URDF's links: shapes and meshes, each with its pose."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from xml.etree import ElementTree as ET  # urdf.read has refused DOCTYPE

import numpy as np

from noisemodel import shapes
from noisemodel.errors import GeometryError
from noisemodel.types import Array


@dataclass(frozen=True, eq=False)
class LinkShape:
    """A piece of geometry of a link.

    Attributes:
        link: The link's name.
        matrix: From the geometry's numbers to the link's axes: its scale, then its rotation,
            shape (3, 3).
        translation: The geometry's origin in the link's axes, shape (3,), in [m].
        body: The address of a mesh, or the triangles of a simple shape, shape (triangles,
            3 corners, 3), in [m].
        colour: Red, green, blue and opacity, from 0 to 1; empty unless it was read.
    """

    link: str
    matrix: Array
    translation: Array
    body: str | Array
    colour: tuple[float, ...] = ()


@dataclass(frozen=True)
class _Solid:
    """How a simple shape is written, and what draws it."""

    numbers: tuple[str, ...]
    count: int
    draw: Callable[..., Array]


SOLIDS: Mapping[str, _Solid] = MappingProxyType(
    {
        "box": _Solid(("size",), 3, shapes.box),
        "capsule": _Solid(("radius", "length"), 2, shapes.capsule),
        "cylinder": _Solid(("radius", "length"), 2, shapes.cylinder),
        "sphere": _Solid(("radius",), 1, shapes.sphere),
    }
)


def read(urdf: Path, use: str) -> list[LinkShape]:
    """Read the geometry of all links.

    Args:
        urdf: A URDF that `noisemodel.urdf.read` has checked.
        use: "visual" or "collision".

    Returns:
        All pieces, in the order of the file.

    Raises:
        GeometryError: If a shape is unknown, or a size or a scale is no number that can be.
    """
    root = ET.parse(urdf).getroot()  # noqa: S314
    return [
        _shape(f"{urdf}: {use} of link {link.get('name')!r}", link.get("name", ""), element)
        for link in root.findall("link")
        for element in link.findall(use)
    ]


def _shape(where: str, link: str, element: ET.Element) -> LinkShape:
    origin = element.find("origin")
    attributes = {} if origin is None else origin.attrib
    roll, pitch, yaw = map(float, attributes.get("rpy", "0 0 0").split())
    rotation = _about(2, yaw) @ _about(1, pitch) @ _about(0, roll)
    translation = np.array(attributes.get("xyz", "0 0 0").split(), dtype=np.float64)
    scale, body = _body(where, element.find("geometry"))
    return LinkShape(link, rotation * scale, translation, body)


def _body(where: str, geometry: ET.Element | None) -> tuple[list[float], str | Array]:
    known = ", ".join([*SOLIDS, "mesh"])
    if geometry is None or not len(geometry):
        raise GeometryError(f"{where}: has no geometry, expected one of {known}")
    element = geometry[0]
    if element.tag == "mesh":
        scale = _numbers(where, element, ("scale",), 3, default="1 1 1")
        if 0 in scale:
            raise GeometryError(f"{where}: scale {element.get('scale')!r} flattens the mesh")
        return scale, element.get("filename", "")
    if element.tag not in SOLIDS:
        raise GeometryError(f"{where}: <{element.tag}> is not known, expected one of {known}")
    solid = SOLIDS[element.tag]
    sizes = _numbers(where, element, solid.numbers, solid.count)
    if min(sizes) <= 0:
        raise GeometryError(f"{where}: <{element.tag}> of size {sizes} m, expected more than 0")
    return [1.0, 1.0, 1.0], solid.draw(*sizes)


def _numbers(
    where: str, element: ET.Element, names: Sequence[str], count: int, default: str = ""
) -> list[float]:
    text = " ".join(element.get(name, default) for name in names)
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise GeometryError(
            f"{where}: {' and '.join(names)} of <{element.tag}> is {text!r},"
            f" expected {count} finite number{'s' if count > 1 else ''}"
        )
    return numbers


def _about(axis: int, angle: float) -> Array:
    """Rotate about a coordinate axis, shape (3, 3)."""
    rotation = np.eye(3)
    left, right = (axis + 1) % 3, (axis + 2) % 3
    rotation[left, left] = rotation[right, right] = math.cos(angle)
    rotation[right, left] = math.sin(angle)
    rotation[left, right] = -math.sin(angle)
    return rotation
