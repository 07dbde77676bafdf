"""The surface of a robot: the triangles of every link that moves, and integrals over them."""

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import cache
from types import MappingProxyType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from noisemodel import meshes
from noisemodel.files import beyond, cached, limit
from noisemodel.robot import Robot
from noisemodel.types import Array, GeometryError, Indices, MeshError
from noisemodel.urdf import LinkShape, find_mesh, shapes_in

# The geometries, and the shapes of the URDF or MJCF that each takes: the first that a link has.
GEOMETRIES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "visual": ("visual",),
        "collision": ("collision",),
        "auto": ("visual", "collision"),
    }
)
VERSION = "link-3"  # changes with what is computed here, so that the cache gives nothing older
HALVINGS = 8  # 1024 points for each link: mean speeds are right to about 1e-3, whatever the motion
FINENESS = 2.0  # panels of the fine points go this many times into the surface's thickness
MOST = 1_000_000  # fine points of a surface; more are placed only where there are many triangles
SLENDEREST = 1e-3  # thinner than this share of its length, a surface counts as that thin
# Points of a tetrahedron: mean 0 and covariance 1 in all directions.
CORNERS = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=np.float64)
SIDE = 96  # cells along one side of the table of turning; between its nodes it is right to 3e-4
FARTHEST = 1e6  # coordinates that a surface may have, in [m]: squares of much larger ones overflow
TINY = 1e-300  # keeps the direction of no rotation finite
ALL: Indices = np.zeros(1, dtype=np.intp)  # where the only cell begins, if all points are in one


def triangles(robot: Robot, geometry: str = "visual", *, world: bool = False) -> tuple[Array, ...]:
    """Triangles of each joint's link in the joint's axes, (triangles, 3 corners, 3), in [m].

    ``geometry`` is as in `Surface.of`. Which side of a triangle is outside is not known. With
    ``world``, what is fixed to the world comes first.
    """
    if geometry not in GEOMETRIES:
        known = ", ".join(GEOMETRIES)
        raise GeometryError(f"geometry {geometry!r} is not known, expected one of {known}")
    places, names = _links(robot)
    mesh = cache(  # left and right often share one
        lambda address: meshes.read(find_mesh(address, robot.path, robot.package_roots))
    )
    parts = [[np.empty((0, 3, 3))] for _ in range(len(names) + 1)]
    waiting = set(range(0 if world else 1, len(parts)))
    count = 0
    for use in GEOMETRIES[geometry]:
        if robot.mjcf is not None:
            shapes = robot.mjcf.visual if use == "visual" else robot.mjcf.collision
        else:
            shapes = tuple(shapes_in(robot.path, use)) if waiting else ()
        for shape in shapes:
            if shape.link not in places:  # readers of XML differ about tabs and ends of lines
                raise GeometryError(f"{robot.path}: Pinocchio names link {shape.link!r} otherwise")
            joint, rotation, translation = places[shape.link]
            if joint not in waiting:
                continue
            parts[joint].append(_placed(shape, mesh, rotation, translation))
            count += len(parts[joint][-1])  # a mesh counts as often as it is drawn
            if count > limit("triangles"):
                raise GeometryError(f"{robot.path}: too many triangles, {beyond('triangles')}")
        waiting = {joint for joint in waiting if len(parts[joint]) == 1}
    return tuple(map(np.concatenate, parts if world else parts[1:]))


def link_names(robot: Robot) -> tuple[str, ...]:
    """The child link of each joint, in the joints' order."""
    return _links(robot)[1]


def _links(robot: Robot) -> tuple[dict[str, tuple[int, Array, Array]], tuple[str, ...]]:
    """Joint that moves each link, with the link's pose there, and the child link of each joint."""
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
    a, b, c = np.moveaxis(surface, 1, 0)
    with np.errstate(over="ignore", invalid="ignore"):  # then it is refused
        area = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
    address = shape.body if isinstance(shape.body, str) else f"of link {shape.link!r}"
    if not 0 < area < np.inf:
        raise MeshError(address, f"has an area of {area:g} m² with its scale, expected a surface")
    if (reach := np.abs(points).max()) > FARTHEST:
        raise MeshError(
            address, f"lies {reach:g} m from its joint, expected {FARTHEST:g} m at most"
        )
    return surface


# Integrals that are exact: area, centroid, and two quadratic forms of a link's twist.


def moments(triangles: Array) -> dict[str, Any]:
    """What is exact about triangles, shape (triangles, 3 corners, 3), in [m], see `LinkSurface`."""
    triangles, areas, normals = _faces(triangles)
    area = float(areas.sum())
    if area == 0.0:
        none = {"mean_square": np.zeros((6, 6)), "mean_square_normal": np.zeros((6, 6))}
        return {"area": area, "centroid": np.zeros(3)} | none
    points, weights = _edge_points(triangles, areas)
    centroid = weights @ points
    second = (points * weights[:, None]).T @ points
    x, y, z = centroid
    crossed = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    inertia = np.trace(second) * np.eye(3) - second
    # <|v + w x r|²> = |v|² + 2 v.(w x <r>) + w.(tr<rr'> - <rr'>) w
    mean_square = np.block([[np.eye(3), -crossed], [crossed, inertia]])
    normals = np.repeat(normals, 3, axis=0)
    pull = np.hstack((normals, np.cross(points, normals)))  # n.(v + w x r) = pull.(v, w)
    forms = {"mean_square": mean_square, "mean_square_normal": (pull * weights[:, None]).T @ pull}
    return {"area": area, "centroid": centroid} | forms


def _faces(triangles: Array) -> tuple[Array, Array, Array]:
    """Triangles that have an area, their areas, in [m²], and unit normals, shape (n, 3)."""
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    double = np.linalg.norm(across, axis=1)
    real = double > 0.0
    return triangles[real], 0.5 * double[real], across[real] / double[real, None]


def _edge_points(triangles: Array, areas: Array) -> tuple[Array, Array]:
    """Middles of the edges, which integrate polynomials of degree 2 exactly, and weights."""
    middles = 0.5 * (triangles + np.roll(triangles, -1, axis=1))
    return middles.reshape(-1, 3), np.repeat(areas / (3.0 * areas.sum()), 3)


# Points for means of speeds, where no exact integral is known.


@dataclass(frozen=True)
class Cloud:
    """Points of a surface, shape (points, 3), in [m], and weights of a mean: positive, of sum 1."""

    points: Array
    weights: Array


def fine(triangles: Array) -> Cloud:
    """Place thousands of points, so densely that means of speeds are right to 1e-4."""
    triangles, areas, _ = _faces(triangles)
    _, (covariance,) = _statistics(*_edge_points(triangles, areas), ALL)
    spread = np.linalg.eigvalsh(covariance)
    # A slender link that spins about itself is resolved only by steps smaller than it is thick.
    thickness, length = np.sqrt(np.maximum([spread[:2].sum(), spread[2]], 0.0))
    step = max(thickness / FINENESS, SLENDEREST * length)
    step = min(step, 0.05 * np.sqrt(areas.sum()))  # enough points for any number of cells
    edges = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)
    sides = np.stack((edges.max(axis=1), edges.min(axis=1)), axis=1)
    while 4 * (panels := np.ceil(sides / step)).prod(axis=1).sum() > max(MOST, 8 * len(triangles)):
        step *= 2.0  # fans of a thousand slender triangles, such as no link has
    tip = edges.argmin(axis=1) + 2  # the corner opposite to the shortest edge
    order = (tip[:, None] + np.arange(3)) % 3
    triangles = np.take_along_axis(triangles, order[:, :, None], axis=1)
    small = (panels == 1).all(axis=1)
    points, weights = [], []
    for along, across in np.unique(panels[~small], axis=0).astype(int):
        alike = (panels == (along, across)).all(axis=1)
        own, share = _on_triangle(along, across)
        points.append(np.einsum("pc,tci->tpi", own, triangles[alike]).reshape(-1, 3))
        weights.append(np.outer(areas[alike], share).ravel())
    if small.any():
        own, share = _edge_points(triangles[small], areas[small])
        points.append(own)
        weights.append(share * areas[small].sum())
    return Cloud(np.concatenate(points), np.concatenate(weights) / areas.sum())


def _on_triangle(along: int, across: int) -> tuple[Array, Array]:
    """Points on lines through the first corner, two by two (Gauss) in each panel.

    They are shares of the three corners, shape (points, 3), with weights of sum 1.
    """
    gauss = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
    far = ((np.arange(along)[:, None] + gauss) / along).ravel()[:, None]
    aside = ((np.arange(across)[:, None] + gauss) / across).ravel()
    shares = np.stack(np.broadcast_arrays(1.0 - far, far * (1.0 - aside), far * aside), axis=2)
    weights = np.broadcast_to(far, shares.shape[:2]).ravel()  # lines part with the distance
    return shares.reshape(-1, 3), weights / weights.sum()


def reduced(cloud: Cloud, *, halvings: int) -> Cloud:
    """Replace the points by up to 4 * 2**halvings, cell by cell, with each cell's moments.

    So means of polynomials of degree 2 stay, weights stay positive, and the mean speed stays at or
    below the root-mean-square speed, which is exact.
    """
    points, weights, starts = _cells(cloud, halvings)
    share = np.add.reduceat(weights, starts)
    center, covariance = _statistics(points, weights, starts)
    spread, axes = np.linalg.eigh(covariance)
    reach = axes * np.sqrt(np.maximum(spread, 0.0))[:, None, :]
    corners = center[:, None, :] + np.einsum("ck,nik->nci", CORNERS, reach)
    return Cloud(corners.reshape(-1, 3), np.repeat(share / len(CORNERS), len(CORNERS)))


def point_speeds(points: Array, twists: Array) -> Array:
    """Speed of points, shape (points, 3), under twists, shape (6, samples): (points, samples)."""
    (x, y, z), (vx, vy, vz, wx, wy, wz) = points.T, twists
    # |v + w x r|² = |v|² + 2 r.(v x w) + |w|²|r|² - (w.r)²: one product of matrices for all
    shape = [np.ones_like(x), 2 * x, 2 * y, 2 * z, y * y + z * z, x * x + z * z, x * x + y * y]
    shape += [-2 * x * y, -2 * x * z, -2 * y * z]
    motion = [vx * vx + vy * vy + vz * vz, vy * wz - vz * wy, vz * wx - vx * wz, vx * wy - vy * wx]
    motion += [wx * wx, wy * wy, wz * wz, wx * wy, wx * wz, wy * wz]
    squares: Array = np.stack(shape, axis=1) @ np.stack(motion)
    np.maximum(squares, 0.0, out=squares)  # rounding, where the axis meets a point
    return np.sqrt(squares, out=squares)


def _cells(cloud: Cloud, halvings: int) -> tuple[Array, Array, Indices]:
    """Points and weights sorted by cells, and where each cell begins.

    Cells are cut at their mean across their longest axis, in axes in which the cloud is less
    slender: so a rod is cut around itself, too, and not only along.
    """
    _, (covariance,) = _statistics(cloud.points, cloud.weights, ALL)
    spread, axes = np.linalg.eigh(covariance)
    # Lengths along these axes are to each other as their square roots are.
    plumper = axes / np.maximum(spread, SLENDEREST**2 * spread[2]) ** 0.25
    points, weights = cloud.points @ plumper, cloud.weights
    order, starts = np.arange(len(points)), ALL
    for _ in range(halvings):
        center, covariance = _statistics(points[order], weights[order], starts)
        cell = _cell(starts, len(points))
        longest = np.linalg.eigh(covariance)[1][:, :, 2]
        along = np.einsum("pi,pi->p", points[order] - center[cell], longest[cell])
        ahead = along > 0.0
        order = order[np.lexsort((ahead, cell))]
        sizes = np.diff(starts, append=len(points))
        behind = sizes - np.add.reduceat(ahead, starts, dtype=np.intp)
        starts = np.union1d(starts, (starts + behind)[(behind > 0) & (behind < sizes)])
    return cloud.points[order], weights[order], starts


def _statistics(points: Array, weights: Array, starts: Indices) -> tuple[Array, Array]:
    """Mean, shape (cells, 3), and covariance, shape (cells, 3, 3), of the points in each cell."""
    share = np.add.reduceat(weights, starts)
    center = np.add.reduceat(points * weights[:, None], starts) / share[:, None]
    offset = points - center[_cell(starts, len(points))]
    products = offset[:, :, None] * (offset * weights[:, None])[:, None, :]
    return center, np.add.reduceat(products, starts) / share[:, None, None]


def _cell(starts: Indices, points: int) -> Indices:
    """Number the cell that each point lies in."""
    return np.repeat(np.arange(len(starts)), np.diff(starts, append=points))


# Mean speed of a surface that turns about any axis through its origin, from a table.


def rounding(inertia: Array) -> Array:
    """Axes U in which rotations of equal size have the same root-mean-square speed, in [m].

    With |U w|² = w' J w, a slender link is as round as a ball, so that one table fits all.
    """
    spread, axes = np.linalg.eigh(inertia)
    lengths = np.sqrt(np.maximum(spread, np.finfo(np.float64).eps * spread[2]))  # of a needle
    return np.asarray(lengths[:, None] * axes.T, dtype=np.float64)


def tabulate(cloud: Cloud, rounded: Array) -> Array:
    """Ratio of the mean to the root-mean-square speed, by the axis of rotation.

    It stands at direction (a, b, 1 - |a| - |b|), for a and b from -1 to 1, shape (97, 97), and is 0
    where |a| + |b| is much above 1.
    """
    a, b = (
        grid.ravel() for grid in np.meshgrid(*2 * [np.linspace(-1, 1, SIDE + 1)], indexing="ij")
    )
    directions = np.stack((a, b, 1 - np.abs(a) - np.abs(b)))
    used = directions[2] > -4 / SIDE  # no lookup reaches further beyond z = 0
    directions = directions[:, used] / np.linalg.norm(directions[:, used], axis=0)
    turns = np.linalg.solve(rounded, directions)
    table = np.zeros((SIDE + 1) ** 2)
    table[used] = cloud.weights @ point_speeds(cloud.points, np.vstack((0.0 * turns, turns)))
    return table.reshape(SIDE + 1, SIDE + 1)


def turning_speed(table: Array, rounded: Array, angular: Array) -> Array:
    """Mean speed <|w x r|> by `tabulate` and `rounding`, of w of shape (3, samples), in [m/s]."""
    x, y, z = turned = rounded @ angular
    # A rotation and its reverse are as fast: all axes lie on half an octahedron, which laid flat
    # is the square |a| + |b| <= 1.
    scale = np.copysign(0.5 * SIDE, z) / np.maximum(np.abs(turned).sum(axis=0), TINY)
    a, b = x * scale + 0.5 * SIDE, y * scale + 0.5 * SIDE
    row, column = (np.minimum(place.astype(np.intp), SIDE - 1) for place in (a, b))
    a, b = a - row, b - column
    corner = row * (SIDE + 1) + column
    ratios = table.ravel()
    low = ratios.take(corner) * (1 - b) + ratios.take(corner + 1) * b
    high = ratios.take(corner + SIDE + 1) * (1 - b) + ratios.take(corner + SIDE + 2) * b
    ratio = low * (1 - a) + high * a
    return np.asarray(np.sqrt(np.einsum("is,is->s", turned, turned)) * ratio)


@dataclass(frozen=True, eq=False)
class LinkSurface:
    """The surface of a link, in its joint's axes; all is 0 where there is no geometry."""

    area: float  # in [m²]
    centroid: Array  # shape (3,), in [m]
    # Mean distance from the axis that the joint turns about (the paper's G), in [m]; 0 for a joint
    # that slides, nan for a floating base, which turns about any axis.
    lever: float
    mean_square: Array  # under a twist nu the mean-square speed is nu' M nu, shape (6, 6)
    mean_square_normal: Array  # the same for the speed normal to the surface, shape (6, 6)
    rounding: Array  # axes in which equal rotations have equal mean-square speed, shape (3, 3)
    turning: Array  # ratio of mean to root-mean-square speed of rotations, by axis, as a table
    points: Cloud

    @classmethod
    def of(cls, triangles: Array, axis: Array | None) -> Self:
        """Integrate over triangles, or take it from the cache; ``axis`` as `Joint.turning_axis`."""
        content = hashlib.sha256(triangles.tobytes())
        content.update(b"any" if axis is None else axis.tobytes())
        kept = cached(f"{VERSION}-{content.hexdigest()}", lambda: _integrals(triangles, axis))
        points = Cloud(kept.pop("points"), kept.pop("weights"))
        area, lever = float(kept.pop("area")), float(kept.pop("lever"))
        return cls(area=area, lever=lever, points=points, **kept)


def _integrals(triangles: Array, axis: Array | None) -> dict[str, NDArray[Any]]:
    found = moments(triangles)
    if found["area"] == 0.0:
        found |= {"lever": 0.0, "rounding": np.zeros((3, 3)), "turning": np.zeros((1, 1))}
        found |= {"points": np.zeros((0, 3)), "weights": np.zeros(0)}
    else:
        dense = fine(triangles)
        cloud = reduced(dense, halvings=HALVINGS)
        rounded = rounding(found["mean_square"][3:, 3:])
        lever = float("nan")
        if axis is not None:  # the mean distance from it
            turning = np.concatenate((np.zeros(3), axis))[:, None]
            lever = float((dense.weights @ point_speeds(dense.points, turning))[0])
        found |= {"lever": lever, "rounding": rounded, "turning": tabulate(cloud, rounded)}
        found |= asdict(cloud)
    return {name: np.asarray(value) for name, value in found.items()}


@dataclass(frozen=True, eq=False)
class Surface:
    """The surface of every link that moves; what is fixed to the world has none.

    A link is all geometry that moves with one joint, and is named after that joint's child link.
    """

    names: tuple[str, ...]
    joint: NDArray[np.intp]  #: index of each link's joint in Pinocchio, shape (links,)
    links: tuple[LinkSurface, ...]

    @classmethod
    def of(cls, robot: Robot, geometry: str = "visual") -> Self:
        """Integrate over the links of a robot; what takes long is kept for the next time.

        ``geometry`` is "visual", "collision", or "auto": the visual, or else the collision. A shape
        or mesh that cannot be read is a GeometryError.
        """
        axes = [joint.turning_axis for joint in robot.joints]
        links = tuple(map(LinkSurface.of, triangles(robot, geometry), axes))
        return cls(link_names(robot), np.arange(1, len(links) + 1), links)

    @property
    def area(self) -> Array:
        """Area of each link, shape (links,), in [m²]."""
        return np.array([link.area for link in self.links], dtype=np.float64)

    @property
    def mean_square_normal(self) -> Array:
        """Mean-square normal speed under a twist nu is nu' M nu, shape (links, 6, 6)."""
        return np.array([link.mean_square_normal for link in self.links])

    @property
    def without_geometry(self) -> tuple[str, ...]:
        """Names of the links without geometry."""
        return tuple(self.names[link] for link in np.flatnonzero(self.area == 0.0))
