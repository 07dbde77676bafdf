"""A run file or any log, opened as a run in memory: what all commands read their inputs by.

The format is found by a file's first bytes, or by the files in a folder. Logs are imported as run
files one by one or a folder of them at a time; ``meta`` of each run file in a folder has a digest
of its log and of how it was read, by which an interrupted import knows what it has written.
"""

import hashlib
import os
import tempfile
import zipfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from inspector.errors import InspectorError, LogError
from inspector.logs.log import LogReader, Progress, without_progress
from inspector.logs.mapping import ReadOptions, read_options
from inspector.logs.motion import Imported, prepared, run_of
from inspector.logs.names import BASE_SIGNALS, JOINT_SIGNALS, listed
from inspector.logs.plausibility import check_joints, contradictions, limit_warnings, named
from inspector.text import counted, printable
from noiseclassifier.jsontext import from_json
from noisemodel import NoiseModelError, OutputError, Robot, RobotError, Run, RunFileError, runfile
from noisemodel.files import also_reading, refuse_existing, replacing
from noisemodel.robot import joint_limits
from noisemodel.run import NotUniformError

MAGIC = {
    b"\x89MCAP0\r\n": "bags",
    b"SQLite format 3\x00": "bags",
    b"#ROSBAG V": "bags",
    b"PAR1": "parquet",
    b"\x89HDF\r\n\x1a\n": "hdf5",
    b"PK\x03\x04": "arrays",
    b"PK\x05\x06": "arrays",
    b"\x93NUMPY": "arrays",
    b"MATLAB 7.3 MAT-f": "hdf5",
    b"MATLAB 5.0 MAT-f": "arrays",
}
"""The first bytes of a file, and the module here that reads it; other files are CSV."""

NEEDS = {"bags": (("rosbags", "mcap"), "ros"), "hdf5": (("h5py",), "hdf5")}
"""The libraries that a reader needs, and the extra that installs them."""

INFO, BAG = Path("meta") / "info.json", "metadata.yaml"
"""By these files, a folder is a LeRobot data set, or a bag of ROS 2."""

SUFFIXES = frozenset(
    (".npz", ".csv", ".tsv", ".log", ".parquet", ".h5", ".hdf5", ".mat", ".mcap", ".bag", ".db3")
)
"""The files of a folder that are taken for logs; others are read if they are named."""


def open_log(path: Path, options: ReadOptions) -> LogReader:
    """Reader of a log, chosen by its first bytes, or by the files in a folder."""
    module = _module_of(path)
    libraries, extra = NEEDS.get(module, ((), ""))
    for library in libraries:
        if find_spec(library) is None:
            raise LogError(
                path,
                f"{library} reads such logs and is not installed;"
                f" pip install 'noise-inspector[{extra}]'",
            )
    reader: Callable[[Path, ReadOptions], LogReader] = import_module(
        f"inspector.logs.{module}"
    ).open_log
    return reader(path, options)


def is_one_log(folder: Path) -> bool:
    """Whether a folder is one log: a LeRobot data set, or a bag; not a folder of logs."""
    try:
        if (folder / INFO).is_file() or (folder / BAG).is_file():
            return True
        files = [each for each in folder.iterdir() if not each.name.startswith(".")]
    except OSError as error:
        raise LogError(folder, f"cannot be read ({error.strerror})") from error
    return len(files) == 1 and files[0].suffix in (".mcap", ".db3")


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except OSError as error:  # such as a name of more than 255 characters
        raise LogError(path, f"cannot be read ({error.strerror})") from error


def _module_of(path: Path) -> str:
    """The module that reads a log."""
    if _is_folder(path):
        if (path / INFO).is_file():
            return "parquet"
        if any(map(Path.is_file, (path / BAG, *path.glob("*.mcap"), *path.glob("*.db3")))):
            return "bags"
        raise LogError(
            path,
            "a folder that is neither a ROS 2 bag (metadata.yaml) nor a LeRobot data set"
            " (meta/info.json); name its files one by one",
        )
    try:
        runfile.check_regular(path)
        with path.open("rb") as stream:
            head = stream.read(16)
    except OSError as error:
        raise LogError(path, f"cannot be read ({error.strerror})") from error
    except runfile.ArchiveError as error:
        raise LogError(path, str(error)) from error
    return next((module for magic, module in MAGIC.items() if head.startswith(magic)), "csv")


# Runs of logs


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
    readers = readers_of(
        path,
        read_options(mapping, **options),
        desired=Path(desired) if desired else None,
        episodes=None if episode is None else [episode],
    )
    if len(readers) > 1:
        raise LogError(
            path,
            f"holds {len(readers)} episodes ({listed([*readers])}); choose one (episode), or read"
            " all (read_logs)",
        )
    return next(iter(readers.values()))()


def read_logs(
    path: str | Path,
    options: ReadOptions | None = None,
    *,
    desired: str | Path | None = None,
    episodes: Sequence[str] | None = None,
    progress: Progress = without_progress,
) -> Iterator[Imported]:
    """Runs of a log, read one after the other.

    Args:
        path: The log.
        options: How to read it.
        desired: Another log with the desired motion.
        episodes: Which episodes to read, all unless given.
        progress: Wraps what is read, to show how much is done.

    Yields:
        A run per episode.

    Raises:
        InspectorError: As ``read_log``.
        RobotError: As ``read_log``.
    """
    readers = readers_of(
        Path(path),
        options or ReadOptions(),
        desired=Path(desired) if desired else None,
        episodes=episodes,
        progress=progress,
    )
    for read in readers.values():
        yield read()


def readers_of(
    path: Path,
    options: ReadOptions,
    *,
    desired: Path | None = None,
    episodes: Sequence[str] | None = None,
    progress: Progress = without_progress,
) -> dict[str, Callable[[], Imported]]:
    """What reads each run of a log, by its episode; arguments and errors as for `read_logs`.

    The name of a log without episodes is empty.
    """
    robot = Robot.load(options.robot) if options.robot else None
    opened = open_log(path, options)
    other = open_log(desired, options) if desired else None
    for episode in opened.episodes:
        if printable(episode) != episode:
            raise LogError(
                path, f"an episode is called {printable(episode)}, which has control characters"
            )
    for episode in episodes or ():
        if episode not in opened.episodes:
            known = listed([each or "no episodes" for each in opened.episodes])
            raise LogError(path, f"there is no episode {episode!r}; it has {known}")
    return {
        episode: partial(_read_episode, path, opened, other, episode, options, robot, progress)
        for episode in episodes or opened.episodes
    }


def listing(path: Path, options: ReadOptions) -> tuple[str, ...]:
    """Contents of a log, a line each."""
    opened = open_log(path, options)
    return (f"{path}: {opened.kind}", *(f"  {line}" for line in opened.listing()))


def _name(path: Path, episode: str) -> str:
    return f"{path.stem}-{episode}" if episode else path.stem


def _read_episode(
    path: Path,
    opened: LogReader,
    desired: LogReader | None,
    episode: str,
    options: ReadOptions,
    robot: Robot | None,
    progress: Progress,
) -> Imported:
    name = _name(path, episode)
    if opened.run and not desired:
        run = opened.run()
        if not options.robot:
            return Imported(run, ("a run file, unchanged",), name)
        remark = f"a run file, its robot is now {options.robot}"
        return Imported(replace(run, robot=options.robot), (remark,), name)
    log = opened.read(episode, progress)
    problem = ""
    if robot is None and log.urdf:
        robot, problem = _robot_of(log.urdf)
    logs = [prepared(log, options, robot)]
    del log  # its tracks remain, and are freed one by one as they are resampled
    if desired:
        same_episode = episode if episode in desired.episodes else desired.episodes[0]
        if len(logs[0].in_degrees) == 2:  # of one robot, in one unit
            options = replace(options, units="degrees")
        logs.append(prepared(desired.read(same_episode, progress), options, robot))
    imported = run_of(logs, options, robot, name)
    unchecked = [f"{problem}; joints are not checked"] if problem else []
    return replace(imported, remarks=(*imported.remarks, *unchecked))


def _robot_of(urdf: str) -> tuple[Robot | None, str]:
    """Robot of the URDF in a log, or None and why it cannot be read."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "robot_description.urdf"
        path.write_text(urdf, encoding="utf-8")
        try:
            return Robot.load(path), ""
        except RobotError as error:
            return None, str(error).replace(str(path), "the log's robot description")


# Run files and logs alike


@dataclass(frozen=True)
class Reading:
    """How logs are opened."""

    options: ReadOptions = field(default_factory=ReadOptions)  # their robot is for run files too
    desired: Path | None = None  # another log with the desired motion, for a single log
    episodes: tuple[str, ...] = ()  # to be taken of a data set, all unless given
    without_robot: bool = False  # a run is taken without the robot that it names


@dataclass(frozen=True)
class Source:
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


def open_run(
    path: str | Path, reading: Reading | None = None, *, progress: Progress = without_progress
) -> Opened:
    """Open a run file or a log that is a single run.

    Args:
        path: A run file, any log that `inspector import` reads, or a folder with one of them.
        progress: Wraps what is read, to show how much is done.
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
    """Open what `sources` found."""
    reading = reading or Reading()
    if printable(str(source.path)) != str(source.path):
        raise LogError(source.shown, "its name has control characters; rename it")
    run = _run_file(source.path, reading)
    if run is None:
        (imported,) = read_logs(
            source.path,
            reading.options,
            desired=reading.desired,
            episodes=[source.episode] if source.episode else None,
            progress=progress,
        )
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
        found += (Source(log, each) for log in new for each in _episodes(log, reading))
    if reading.desired and len(found) > 1:
        raise InspectorError(
            f"{reading.desired}: belongs to one log, {len(found)} are given (--desired)"
        )
    return tuple(found), tuple(others)


def logs_in(path: Path) -> tuple[tuple[Path, ...], tuple[Path, ...]]:
    """List the logs of a folder and of the folders in it, and its other files."""
    if not _is_folder(path) or is_one_log(path):
        return (path,), ()
    logs: list[Path] = []
    others: list[Path] = []
    waiting = [path]
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
            elif is_one_log(here):
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
    run = imported.run
    units = str(run.meta.get("units") or "radians")
    decided = any("degrees" in remark for remark in imported.remarks)
    lacking = check_joints(run.joint_names, run.robot)
    others = "other " if any(": converted from" in each for each in imported.remarks) else ""
    held = [
        name.replace("_", " ")
        for name in (*JOINT_SIGNALS, *BASE_SIGNALS)
        if getattr(run, name) is not None
    ]
    parts = [
        f"read as {counted(len(run.joint_names), 'joint')} ({_listed(run)}): {', '.join(held)}",
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


def _listed(run: Run) -> str:
    names = run.joint_names
    return ", ".join(names) if len(names) <= 3 else f"{names[0]} to {names[-1]}"


def _episodes(path: Path, reading: Reading) -> tuple[str, ...]:
    """The episodes of a log; none of one that cannot be listed, or of a run file."""
    if not _is_folder(path) and _is_npz(path):
        return ("",)
    try:
        return tuple(readers_of(path, reading.options, episodes=reading.episodes or None))
    except (InspectorError, NoiseModelError):
        return reading.episodes or ("",)


def _run_file(path: Path, reading: Reading) -> Run | None:
    """The run of a run file; None of another log, or if it has to be read as one."""
    if _is_folder(path) or not _is_npz(path):
        return None
    if _is_archive(path):
        options = reading.options
        if reading.desired or options.entries or options.units or options.joints:
            return None
        try:
            names = set(runfile.names_in(path))
        except (OSError, runfile.ArchiveError):
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


# Import as run files

DIGEST = "import_sha256"  # key of ``meta`` with the digest of what a run file was made of
READ = (*SUFFIXES, ".json", ".yaml")
"""Suffixes of the files of a folder that are read if it is a log."""


@dataclass(frozen=True)
class Written:
    """Result of importing one log, or one of its episodes."""

    path: Path  # the run file; if the log could not be read, the log
    duration: float = 0.0
    rate: float = 0.0
    remarks: tuple[str, ...] = ()  # what was decided during the import, a sentence each
    problem: str = ""  # why there is no run file; empty if there is one
    lost: bool = False  # the log could be read, and the run file not be written
    kept: bool = False  # the run file is there already, from a call that was interrupted


def import_logs(
    logs: Sequence[Path],
    output: Path,
    options: ReadOptions,
    *,
    desired: Path | None = None,
    episodes: Sequence[str] = (),
    overwrite: bool = False,
    progress: Progress,
) -> Iterator[Written]:
    """Write a run file for each run of some logs.

    In a folder, those that an interrupted call of the same logs and options has written are kept.
    """
    logs = [log for path in logs for log in logs_in(path)[0]]
    also_reading(logs)
    several = len(logs) > 1
    if desired and several:
        raise InspectorError(f"{desired}: belongs to one log, {len(logs)} are given")
    jobs: list[tuple[Path, str, Callable[[], Imported]]] = []
    failed: list[Written] = []
    for log in logs:
        inner = without_progress if several else progress  # there is one bar at a time
        try:
            found = readers_of(
                log, options, desired=desired, episodes=episodes or None, progress=inner
            )
            jobs += ((log, _name(log, episode), read) for episode, read in found.items())
        except (InspectorError, NoiseModelError) as error:
            if not several:
                raise
            failed.append(Written(log, problem=str(error)))
    targets = _targets([name for _, name, _ in jobs], output, several=several)
    in_folder = targets != (output,)
    digest = cache(lambda log: _digest(options, log, desired) if in_folder else "")
    for (log, _, _), target in zip(jobs, targets, strict=True):
        if not (in_folder and target.exists() and _digest_in(target) == digest(log)):
            refuse_existing(target, overwrite=overwrite)
    there = {target for target in targets if target.exists() and not overwrite}
    yield from failed
    for (log, _, read), target in progress(zip(jobs, targets, strict=True), len(jobs)):
        if target in there:
            yield Written(target, kept=True)
            continue
        try:
            yield _written(read(), target, digest(log), overwrite=overwrite)
        except (InspectorError, NoiseModelError) as error:
            if len(targets) == 1 and not several:
                raise
            lost = isinstance(error, OutputError) and isinstance(error.__cause__, OSError)
            yield Written(target, problem=str(error), lost=lost)


def _digest(options: ReadOptions, *logs: Path | None) -> str:
    """SHA-256 of the options, the robot's file, and what is read of the logs."""
    found = hashlib.sha256(repr(options).encode(errors="surrogatepass"))
    for log in (*(log or Path() for log in logs), Path(options.robot)):
        files = sorted(log.rglob("*")) if log != Path() and log.is_dir() else [log]
        for path in files:  # not the videos of a data set
            if path.is_file() and (path == log or path.suffix.lower() in READ):
                with path.open("rb") as stream:
                    found.update(hashlib.file_digest(stream, "sha256").digest())
    return found.hexdigest()


def _targets(names: Sequence[str], output: Path, *, several: bool) -> tuple[Path, ...]:
    """Paths of the run files, checked before the logs are read."""
    if len(names) == 1 and not several and not _is_folder(output):
        return (output,)
    if output.suffix == ".npz" or output.is_file():
        raise InspectorError(
            f"{output}: {len(names)} runs do not fit into one file; name a folder, or choose one"
            " (--episode)"
        )
    targets = tuple(output / f"{name}.npz" for name in names)
    there = set[Path]()
    for path in targets:
        if path in there:
            raise InspectorError(f"{path}: two logs would be written there; import them one by one")
        there.add(path)
    try:
        output.mkdir(exist_ok=True)
    except OSError as error:
        raise InspectorError(f"{output}: cannot be created ({error.strerror})") from error
    return targets


def _digest_in(target: Path) -> object:
    """What a run file was made of; None of another file."""
    try:
        held = runfile.read_npz(target, ["meta"])["meta"]
        meta = None if held.shape else from_json(str(held))
    except (OSError, ValueError, KeyError):
        return None
    return meta.get(DIGEST) if isinstance(meta, dict) else None


def _written(imported: Imported, target: Path, digest: str, *, overwrite: bool) -> Written:
    run, remarks = imported.run, list(imported.remarks)
    if digest:
        run = replace(run, meta={**run.meta, DIGEST: digest})
    if imported.urdf:
        urdf = target.with_suffix(".urdf")
        if not (urdf.is_file() and urdf.read_bytes() == imported.urdf.encode()):
            with replacing(urdf, overwrite=overwrite) as temporary:
                temporary.write_bytes(imported.urdf.encode())
        run = replace(run, robot=str(urdf))
        remarks.append(f"{urdf.name}: the robot, as the log describes it")
    remarks += [*contradictions(run), *limit_warnings(run)]
    run.save(target, overwrite=overwrite)
    return Written(target, run.duration, run.rate, tuple(remarks))
