"""A robot from an MJCF file: Pinocchio's model of its joints, and the geometry of its bodies.

MuJoCo reads the file; the joints are then added to a Pinocchio model one by one. Pinocchio's own
reader of MJCF gives the same joints where it can, and a test holds this module to it; but it leaves
out included files, bodies without a name and all trees but the first, and merges the joints of a
body into one, all without an error. Meshes are not opened here: they are read as a URDF's are.

A few bytes of MJCF can ask MuJoCo for any memory and time, or crash it. So it compiles in a process
of its own, within limits; what is left here is to look at the files that it may open.
"""

import json
import os
import re
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias
from xml.etree import ElementTree as ET

import numpy as np

from noisemodel.files import beyond, limit, read_xml
from noisemodel.types import Array, RobotError
from noisemodel.urdf import HINT, LinkShape, Mimic, box, capsule, cylinder, sphere

# By index of a geom that is a mesh of a file: the mesh's address relative to the model's folder,
# and from the file's numbers to the geom's axes a matrix, shape (3, 3), and a shift, shape (3,).
Meshes: TypeAlias = dict[int, tuple[str, Array, Array]]
SUFFIXES = (".xml", ".mjcf")

DRAWN_GROUPS = 3  # MuJoCo draws groups 0, 1 and 2 unless told otherwise; collision shapes are in 3
UNCOLOURED = (0.5, 0.5, 0.5, 1.0)  # of a geom that names no colour: its material's is taken then
MAX_INCLUDED = 200  # most files that one MJCF may consist of
# Memory of the process that compiles, in [byte], its processor time and its time, in [s].
MEMORY, SECONDS, PATIENCE = 2 * 2**30, 10, 60.0
MAX_COMPILED = 2**28  # most bytes of a compiled model


@dataclass(frozen=True, eq=False)
class Mjcf:
    """What an MJCF describes; free joints but the first are objects that stay where they are."""

    model: Any  # pinocchio.Model
    floating_base: bool  # whether the first joint lets the base move freely
    mimics: Mapping[str, Mimic]  # joints that a linear equality ties to another one, by name
    visual: tuple[LinkShape, ...]  # the geoms that are drawn, by the rule of `_visual`
    collision: tuple[LinkShape, ...]  # the geoms that can collide


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
    """Read an MJCF; the files that it names have to lie in the folders ``roots``.

    The base floats by ``floating_base``, or where a free joint comes first if that is None.
    """
    folders = _check(path, roots)
    try:
        str(path.absolute()).encode()
    except UnicodeEncodeError as error:
        raise RobotError(f"{path}: its path is not UTF-8, as MuJoCo needs it") from error
    compiled, meshes = _compiled(path, folders)
    for count, name in ((compiled.njnt, "joints"), (compiled.nbody + compiled.ngeom, "bodies")):
        if count > limit(name):
            raise RobotError(f"{path}: {count} {name}; {beyond(name)}")
    for name in ("qpos0", "body_pos", "body_quat", "jnt_pos", "jnt_axis", "geom_pos", "geom_size"):
        if not np.isfinite(getattr(compiled, name)).all():
            raise RobotError(f"{path}: {name} of the compiled model is not finite")
    drawn, triangles, bodies = {}, 0, _body_names(compiled)
    for geom in range(compiled.ngeom):
        link = bodies[int(compiled.geom_bodyid[geom])]
        if (shape := _shape(compiled, geom, link, meshes.get(geom))) is not None:
            drawn[geom] = shape
            triangles += 0 if isinstance(shape.body, str) else len(shape.body)
        if triangles > limit("triangles"):
            raise RobotError(f"{path}: its shapes have too many triangles, {beyond('triangles')}")
    visual = _visual(compiled)
    model, floating = _model(path, compiled, bodies, floating_base)
    return Mjcf(
        model=model,
        floating_base=floating,
        mimics=dict(_mimics(compiled)),
        visual=tuple(shape for geom, shape in drawn.items() if geom in visual),
        collision=tuple(shape for geom, shape in drawn.items() if _collides(compiled, geom)),
    )


def _check(path: Path, roots: Sequence[Path]) -> list[Path]:
    """Refuse what is no MJCF, or names files outside of its folders, before MuJoCo opens any."""
    folders, below, named = list[Path](), {""}, set[str]()
    for part, root in _parts(path, roots):
        folders.append(part.parent)
        for element in root.iter():
            if element.tag == "compiler":
                below |= {element.get("assetdir", ""), element.get("meshdir", "")}
            if element.tag not in ("texture", "skin"):  # which are not read
                named |= {file for name, file in element.items() if name.startswith("file")}
    folders = list(dict.fromkeys(folders))
    for file in sorted(named):
        for place in (folder / each / file for folder in folders for each in below):
            if place.exists():
                _inside(path, file, place, roots)
                if not place.is_file():  # a pipe may have no end
                    raise RobotError(f"{path}: names {file!r}, which is no regular file")
    return folders


def _parts(path: Path, roots: Sequence[Path]) -> Iterator[tuple[Path, ET.Element]]:
    """The files of an MJCF, each once, with their roots."""
    waiting, known = [path], {path.resolve()}
    while waiting:
        part = waiting.pop()
        root = read_xml(part, "MJCF")
        if part == path and root.tag != "mujoco":
            raise RobotError(f"{path}: not an MJCF, its root is <{root.tag}>, expected <mujoco>")
        yield part, root
        for element in (*root.iter("include"), *root.iter("model")):
            file = element.get("file", "")
            found = [f / file for f in (path.parent, part.parent) if (f / file).is_file()]
            if not found:
                raise RobotError(f"{part}: includes {file!r}, which is missing")
            _inside(path, file, found[0], roots)
            if found[0].resolve() not in known:
                known.add(found[0].resolve())
                waiting.append(found[0])
        if len(known) > MAX_INCLUDED:
            raise RobotError(f"{path}: includes more than {MAX_INCLUDED} files")


def _inside(path: Path, named: str, file: Path, roots: Sequence[Path]) -> None:
    if not any(file.resolve().is_relative_to(root.resolve()) for root in roots):
        allowed = ", ".join(map(str, roots))
        raise RobotError(f"{path}: names {named!r}, which lies outside of {allowed}; {HINT}")


def _compiled(path: Path, folders: Sequence[Path]) -> tuple[Any, Meshes]:
    """Compile an MJCF in a process of its own: a ``mujoco.MjModel``, and the meshes of files."""
    try:
        import mujoco
    except ImportError as error:
        raise RobotError(
            f"{path}: an MJCF needs MuJoCo; `pip install 'noise-inspector[sim]'`"
        ) from error
    # An absolute path: files that an included file names get its folder before their names.
    names = [str(each.absolute()) for each in (path, *folders)]
    code = f"from noisemodel import mjcf; mjcf.compile_here({json.dumps(names)})"
    search = os.pathsep.join(str(Path(each).absolute()) for each in sys.path)
    with tempfile.TemporaryDirectory(prefix="noise-inspector-") as folder:
        try:
            done = subprocess.run(
                [sys.executable, "-c", code],
                cwd=folder,
                env=os.environ | {"PYTHONPATH": search, "OPENBLAS_NUM_THREADS": "1"},
                capture_output=True,
                timeout=PATIENCE,
                check=False,
            )
        except subprocess.TimeoutExpired as error:
            raise RobotError(f"{path}: MuJoCo needs more than {PATIENCE:.0f} s for it") from error
        if done.returncode == 1 and (reason := done.stdout.decode(errors="replace").strip()):
            raise RobotError(f"{path}: MuJoCo cannot read the MJCF ({reason})")
        if done.returncode:
            raise RobotError(
                f"{path}: MuJoCo crashes on it, or needs {MEMORY // 2**30} GB of memory or"
                f" {SECONDS} s of processor time"
            )
        if (size := (Path(folder) / "model.mjb").stat().st_size) > MAX_COMPILED:
            raise RobotError(f"{path}: {size} bytes when compiled, expected {MAX_COMPILED} at most")
        meshes = json.loads((Path(folder) / "meshes.json").read_text())
        compiled = mujoco.MjModel.from_binary_path(str(Path(folder) / "model.mjb"))
    return compiled, {
        int(geom): (address, np.array(matrix), np.array(shift))
        for geom, (address, matrix, shift) in meshes.items()
    }


def compile_here(names: Sequence[str]) -> None:
    """What the process of `_compiled` does with the names of an MJCF and of its files' folders."""
    import resource

    import mujoco

    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    path, *folders = map(Path, names)
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        spec.memory = -1  # nothing is simulated
        spec.compiler.fusestatic = spec.compiler.discardvisual = False
        meshes = _without_files(spec, path, folders)
        with warnings.catch_warnings(action="ignore"):  # such as attributes that are deprecated
            compiled = spec.compile()
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        print(" ".join(str(error).split()).removeprefix("Error: "))
        sys.exit(1)
    Path("meshes.json").write_text(json.dumps(meshes))
    mujoco.mj_saveModel(compiled, "model.mjb")


def _without_files(spec: Any, path: Path, folders: Sequence[Path]) -> dict[int, Any]:
    """Take meshes and textures out of a spec, so that compiling it opens no file; see `Meshes`.

    The poses of geoms are compiled all the same: a sphere takes the place of a mesh.
    """
    from mujoco import mjtGeom

    for material in spec.materials:
        for role in range(len(material.textures)):
            material.textures[role] = ""
    for element in (*spec.textures, *spec.skins):
        spec.delete(element)
    by_name = {mesh.name or Path(mesh.file).stem: mesh for mesh in spec.meshes if mesh.file}
    meshes: dict[int, Any] = {}
    fitted = set()
    for index, geom in enumerate(spec.geoms):
        name, mesh = geom.meshname, by_name.get(geom.meshname)
        if mesh is None:
            continue
        if geom.type not in (mjtGeom.mjGEOM_MESH, mjtGeom.mjGEOM_SDF):
            fitted.add(name)  # a box, say, of the mesh's size
            continue
        # MuJoCo takes refpos off, turns by refquat backwards, then scales.
        matrix = np.diag(mesh.scale) @ _rotation(mesh.refquat).T
        file = Path(mesh.file).name if spec.strippath else mesh.file
        places = [folder / mesh.compiler.meshdir / file for folder in folders]
        found = next((place for place in places if place.is_file()), places[0])
        address = os.path.relpath(found, path.parent)
        meshes[index] = (address, matrix.tolist(), (-matrix @ mesh.refpos).tolist())
        geom.type, geom.meshname, geom.size = mjtGeom.mjGEOM_SPHERE, "", (1.0, 0.0, 0.0)
    for name, mesh in by_name.items():
        if name not in fitted:
            spec.delete(mesh)
    # MuJoCo takes the masses of some bodies from meshes, now from spheres: nothing reads them.
    spec.compiler.boundmass = spec.compiler.boundinertia = 1e-6
    return meshes


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


def _model(
    path: Path, compiled: Any, bodies: Sequence[str], floating_base: bool | None
) -> tuple[Any, bool]:
    """Add bodies and joints to a Pinocchio model, in their order; and whether its base floats."""
    import pinocchio as pin
    from mujoco import mjtJoint

    model = pin.Model()
    model.name = path.stem
    free = bool(compiled.njnt) and compiled.jnt_type[0] == mjtJoint.mjJNT_FREE
    floating = free if floating_base is None else floating_base
    joints, frames = {compiled.joint(index).name for index in range(compiled.njnt)}, set(bodies)
    base = 0
    if floating and not free:
        title = unused("root_joint", joints)
        base = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), title)
        model.addFrame(pin.Frame("world", base, pin.SE3.Identity(), pin.FrameType.BODY))
    carrier = {0: (base, pin.SE3.Identity())}  # of each body: the joint, and its pose there
    for body in range(1, compiled.nbody):
        joint, place = carrier[int(compiled.body_parentid[body])]
        place = place * pin.SE3(_rotation(compiled.body_quat[body]), compiled.body_pos[body])
        first = int(compiled.body_jntadr[body])
        count = int(compiled.body_jntnum[body])
        for index in range(first, first + count):
            kind = compiled.jnt_type[index]
            unnamed = "_free" if kind == mjtJoint.mjJNT_FREE else f"Joint_{index - first}"
            # As Pinocchio names them
            title = compiled.joint(index).name or unused(bodies[body] + unnamed, joints)
            if kind == mjtJoint.mjJNT_BALL:
                raise RobotError(f"{path}: joint {title!r} is a ball joint, which is not supported")
            if kind == mjtJoint.mjJNT_FREE:
                if floating and index == 0:
                    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), title)
                    place = pin.SE3.Identity()
                continue
            joint, place = _add_joint(model, joint, place, compiled, index, title)
            if index < first + count - 1:  # the next joint of the body moves against this one
                name = unused(f"{bodies[body]}:{title}", frames)
                model.addFrame(pin.Frame(name, joint, place, pin.FrameType.BODY))
        carrier[body] = (joint, place)
        model.addFrame(pin.Frame(bodies[body], joint, place, pin.FrameType.BODY))
    return model, floating


def _add_joint(
    model: Any, parent: int, place: Any, compiled: Any, index: int, title: str
) -> tuple[int, Any]:
    """Add a joint that turns or slides: its index, and the pose of its body there."""
    import pinocchio as pin
    from mujoco import mjtJoint

    turns = compiled.jnt_type[index] == mjtJoint.mjJNT_HINGE
    axis, origin = compiled.jnt_axis[index], compiled.jnt_pos[index]
    zero = float(compiled.qpos0[compiled.jnt_qposadr[index]])  # where the file has it
    if turns:
        back = pin.SE3(pin.AngleAxis(-zero, axis).toRotationMatrix(), np.zeros(3))
    else:
        back = pin.SE3(np.eye(3), -zero * axis)
    if np.count_nonzero(axis) == 1 and axis.max() == 1.0:
        kinds = ("RX", "RY", "RZ") if turns else ("PX", "PY", "PZ")
        kind = getattr(pin, f"JointModel{kinds[int(axis.argmax())]}")()
    else:
        kind = (pin.JointModelRevoluteUnaligned if turns else pin.JointModelPrismaticUnaligned)(
            axis
        )
    limits = compiled.jnt_range[index] if compiled.jnt_limited[index] else (-np.inf, np.inf)
    place = place * pin.SE3(np.eye(3), origin) * back
    bounds = [np.array([float(each)]) for each in (np.inf, np.inf, *limits)]  # effort, speed, range
    joint = model.addJoint(parent, kind, place, title, *bounds)
    return joint, pin.SE3(np.eye(3), -origin)


def _body_names(compiled: Any) -> list[str]:
    """The names of all bodies, or ones that stand for them."""
    names = [compiled.body(body).name for body in range(compiled.nbody)]
    taken = set(names)
    return [name or unused(f"body{body}", taken) for body, name in enumerate(names)]


def unused(name: str, taken: set[str]) -> str:
    """A name that stands for none, with underscores after it if it is taken; from now on it is."""
    while name in taken:
        name += "_"
    taken.add(name)
    return name


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


def _shape(
    compiled: Any, geom: int, link: str, mesh: tuple[str, Array, Array] | None
) -> LinkShape | None:
    """A geom in its body's axes; None for planes, height fields and what is fixed to the world."""
    from mujoco import mjtGeom

    x, y, z = compiled.geom_size[geom].tolist()
    matrix, shift = np.eye(3), np.zeros(3)
    drawn: str | Array
    match mjtGeom(compiled.geom_type[geom]):
        case _ if compiled.geom_bodyid[geom] == 0:
            return None
        case _ if mesh is not None:
            drawn, matrix, shift = mesh
        case mjtGeom.mjGEOM_MESH:  # written in the file itself
            index = int(compiled.geom_dataid[geom])
            first, count = compiled.mesh_vertadr[index], compiled.mesh_vertnum[index]
            points = compiled.mesh_vert[first : first + count].astype(np.float64)
            first, count = compiled.mesh_faceadr[index], compiled.mesh_facenum[index]
            drawn = points[compiled.mesh_face[first : first + count]]
        case mjtGeom.mjGEOM_SPHERE:
            drawn = sphere(x)
        case mjtGeom.mjGEOM_ELLIPSOID:
            drawn = sphere(1.0) * (x, y, z)
        case mjtGeom.mjGEOM_CAPSULE:
            drawn = capsule(x, 2 * y)
        case mjtGeom.mjGEOM_CYLINDER:
            drawn = cylinder(x, 2 * y)
        case mjtGeom.mjGEOM_BOX:
            drawn = box(2 * x, 2 * y, 2 * z)
        case _:
            return None
    turn = _rotation(compiled.geom_quat[geom])
    place = turn @ shift + compiled.geom_pos[geom]
    return LinkShape(link, turn @ matrix, place, drawn)


def _opacity(compiled: Any, geom: int) -> float:
    colour, material = tuple(compiled.geom_rgba[geom].tolist()), int(compiled.geom_matid[geom])
    own = material < 0 or colour != UNCOLOURED
    return float(colour[3] if own else compiled.mat_rgba[material][3])


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
        if group < DRAWN_GROUPS and compiled.geom_bodyid[geom] and _opacity(compiled, geom) > 0:
            groups.setdefault(group, []).append(geom)
    colliding = {g: [_collides(compiled, geom) for geom in geoms] for g, geoms in groups.items()}
    decorated = any(not any(each) for each in colliding.values())
    return {
        geom
        for group, geoms in groups.items()
        if not (decorated and all(colliding[group]))
        for geom in geoms
    }
