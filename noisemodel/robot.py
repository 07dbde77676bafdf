"""The robot: read once by Pinocchio, then a table of joints, and the twists of its links."""

import os
import re
import tempfile
import tomllib
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import chain
from math import inf, isfinite
from pathlib import Path
from types import MappingProxyType
from typing import Any, Self

import numpy as np

from noisemodel import mjcf, urdf
from noisemodel.files import MAX_BYTES
from noisemodel.mjcf import Mjcf
from noisemodel.run import Run, is_robot_file
from noisemodel.types import (
    Array,
    NoiseModelError,
    Real,
    RobotError,
    RunError,
    UnknownJointError,
    UnknownRobotError,
)
from noisemodel.urdf import Mimic

MENAGERIE = "menagerie/"  # the names of MuJoCo Menagerie's robots begin so: menagerie/unitree_go2
PACKAGE_ROOT = "NOISE_PACKAGE_ROOT"  # environment variable: a further folder of meshes
PACKAGE = re.compile(
    rb"(?:package|model):///?([^/\"'<>\s]+)/"
)  # the package in the address of a mesh
# Folders beside a URDF's or MJCF's own that belong to the robot if no package says so.
BESIDE = ("meshes", "visual", "collision", "assets")
# Pinocchio's joint types by what they do; a URDF has no others.
KINDS = {
    r"R[XYZ]|RevoluteUnaligned": "revolute",
    r"RUB[XYZ]|RevoluteUnboundedUnaligned": "continuous",
    r"P[XYZ]|PrismaticUnaligned": "prismatic",
    "FreeFlyer": "floating",
    "Planar": "planar",
}
SINGLE = ("revolute", "continuous", "prismatic")  # the types of joints that a run can name
CHUNK = 4096  # samples worked on at once: few enough for the cache, with little overhead of Python


@dataclass(frozen=True)
class Listed:
    """A robot of the list."""

    urdf: str  # path below the robots' folder of example-robot-data
    floating_base: bool = False  # whether it moves freely in space


_tables = tomllib.loads(Path(__file__).with_name("robots.toml").read_text())
_paths = {(name, base): path for base, table in _tables.items() for name, path in table.items()}

# The listed robots by name.
ROBOTS: Mapping[str, Listed] = MappingProxyType(
    {name: Listed(path, base == "floating") for (name, base), path in sorted(_paths.items())}
)


@dataclass(frozen=True)
class Joint:
    """How one joint moves its link."""

    name: str
    kind: str  # one of the values of `KINDS`
    parent: int  # index of the joint that carries it; 0 is the universe
    first_q: int  # index of its first entry in the configuration
    first_v: int  # index of its first entry in the velocity
    axis: int  # index of the coordinate axis that it moves about or along, after ``turn``
    # Rotation from the joint's axes to axes of which one is the joint's own, shape (3, 3), or None
    # where that is so already.
    turn: Array | None
    shift: Array  # twist of the parent to twist of the resting joint, in those axes, shape (6, 6)
    multiplier: float = 1.0  # of a mimic joint: ratio to the joint that ``first_q`` belongs to
    offset: float = 0.0  # of a mimic joint: added to the position, in [rad] or [m]

    @property
    def nq(self) -> int:
        """Entries in the configuration."""
        return {"floating": 7, "planar": 4, "continuous": 2}.get(self.kind, 1)

    @property
    def nv(self) -> int:
        """Entries in the velocity."""
        return {"floating": 6, "planar": 3}.get(self.kind, 1)

    @property
    def moves(self) -> slice | list[int]:
        """The entries of the twist that its velocity adds to."""
        if self.kind == "planar":
            return [0, 1, 5]
        first = {"floating": 0, "prismatic": self.axis}.get(self.kind, 3 + self.axis)
        return slice(first, first + self.nv)  # adds in place, which a list does not

    @property
    def subspace(self) -> Array:
        """The matrix S, shape (6, nv): the link's twist, in the joint's axes, at unit velocities.

        (v_rel, w_rel) = S qdot is the motion that a joint adds to its link.
        """
        own = np.zeros((6, self.nv))
        own[self.moves] = np.eye(self.nv)
        if self.turn is not None:
            own = np.vstack((self.turn.T @ own[:3], self.turn.T @ own[3:]))
        return self.multiplier * own

    @property
    def turning_axis(self) -> Array | None:
        """The axis that the link turns about, of length 1 or 0 where the joint only slides.

        None where it turns about any axis.
        """
        if self.kind == "floating":
            return None
        axis = self.subspace[3:, -1]
        return axis / max(float(np.linalg.norm(axis)), np.finfo(np.float64).tiny)


def table_of(model: Any) -> tuple[Joint, ...]:
    """Read the joints of a Pinocchio model, the universe left out."""
    return tuple(_joint(model, index) for index in range(1, model.njoints))


def _joint(model: Any, index: int) -> Joint:
    joint, placement = model.joints[index], model.jointPlacements[index]
    kind = joint.shortname().removeprefix("JointModel")
    matches = [word for pattern, word in KINDS.items() if re.fullmatch(pattern, kind)]
    if not matches:
        raise RobotError(f"joint {model.names[index]!r} is of type {kind}, which is not supported")
    turn, rotation = None, placement.rotation.T
    if kind.endswith("Unaligned"):
        subspace = np.ravel(joint.createData().S)  # the joint's twist at unit velocity
        z = subspace[:3] + subspace[3:]
        z /= np.linalg.norm(z)
        x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
        x /= np.linalg.norm(x)
        turn = np.stack((x, np.cross(z, x), z))
        rotation = turn @ rotation
    x, y, z = placement.translation
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return Joint(
        name=str(model.names[index]),
        kind=matches[0],
        parent=int(model.parents[index]),
        first_q=int(joint.idx_q),
        first_v=int(joint.idx_v),
        axis="XYZ".find(kind[-1]) if kind[-1] in "XYZ" else 2,
        turn=turn,
        # v' = R (v + w x t), w' = R w
        shift=np.block([[rotation, -rotation @ cross], [np.zeros((3, 3)), rotation]]),
    )


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot with its kinematics."""

    name: str  #: its name in the list, or its file's
    path: Path  #: the URDF or MJCF that it was read from
    package_roots: tuple[Path, ...]  #: folders that ``package://`` addresses are searched in
    model: Any  #: Pinocchio's; mimic joints are joints of their own in it
    joints: tuple[Joint, ...]  #: all after the universe, in Pinocchio's order
    nq: int  #: length of a configuration
    nv: int  #: length of a velocity
    floating_base: bool  #: whether the base moves freely
    mimics: Mapping[str, Mimic]  #: joints that follow another one; empty if they are independent
    mjcf: Mjcf | None = None  #: what an MJCF describes; None if the robot is from a URDF

    @classmethod
    def load(
        cls,
        name: str | Path,
        *,
        floating_base: bool | None = None,
        mimic: bool = False,
        apart: Collection[str] = (),
        package_root: str | Path | None = None,
    ) -> Self:
        """Read a robot; a RobotError if it is not known or cannot be read.

        Args:
            name: A listed name (see ``noisemodel.ROBOTS``), ``menagerie/NAME`` or
                ``menagerie/NAME/ENTRY`` for a robot of MuJoCo Menagerie, or the path of a URDF
                (``*.urdf``) or of an MJCF (``*.xml``).
            floating_base: Whether the base moves freely; unless given, as listed, False for a URDF
                of its own, and as an MJCF has it.
            mimic: Whether joints that mimic another one follow it, and have no entry in q and v.
            apart: Names of joints that do not follow all the same.
            package_root: A further folder that meshes may lie in, see `package_roots`.
        """
        listed = ROBOTS.get(str(name))
        path = locate(name)
        roots = package_roots(name if listed else path, package_root)
        description: Mjcf | None = None
        if mjcf.is_mjcf(path):
            description = mjcf.read(path, roots, floating_base)
            model, floating_base = description.model, description.floating_base
            mimics = description.mimics
        else:
            if floating_base is None:
                floating_base = listed is not None and listed.floating_base
            root = urdf.checked(path)
            mimics = urdf.mimics(path, root)
            names = {joint.get("name", "") for joint in root.findall("joint")}
            model = _model(path, mjcf.unused("root_joint", names) if floating_base else None)
        table = table_of(model)
        mimics = {name: each for name, each in mimics.items() if mimic and name not in apart}
        if mimics:
            table = _coupled(table, mimics, path)
        own = [joint for joint in table if joint.name not in mimics]
        nq, nv = sum(joint.nq for joint in own), sum(joint.nv for joint in own)
        title = str(name) if is_name(str(name)) else path.stem
        return cls(title, path, roots, model, table, nq, nv, floating_base, mimics, description)

    @classmethod
    def of(cls, run: Run) -> Self:
        """Read the robot of a run; errors are those of `load`, and a RunError if it names none.

        Its base floats if the run has a pose or a velocity of it. Joints that mimic another one
        follow it where the run does not have them, unless one of them cannot.
        """
        if run.robot is None:
            raise RunError("the run names no robot; `inspector import --robot` adds one")
        floats = run.base_pose is not None or run.base_velocity is not None or None
        apart = {*run.joint_names, *run.desired_joint_names}
        try:
            return cls.load(run.robot, floating_base=floats, mimic=True, apart=apart)
        except RobotError:
            return cls.load(run.robot, floating_base=floats)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The joints that a run can name: all of one degree of freedom that follow no other."""
        return tuple(
            joint.name for joint in self.joints if joint.nv == 1 and joint.name not in self.mimics
        )

    def configuration(self, run: Run) -> tuple[Array, Array]:
        """Order a run's motion as Pinocchio does, joint by joint, by name: q and v.

        Joints that are not in the log are assumed stationary in their neutral position, and so is a
        base of which the run has no pose. Columns of joints that follow another one are ignored.

        Raises:
            UnknownJointError: If the run names a joint that the robot does not have.
            RunError: If the run has no positions.
        """
        if run.position is None:
            raise RunError(f"the run has no 'position'; {self.name!r} cannot be moved without")
        q = self._positions((run.joint_names, run.position))
        v = self._velocities(run.joint_names, run.velocity)
        if self.floating_base:
            if run.base_pose is not None:
                q[run.mask, :7] = run.base_pose[run.mask]
            if run.base_velocity is not None:
                v[:, :6] = run.base_velocity
        return q, v

    def desired(self, run: Run) -> tuple[Array, Array] | None:
        """Order a run's desired motion as Pinocchio does, q and v; its base is stationary.

        Joints without desired positions are where they were measured. It is None where the run has
        no desired velocities; errors are those of `configuration`.
        """
        if run.velocity_desired is None:
            return None
        if run.position is None and run.position_desired is None:
            raise RunError(f"the run has no positions; {self.name!r} cannot be moved without")
        wanted = (run.desired_joint_names, run.position_desired)
        q = self._positions((run.joint_names, run.position), wanted)
        return q, self._velocities(run.desired_joint_names, run.velocity_desired)

    def _positions(self, *known: tuple[tuple[str, ...], Real | None]) -> Array:
        """Configurations of positions that are known by name, the last ones first."""
        given = [(names, position) for names, position in known if position is not None]
        # Samples lie next to each other in memory, as batch kinematics reads them.
        q = np.tile(self.neutral[:, None], len(given[0][1]))
        for joint, angle in chain.from_iterable(self._named(*each) for each in given):
            if joint.kind == "continuous":
                q[joint.first_q], q[joint.first_q + 1] = np.cos(angle), np.sin(angle)
            else:
                q[joint.first_q] = angle
        return q.T

    def _velocities(self, names: tuple[str, ...], velocity: Real) -> Array:
        v = np.zeros((self.nv, len(velocity)))
        for joint, rate in self._named(names, velocity):
            v[joint.first_v] = rate
        return v.T

    def _named(self, names: tuple[str, ...], signal: Real) -> Iterator[tuple[Joint, Real]]:
        """Joints that move by themselves, each with its column of a signal."""
        by_name = {joint.name: joint for joint in self.joints if joint.nv == 1}
        for name, column in zip(names, np.ascontiguousarray(signal.T), strict=True):
            if name not in by_name:
                raise UnknownJointError(name, self.name, self.joint_names)
            if name not in self.mimics:
                yield by_name[name], column

    @property
    def neutral(self) -> Array:
        """The configuration in which every joint is at 0, shape (nq,)."""
        one = {"floating": 6, "continuous": 0, "planar": 2}  # scalar of a quaternion, or cosine
        q = np.zeros(self.nq)
        for joint in self.joints:
            if joint.name not in self.mimics and joint.kind in one:
                q[joint.first_q + one[joint.kind]] = 1.0
        return q


def locate(name: str | Path) -> Path:
    """Find the URDF or MJCF of a robot that is given by its name or its path."""
    if str(name) in ROBOTS:
        return listed_folders()[-1] / ROBOTS[str(name)].urdf
    path = Path(name)
    with suppress(OSError, ValueError):  # no name that a file can have
        if path.is_file():
            return path
    if is_name(str(name)):
        return menagerie_path(str(name))
    if is_robot_file(str(name)):
        kind = "URDF" if path.suffix.lower() == ".urdf" else "MJCF"
        raise RobotError(f"{path}: there is no such {kind} file")
    raise UnknownRobotError(str(name), ROBOTS)


def package_roots(name: str | Path, package_root: str | Path | None = None) -> tuple[Path, ...]:
    """Folders that a robot's meshes are searched in, and outside of which none may lie.

    For a file that is not listed it is the nearest folder above that a ``package://`` address in it
    names; else the nearest one with a package.xml; else its own and those of ``BESIDE``; never the
    root of the disk or a home. ``package_root``, or ``NOISE_PACKAGE_ROOT``, adds one.
    """
    named = package_root or os.environ.get(PACKAGE_ROOT)
    further = () if not named else (Path(named).resolve(),)
    if further and not further[0].is_dir():
        raise RobotError(f"package root {named}: there is no such folder")
    if str(name) in ROBOTS:
        return (*further, *listed_folders())
    path = Path(name).resolve()
    with suppress(RobotError):
        listed = listed_folders()
        if path.is_relative_to(listed[-1].resolve()):
            return (*further, *listed)
    return (*further, *_own_roots(path))


def _own_roots(path: Path) -> tuple[Path, ...]:
    try:
        text = path.read_bytes() if path.stat().st_size <= MAX_BYTES else b""
        packages = set(PACKAGE.findall(text))
    except OSError as error:
        raise RobotError(f"{path}: cannot be read ({error.strerror})") from error
    above = [folder for folder in path.parents if not _is_wide(folder)]
    with_xml = [folder for folder in above if (folder / "package.xml").is_file()]
    # /usr and the like have no name that a file may choose
    named = [folder for folder in above if len(folder.parts) > 2 or folder in with_xml]
    nearest = (next((f for f in named if os.fsencode(f.name) == each), None) for each in packages)
    if found := sorted({folder for folder in nearest if folder is not None}):
        return tuple(found)
    if with_xml:
        return (with_xml[0],)
    own = path.parent
    beside = [folder / each for folder in (own.parent, own) for each in BESIDE]
    return (*(() if _is_wide(own) else (own,)), *(each for each in beside if each.is_dir()))


def _is_wide(folder: Path) -> bool:
    """Whether a folder is the root of a disk, a home, or contains one."""
    homes = [Path("/root"), Path("/home/x"), Path("/Users/x")]
    with suppress(RuntimeError):  # the user has no home
        homes.append(Path.home().resolve())
    a_home = folder.parent in (Path("/home"), Path("/Users"))
    return a_home or any(home.is_relative_to(folder) for home in homes)


def _model(path: Path, floating: str | None) -> Any:
    """Read a URDF with Pinocchio, whose words on file descriptor 2 become the error's.

    The base floats by a joint of the name ``floating``, or is fixed if that is None.
    """
    import pinocchio

    root = () if floating is None else (pinocchio.JointModelFreeFlyer(), floating)
    with tempfile.TemporaryFile() as kept:
        terminal = os.dup(2)
        os.dup2(kept.fileno(), 2)
        try:
            return pinocchio.buildModelFromUrdf(str(path), *root)
        except (ValueError, RuntimeError) as error:
            # The exception only states that the URDF is not valid; the reason went to stderr.
            said = os.pread(kept.fileno(), 2**16, 0).decode(errors="replace")
            reasons = re.findall(r"Error: +(.+)", said) or [str(error)]
            reason = " ".join(reasons[0].split())
            raise RobotError(f"{path}: Pinocchio cannot read the URDF ({reason})") from error
        finally:
            os.dup2(terminal, 2)
            os.close(terminal)


def _coupled(
    table: tuple[Joint, ...], mimics: Mapping[str, Mimic], path: Path
) -> tuple[Joint, ...]:
    """Let mimic joints follow, and close the gaps that they leave in q and v."""
    placed: dict[str, Joint] = {}
    first_q = first_v = 0
    for joint in table:
        if joint.name not in mimics:
            placed[joint.name] = replace(joint, first_q=first_q, first_v=first_v)
            first_q, first_v = first_q + joint.nq, first_v + joint.nv
    for joint in (each for each in table if each.name in mimics):
        leader, multiplier, offset = joint.name, 1.0, 0.0
        for _ in range(len(mimics) + 1):  # a chain of joints that follow each other
            if leader in mimics:
                mimic = mimics[leader]
                offset += multiplier * mimic.offset
                leader, multiplier = mimic.joint, multiplier * mimic.multiplier
        about = f"{path}: joint {joint.name!r} mimics {leader!r}"
        if leader in mimics:
            raise RobotError(f"{path}: joint {joint.name!r} mimics itself")
        if leader not in placed:
            raise RobotError(f"{about}, which is missing")
        first = placed[leader]
        if "continuous" in (joint.kind, first.kind):
            raise RobotError(f"{about}; continuous joints cannot")
        q, v = first.first_q, first.first_v
        placed[joint.name] = replace(
            joint, first_q=q, first_v=v, multiplier=multiplier, offset=offset
        )
    return tuple(placed[joint.name] for joint in table)


def listed_folders() -> tuple[Path, ...]:
    """Folders that the listed robots' ``package://`` addresses are searched in."""
    from importlib.metadata import PackageNotFoundError, distribution  # slow

    try:
        share = Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share")))
    except PackageNotFoundError as error:
        raise RobotError(
            "the listed robots need example-robot-data; `pip install example-robot-data`"
        ) from error
    data = share / "example-robot-data"
    return share, data, data / "robots"


def is_name(name: str) -> bool:
    """Whether a text is a listed robot, or names one of MuJoCo Menagerie."""
    return name in ROBOTS or (name.startswith(MENAGERIE) and not is_robot_file(name))


def menagerie_names() -> dict[str, str]:
    """The robots of MuJoCo Menagerie, each with what it is; none without the package."""
    try:
        import mujoco_menagerie
    except ImportError:
        return {}
    return {MENAGERIE + robot.name: robot.category for robot in mujoco_menagerie.robots()}


def menagerie_path(name: str) -> Path:
    """Find the MJCF of a robot of MuJoCo Menagerie; the package downloads it at its first use."""
    try:
        import mujoco_menagerie
    except ImportError as error:
        raise RobotError(
            f"{name}: the robots of MuJoCo Menagerie need its package;"
            " `pip install 'noise-inspector[menagerie]'`"
        ) from error
    folder, _, entry = name.removeprefix(MENAGERIE).partition("/")
    if MENAGERIE + folder not in menagerie_names():
        raise UnknownRobotError(name, menagerie_names())
    robot = mujoco_menagerie.get(folder)
    try:
        return Path(robot.xml(entry or robot.default_model))
    except mujoco_menagerie.DownloadError as error:
        raise RobotError(
            f"{name}: cannot be downloaded ({' '.join(str(error).split())});"
            " MENAGERIE_ROOT=path names a checkout to use instead"
        ) from error
    except (mujoco_menagerie.MenagerieError, OSError) as error:
        raise RobotError(f"{name}: {' '.join(str(error).split())}") from error


@dataclass(frozen=True)
class Limits:
    """Lowest and highest position of a joint in [rad] or [m], and speed; infinite if not known."""

    lower: float = -inf
    upper: float = inf
    velocity: float = inf
    turns: bool = True

    @property
    def centre(self) -> float:
        """Middle of the range, 0 without one, in [rad] or [m]."""
        return (self.lower + self.upper) / 2 if isfinite(self.upper - self.lower) else 0.0


def joint_limits(name: str | Path) -> Mapping[str, Limits]:
    """Limits of the joints that a run can name, by name, in the order of the robot's file."""
    path = locate(name)
    return _limits_in(str(name), path, path.stat().st_mtime_ns if path.is_file() else 0)


@lru_cache(maxsize=32)
def _limits_in(name: str, path: Path, _modified: int) -> Mapping[str, Limits]:
    if path.suffix.lower() != ".urdf":
        return MappingProxyType(limits_of(Robot.load(name)))
    found = {}  # without Pinocchio, which takes long to import
    for joint in urdf.checked(path).findall("joint"):
        if (kind := joint.get("type", "")) in SINGLE:
            limit = joint.find("limit")
            known = {} if limit is None else limit.attrib
            numbers = []
            for each, default in (("lower", 0.0), ("upper", 0.0), ("velocity", inf)):
                try:
                    number = float(known.get(each, default))
                except ValueError:
                    number = default
                numbers.append(number if isfinite(number) else default)
            found[joint.get("name", "")] = _limits(kind, *numbers)
    return MappingProxyType(found)


def limits_of(robot: Robot) -> dict[str, Limits]:
    """Limits of a robot's joints as Pinocchio has read them, by name."""
    model, found = robot.model, {}
    for joint in robot.joints:
        if joint.kind in SINGLE:
            index = model.getJointId(joint.name)  # followers have places of their own there
            q, v = model.idx_qs[index], model.idx_vs[index]
            lower, upper = model.lowerPositionLimit[q], model.upperPositionLimit[q]
            speed = float(model.velocityLimit[v])
            found[joint.name] = _limits(joint.kind, float(lower), float(upper), speed)
    return found


def _limits(kind: str, lower: float, upper: float, velocity: float) -> Limits:
    """Limits without those that are none: an empty range, or no speed at all."""
    if kind == "continuous" or not lower < upper or max(abs(lower), abs(upper)) > 1e6:
        lower, upper = -inf, inf
    return Limits(lower, upper, velocity if 0 < velocity < 1e6 else inf, kind != "prismatic")


# Twists of all links, all samples at once.


def link_twists(robot: Robot, q: Real, v: Real) -> Array:
    """Compute the twist of every link, in every sample.

    Args:
        robot: The robot.
        q: Configurations as Pinocchio has them, shape (samples, nq).
        v: Velocities as Pinocchio has them, shape (samples, nv).

    Returns:
        Linear, then angular velocity of each joint's frame in its own axes, the universe first,
        as Pinocchio's ``data.v``, shape (samples, njoints, 6), in [m/s] and [rad/s]. In memory
        the samples lie next to each other.
    """
    for name, array, width in (("q", q, robot.nq), ("v", v, robot.nv)):
        if array.shape != (len(q), width):
            raise NoiseModelError(f"{name} has shape {array.shape}, expected ({len(q)}, {width})")
    twists = np.empty((len(robot.joints) + 1, 6, len(q)))
    for start in range(0, len(q), CHUNK):
        part = slice(start, start + CHUNK)
        chunk_twists(robot.joints, q[part], v[part], out=twists[:, :, part])
    return twists.transpose(2, 0, 1)


def chunk_twists(joints: Sequence[Joint], q: Real, v: Real, *, out: Array) -> None:
    """Link twists of a few thousand samples, into ``out`` of shape (njoints, 6, samples)."""
    positions, velocities = (np.ascontiguousarray(a.T, dtype=np.float64) for a in (q, v))
    out[0] = 0.0  # the universe rests
    for index, joint in enumerate(joints, start=1):
        position = positions[joint.first_q : joint.first_q + joint.nq]
        velocity = velocities[joint.first_v : joint.first_v + joint.nv]
        if joint.multiplier != 1.0 or joint.offset != 0.0:
            position = joint.multiplier * position + joint.offset
            velocity = joint.multiplier * velocity
        twist = out[index]
        if joint.parent:
            np.matmul(joint.shift, out[joint.parent], out=twist)
            _carry(joint, twist, position)
        else:
            twist[:] = 0.0
        twist[joint.moves] += velocity
        if joint.turn is not None:
            twist[:3] = joint.turn.T @ twist[:3]
            twist[3:] = joint.turn.T @ twist[3:]


def _carry(joint: Joint, twist: Array, position: Array) -> None:
    """From the twist that a parent gives the resting joint to the joint as it stands.

    It works in place: copies of these arrays would cost as much as the sums.
    """
    left, right = (joint.axis + 1) % 3, (joint.axis + 2) % 3
    match joint.kind:
        case "revolute":
            tangent = np.tan(0.5 * position[0])  # takes less time than a sine and a cosine
            double = 2.0 / (1.0 + tangent * tangent)
            _turn(joint.axis, twist, double - 1.0, double * tangent)
        case "continuous":
            _turn(joint.axis, twist, *(position / np.hypot(*position)))
        case "prismatic":
            twist[left] += twist[3 + right] * position[0]  # v' = v + w x (axis q)
            twist[right] -= twist[3 + left] * position[0]
        case "planar":
            x, y, cosine, sine = position
            twist[0] -= twist[5] * y  # v' = v + w x (x, y, 0)
            twist[1] += twist[5] * x
            twist[2] += twist[3] * y - twist[4] * x
            _turn(joint.axis, twist, cosine, sine)
        case "floating":
            origin, vector, scalar = position[:3], position[3:6], position[6]
            twist[:3] += np.cross(twist[3:], origin, axis=0)
            for part in (twist[:3], twist[3:]):  # R(q)^T part
                across = 2 * np.cross(part, vector, axis=0)
                part += scalar * across + np.cross(across, vector, axis=0)


def _turn(axis: int, twist: Array, cosine: Array, sine: Array) -> None:
    """See a twist from axes that are turned about one of them."""
    left, right = twist[(axis + 1) % 3 :: 3], twist[(axis + 2) % 3 :: 3]
    ahead, back = sine * right, sine * left
    left *= cosine
    left += ahead
    right *= cosine
    right -= back
