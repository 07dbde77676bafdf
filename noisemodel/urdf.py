"""URDF: its checks, its shapes and where its meshes lie.

The checks come before Pinocchio reads a URDF, which crashes on some and accepts wrong ones. A box
is exact. What is round is drawn with flat triangles whose corners lie on it, and so comes out too
small: the side of a cylinder by 0.04 % of its area, its ends by 0.16 %, a sphere by 0.12 % and
the ends of a capsule by 0.20 % (0.01 dB; a test holds these).
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType
from xml.etree import ElementTree as ET

import numpy as np

from noisemodel.files import beyond, limit, read_xml
from noisemodel.types import Array, GeometryError, MeshError, RobotError

NUMBERS = {"xyz": 3, "rpy": 3, "ixx": 1, "iyy": 1, "izz": 1, "ixy": 1, "ixz": 1, "iyz": 1}

AXIAL = {"revolute", "continuous", "prismatic", "planar"}  # types whose axis may not be 0
SECTIONS = 64  # flat sides of a cylinder or capsule
SUBDIVISIONS = 4  # how often an icosahedron's triangles are cut in four to make a sphere
IN_PACKAGES = ("package", "model")  # schemes of addresses that begin with a package's name
HINT = "--package-root (`package_root=`) names a folder of meshes elsewhere"


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another one: position = multiplier * the other's + offset."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True, eq=False)
class LinkShape:
    """A piece of geometry of a link."""

    link: str  # name
    matrix: Array  # from its numbers to the link's axes: scale, then rotation, shape (3, 3)
    translation: Array  # its origin in the link's axes, shape (3,), in [m]
    body: str | Array  # address of a mesh, or triangles, (triangles, 3 corners, 3), in [m]


def checked(path: Path) -> ET.Element:
    """Root of a URDF that Pinocchio can be given."""
    root = read_xml(path, "URDF")
    if root.tag != "robot":
        raise RobotError(f"{path}: not a URDF, its root is <{root.tag}>, expected <robot>")
    if not root.get("name") or root.find("link") is None:
        what = "its <robot> has no name or no link"
        raise RobotError(f"{path}: the URDF is empty or unexpanded, {what}")
    joints = root.findall("joint")
    if len(joints) > limit("joints"):
        raise RobotError(f"{path}: {len(joints)} joints; {beyond('joints')}")
    _check_numbers(path, root)
    _check_tree(path, joints)
    mimics(path, root)
    return root


def mimics(path: Path, root: ET.Element) -> dict[str, Mimic]:
    """Joints of a URDF that follow another one, by name; a RobotError if one follows itself."""
    found = {}
    for joint in root.findall("joint"):
        if (mimic := joint.find("mimic")) is not None:
            (multiplier,) = _numbers(path, mimic, ("multiplier",), 1, default="1")
            (offset,) = _numbers(path, mimic, ("offset",), 1, default="0")
            found[joint.get("name", "")] = Mimic(mimic.get("joint", ""), multiplier, offset)
    for name in found:
        leader = name
        for _ in found:
            leader = found[leader].joint if leader in found else ""
            if leader == name:
                raise RobotError(f"{path}: joint {name!r} mimics itself")
    return found


def _check_numbers(path: Path, root: ET.Element) -> None:
    for element in root.iter():
        if re.match(r"\{[^}]*xacro\}(?!property)", element.tag):
            word = element.tag.rpartition("}")[2]
            raise RobotError(f"{path}: <xacro:{word}> is not expanded; run xacro first")
        counts = {name: count for name, count in NUMBERS.items() if name in element.attrib}
        if element.tag == "mass":
            counts["value"] = 1
        for name, count in counts.items():
            _numbers(path, element, (name,), count)
    for joint in root.findall("joint"):
        axis = joint.find("axis")
        if axis is None or joint.get("type") not in AXIAL:
            continue
        if not any(_numbers(path, axis, ("xyz",), 3, default="0 0 0")):
            raise RobotError(f"{path}: the axis of joint {joint.get('name')!r} has length 0")


def _check_tree(path: Path, joints: list[ET.Element]) -> None:
    """Refuse joints that go round in a circle, which Pinocchio leaves out."""
    parents = {}
    for joint in joints:
        parent, child = joint.find("parent"), joint.find("child")
        if parent is not None and child is not None:
            parents[child.get("link")] = parent.get("link")
    done = set[str | None]()
    for link in parents:
        chain = set[str | None]()
        while link in parents and link not in done:
            if link in chain:
                raise RobotError(f"{path}: the joints of link {link!r} go round in a circle")
            chain.add(link)
            link = parents[link]
        done |= chain


def _numbers(
    where: str | Path,
    element: ET.Element,
    names: Sequence[str],
    count: int,
    *,
    default: str = "",
    error: type[RobotError | GeometryError] = RobotError,
) -> list[float]:
    """So many finite numbers that attributes of an element hold together."""
    text = " ".join(element.get(name, default) for name in names)
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise error(
            f"{where}: {' and '.join(names)} of <{element.tag}> is {text!r},"
            f" expected {count} finite number{'s' if count > 1 else ''}"
        )
    return numbers


def shapes_in(urdf: Path, use: str) -> list[LinkShape]:
    """The geometry of all links of a URDF that was checked, for "visual" or "collision"."""
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
        scale = _numbers(where, element, ("scale",), 3, default="1 1 1", error=GeometryError)
        if 0 in scale:
            raise GeometryError(f"{where}: scale {element.get('scale')!r} flattens the mesh")
        return scale, element.get("filename", "")
    if element.tag not in SOLIDS:
        raise GeometryError(f"{where}: <{element.tag}> is not known, expected one of {known}")
    names, count, draw = SOLIDS[element.tag]
    sizes = _numbers(where, element, names, count, error=GeometryError)
    if min(sizes) <= 0:
        raise GeometryError(f"{where}: <{element.tag}> of size {sizes} m, expected more than 0")
    return [1.0, 1.0, 1.0], draw(*sizes)


def _about(axis: int, angle: float) -> Array:
    """Rotate about a coordinate axis, shape (3, 3)."""
    rotation = np.eye(3)
    left, right = (axis + 1) % 3, (axis + 2) % 3
    rotation[left, left] = rotation[right, right] = math.cos(angle)
    rotation[right, left] = math.sin(angle)
    rotation[left, right] = -math.sin(angle)
    return rotation


# The triangles of simple shapes, shape (triangles, 3 corners, 3), in [m], around the origin.


def box(x: float, y: float, z: float) -> Array:
    """Draw a box of these lengths."""
    sides = []
    for axis in np.eye(3):
        across, along = np.roll(axis, 1), np.roll(axis, 2)
        for end in (-axis, axis):
            a, b = end - across - along, end + across - along
            c, d = end + across + along, end - across + along
            sides += [(a, b, c), (a, c, d)]
    return np.array(sides) * (0.5 * np.array((x, y, z)))


def cylinder(radius: float, length: float) -> Array:
    """Draw a cylinder with its two ends, along the z axis."""
    half = 0.5 * length
    return _turned(np.array([(0, -half), (radius, -half), (radius, half), (0, half)]))


def capsule(radius: float, length: float) -> Array:
    """Draw a cylinder of this length with a half sphere on either end, along the z axis.

    The half spheres are cut along their circles of longitude and latitude: so they meet the
    cylinder's corners, which an icosahedron would not.
    """
    latitude = np.linspace(0, np.pi / 2, SECTIONS // 4 + 1)
    rim, height = radius * np.cos(latitude), radius * np.sin(latitude) + 0.5 * length
    rim[-1] = 0.0
    upper = np.stack((rim, height), axis=1)
    return _turned(np.concatenate((upper[::-1] * (1, -1), upper)))


def sphere(radius: float) -> Array:
    """Draw a sphere with 5120 triangles."""
    return radius * _unit_sphere()


def _turned(profile: Array) -> Array:
    """Turn a line of points (radius, height), from end to end, about the z axis."""
    angle = 2 * np.pi * np.arange(SECTIONS) / SECTIONS
    circle = np.stack((np.cos(angle), np.sin(angle), np.ones(SECTIONS)), axis=1)
    rings = profile[:, None, [0, 0, 1]] * circle
    ahead = np.roll(rings, -1, axis=1)
    lower = np.stack((rings[:-1], ahead[:-1], ahead[1:]), axis=2)[profile[:-1, 0] > 0]
    upper = np.stack((rings[:-1], ahead[1:], rings[1:]), axis=2)[profile[1:, 0] > 0]
    return np.concatenate((lower, upper)).reshape(-1, 3, 3)


@cache
def _unit_sphere() -> Array:
    golden = (1 + 5**0.5) / 2
    corners = np.array([(0, y, z) for y in (-1, 1) for z in (-golden, golden)])
    corners = np.concatenate([np.roll(corners, turn, axis=1) for turn in range(3)])
    distance = np.linalg.norm(corners[:, None] - corners, axis=2)
    near = np.isclose(distance, 2.0)  # the icosahedron's edges are of length 2
    triangles = np.array(
        [
            corners[[i, j, k]]
            for i in range(len(corners))
            for j in range(i)
            for k in range(j)
            if near[i, j] and near[j, k] and near[i, k]
        ]
    )
    for _ in range(SUBDIVISIONS):
        a, b, c = np.moveaxis(triangles, 1, 0)
        ab, bc, ca = (_on_sphere(p + q) for p, q in ((a, b), (b, c), (c, a)))
        a, b, c = map(_on_sphere, (a, b, c))
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        triangles = np.concatenate([np.stack(part, axis=1) for part in parts])
    triangles.flags.writeable = False
    return triangles


def _on_sphere(points: Array) -> Array:
    return np.asarray(points / np.linalg.norm(points, axis=-1, keepdims=True))


# The simple shapes: the attributes with their sizes, how many these are, and what draws them.
SOLIDS: Mapping[str, tuple[tuple[str, ...], int, Callable[..., Array]]] = MappingProxyType(
    {
        "box": (("size",), 3, box),
        "capsule": (("radius", "length"), 2, capsule),
        "cylinder": (("radius", "length"), 2, cylinder),
        "sphere": (("radius",), 1, sphere),
    }
)


# Where the mesh is that a URDF names: inside of the robot's own folders, or nowhere.


def find_mesh(address: str, urdf: Path, roots: Sequence[Path]) -> Path:
    """Find the file of a mesh, with links resolved.

    Its address is ``package://`` (two slashes or three) or Gazebo's ``model://``, ``file://``, or a
    path relative to the URDF. ``roots`` are packages, or folders of packages, which meshes lie in.
    """
    if not address:
        raise MeshError("''", f"{urdf.name} names a mesh without a file")
    scheme, _, rest = address.rpartition("://")
    if scheme not in ("", "file", *IN_PACKAGES) or "$(" in address:
        raise MeshError(
            address, "expected a path, file://, package:// or model://; xacro replaces $(…)"
        )
    places = [urdf.parent / rest] if scheme in ("", "file") else []
    try:
        for root in roots if scheme in IN_PACKAGES else ():
            places.append(root / rest.lstrip("/"))
            package, _, inside = rest.lstrip("/").partition("/")
            if root.name == package or (root / "package.xml").is_file():
                places.append(root / inside)
        found = [path.resolve() for path in places if path.is_file()]
    except OSError as error:  # no permission, or a name too long for a file
        raise MeshError(address, f"cannot be looked up ({error.strerror})") from error
    listed = ", ".join(map(str, roots)) or "any folder: a home has no meshes"
    if not found:
        raise MeshError(address, f"not found in {listed}; {HINT}")
    # Resolving takes longer than all else here, and most folders are no links.
    for path in found:
        if any(path.is_relative_to(root) for root in roots) or any(
            path.is_relative_to(root.resolve()) for root in roots
        ):
            return path
    raise MeshError(address, f"lies outside of {listed}; {HINT}")
