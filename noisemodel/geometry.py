"""The surface of every link of a robot, as triangles."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Literal, get_args

import numpy as np

from noisemodel import linkshapes, meshfile, meshpath
from noisemodel.errors import GeometryError, MeshError, MissingMeshError
from noisemodel.linkshapes import LinkShape
from noisemodel.robot import Robot
from noisemodel.types import Array, Indices

Missing = Literal["error", "skip"]

GEOMETRIES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "visual": ("visual",),
        "collision": ("collision",),
        "hull": ("visual",),
        "auto": ("visual", "collision"),
    }
)
"""The geometries, and the shapes of the URDF or MJCF that each takes: the first that a link has."""


@dataclass(frozen=True, eq=False)
class LinkTriangles:
    """The surface of every link that moves; a link is all geometry that moves with one joint.

    What is fixed to the world is left out.

    Attributes:
        joint: Index of the link's joint in Pinocchio, which is 1 to the last, shape (links,).
        names: Name of each joint's child link.
        triangles: The link's triangles in the joint's axes, for each link of shape
            (triangles, 3 corners, 3), in [m]. Which side of a triangle is outside is not known.
        kind: What each link was taken from: "visual", "collision", "hull" or "none".
        missing: Addresses of the meshes that were not found and are left out.
    """

    joint: Indices
    names: tuple[str, ...]
    triangles: tuple[Array, ...]
    kind: tuple[str, ...]
    missing: tuple[str, ...]

    @property
    def without_geometry(self) -> tuple[str, ...]:
        """Names of the links without geometry."""
        return tuple(
            name for name, kind in zip(self.names, self.kind, strict=True) if kind == "none"
        )

    def __str__(self) -> str:
        count = sum(map(len, self.triangles))
        lines = [f"{count} triangles on {len(self.names)} links"]
        if self.without_geometry:
            lines.append(f"without geometry: {', '.join(self.without_geometry)}")
        if self.missing:
            lines.append(f"not found: {', '.join(self.missing)}")
        return "\n".join(lines)


def triangles(
    robot: Robot, geometry: str = "visual", *, missing: Missing = "error"
) -> LinkTriangles:
    """Draw all links of a robot with triangles.

    Args:
        robot: The robot.
        geometry: "visual" or "collision", as the URDF or MJCF has them; "hull", the convex hull of
            every visual by itself; or "auto", the visual or, of a link that has none, the
            collision.
        missing: What to do about a mesh that is not there: "error", or "skip" it with a warning.

    Returns:
        The triangles of every link that moves.

    Raises:
        GeometryError: If there is no such geometry, or a shape of the URDF is wrong.
        MeshError: If a mesh cannot be found or read, or has no surface.
    """
    for name, word, known in (
        ("geometry", geometry, tuple(GEOMETRIES)),
        ("missing", missing, get_args(Missing)),
    ):
        if word not in known:
            raise GeometryError(f"{name} {word!r} is not known, expected one of {', '.join(known)}")
    places, names = _links(robot)
    mesh = _reader(robot, hull=geometry == "hull")
    surfaces = [np.empty((0, 3, 3))] * len(names)
    kinds = ["none"] * len(names)
    absent: list[str] = []
    for use in GEOMETRIES[geometry]:
        if "none" not in kinds:
            break
        pieces: dict[int, list[Array]] = defaultdict(list)
        for shape in shapes_of(robot, use):
            joint, rotation, translation = places[shape.link]
            if joint == 0 or kinds[joint - 1] != "none":
                continue
            try:
                surface = _placed(shape, mesh, rotation, translation)
            except MissingMeshError as error:
                if missing == "error":
                    raise
                absent.append(error.mesh)
            else:
                pieces[joint].append(surface)
        for joint, parts in pieces.items():
            surfaces[joint - 1] = np.concatenate(parts)
            kinds[joint - 1] = "hull" if geometry == "hull" else use
    return LinkTriangles(
        joint=np.arange(1, len(names) + 1),
        names=names,
        triangles=tuple(surfaces),
        kind=tuple(kinds),
        missing=tuple(dict.fromkeys(absent)),
    )


def shapes_of(robot: Robot, use: str) -> Sequence[LinkShape]:
    """The geometry of all links of a robot, as its URDF or MJCF has it.

    Args:
        robot: The robot.
        use: "visual" or "collision".

    Raises:
        GeometryError: If a shape of the URDF is wrong.
    """
    if robot.mjcf is None:
        return linkshapes.read(robot.path, use)
    return robot.mjcf.visual if use == "visual" else robot.mjcf.collision


def link_names(robot: Robot) -> tuple[str, ...]:
    """The child link of each joint, in the joints' order."""
    return _links(robot)[1]


def pieces(robot: Robot) -> Iterator[tuple[int, LinkShape, Array]]:
    """Draw a robot piece by piece, what is fixed to the world included.

    Of a link without visual geometry the collision geometry is drawn.

    Yields:
        Index of the joint that moves a piece in Pinocchio, 0 if none does; the piece as the file
        has it; and its triangles in the joint's axes, shape (triangles, 3 corners, 3), in [m].

    Raises:
        GeometryError: As `triangles`.
    """
    places, _ = _links(robot)
    mesh = _reader(robot, hull=False)
    drawn: set[int] = set()
    for use in GEOMETRIES["auto"]:
        parts = [(*places[shape.link], shape) for shape in shapes_of(robot, use)]
        parts = [part for part in parts if part[0] not in drawn]
        for joint, rotation, translation, shape in parts:
            yield joint, shape, _placed(shape, mesh, rotation, translation)
        drawn |= {part[0] for part in parts}


def _reader(robot: Robot, *, hull: bool) -> Callable[[str], Array]:
    """Reads meshes by their addresses, each once: left and right often share one."""
    read = meshfile.hull if hull else meshfile.read
    return cache(lambda address: read(meshpath.find(address, robot.path, robot.package_roots)))


def _links(robot: Robot) -> tuple[dict[str, tuple[int, Array, Array]], tuple[str, ...]]:
    """Joint that moves each link of the robot, the link's pose there, and the links' names."""
    from pinocchio import FrameType

    bodies = [frame for frame in robot.model.frames if frame.type == FrameType.BODY]
    places = {}
    for frame in bodies:
        place = frame.placement.copy()
        places[frame.name] = (int(frame.parentJoint), place.rotation, place.translation)
    first: dict[int, str] = {}
    for name, (joint, *_) in places.items():  # a joint's own child comes before what is fixed to it
        first.setdefault(joint, name)
    return places, tuple(first[joint] for joint in range(1, robot.model.njoints))


def _placed(
    shape: LinkShape, mesh: Callable[[str], Array], rotation: Array, translation: Array
) -> Array:
    """Draw a piece of geometry in the axes of the joint that moves its link."""
    own = mesh(shape.body) if isinstance(shape.body, str) else shape.body
    turn, shift = rotation @ shape.matrix, rotation @ shape.translation + translation
    points: Array = own.reshape(-1, 3) @ turn.T + shift
    surface = points.reshape(-1, 3, 3)
    area = _area(surface)
    if not 0 < area < np.inf:
        address = shape.body if isinstance(shape.body, str) else f"of link {shape.link!r}"
        raise MeshError(address, f"has an area of {area:g} m² with its scale, expected a surface")
    return surface


def _area(surface: Array) -> float:
    a, b, c = np.moveaxis(surface, 1, 0)
    with np.errstate(over="ignore", invalid="ignore"):  # then it is refused
        return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
