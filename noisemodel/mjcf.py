"""A robot from an MJCF file: Pinocchio's model of its joints, and the geometry of its bodies.

MuJoCo reads the file, with its defaults, included and attached files; the joints are then added to
a Pinocchio model one by one. Pinocchio's own reader of MJCF (``pinocchio.buildModelFromMJCF``,
4.1) gives the same joints where it can, and a test holds this module to it; but it leaves out
included files, bodies without a name and all trees but the first, and merges the joints of a body
into one, all without an error. Meshes are not opened here: they are read as a URDF's are.
"""

import os
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from noisemodel import shapes
from noisemodel.errors import RobotError
from noisemodel.files import beyond, limit, parsed_xml
from noisemodel.linkshapes import LinkShape
from noisemodel.meshpath import HINT
from noisemodel.types import Array
from noisemodel.urdf import MAX_BYTES, Mimic

SUFFIXES = (".xml", ".mjcf")

DRAWN_GROUPS = 3
"""MuJoCo draws geoms of groups 0, 1 and 2 unless told otherwise; collision shapes are in 3."""

UNCOLOURED = (0.5, 0.5, 0.5, 1.0)
"""MuJoCo's colour of a geom that names none: its material's is taken then."""

MAX_INCLUDED = 200
"""Most files that one MJCF may consist of, each counted as often as it is named."""

MAX_COPIES = 10_000
"""Most copies that ``<replicate>`` and the like may make of an element."""

MAX_CELLS = 10_000_000
"""Most cells of a height field."""


@dataclass(frozen=True, eq=False)
class Mjcf:
    """What an MJCF describes.

    Attributes:
        model: The ``pinocchio.Model``.
        floating_base: Whether its first joint lets the base move freely. Further free joints are
            those of objects, which stay where the file puts them.
        mimics: Joints that a linear equality constraint ties to another one, by name.
        visual: The geoms that are drawn, by the rule of `_visual`.
        collision: The geoms that can collide.
    """

    model: Any
    floating_base: bool
    mimics: Mapping[str, Mimic]
    visual: tuple[LinkShape, ...]
    collision: tuple[LinkShape, ...]


def is_mjcf(path: Path) -> bool:
    """Whether a file is an MJCF: by its suffix, unless its root element is a URDF's."""
    if path.suffix.lower() not in SUFFIXES:
        return False
    with path.open("rb") as stream:
        head = stream.read(2**16)
    while b"<!--" in head:
        before, _, after = head.partition(b"<!--")
        head = before + after.partition(b"-->")[2]
    root = re.search(rb"<([A-Za-z][\w.-]*)", head)
    return root is None or root[1] != b"robot"


def read(path: Path, roots: Sequence[Path], floating_base: bool | None = None) -> Mjcf:
    """Read an MJCF.

    Args:
        path: The file.
        roots: Folders that the files it names have to lie in.
        floating_base: Whether the base moves freely; None as in the file, where a free joint that
            comes first says so.

    Returns:
        Its joints and its geometry.

    Raises:
        RobotError: If MuJoCo is not installed or cannot read the file, a file that it includes is
            missing or lies elsewhere, or a joint is a ball joint.
    """
    folders = _check(path, roots)
    try:
        str(path.absolute()).encode()
    except UnicodeEncodeError as error:
        raise RobotError(f"{path}: its path is not UTF-8, as MuJoCo needs it") from error
    try:
        import mujoco
    except ImportError as error:
        raise RobotError(
            f"{path}: an MJCF needs MuJoCo; `pip install 'noise-inspector[sim]'`"
        ) from error
    try:
        # An absolute path: files that an included file names get its folder before their names.
        spec = mujoco.MjSpec.from_file(str(path.absolute()))
        spec.memory = -1  # nothing is simulated
        spec.compiler.fusestatic = spec.compiler.discardvisual = False
        meshes = _without_files(spec, path, folders)
        with warnings.catch_warnings(action="ignore"):  # such as attributes that are deprecated
            compiled = spec.compile()
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        reason = " ".join(str(error).split()).removeprefix("Error: ")
        raise RobotError(f"{path}: MuJoCo cannot read the MJCF ({reason})") from error
    if compiled.njnt > limit("joints"):
        raise RobotError(f"{path}: {compiled.njnt} joints; {beyond('joints')}")
    drawn = [
        (geom, shape)
        for geom in range(compiled.ngeom)
        if (shape := _shape(compiled, geom, meshes.get(geom))) is not None
    ]
    visual = _visual(compiled)
    model, floating = _model(path, compiled, floating_base)
    return Mjcf(
        model=model,
        floating_base=floating,
        mimics=dict(_mimics(compiled)),
        visual=tuple(shape for geom, shape in drawn if geom in visual),
        collision=tuple(shape for geom, shape in drawn if _collides(compiled, geom)),
    )


def _check(path: Path, roots: Sequence[Path]) -> list[Path]:
    """Refuse what is no MJCF, or names files outside of its folders, before MuJoCo opens any.

    Returns:
        The folders of the file and of those that it includes or attaches.
    """
    waiting, known = [path], {path.resolve()}
    parts: dict[Path, _Part] = {}
    folders, below, named = [path.parent], {""}, set()
    while waiting:
        part = waiting.pop()
        root = _parsed(part)
        if part == path and root.tag != "mujoco":
            raise RobotError(f"{path}: not an MJCF, its root is <{root.tag}>, expected <mujoco>")
        if _copies(root) > MAX_COPIES:
            raise RobotError(f"{part}: replicates an element more than {MAX_COPIES} times")
        _check_sizes(part, root)
        parts[part.resolve()] = own = _Part(root)
        for compiler in root.iter("compiler"):
            below |= {compiler.get("assetdir", ""), compiler.get("meshdir", "")}
        for element in root.iter():
            if element.tag not in ("texture", "skin"):  # which are not read
                named |= {file for name, file in element.items() if name.startswith("file")}
            if element.tag in ("include", "model"):
                file = element.get("file", "")
                found = [f / file for f in (path.parent, part.parent) if (f / file).is_file()]
                if not found:
                    raise RobotError(f"{part}: includes {file!r}, which is missing")
                _inside(path, file, found[0], roots)
                own.files[element] = found[0].resolve()
                if found[0].resolve() not in known:
                    known.add(found[0].resolve())
                    waiting.append(found[0])
                    folders.append(found[0].parent)
        if len(known) > MAX_INCLUDED:
            raise RobotError(f"{path}: includes more than {MAX_INCLUDED} files")
    _check_count(path, parts)
    folders = list(dict.fromkeys(folders))
    for file in sorted(named):
        for folder in (folder / each for folder in folders for each in below):
            if (folder / file).exists():
                _inside(path, file, folder / file, roots)
    return folders


def _parsed(path: Path) -> ET.Element:
    try:
        if not path.is_file():
            raise RobotError(f"{path}: there is no such MJCF file")
        if path.stat().st_size > MAX_BYTES:
            raise RobotError(f"{path}: larger than {MAX_BYTES} bytes, no MJCF is")
        text = path.read_bytes()
    except OSError as error:
        raise RobotError(f"{path}: cannot be read ({error.strerror})") from error
    if not text.strip():
        raise RobotError(f"{path}: the MJCF is empty")
    try:
        return parsed_xml(text)
    except ValueError as error:
        raise RobotError(f"{path}: {error}") from error


@dataclass
class _Part:
    """One of the files of an MJCF; ``files`` are those that its includes and models name."""

    root: ET.Element
    files: dict[ET.Element, Path] = field(default_factory=dict)


def _copies(root: ET.Element) -> int:
    """How often the most replicated element of a file is there."""
    return max(copies for _, copies in _elements(root))


def _elements(root: ET.Element) -> Iterator[tuple[ET.Element, int]]:
    """Elements of a file, and how often each is there."""
    waiting = [(root, 1)]
    while waiting:
        element, copies = waiting.pop()
        if element.tag in ("replicate", "composite", "flexcomp"):
            for count in re.findall(r"\d+", element.get("count", ""))[:3]:
                copies *= min(max(int(count[:9]), 1), MAX_COPIES + 1)
        yield element, copies
        waiting += [(child, copies) for child in element]


def _check_sizes(part: Path, root: ET.Element) -> None:
    """Refuse sizes that MuJoCo would take gigabytes for."""
    for element in root.iter():
        if element.tag == "size":
            for name, text in element.items():
                if name.startswith("nuser") and len(text.strip()) > 5:
                    raise RobotError(f"{part}: <{element.tag} {name}={text[:40]!r}> is too large")
        cells = [element.get(name, "1")[:9] for name in ("nrow", "ncol")]
        if all(map(str.isdecimal, cells)) and int(cells[0]) * int(cells[1]) > MAX_CELLS:
            raise RobotError(f"{part}: a height field of more than {MAX_CELLS} cells")


def _check_count(path: Path, parts: Mapping[Path, _Part]) -> None:
    """Refuse what is copied or attached to more bodies or joints than a robot has."""

    def counts(part: Path) -> tuple[int, int, int]:
        bodies, joints, files = 0, 0, 1
        included, models = {}, {}
        # MuJoCo reads all models, attached or not, and crashes on those that contain themselves.
        for element, file in parts[part].files.items():
            found = counts(file)
            files += found[2]
            if files > MAX_INCLUDED:
                raise RobotError(f"{path}: includes more than {MAX_INCLUDED} files")
            if element.tag == "include":
                included[element] = found
            else:
                models[_model_name(element, parts[file])] = found
        for element, copies in _elements(parts[part].root):
            bodies += copies * (element.tag in ("body", "geom", "composite", "flexcomp"))
            joints += copies * (element.tag in ("joint", "freejoint") and not element.get("joint"))
            more = included.get(element)
            if element.tag == "attach":
                more = models.get(element.get("model", ""))
            if more is not None:
                bodies, joints = bodies + copies * more[0], joints + copies * more[1]
            if bodies > limit("bodies"):
                raise RobotError(
                    f"{path}: more than {limit('bodies')} bodies and geoms; {beyond('bodies')}"
                )
        return bodies, joints, files

    try:
        _, joints, _ = counts(path.resolve())
    except RecursionError as error:
        raise RobotError(f"{path}: its models contain each other") from error
    if joints > 10 * limit("joints"):  # those of defaults, sensors and equalities are counted too
        raise RobotError(f"{path}: more than {limit('joints')} joints; {beyond('joints')}")


def _model_name(element: ET.Element, part: _Part) -> str:
    return element.get("name") or part.root.get("model") or ""


def _inside(path: Path, named: str, file: Path, roots: Sequence[Path]) -> None:
    if not any(file.resolve().is_relative_to(root.resolve()) for root in roots):
        allowed = ", ".join(map(str, roots))
        raise RobotError(f"{path}: names {named!r}, which lies outside of {allowed}; {HINT}")


def _without_files(
    spec: Any, path: Path, folders: Sequence[Path]
) -> dict[int, tuple[str, Array, Array]]:
    """Take meshes and textures out of a spec, so that compiling it opens no file.

    The poses of geoms are compiled all the same: a sphere takes the place of a mesh.

    Returns:
        By index of a geom that was a mesh: the mesh's address relative to the model's folder, and
        from the file's numbers to the geom's axes a matrix, shape (3, 3), and a shift, shape (3,).
    """
    from mujoco import mjtGeom

    for material in spec.materials:
        for role in range(len(material.textures)):
            material.textures[role] = ""
    for element in (*spec.textures, *spec.skins):
        spec.delete(element)
    by_name = {mesh.name or Path(mesh.file).stem: mesh for mesh in spec.meshes if mesh.file}
    meshes, fitted = {}, set()
    for index, geom in enumerate(spec.geoms):
        name, mesh = geom.meshname, by_name.get(geom.meshname)
        if mesh is None:
            continue
        if geom.type not in (mjtGeom.mjGEOM_MESH, mjtGeom.mjGEOM_SDF):
            fitted.add(name)  # a box, say, of the mesh's size
            continue
        # MuJoCo takes refpos off, turns by refquat backwards, then scales.
        matrix = np.diag(mesh.scale) @ _rotation(mesh.refquat).T
        meshes[index] = (_address(spec, mesh, path, folders), matrix, -matrix @ mesh.refpos)
        geom.type, geom.meshname, geom.size = mjtGeom.mjGEOM_SPHERE, "", (1.0, 0.0, 0.0)
    for name, mesh in by_name.items():
        if name not in fitted:
            spec.delete(mesh)
    # Bodies whose mass MuJoCo would take from meshes have that of the spheres: nothing reads it.
    spec.compiler.boundmass = spec.compiler.boundinertia = 1e-6
    return meshes


def _address(spec: Any, mesh: Any, path: Path, folders: Sequence[Path]) -> str:
    file = Path(mesh.file).name if spec.strippath else mesh.file
    places = [folder / mesh.compiler.meshdir / file for folder in folders]
    found = next((place for place in places if place.is_file()), places[0])
    return os.path.relpath(found.absolute(), path.absolute().parent)


def _rotation(quaternion: Array) -> Array:
    """The rotation of a quaternion w, x, y, z of any length, shape (3, 3)."""
    w, x, y, z = np.asarray(quaternion, dtype=np.float64) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _model(path: Path, compiled: Any, floating_base: bool | None) -> tuple[Any, bool]:
    """Add the bodies and joints of a compiled MJCF to a Pinocchio model, in their order.

    Returns:
        The model, and whether its base floats.
    """
    import pinocchio as pin
    from mujoco import mjtJoint

    model = pin.Model()
    model.name = path.stem
    free = bool(compiled.njnt) and compiled.jnt_type[0] == mjtJoint.mjJNT_FREE
    floating = free if floating_base is None else floating_base
    base = 0
    if floating and not free:
        base = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root_joint")
        model.addFrame(pin.Frame("world", base, pin.SE3.Identity(), pin.FrameType.BODY))
    carrier = {0: (base, pin.SE3.Identity())}  # of each body: the joint, and its pose there
    for body in range(1, compiled.nbody):
        name = _body_name(compiled, body)
        joint, place = carrier[int(compiled.body_parentid[body])]
        place = place * pin.SE3(_rotation(compiled.body_quat[body]), compiled.body_pos[body])
        first = int(compiled.body_jntadr[body])
        count = int(compiled.body_jntnum[body])
        for index in range(first, first + count):
            kind = compiled.jnt_type[index]
            unnamed = "_free" if kind == mjtJoint.mjJNT_FREE else f"Joint_{index - first}"
            title = compiled.joint(index).name or name + unnamed  # as Pinocchio names them
            if kind == mjtJoint.mjJNT_BALL:
                raise RobotError(f"{path}: joint {title!r} is a ball joint, which is not supported")
            if kind == mjtJoint.mjJNT_FREE:
                if floating and index == 0:
                    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), title)
                    place = pin.SE3.Identity()
                continue
            axis, origin = compiled.jnt_axis[index], compiled.jnt_pos[index]
            zero = float(compiled.qpos0[compiled.jnt_qposadr[index]])  # where the file has it
            if kind == mjtJoint.mjJNT_HINGE:
                back = pin.SE3(pin.AngleAxis(-zero, axis).toRotationMatrix(), np.zeros(3))
            else:
                back = pin.SE3(np.eye(3), -zero * axis)
            limits = compiled.jnt_range[index] if compiled.jnt_limited[index] else (-np.inf, np.inf)
            joint = model.addJoint(
                joint,
                _joint(kind == mjtJoint.mjJNT_HINGE, axis),
                place * pin.SE3(np.eye(3), origin) * back,
                title,
                np.array([np.inf]),
                np.array([np.inf]),
                *(np.array([float(limit)]) for limit in limits),
            )
            place = pin.SE3(np.eye(3), -origin)
            if index < first + count - 1:  # the next joint of the body moves against this one
                frame = pin.Frame(f"{name}:{title}", joint, place, pin.FrameType.BODY)
                model.addFrame(frame)
        carrier[body] = (joint, place)
        model.addFrame(pin.Frame(name, joint, place, pin.FrameType.BODY))
    return model, floating


def _joint(turns: bool, axis: Array) -> Any:
    """A joint of Pinocchio that turns about an axis, or slides along it."""
    import pinocchio as pin

    if np.count_nonzero(axis) == 1 and axis.max() == 1.0:
        kinds = ("RX", "RY", "RZ") if turns else ("PX", "PY", "PZ")
        return getattr(pin, f"JointModel{kinds[int(axis.argmax())]}")()
    return (pin.JointModelRevoluteUnaligned if turns else pin.JointModelPrismaticUnaligned)(axis)


def _body_name(compiled: Any, body: int) -> str:
    """The name of a body, or one that stands for it."""
    return compiled.body(body).name or f"body{body}"


def _mimics(compiled: Any) -> Iterator[tuple[str, Mimic]]:
    """Joints that an equality constraint ties to another one: q1 = ref1 + c0 + c1 (q2 - ref2).

    MuJoCo refuses equalities of joints that neither turn nor slide.
    """
    from mujoco import mjtEq

    for index in range(compiled.neq):
        first, second = int(compiled.eq_obj1id[index]), int(compiled.eq_obj2id[index])
        if int(compiled.eq_type[index]) != int(mjtEq.mjEQ_JOINT) or second < 0:
            continue
        constant, linear, *higher = compiled.eq_data[index][:5].tolist()
        if any(higher) or not compiled.eq_active0[index]:
            continue
        zeros = compiled.qpos0[compiled.jnt_qposadr[[first, second]]]
        offset = float(zeros[0] + constant - linear * zeros[1])
        names = [compiled.joint(joint).name for joint in (first, second)]
        yield names[0], Mimic(names[1], linear, offset)


def _shape(compiled: Any, geom: int, mesh: tuple[str, Array, Array] | None) -> LinkShape | None:
    """A geom in its body's axes; None for planes, height fields and what is fixed to the world."""
    from mujoco import mjtGeom

    body = int(compiled.geom_bodyid[geom])
    x, y, z = compiled.geom_size[geom].tolist()
    matrix, shift = np.eye(3), np.zeros(3)
    drawn: str | Array | None = None
    kind = compiled.geom_type[geom]
    if mesh is not None:
        drawn, matrix, shift = mesh
    elif kind == mjtGeom.mjGEOM_MESH:  # written in the file itself
        drawn = _mesh(compiled, int(compiled.geom_dataid[geom]))
    elif kind == mjtGeom.mjGEOM_SPHERE:
        drawn = shapes.sphere(x)
    elif kind == mjtGeom.mjGEOM_ELLIPSOID:
        drawn = shapes.sphere(1.0) * (x, y, z)
    elif kind == mjtGeom.mjGEOM_CAPSULE:
        drawn = shapes.capsule(x, 2 * y)
    elif kind == mjtGeom.mjGEOM_CYLINDER:
        drawn = shapes.cylinder(x, 2 * y)
    elif kind == mjtGeom.mjGEOM_BOX:
        drawn = shapes.box(2 * x, 2 * y, 2 * z)
    if body == 0 or drawn is None:
        return None
    turn = _rotation(compiled.geom_quat[geom])
    return LinkShape(
        link=_body_name(compiled, body),
        matrix=turn @ matrix,
        translation=turn @ shift + compiled.geom_pos[geom],
        body=drawn,
        colour=_colour(compiled, geom),
    )


def _mesh(compiled: Any, mesh: int) -> Array:
    first, count = compiled.mesh_vertadr[mesh], compiled.mesh_vertnum[mesh]
    points = compiled.mesh_vert[first : first + count].astype(np.float64)
    first, count = compiled.mesh_faceadr[mesh], compiled.mesh_facenum[mesh]
    triangles: Array = points[compiled.mesh_face[first : first + count]]
    return triangles


def _colour(compiled: Any, geom: int) -> tuple[float, ...]:
    colour = tuple(compiled.geom_rgba[geom].tolist())
    material = int(compiled.geom_matid[geom])
    if material >= 0 and colour == UNCOLOURED:
        return tuple(compiled.mat_rgba[material].tolist())
    return colour


def _collides(compiled: Any, geom: int) -> bool:
    return bool(compiled.geom_contype[geom] or compiled.geom_conaffinity[geom])


def _visual(compiled: Any) -> set[int]:
    """The geoms that are drawn: those that MuJoCo draws by itself, and that are not transparent.

    Where these are of several groups, and one holds only geoms that never collide, a group of which
    every geom collides is left out: it repeats the shapes for collisions (as in robosuite).
    """
    groups: dict[int, list[int]] = {}
    for geom in range(compiled.ngeom):
        group = int(compiled.geom_group[geom])
        if group < DRAWN_GROUPS and compiled.geom_bodyid[geom] and _colour(compiled, geom)[3] > 0:
            groups.setdefault(group, []).append(geom)
    colliding = {g: [_collides(compiled, geom) for geom in geoms] for g, geoms in groups.items()}
    decorated = any(not any(each) for each in colliding.values())
    return {
        geom
        for group, geoms in groups.items()
        if not (decorated and all(colliding[group]))
        for geom in geoms
    }
