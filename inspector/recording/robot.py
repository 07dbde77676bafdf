"""The robot in a recording: from its URDF or MJCF, its motion and colours, and its camera.

The camera is as near as it sees every point in the motion, and the floor below. What is framed is
what is drawn: the viewer's tree of links, with mimicking joints and what is fixed to the world.
"""

import hashlib
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain, product
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from rerun.urdf import UrdfJoint, UrdfTree

import noisemodel
from inspector.errors import InspectorError
from inspector.recording import axes, unstable
from inspector.recording.unstable import Camera
from noisemodel import meshes, robot, urdf
from noisemodel.mjcf import is_mjcf
from noisemodel.robot import Robot
from noisemodel.run import Run
from noisemodel.surface import link_names, pieces
from noisemodel.types import Array, UnknownJointError
from noisemodel.urdf import find_mesh, shapes_in

FRAMES_PER_SECOND = 50.0
MAX_FRAMES = 2000
WORLD = "world"
# The shapes that a URDF becomes, and what colours each.
COLOURED = {
    "Asset3D": "albedo_factor",
    "Boxes3D": "colors",
    "Capsules3D": "colors",
    "Cylinders3D": "colors",
    "Ellipsoids3D": "colors",
}


def load(name: str, folder: Path, joint_names: Sequence[str] = (), *, side: str = "") -> UrdfTree:
    """Read the robot that a run names, for drawing; `side` tells one of several apart."""
    path, copy = robot.locate(name), drawn_file(name, folder)
    place = f"robot_{side}" if side else "robot"
    if is_mjcf(path):
        text = drawable_mjcf(Robot.load(path), folder)
    else:
        urdf.checked(path)
        text = drawable(path, robot.package_roots(name), folder)
    copy.write_text(text, encoding="utf-8")
    tree = UrdfTree.from_file_path(
        copy,
        entity_path_prefix=place,
        frame_prefix=f"{place}/" if side else None,
        static_transform_entity_path=f"/{place}/fixed",
    )
    known = [joint.name for joint in tree.joints() if joint.joint_type != "fixed"]
    for joint in joint_names:
        if joint not in known:
            raise UnknownJointError(joint, tree.name, known)
    return tree


def drawn_file(name: str, folder: Path) -> Path:
    """The URDF that `load` writes into a folder for rerun to read."""
    return folder / robot.locate(name).with_suffix(".urdf").name


def origin(tree: UrdfTree) -> str:
    """Entity path that all of a robot lies under."""
    return f"/{tree.frame_prefix or 'robot'}".rstrip("/")


def frame(tree: UrdfTree, link: str) -> str:
    """Name of a link's frame of transforms, or of the world's."""
    return f"{tree.frame_prefix or ''}{link}"


def outwards(tree: UrdfTree) -> Iterator[UrdfJoint]:
    """The joints of a robot, each after those that carry it."""
    reached, waiting = {tree.root_link().name}, list(tree.joints())
    while waiting:
        ready = [joint for joint in waiting if joint.parent_link in reached]
        yield from ready
        reached |= {joint.child_link for joint in ready}
        waiting = [joint for joint in waiting if joint not in ready]


def shapes_by_link(tree: UrdfTree) -> dict[str, list[tuple[str, str]]]:
    """What is drawn of each link that moves, and of the root, with what is fixed to it.

    These are entities and their shapes, keys of ``COLOURED``.
    """
    kinds = {}
    for chunk in tree.stream().to_chunks():
        for name in chunk.to_record_batch().schema.names:
            shape, _, component = name.partition(":")
            if shape in COLOURED and component != COLOURED[shape]:
                kinds[chunk.entity_path] = shape
    carrier = {tree.root_link().name: tree.root_link().name}
    for joint in outwards(tree):
        fixed = joint.joint_type == "fixed"
        carrier[joint.child_link] = carrier[joint.parent_link] if fixed else joint.child_link
    found: dict[str, list[tuple[str, str]]] = {}
    for link, moved in carrier.items():
        paths = tree.get_visual_geometry_paths(link)
        found.setdefault(moved, []).extend((path, kinds[path]) for path in paths)
    return found


def log_robots(
    recording: rr.RecordingStream, runs: Mapping[str, Run], folder: Path, *, aspect: float
) -> list[tuple[UrdfTree, Camera]]:
    """Log the robot of each side's run, its motion and the floor; colours have to follow.

    All are of one robot, and seen from where the camera sees both.
    """
    trees, parts, poses = list[UrdfTree](), list[Iterator[Array]](), list[Array | None]()
    drawn: dict[str, Array] = {}
    for side, run in runs.items():
        assert run.robot is not None
        names = (*run.joint_names, *run.desired_joint_names)
        tree, frames = load(run.robot, folder, names, side=side), shown(run)
        log_shapes(recording, tree)
        assert run.position is not None
        columns = dict(zip(run.joint_names, run.position[frames].T, strict=True))
        moved, index = angles(tree, columns), [axes.at(run.time[frames])]
        for joint in tree.joints():
            if joint.name in moved:
                angle = moved[joint.name].tolist()
                path = f"{origin(tree)}/motion/{joint.name}"
                turns = joint.compute_transform_columns(angle, clamp=False)
                recording.send_columns(path, indexes=index, columns=turns)
        pose = None if run.base_pose is None else run.base_pose[frames].astype(np.float64)
        if pose is not None:
            _log_motion(recording, tree, "base", run, pose[:, :3], quaternion=pose[:, 3:])
        trees.append(tree)
        poses.append(pose if len(frames) else None)
        drawn = drawn or outermost(drawn_file(run.robot, folder))
        parts.append(reached(tree, drawn, moved, poses[-1]))
    seen, cameras = fitted(chain(*parts), aspect=aspect), list[Camera]()
    for tree, run, pose in zip(trees, runs.values(), poses, strict=True):
        cameras.append(standing(seen, tree, moves=pose is not None))
        if pose is not None:  # the camera follows on the floor below the base, without its turns
            _log_motion(recording, tree, "view", run, pose[:, :3] * ON_FLOOR)
            log_floor(recording, tree, cameras[-1], pose)
    return list(zip(trees, cameras, strict=True))


def _log_motion(
    recording: rr.RecordingStream, tree: UrdfTree, name: str, run: Run, place: Array, **turn: Any
) -> None:
    """Log the motion of the root or of the camera's frame in the world."""
    moves = tree.root_link().name if name == "base" else VIEW
    columns = rr.Transform3D.columns(
        translation=place,
        parent_frame=[frame(tree, WORLD)] * len(place),
        child_frame=[frame(tree, moves)] * len(place),
        **turn,
    )
    index = [axes.at(run.time[shown(run)])]
    recording.send_columns(f"{origin(tree)}/motion/{name}", indexes=index, columns=columns)


def shown(run: Run) -> NDArray[np.intp]:
    """The samples that are drawn, at most 50 a second and 2000 in all; none in a gap."""
    step = max(1, round(run.rate / FRAMES_PER_SECOND), -(-len(run.time) // MAX_FRAMES))
    frames = np.arange(0, len(run.time), step)
    return frames[run.mask[frames]]


def angles(tree: UrdfTree, columns: Mapping[str, Array]) -> dict[str, Array]:
    """Positions of all joints that move, by joint, mimics included, by those that are known."""
    found = {}
    for joint in tree.joints():
        follows = joint.mimic
        if joint.joint_type == "fixed":
            continue
        if follows is not None and follows.joint in columns:
            found[joint.name] = columns[follows.joint] * follows.multiplier + follows.offset
        elif joint.name in columns:
            found[joint.name] = columns[joint.name]
    return found


def log_shapes(recording: rr.RecordingStream, tree: UrdfTree, *, coloured: bool = False) -> None:
    """Log a robot at rest, with its own colours or without."""
    unstable.log_up(recording)
    colours = [":".join(pair) for pair in COLOURED.items()]
    shapes = tree.stream()
    recording.send_chunks(shapes if coloured else shapes.drop(components=colours))


def log_colours(
    recording: rr.RecordingStream,
    tree: UrdfTree,
    time: Array,
    colours: Mapping[str, NDArray[np.uint8]],
    *,
    rest: NDArray[np.uint8],
) -> None:
    """Log the colours of links over time, shape (steps, 4), and of what does not move."""
    for link, shapes in shapes_by_link(tree).items():
        if link not in colours:
            for path, kind in shapes:
                colour = getattr(rr, kind).from_fields(**{COLOURED[kind]: rest})
                recording.log(path, colour, static=True)
            continue
        own = colours[link]
        changed = np.concatenate(([True], (own[1:] != own[:-1]).any(axis=1)))
        index = [axes.at(time[changed])]
        for path, kind in shapes:
            columns = getattr(rr, kind).columns(**{COLOURED[kind]: own[changed]})
            recording.send_columns(path, indexes=index, columns=columns)


DRAWN = {".stl", ".dae", ".obj", ".glb", ".gltf"}
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def _not_drawn(mesh: str, problem: str) -> InspectorError:
    """A mesh that is missing, lies outside of the robot's folders, or cannot be read."""
    return InspectorError(f"mesh {mesh}: {problem}; `--robot none` shows the run without the robot")


def drawable(urdf: Path, roots: Sequence[Path], folder: Path) -> str:
    """Rewrite a URDF for drawing.

    Textures and simulator extensions are left out, addresses of meshes become absolute: rerun
    refuses empty textures and needs an environment variable for ``package://``. For a link without
    visual shapes the collision shapes are drawn.
    """
    tree = ET.parse(urdf).getroot()  # noqa: S314
    for link in tree.iter("link"):
        if link.find("visual") is None:
            for shape in link.findall("collision"):
                shape.tag = "visual"
    for parent in list(tree.iter()):
        for child in list(parent):
            empty = child.tag == "texture" and not child.get("filename")
            if empty or child.tag in ("collision", "gazebo", "transmission", "sensor"):
                parent.remove(child)
    for mesh in tree.iter("mesh"):
        mesh.set("filename", f"file://{_checked(mesh.get('filename', ''), urdf, roots, folder)}")
    return ET.tostring(tree, encoding="unicode")


def drawable_mjcf(moved: Robot, folder: Path) -> str:
    """Write the URDF of a robot that was read from an MJCF, for drawing.

    Links are what moves with one joint, in that joint's axes. What is fixed to the world is the
    root; where the base floats, the base is, and the rest of the world is left out.

    Args:
        folder: Takes the links' shapes as STL files, one for each colour.
    """
    assert moved.mjcf is not None
    names = ["base", *link_names(moved)]
    while names[0] in names[1:]:
        names[0] += "_"
    shapes: dict[tuple[int, tuple[float, ...]], list[Array]] = {}
    try:
        for joint, shape, triangles in pieces(moved):
            if joint == 0 and all(known for known, _ in shapes):
                names[0] = shape.link  # the foot of an arm
            shapes.setdefault((joint, shape.colour), []).append(triangles)
    except noisemodel.MeshError as error:
        raise _not_drawn(error.mesh, error.problem) from error
    tree = ET.Element("robot", name=moved.name)
    base = 1 if moved.floating_base else 0
    links = {base: ET.SubElement(tree, "link", name=names[base])}
    for index, moving in enumerate(moved.joints, start=1):
        if moving.kind != "floating" and moving.parent in links:
            links[index] = ET.SubElement(tree, "link", name=names[index])
            tree.append(_joint(moved, index, names[moving.parent], names[index]))
    for number, ((joint, colour), parts) in enumerate(shapes.items()):
        if joint not in links:
            continue
        visual = ET.SubElement(links[joint], "visual")
        file = _write_stl(np.concatenate(parts), folder / f"{number}.stl")
        ET.SubElement(ET.SubElement(visual, "geometry"), "mesh", filename=f"file://{file}")
        material = ET.SubElement(visual, "material", name=f"colour{number}")
        ET.SubElement(material, "color", rgba=_numbers(colour))
    return ET.tostring(tree, encoding="unicode")


def _joint(moved: Robot, index: int, parent: str, child: str) -> ET.Element:
    """Write a joint of a robot that was read from an MJCF as a URDF has it."""
    from pinocchio.rpy import matrixToRpy

    assert moved.mjcf is not None
    joint, place = moved.joints[index - 1], moved.model.jointPlacements[index]
    kind = "prismatic" if joint.kind == "prismatic" else "continuous"
    element = ET.Element("joint", name=joint.name, type=kind)
    ET.SubElement(element, "parent", link=parent)
    ET.SubElement(element, "child", link=child)
    turn = _numbers(matrixToRpy(place.rotation))
    ET.SubElement(element, "origin", xyz=_numbers(place.translation), rpy=turn)
    axis = (np.eye(3) if joint.turn is None else joint.turn)[joint.axis]
    ET.SubElement(element, "axis", xyz=_numbers(axis))
    ET.SubElement(element, "limit", lower="-1e3", upper="1e3", effort="0", velocity="0")
    if joint.name in moved.mjcf.mimics:
        mimic = moved.mjcf.mimics[joint.name]
        ratio = {"multiplier": repr(mimic.multiplier), "offset": repr(mimic.offset)}
        ET.SubElement(element, "mimic", {"joint": mimic.joint, **ratio})
    return element


def _numbers(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def _checked(address: str, urdf: Path, roots: Sequence[Path], folder: Path) -> Path:
    """The file of a mesh; its triangles as the noise model reads them where rerun draws nothing."""
    try:
        path = find_mesh(address, urdf, roots)
        if path.suffix.lower() not in DRAWN:
            known = ", ".join(sorted(DRAWN))
            raise _not_drawn(address, f"of kind {path.suffix!r}, expected {known}")
        meshes.check_whole(path)  # the viewer draws nothing of others, without a warning
        if path.suffix.lower() != ".dae" or _read_by_rerun(path):
            return path
        copy = folder / f"{hashlib.sha256(bytes(path)).hexdigest()[:16]}.stl"
        return copy if copy.exists() else _write_stl(meshes.read(path), copy)
    except noisemodel.MeshError as error:
        raise _not_drawn(address or "''", error.problem) from error


def _read_by_rerun(path: Path) -> bool:
    """Whether rerun's reader of COLLADA draws a file; of others it draws nothing, silently.

    As of 0.41 on the robots of example-robot-data: it takes triangles of version 1.4.1 only,
    and turns what is not Z_UP, which URDFs do not mean.
    """
    text = path.read_text(encoding="utf-8", errors="replace")
    others = re.search(r"<(polylist|polygons|tristrips|trifans)\b", text)
    return not others and 'version="1.4.1"' in text and "<up_axis>Z_UP<" in text


def _write_stl(triangles: Array, file: Path) -> Path:
    """Write triangles, shape (triangles, 3 corners, 3), as a binary STL file."""
    facets = np.zeros(len(triangles), FACET)
    facets["corners"] = triangles
    edges = np.diff(triangles, axis=1)
    across = np.cross(edges[:, 0], edges[:, 1])
    length = np.linalg.norm(across, axis=1, keepdims=True)
    facets["normal"] = across / np.where(length > 0.0, length, 1.0)
    file.write_bytes(bytes(80) + len(facets).to_bytes(4, "little") + facets.tobytes())
    return file


# Of the viewer's camera, from the lower to the upper edge, in [rad].
FIELD_OF_VIEW = np.deg2rad(55.0)
# From where a robot that looks along x is seen: from its front, right and above, in [rad].
AZIMUTH, ELEVATION = np.deg2rad(-55.0), np.deg2rad(18.0)
MARGIN = 0.08  # share of the picture that stays free at each edge
# A robot that is smaller, such as one without any shape, is framed as if it were so large, [m].
SMALLEST = 0.05
ON_FLOOR = np.array([1.0, 1.0, 0.0])  # the camera follows a base along the floor, not up and down
VIEW = "_view"  # frame of transforms that the camera moves with
# Colour of the lines of a floor, and half of their width by their distance.
FLOOR, THICKNESS = (58, 62, 70), 0.006
MOST_LINES = 200  # lines of a floor in one direction
# Along each of these, a mesh is taken by its outermost point; it reaches beyond by a tenth.
DIRECTIONS = np.array([each for each in product((-1.0, 0.0, 1.0), repeat=3) if any(each)])


def fitted(parts: Iterable[Array], *, aspect: float = 1.0, room: float = 1.0) -> Camera:
    """Place a camera as near as it sees all points, parts of shape (points, 3), in [m]."""
    sighted = sight()
    slopes = (1.0 - 2.0 * MARGIN) * np.tan(FIELD_OF_VIEW / 2) * np.array([aspect, 1.0])
    # The edges of the picture are planes through the eye: a point is between the left and the right
    # one if |right - right of eye| <= slope (ahead - ahead of eye). The point that is farthest
    # beyond a plane is the same wherever the eye is, and it alone decides.
    right, up, ahead = sighted
    planes = [
        across + sign * slope * ahead
        for across, slope in zip((right, up), slopes, strict=True)
        for sign in (1, -1)
    ]
    measured = np.stack([*planes, ahead, *np.eye(3)])
    reaches = [part @ measured.T for part in parts]
    least = np.min([reach.min(axis=0) for reach in reaches], axis=0)
    most = np.max([reach.max(axis=0) for reach in reaches], axis=0)
    floor = float(least[-1])
    extent = (most - least)[-3:]
    slack = np.abs(measured) @ np.maximum(SMALLEST - extent, (room - 1.0) * extent) / 2
    least, most = least - slack, most + slack
    nearest = min((least[0] - most[1]) / (2 * slopes[0]), (least[2] - most[3]) / (2 * slopes[1]))
    across, height = (least[0] + most[1]) / 2, (least[2] + most[3]) / 2
    middle = (least[4] + most[4]) / 2
    size = float((most - least)[-3:].max())
    return Camera(
        eye=np.array([across, height, nearest]) @ sighted,
        target=np.array([across, height, middle]) @ sighted,
        floor=floor,
        spacing=float(10.0 ** np.floor(np.log10(size))) / 2,
    )


def sight() -> Array:
    """Directions to the right, upwards and ahead in the picture, one a row, shape (3, 3)."""
    level = np.array([np.cos(AZIMUTH), np.sin(AZIMUTH), np.tan(ELEVATION)])
    ahead = -level / np.linalg.norm(level)
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    return np.stack((right, np.cross(right, ahead), ahead))


def standing(camera: Camera, tree: UrdfTree, *, moves: bool) -> Camera:
    """A camera in the frame of transforms that it stands in."""
    own = frame(tree, VIEW if moves else tree.root_link().name)
    return replace(camera, frame=own, moves=moves)


def log_floor(recording: rr.RecordingStream, tree: UrdfTree, camera: Camera, pose: Array) -> None:
    """Log a floor below all poses of a base, which stays where it is while the camera moves."""
    reach = 4.0 * float(np.linalg.norm(camera.eye - camera.target))
    low, high = pose[:, :2].min(axis=0) - reach, pose[:, :2].max(axis=0) + reach
    spacing = camera.spacing
    while (high - low).max() > MOST_LINES * spacing:
        spacing *= 2.0
    low, high = np.floor(low / spacing) * spacing, np.ceil(high / spacing) * spacing
    across, along = (
        np.arange(low[i], high[i] + spacing / 2, spacing, dtype=np.float64) for i in (0, 1)
    )
    lines = [[(x, low[1], camera.floor), (x, high[1], camera.floor)] for x in across.tolist()]
    lines += [[(low[0], y, camera.floor), (high[0], y, camera.floor)] for y in along.tolist()]
    path = f"{origin(tree)}/floor"
    recording.log(path, rr.CoordinateFrame(frame(tree, WORLD)), static=True)
    drawn = rr.LineStrips3D(lines, colors=[FLOOR] * len(lines), radii=spacing * THICKNESS)
    recording.log(path, drawn, static=True)


def outermost(urdf: Path) -> dict[str, Array]:
    """Outermost points of the links that are drawn, by link, in its axes, in [m]."""
    found: dict[str, list[Array]] = {}
    for shape in shapes_in(urdf, "visual"):
        body = shape.body
        if isinstance(body, str):
            try:
                body = meshes.read(Path(body.removeprefix("file://")))
            except noisemodel.MeshError:
                body = np.zeros((1, 3))
        corners = body.reshape(-1, 3)
        chosen = corners[np.unique((corners @ DIRECTIONS.T).argmax(axis=0))]
        found.setdefault(shape.link, []).append(chosen @ shape.matrix.T + shape.translation)
    return {link: np.concatenate(parts) for link, parts in found.items()}


def reached(
    tree: UrdfTree, drawn: Mapping[str, Array], angles: Mapping[str, Array], base: Array | None
) -> Iterator[Array]:
    """Points of each link in all frames, from the place on the floor below the base, in [m].

    Args:
        angles: Of joints that move, each of shape (frames,), in [rad] or [m].
        base: x, y, z and quaternion x, y, z, w of a base that moves, shape (frames, 7).
    """
    from scipy.spatial.transform import Rotation

    at_root = np.eye(3), np.zeros(3)
    if base is not None:
        turned = Rotation.from_quat(base[:, 3:]).as_matrix()
        at_root = turned, base[:, :3] * (1.0 - ON_FLOOR)
    poses = {tree.root_link().name: at_root}
    for joint in outwards(tree):
        turned, shifted = poses[joint.parent_link]
        own_turn, own_shift = pose(joint, angles.get(joint.name, np.zeros(())))
        place = (turned @ own_shift[..., None])[..., 0] + shifted
        poses[joint.child_link] = turned @ own_turn, place
    drawn = drawn or dict.fromkeys(poses, np.zeros((1, 3)))
    for link, own in drawn.items():
        turned, shifted = poses[link]
        # One product for all frames: many of three by three would take much longer.
        placed = (turned.reshape(-1, 3) @ own.T).reshape(-1, 3, len(own))
        yield (placed + shifted.reshape(-1, 3, 1)).swapaxes(1, 2).reshape(-1, 3)


def pose(joint: UrdfJoint, angle: Array) -> tuple[Array, Array]:
    """Pose of a joint's child in the axes of its parent, for each angle in [rad] or [m]."""
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_euler("xyz", joint.origin_rpy)
    place, axis = np.array(joint.origin_xyz), np.array(joint.axis)
    if joint.joint_type == "fixed":
        return turn.as_matrix(), place
    along = angle[..., None] * axis / np.linalg.norm(axis)
    if joint.joint_type == "prismatic":
        return turn.as_matrix(), place + along @ turn.as_matrix().T
    return (turn * Rotation.from_rotvec(along)).as_matrix(), place
