"""The robot: read once by Pinocchio, then a table of joints."""

import os
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from noisemodel import catalog, mjcf, urdf
from noisemodel.errors import RobotError, RunError, UnknownJointError, UnknownRobotError
from noisemodel.joints import Joint, table_of
from noisemodel.mjcf import Mjcf
from noisemodel.run import Run, is_robot_file
from noisemodel.types import Array, Real
from noisemodel.urdf import Mimic

ROOT = "root_joint"
"""Pinocchio's name for the joint that makes a base float."""

PACKAGE_ROOT = "NOISE_PACKAGE_ROOT"
"""Environment variable with a folder that meshes may lie in besides the robot's own."""

PACKAGE = re.compile(rb"package:///?([^/\"'<>\s]+)/")
"""The package in the address of a mesh."""

BESIDE = ("meshes", "visual", "collision", "assets")
"""Folders beside that of a URDF or an MJCF that belong to it where no package says so."""


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot with its kinematics.

    Attributes:
        name: Its name in the list, or that of its file.
        path: The URDF or MJCF that it was read from.
        package_roots: Folders that ``package://`` addresses are searched in.
        model: Pinocchio's model; mimic joints are joints of their own in it.
        joints: All joints after the universe, in Pinocchio's order.
        nq: Length of a configuration.
        nv: Length of a velocity.
        floating_base: Whether the base moves freely.
        mimics: The joints that follow another one; empty where they are independent.
        mjcf: What an MJCF describes; None if the robot is from a URDF.
    """

    name: str
    path: Path
    package_roots: tuple[Path, ...]
    model: Any
    joints: tuple[Joint, ...]
    nq: int
    nv: int
    floating_base: bool
    mimics: Mapping[str, Mimic]
    mjcf: Mjcf | None = None

    @classmethod
    def load(
        cls,
        name: str | Path,
        *,
        floating_base: bool | None = None,
        mimic: bool = False,
        package_root: str | Path | None = None,
    ) -> Self:
        """Read a robot.

        Args:
            name: A listed name (see ``noisemodel.ROBOTS``), ``menagerie/NAME`` or
                ``menagerie/NAME/ENTRY`` for a robot of MuJoCo Menagerie, or the path of a URDF
                (``*.urdf``) or of an MJCF (``*.xml``).
            floating_base: Whether the base moves freely; unless given, as listed, False for a URDF
                of one's own, and as an MJCF has it.
            mimic: Whether joints that mimic another one follow it, and have no entry in q and v.
            package_root: A folder that meshes may lie in besides those of `package_roots`.

        Returns:
            The robot.

        Raises:
            UnknownRobotError: If there is neither such a name nor such a file.
            RobotError: If the URDF or MJCF cannot be read, or ``package_root`` is no folder.
        """
        listed = catalog.ROBOTS.get(str(name))
        path = locate(name)
        roots = package_roots(name if listed else path, package_root)
        description: urdf.Urdf | Mjcf
        if mjcf.is_mjcf(path):
            description = mjcf.read(path, roots, floating_base)
            model, floating_base = description.model, description.floating_base
        else:
            if floating_base is None:
                floating_base = listed is not None and listed.floating_base
            description = urdf.read(path)
            model = _model(path, floating_base)
        table = table_of(model)
        mimics = description.mimics if mimic else {}
        if mimic:
            table = _coupled(table, mimics, path)
        independent = [joint for joint in table if joint.name not in mimics]
        return cls(
            name=str(name) if catalog.is_name(str(name)) else path.stem,
            path=path,
            package_roots=roots,
            model=model,
            joints=table,
            nq=sum(joint.nq for joint in independent),
            nv=sum(joint.nv for joint in independent),
            floating_base=floating_base,
            mimics=mimics,
            mjcf=description if isinstance(description, Mjcf) else None,
        )

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The joints that a run can name: all of one degree of freedom that follow no other."""
        return tuple(
            joint.name for joint in self.joints if joint.nv == 1 and joint.name not in self.mimics
        )

    def configuration(self, run: Run) -> tuple[Array, Array]:
        """Order a run's motion as Pinocchio does, joint by joint, by name.

        Joints that are not in the log are assumed stationary in their neutral position, and so is a
        base of which the run has no pose. Columns of joints that follow another one are ignored.

        Args:
            run: A run with positions.

        Returns:
            Configurations q, shape (samples, nq), and velocities v, shape (samples, nv).

        Raises:
            UnknownJointError: If the run names a joint that the robot does not have.
            RunError: If the run has no positions.
        """
        if run.position is None:
            raise RunError(f"the run has no 'position'; {self.name!r} cannot be moved without")
        q = self._positions(run.joint_names, run.position)
        v = self._velocities(run.joint_names, run.velocity)
        if self.floating_base:
            if run.base_pose is not None:
                q[run.mask, :7] = run.base_pose[run.mask]
            if run.base_velocity is not None:
                v[:, :6] = run.base_velocity
        return q, v

    def desired(self, run: Run) -> tuple[Array, Array] | None:
        """Order a run's desired motion as Pinocchio does; its base is stationary.

        Args:
            run: A run with positions, measured or desired: without desired ones the joints are
                where they were measured.

        Returns:
            Configurations, shape (samples, nq), and velocities, shape (samples, nv); None where
            the run has no desired velocities.

        Raises:
            UnknownJointError: If the run names a joint that the robot does not have.
            RunError: If the run has no positions.
        """
        if run.velocity_desired is None:
            return None
        v = self._velocities(run.desired_joint_names, run.velocity_desired)
        if run.position_desired is None and run.position is not None:
            return self._positions(run.joint_names, run.position), v
        if run.position_desired is None:
            raise RunError(f"the run has no positions; {self.name!r} cannot be moved without")
        return self._positions(run.desired_joint_names, run.position_desired), v

    def _positions(self, names: tuple[str, ...], position: Real) -> Array:
        # Samples lie next to each other in memory, as batch kinematics reads them.
        q = np.tile(self.neutral[:, None], len(position))
        columns = np.ascontiguousarray(position.T)
        for column, joint in self._named(names):
            angle = columns[column]
            if joint.kind == "continuous":
                q[joint.first_q], q[joint.first_q + 1] = np.cos(angle), np.sin(angle)
            else:
                q[joint.first_q] = angle
        return q.T

    def _velocities(self, names: tuple[str, ...], velocity: Real) -> Array:
        v = np.zeros((self.nv, len(velocity)))
        columns = np.ascontiguousarray(velocity.T)
        for column, joint in self._named(names):
            v[joint.first_v] = columns[column]
        return v.T

    def _named(self, names: tuple[str, ...]) -> Iterator[tuple[int, Joint]]:
        """Go through the columns of joints that move by themselves."""
        by_name = {joint.name: joint for joint in self.joints if joint.nv == 1}
        for column, name in enumerate(names):
            if name not in by_name:
                raise UnknownJointError(name, self.name, self.joint_names)
            if name not in self.mimics:
                yield column, by_name[name]

    @property
    def neutral(self) -> Array:
        """The configuration in which every joint is at 0, shape (nq,)."""
        q = np.zeros(self.nq)
        for joint in self.joints:
            if joint.name not in self.mimics:
                if joint.kind == "floating":
                    q[joint.first_q + 6] = 1.0
                elif joint.kind == "continuous":
                    q[joint.first_q] = 1.0
                elif joint.kind == "planar":
                    q[joint.first_q + 2] = 1.0
        return q


def locate(name: str | Path) -> Path:
    """Find the URDF or MJCF of a robot that is given by its name or its path.

    Raises:
        UnknownRobotError: If there is neither such a name nor such a file.
        RobotError: If a robot of MuJoCo Menagerie cannot be had.
    """
    if str(name) in catalog.ROBOTS:
        return catalog.urdf_path(str(name))
    path = Path(name)
    with suppress(OSError, ValueError):  # no name that a file can have
        if path.is_file():
            return path
    if catalog.is_name(str(name)):
        return catalog.menagerie_path(str(name))
    if is_robot_file(str(name)):
        kind = "URDF" if path.suffix.lower() == ".urdf" else "MJCF"
        raise RobotError(f"{path}: there is no such {kind} file")
    raise UnknownRobotError(str(name), catalog.ROBOTS)


def package_roots(name: str | Path, package_root: str | Path | None = None) -> tuple[Path, ...]:
    """Folders that a robot's meshes are searched in, and outside of which none may lie.

    Of a file that is the nearest folder above it that a ``package://`` address in it names; else
    the nearest one with a package.xml; else the file's own folder and those of ``BESIDE``. The
    root of the disk, a home, and what contains a home are never among them.

    Args:
        name: A listed name, or the path of a URDF or an MJCF: where it lies among the listed
            robots, their folders are taken.
        package_root: A further folder; unless given, that of the environment variable
            ``NOISE_PACKAGE_ROOT``, if any.

    Raises:
        RobotError: If ``package_root`` is no folder, or the file cannot be read.
    """
    named = package_root or os.environ.get(PACKAGE_ROOT)
    further = () if not named else (Path(named).resolve(),)
    if further and not further[0].is_dir():
        raise RobotError(f"package root {named}: there is no such folder")
    if str(name) in catalog.ROBOTS:
        return (*further, *catalog.package_roots())
    path = Path(name).resolve()
    with suppress(RobotError):
        listed = catalog.package_roots()
        if path.is_relative_to(listed[-1].resolve()):
            return (*further, *listed)
    return (*further, *_own_roots(path))


def _own_roots(path: Path) -> tuple[Path, ...]:
    try:
        text = path.read_bytes() if path.stat().st_size <= urdf.MAX_BYTES else b""
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


def _model(path: Path, floating_base: bool) -> Any:
    import pinocchio

    root = (pinocchio.JointModelFreeFlyer(),) if floating_base else ()
    with kept_stderr() as messages:
        try:
            return pinocchio.buildModelFromUrdf(str(path), *root)
        except (ValueError, RuntimeError) as error:
            # The exception only states that the URDF is not valid; the reason went to stderr.
            reasons = re.findall(r"Error: +(.+)", messages()) or [str(error)]
            reason = " ".join(reasons[0].split())
            raise RobotError(f"{path}: Pinocchio cannot read the URDF ({reason})") from error


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
    for joint in table:
        if joint.name in mimics:
            leader, multiplier, offset = _leader(joint.name, mimics, path)
            if leader not in placed:
                raise RobotError(
                    f"{path}: joint {joint.name!r} mimics {leader!r}, which is missing"
                )
            if "continuous" in (joint.kind, placed[leader].kind):
                raise RobotError(
                    f"{path}: joint {joint.name!r} mimics {leader!r}; continuous joints cannot"
                )
            placed[joint.name] = replace(
                joint,
                first_q=placed[leader].first_q,
                first_v=placed[leader].first_v,
                multiplier=multiplier,
                offset=offset,
            )
    return tuple(placed[joint.name] for joint in table)


def _leader(name: str, mimics: Mapping[str, Mimic], path: Path) -> tuple[str, float, float]:
    """Follow a chain of mimic joints to the joint that moves by itself."""
    multiplier, offset = 1.0, 0.0
    for _ in range(len(mimics) + 1):
        if name not in mimics:
            return name, multiplier, offset
        mimic = mimics[name]
        multiplier, offset = multiplier * mimic.multiplier, multiplier * mimic.offset + offset
        name = mimic.joint
    raise RobotError(f"{path}: joint {name!r} mimics itself")


@contextmanager
def kept_stderr() -> Iterator[Callable[[], str]]:
    """Keep what the process writes to file descriptor 2 while the block runs.

    Yields:
        A function that returns what was written so far.
    """
    with tempfile.TemporaryFile() as kept:
        terminal = os.dup(2)
        os.dup2(kept.fileno(), 2)
        try:
            yield lambda: os.pread(kept.fileno(), 2**16, 0).decode(errors="replace")
        finally:
            os.dup2(terminal, 2)
            os.close(terminal)
