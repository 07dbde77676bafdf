"""A run file or any log, opened as a run in memory: what all commands read their inputs by.

The format is found by a file's first bytes, or by the files in a folder.
"""

import hashlib
import os
import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from inspector.errors import InspectorError, LogError
from inspector.logs.mapping import (
    LogReader,
    ReadOptions,
    check_joints,
    errors_of,
    named,
    read_options,
)
from inspector.logs.motion import Imported, prepared, run_of
from inspector.logs.names import EPISODES, SIGNALS, first_to_last, listed
from inspector.text import counted, printable
from noisemodel import NoiseModelError, Robot, Run, RunFileError, runfile
from noisemodel.files import also_reading
from noisemodel.robot import joint_limits
from noisemodel.run import NotUniformError

# The first bytes of a file, and the module here that reads it; other files are CSV.
MAGIC = {
    b"\x89MCAP0\r\n": "bags",
    b"SQLite format 3\x00": "bags",
    b"#ROSBAG V": "bags",
    b"\x28\xb5\x2f\xfd": "bags",  # a file of a bag that zstd packed
    b"PAR1": "parquet",
    b"\x89HDF\r\n\x1a\n": "hdf5",
    b"PK\x03\x04": "arrays",
    b"PK\x05\x06": "arrays",
    b"\x93NUMPY": "arrays",
    b"MATLAB 7.3 MAT-f": "hdf5",
    b"MATLAB 5.0 MAT-f": "arrays",
}
# The libraries that a reader needs, and the extra that installs them.
NEEDS = {"bags": (("rosbags", "mcap"), "ros"), "hdf5": (("h5py",), "hdf5")}
# By these files, a folder is a LeRobot data set, or a bag of ROS 2.
INFO, BAG = Path("meta") / "info.json", "metadata.yaml"
# The files of a folder that are taken for logs; others are read if they are named.
SUFFIXES = frozenset(
    (".npz", ".csv", ".tsv", ".log", ".parquet", ".h5", ".hdf5", ".mat", ".mcap", ".bag", ".db3")
)


def open_log(path: Path, options: ReadOptions) -> LogReader:
    """Reader of a log, chosen by its first bytes, or by the files in a folder."""
    if _is_folder(path):
        module = _module_of_folder(path)
        if not module:
            problem = "neither a ROS 2 bag (metadata.yaml) nor a LeRobot data set (meta/info.json)"
            raise LogError(path, f"a folder that is {problem}; name its files one by one")
    else:
        with errors_of(path):
            runfile.check_regular(path)
            with path.open("rb") as stream:
                head = stream.read(16)
        module = next((name for magic, name in MAGIC.items() if head.startswith(magic)), "csv")
    libraries, extra = NEEDS.get(module, ((), ""))
    for library in libraries:
        if find_spec(library) is None:
            how = f"pip install 'noise-inspector[{extra}]'"
            raise LogError(path, f"{library} reads such logs and is not installed; {how}")
    opened: LogReader = import_module(f"inspector.logs.{module}").open_log(path, options)
    return opened


def _module_of_folder(folder: Path) -> str:
    """What reads a folder that is one log, a LeRobot data set or a bag; empty for one of logs."""
    with errors_of(folder):
        if (folder / INFO).is_file():
            return "parquet"
        files = [each for each in folder.iterdir() if not each.name.startswith(".")]
        alone = len(files) == 1 and files[0].suffix in (".mcap", ".db3")
        return "bags" if alone or (folder / BAG).is_file() else ""


def _is_folder(path: Path) -> bool:
    with errors_of(path):  # such as one whose name has more than 255 characters
        return path.is_dir()


# Runs of logs


@dataclass(frozen=True)
class Reading:
    """How logs are opened."""

    options: ReadOptions = field(default_factory=ReadOptions)  # their robot is for run files too
    desired: Path | None = None  # another log with the desired motion, for a single log
    episodes: tuple[str, ...] = ()  # to be taken of a data set, all unless given
    without_robot: bool = False  # a run is taken without the robot that it names


def read_log(
    path: str | Path,
    *,
    desired: str | Path | None = None,
    episode: str | None = None,
    mapping: Sequence[str] = (),
    **options: Any,
) -> Imported:
    """Run of a log of any known format.

    Args:
        path: A CSV, Parquet, HDF5, MATLAB or npz file, a ROS bag, a LeRobot data set, or a run
            file.
        desired: Another log with the desired motion, which may have a clock of its own.
        episode: Which episode to read, where the log holds several.
        mapping: Signals of columns and arrays that are not known by their names:
            ``SIGNAL.JOINT=COLUMN``, ``SIGNAL=ARRAY`` or ``time=COLUMN``.
        **options: ``robot``, ``rate``, ``units``, ``joints``, ``topics``, ``offset``, ``force`` and
            ``columns``, as ``inspector.logs.mapping.ReadOptions`` has them.

    Returns:
        The run, and what was decided during the import.

    Raises:
        InspectorError: If an option is not valid, or the log cannot be read as one robot's
            motion.
        RobotError: If the robot cannot be read, or lacks the joints that the log names.

    Example:
        >>> read_log("bag/", robot="panda").run.rate  # doctest: +SKIP
        1000.0
    """
    path = Path(path)
    wanted = () if episode is None else (episode,)
    reading = Reading(read_options(mapping, **options), Path(desired) if desired else None, wanted)
    readers = readers_of(path, reading)
    if len(readers) > 1:
        held = f"{len(readers)} episodes ({listed([*readers])})"
        raise LogError(path, f"holds {held}; choose one (episode), or read all (read_logs)")
    return next(iter(readers.values()))()


def read_logs(
    path: str | Path,
    options: ReadOptions | None = None,
    *,
    desired: str | Path | None = None,
    episodes: Sequence[str] | None = None,
) -> Iterator[Imported]:
    """Runs of a log, an episode each, read one by one; arguments and errors of `read_log`."""
    other = Path(desired) if desired else None
    reading = Reading(options or ReadOptions(), other, tuple(episodes or ()))
    for read in readers_of(Path(path), reading).values():
        yield read()


def readers_of(path: Path, reading: Reading) -> dict[str, Callable[[], Imported]]:
    """What reads each run of a log, by its episode, whose name is empty in a log without."""
    options = reading.options
    robot = Robot.load(options.robot) if options.robot else None
    opened = open_log(path, options)
    other = open_log(reading.desired, options) if reading.desired else None
    for episode in opened.episodes:
        if (shown := printable(episode)) != episode:
            raise LogError(path, f"an episode is called {shown}, which has control characters")
    for episode in reading.episodes:
        if episode not in opened.episodes:
            known = listed(opened.episodes) or "no episodes"
            raise LogError(path, f"there is no episode {episode!r}; it has {known}")

    def read(episode: str) -> Imported:
        name = run_name(path, episode)
        if opened.run and not other:
            run = opened.run()
            run = replace(run, robot=options.robot or run.robot)
            return Imported(run, ("a run file, unchanged",), name)
        logs = [prepared(opened.read(episode), options, robot)]
        if other:
            same = episode if episode in other.episodes else other.episodes[0]
            logs.append(prepared(other.read(same), options, robot, logs[0]))
        return run_of(logs, options, name)

    return {each: partial(read, each) for each in reading.episodes or opened.episodes}


def listing(path: Path, options: ReadOptions) -> tuple[str, ...]:
    """Contents of a log, a line each."""
    opened = open_log(path, options)
    return (f"{path}: {opened.kind}", *(f"  {line}" for line in opened.listing()))


def run_name(path: Path, episode: str) -> str:
    """Name of the run of an episode of a log."""
    return f"{path.stem}-{episode}" if episode else path.stem


# Run files and logs alike


class Source(NamedTuple):
    """A run that is not read yet: a file, the folder of a bag, or an episode of a data set."""

    path: Path
    episode: str = ""  # empty for a log without episodes

    @property
    def shown(self) -> Path:
        """The path, with the episode as its last part, in characters that can be printed."""
        return Path(printable(str(self.path / self.episode if self.episode else self.path)))


@dataclass(frozen=True, eq=False)
class Opened:
    """A run, and what was assumed when its log was read: joints, units, rate, robot and more."""

    run: Run
    assumed: str  # in one line, empty for a run file that names its joints
    source: Source

    @property
    def sha256(self) -> str:
        """SHA-256 of its file; for a folder or an episode, of the run's velocities."""
        if self.source.episode or not self.source.path.is_file():
            return hashlib.sha256(self.run.velocity.tobytes()).hexdigest()
        with self.source.path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()


def open_run(path: str | Path, reading: Reading | None = None) -> Opened:
    """Open a run file, a log that is a single run, or a folder with one of them."""
    reading = reading or Reading()
    found, _ = sources([Path(path)], reading)
    if len(found) != 1:
        names = listed([each.episode or each.path.name for each in found])
        how = "choose one (--episode)" if found[0].episode else f"name one, such as {found[0].path}"
        raise LogError(Path(path), f"holds {len(found)} runs ({names}); {how}")
    return open_source(found[0], reading)


def open_source(source: Source, reading: Reading | None = None) -> Opened:
    """Open what `sources` found."""
    reading = reading or Reading()
    if printable(str(source.path)) != str(source.path):
        raise LogError(source.shown, "its name has control characters; rename it")
    run = _run_file(source.path, reading)
    if run is None:
        episodes = (source.episode,) if source.episode else ()
        (read,) = readers_of(source.path, replace(reading, episodes=episodes)).values()
        imported = read()
        return Opened(imported.run, assumed(imported, source.path), source)
    robot = reading.options.robot
    if robot:
        joint_limits(robot)  # a name that a run names may be any, one that a user types may not
    if robot or reading.without_robot:
        run = replace(run, robot=robot or None)
    by_robot = named(run)
    taken = first_to_last(by_robot.joint_names)
    told = "" if by_robot is run else f"joints are not named: taken for {taken}"
    return Opened(by_robot, told, source)


def sources(
    paths: Sequence[Path], reading: Reading | None = None
) -> tuple[tuple[Source, ...], tuple[Path, ...]]:
    """List the runs in files, data sets and folders of them, however deep.

    Hidden files are left out. What cannot be read is listed too: `open_source` says why.
    """
    reading = reading or Reading()
    found, others, seen = list[Source](), list[Path](), set[str]()
    for path in paths:
        logs, rest = logs_in(path)
        others += rest
        new = [log for log in logs if os.path.realpath(log) not in seen]  # may link to itself
        seen.update(map(os.path.realpath, new))
        also_reading(new)
        for log in new:
            episodes: Iterable[str] = ("",)
            if not _is_npz(log) or _ends_episodes(log):
                try:
                    episodes = readers_of(log, reading)
                except (InspectorError, NoiseModelError):
                    episodes = reading.episodes or ("",)
            found += (Source(log, each) for each in episodes)
    if reading.desired and len(found) > 1:
        problem = f"belongs to one log, {len(found)} are given (--desired)"
        raise InspectorError(f"{reading.desired}: {problem}")
    return tuple(found), tuple(others)


def logs_in(path: Path) -> tuple[tuple[Path, ...], tuple[Path, ...]]:
    """List the logs of a folder and of the folders in it, and its other files."""
    if not _is_folder(path) or _module_of_folder(path):
        return (path,), ()
    logs, others, waiting = list[Path](), list[Path](), [path]
    while waiting:  # not by recursion: folders may lie a thousand deep
        folder = waiting.pop()
        if os.path.lexists(folder / "reference.toml"):
            continue  # the levels of accepted runs are no logs
        try:
            inside = sorted(os.scandir(folder), key=lambda each: each.name)
        except PermissionError:
            continue
        except OSError as error:
            raise LogError(folder, f"cannot be listed ({error.strerror})") from error
        for each in inside:
            here = folder / each.name
            if each.name.startswith("."):
                continue
            if not each.is_dir():
                (logs if here.suffix.lower() in SUFFIXES else others).append(here)
            elif _module_of_folder(here):
                logs.append(here)
            elif not each.is_symlink():
                waiting.append(here)
    if not logs:
        raise LogError(path, f"a folder without logs ({', '.join(sorted(SUFFIXES))})")
    return tuple(sorted(logs)), tuple(sorted(others))


def left_out(others: Sequence[Path]) -> str:
    """Say which files of folders are not taken for logs; empty if there are none."""
    if not others:
        return ""
    names = [printable(each.name) for each in others]
    return f"{counted(len(others), 'other file')} left out: {listed(names)}"


def assumed(imported: Imported, path: Path) -> str:
    """Say in one line what was assumed when a log was read."""
    run, remarks = imported.run, imported.remarks
    lacking = check_joints(run.joint_names, run.robot)
    others = "other " if any(": converted from" in each for each in remarks) else ""
    signals = [name for name in SIGNALS if getattr(run, name) is not None]
    held, joints = ", ".join(signals).replace("_", " "), run.joint_names
    parts = [f"read as {counted(len(joints), 'joint')} ({first_to_last(joints)}): {held}"]
    if not any("degrees" in remark for remark in remarks):
        parts.append(f"{others}angles taken for {run.meta.get('units') or 'radians'}")
    parts.append(f"{run.rate:g} Hz")
    parts.append(f"robot {run.robot}" if run.robot else "no robot (--robot NAME)")
    if lacking:
        parts.append(f"not in the log, assumed stationary: {listed(lacking)}")
    told = (each for each in remarks if not each.startswith("time starts at 0"))  # of `import`
    parts += [each.removeprefix(f"{path.name}: ") for each in told]
    return "; ".join(" ".join(part.split()) for part in parts)


def _run_file(path: Path, reading: Reading) -> Run | None:
    """The run of a run file; None of another log, or if it has to be read as one."""
    if not _is_npz(path):
        return None
    if _is_archive(path):
        options = reading.options
        if reading.desired or options.entries or options.units or options.joints:
            return None
        try:
            names = set(runfile.names_in(path))
        except (OSError, runfile.ArchiveError):
            names = {"time", "velocity"}  # `Run.load` says what is wrong
        if "time" not in names or not names & {"velocity", "position"} or _ends_episodes(path):
            return None  # arrays of a simulator
    try:
        return Run.load(path, on_demand=True)
    except RunFileError as error:
        if isinstance(error.__cause__, NotUniformError):
            return None
        raise


def _is_npz(path: Path) -> bool:
    """Whether a file holds, or should hold, an archive of arrays."""
    return not _is_folder(path) and (path.suffix.lower() == ".npz" or _is_archive(path))


def _ends_episodes(path: Path) -> bool:
    """Whether an archive holds arrays of several episodes, one after the other."""
    try:
        return any(name.lower() in EPISODES for name in runfile.names_in(path))
    except (OSError, runfile.ArchiveError):
        return False


def _is_archive(path: Path) -> bool:
    return path.is_file() and zipfile.is_zipfile(path)  # a device or a pipe may have no end
