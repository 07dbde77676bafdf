"""A run file or any log, opened as a run in memory: what all commands read their inputs by."""

import hashlib
import os
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from os import walk
from pathlib import Path

from inspector.errors import InspectorError, LogError
from inspector.logs.formats import is_one_log
from inspector.logs.importing import Imported
from inspector.logs.log import Progress, without_progress
from inspector.logs.options import ReadOptions
from inspector.logs.reading import jobs_of
from inspector.logs.signals import BASE_SIGNALS, JOINT_SIGNALS, listed
from inspector.text import printable
from inspector.wrongrobot import check_joints, named
from noisemodel import NoiseModelError, Run, RunFileError, archive
from noisemodel.atomic import also_reading
from noisemodel.checks import NotUniformError
from noisemodel.limits import joint_limits
from noisemodel.types import Real

SUFFIXES = frozenset(
    (".npz", ".csv", ".tsv", ".log", ".parquet", ".h5", ".hdf5", ".mcap", ".bag", ".db3")
)
"""The files of a folder that are taken for logs; others are read if they are named."""


@dataclass(frozen=True)
class Reading:
    """How logs are opened.

    Attributes:
        options: How to read what is no run file; its robot is taken for run files too.
        desired: Another log, with the desired motion; for a single log.
        episodes: The episodes to take of a data set, all unless given.
        without_robot: Whether a run is taken without the robot that it names.
    """

    options: ReadOptions = field(default_factory=ReadOptions)
    desired: Path | None = None
    episodes: tuple[str, ...] = ()
    without_robot: bool = False


@dataclass(frozen=True)
class Source:
    """A run that is not read yet: a file, or an episode of a data set.

    Attributes:
        path: The file, or the folder of a bag or data set.
        episode: The episode, empty for a log without episodes.
    """

    path: Path
    episode: str = ""

    @property
    def shown(self) -> Path:
        """The path, with the episode as its last part, in characters that can be printed."""
        return Path(printable(str(self.path / self.episode if self.episode else self.path)))


@dataclass(frozen=True, eq=False)
class Opened:
    """A run, and what was assumed when its log was read.

    Attributes:
        run: The run.
        assumed: Joints, units, rate and robot, and all that was decided, in one line; empty for a
            run file that names its joints.
        source: Where it is from.
    """

    run: Run
    assumed: str
    source: Source

    @property
    def sha256(self) -> str:
        """SHA-256 of its file; of a folder or an episode that of the run's velocities."""
        if self.source.episode or not self.source.path.is_file():
            return hashlib.sha256(self.run.velocity.tobytes()).hexdigest()
        with self.source.path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()


def open_run(
    path: str | Path, reading: Reading | None = None, *, progress: Progress = without_progress
) -> Opened:
    """Open a run file or a log that is a single run.

    Args:
        path: A run file, any log that `inspector import` reads, or a folder with one of them.
        reading: How to read it.
        progress: Wraps what is read, to show how much is done.

    Returns:
        The run, and what was assumed.

    Raises:
        InspectorError: If it cannot be read, or holds several runs.
        NoiseModelError: If it makes no run.
    """
    reading = reading or Reading()
    found, _ = sources([Path(path)], reading)
    if len(found) != 1:
        what = "episodes" if any(each.episode for each in found) else "logs"
        names = listed([each.episode or each.path.name for each in found])
        named = f"name what to open, such as {found[0].path}"
        how = "choose one (--episode)" if what == "episodes" else named
        raise LogError(Path(path), f"holds {len(found)} {what} ({names}); {how}")
    return open_source(found[0], reading, progress=progress)


def open_source(
    source: Source, reading: Reading | None = None, *, progress: Progress = without_progress
) -> Opened:
    """Open what `sources` found.

    Raises:
        InspectorError: If it cannot be read.
        NoiseModelError: If it makes no run.
    """
    reading = reading or Reading()
    if printable(str(source.path)) != str(source.path):
        raise LogError(source.shown, "its name has control characters; rename it")
    run = _run_file(source.path, reading)
    if run is None:
        (job,) = jobs_of(
            source.path,
            reading.options,
            desired=reading.desired,
            episodes=[source.episode] if source.episode else None,
            progress=progress,
        )
        imported = job.read()
        return Opened(imported.run, assumed(imported, source.path), source)
    robot = reading.options.robot
    if robot:
        joint_limits(robot)  # a name that a run names may be any, one that a user types may not
    if robot or reading.without_robot:
        run = replace(run, robot=robot or None)
    by_robot = named(run)
    if by_robot is run:
        return Opened(run, "", source)
    return Opened(by_robot, f"joints are not named: taken for {_listed(by_robot)}", source)


def sources(
    paths: Sequence[Path], reading: Reading | None = None
) -> tuple[tuple[Source, ...], tuple[Path, ...]]:
    """List the runs in files, data sets and folders of them, however deep.

    Hidden files are left out. What cannot be read is listed too: `open_source` says why.

    Args:
        paths: Files, and folders.
        reading: How to read them.

    Returns:
        The runs, each once, in the order of the paths, those of a folder by name; and the files of
        folders that are not taken for logs.

    Raises:
        InspectorError: If a folder holds no log, or a desired log is named for several.
    """
    reading = reading or Reading()
    found: list[Source] = []
    others: list[Path] = []
    seen: set[str] = set()
    for path in paths:
        logs, rest = logs_in(path)
        others += rest
        new = [log for log in logs if os.path.realpath(log) not in seen]  # may link to itself
        seen.update(map(os.path.realpath, new))
        also_reading(new)
        found += (each for log in new for each in _episodes(log, reading))
    if reading.desired and len(found) > 1:
        raise InspectorError(
            f"{reading.desired}: belongs to one log, {len(found)} are given (--desired)"
        )
    return tuple(found), tuple(others)


def logs_in(path: Path) -> tuple[tuple[Path, ...], tuple[Path, ...]]:
    """List the logs of a folder and of the folders in it, and its other files.

    Args:
        path: A folder; a file, a bag or a data set is one log.

    Raises:
        LogError: If the folder holds no log.
    """
    if not path.is_dir() or is_one_log(path):
        return (path,), ()
    logs: list[Path] = []
    others: list[Path] = []
    for name, folders, files in walk(path):
        here = Path(name)
        folders[:] = sorted(
            each
            for each in folders
            # The levels of accepted runs are no logs.
            if not each.startswith(".") and not os.path.lexists(here / each / "reference.toml")
        )
        one = [each for each in folders if is_one_log(here / each)]
        folders[:] = [each for each in folders if each not in one]
        logs += [here / each for each in one]
        for each in sorted(each for each in files if not each.startswith(".")):
            (logs if Path(each).suffix.lower() in SUFFIXES else others).append(here / each)
    if not logs:
        raise LogError(path, f"a folder without logs ({', '.join(sorted(SUFFIXES))})")
    return tuple(sorted(logs)), tuple(others)


def left_out(others: Sequence[Path]) -> str:
    """Say which files of folders are not taken for logs; empty if there are none."""
    if not others:
        return ""
    plural = "" if len(others) == 1 else "s"
    names = [printable(each.name) for each in others]
    return f"{len(others)} other file{plural} left out: {listed(names)}"


def assumed(imported: Imported, path: Path) -> str:
    """Say in one line what was assumed when a log was read.

    Args:
        imported: The run, and what was decided.
        path: The log.
    """
    run = imported.run
    units = str(run.meta.get("units") or "radians")
    decided = any("degrees" in remark for remark in imported.remarks)
    lacking = check_joints(run.joint_names, run.robot)
    others = "other " if any(": converted from" in each for each in imported.remarks) else ""
    parts = [
        _joints(run),
        *([] if decided else [f"{others}angles taken for {units}"]),
        f"{run.rate:g} Hz",
        f"robot {run.robot}" if run.robot else "no robot (--robot NAME)",
        *([f"not in the log, assumed stationary: {listed(lacking)}"] if lacking else []),
        *(["the log describes its robot, which `import` keeps"] if imported.urdf else []),
        *(
            remark.removeprefix(f"{path.name}: ")
            for remark in imported.remarks
            if not remark.startswith("time starts at 0")  # says where `import` keeps it
        ),
    ]
    return "; ".join(" ".join(part.split()) for part in parts)


def _joints(run: Run) -> str:
    names = run.joint_names
    signals: dict[str, Real | None] = {
        name: getattr(run, name) for name in (*JOINT_SIGNALS, *BASE_SIGNALS)
    }
    held = [name.replace("_", " ") for name, signal in signals.items() if signal is not None]
    plural = "" if len(names) == 1 else "s"
    return f"read as {len(names)} joint{plural} ({_listed(run)}): {', '.join(held)}"


def _listed(run: Run) -> str:
    names = run.joint_names
    return ", ".join(names) if len(names) <= 3 else f"{names[0]} to {names[-1]}"


def _episodes(path: Path, reading: Reading) -> Iterator[Source]:
    """The runs of a log; the log itself if they cannot be listed, or it is a run file."""
    if path.is_dir() or not _is_npz(path):
        try:
            jobs = jobs_of(path, reading.options, episodes=reading.episodes or None)
            yield from (Source(path, job.episode) for job in jobs)
        except (InspectorError, NoiseModelError):
            yield from (Source(path, each) for each in reading.episodes or ("",))
        return
    yield Source(path)


def _run_file(path: Path, reading: Reading) -> Run | None:
    """The run of a run file; None of another log, or if it has to be read as one."""
    options = reading.options
    as_log = bool(reading.desired or options.entries or options.units or options.joints)
    if path.is_dir() or not _is_npz(path) or (_is_archive(path) and as_log):
        return None
    if _is_archive(path):
        try:
            names = set(archive.names_in(path))
        except (OSError, archive.ArchiveError):
            names = {"time", "velocity"}  # `Run.load` says what is wrong
        if "time" not in names or not names & {"velocity", "position"}:
            return None  # arrays of a simulator
    try:
        return Run.load(path, on_demand=True)
    except RunFileError as error:
        if isinstance(error.__cause__, NotUniformError):
            return None
        raise


def _is_npz(path: Path) -> bool:
    return path.suffix.lower() == ".npz" or _is_archive(path)


def _is_archive(path: Path) -> bool:
    return path.is_file() and zipfile.is_zipfile(path)  # a device or a pipe may have no end
