"""Runs read from logs of any known format, by path."""

import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from inspector.errors import LogError
from inspector.logs.formats import open_log
from inspector.logs.importing import Imported, run_of
from inspector.logs.log import LogReader, Progress, without_progress
from inspector.logs.options import ReadOptions, parse_mapping
from inspector.logs.preparation import prepared
from inspector.logs.signals import listed
from inspector.text import printable
from noisemodel import Robot, RobotError


@dataclass(frozen=True)
class Job:
    """A run of a log that is not read yet.

    Attributes:
        name: Its name.
        episode: The episode that it is, empty for a log without episodes.
        read: Reads it.
    """

    name: str
    episode: str
    read: Callable[[], Imported]


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
        path: A CSV, Parquet, HDF5 or npz file, a ROS bag, a LeRobot data set, or a run file.
        desired: Another log with the desired motion, which may have a clock of its own.
        episode: Which episode to read, where the log holds several.
        mapping: Signals of columns and arrays that are not known by their names:
            ``SIGNAL.JOINT=COLUMN``, ``SIGNAL=ARRAY`` or ``time=COLUMN``.
        **options: ``robot``, ``rate``, ``units``, ``joints``, ``topics``, ``offset`` and
            ``columns``, as ``inspector.logs.options.ReadOptions`` has them.

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
    chosen = read_options(mapping, **options)
    jobs = jobs_of(Path(path), chosen, desired=Path(desired) if desired else None)
    if episode is None and len(jobs) > 1:
        raise LogError(
            Path(path),
            f"holds {len(jobs)} episodes ({listed([job.episode for job in jobs])}); choose one"
            " (episode), or read all (read_logs)",
        )
    return _chosen(Path(path), jobs, None if episode is None else [episode])[0].read()


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
    jobs = jobs_of(
        Path(path),
        options or ReadOptions(),
        desired=Path(desired) if desired else None,
        progress=progress,
    )
    for job in _chosen(Path(path), jobs, episodes):
        yield job.read()


def jobs_of(
    path: Path,
    options: ReadOptions,
    *,
    desired: Path | None = None,
    episodes: Sequence[str] | None = None,
    progress: Progress = without_progress,
) -> tuple[Job, ...]:
    """Runs of a log, to be read one by one.

    Args:
        path: The log.
        options: How to read it.
        desired: Another log with the desired motion.
        episodes: Which episodes, all unless given.
        progress: Wraps what is read, to show how much is done.

    Raises:
        InspectorError: As ``read_log``.
        RobotError: If the robot cannot be read.
    """
    robot = Robot.load(options.robot) if options.robot else None
    opened = open_log(path, options)
    opened_desired = open_log(desired, options) if desired else None
    jobs = []
    for episode in opened.episodes:
        if printable(episode) != episode:
            raise LogError(
                path, f"an episode is called {printable(episode)}, which has control characters"
            )
        name = f"{path.stem}-{episode}" if episode else path.stem
        read = partial(
            _run_of_episode, path, name, opened, opened_desired, episode, options, robot, progress
        )
        jobs.append(Job(name, episode, read))
    return _chosen(path, tuple(jobs), episodes)


def read_options(
    mapping: Sequence[str] = (), *, saved: str | Path | None = None, **options: Any
) -> ReadOptions:
    """Options of reading a log, combined with a saved mapping.

    Args:
        mapping: Signals of columns and arrays, as ``parse_mapping`` has it.
        saved: A saved mapping; the other arguments take precedence.
        **options: The other attributes of ``ReadOptions``; None for what is not specified.

    Raises:
        InspectorError: If one of them is not valid.
    """
    before = ReadOptions.load(Path(saved)) if saved else ReadOptions()
    given = {name: value for name, value in options.items() if value is not None}
    for name in {"joints", "topics", "columns"} & set(given):
        given[name] = tuple(given[name])
    if "robot" in given:
        given["robot"] = str(given["robot"])
    entries = parse_mapping(mapping)
    targets = {entry.target for entry in entries}
    kept = tuple(entry for entry in before.entries if entry.target not in targets)
    return replace(before, **given, entries=(*entries, *kept))


def listing(path: Path, options: ReadOptions) -> tuple[str, ...]:
    """Contents of a log, a line each.

    Raises:
        LogError: If it cannot be read.
    """
    opened = open_log(path, options)
    return (f"{path}: {opened.kind}", *(f"  {line}" for line in opened.listing()))


def _chosen(path: Path, jobs: tuple[Job, ...], episodes: Sequence[str] | None) -> tuple[Job, ...]:
    by_name = {job.episode: job for job in jobs}
    for episode in episodes or ():
        if episode not in by_name:
            known = listed([each or "no episodes" for each in by_name])
            raise LogError(path, f"there is no episode {episode!r}; it has {known}")
    return tuple(by_name[episode] for episode in episodes) if episodes else jobs


def _run_of_episode(
    path: Path,
    name: str,
    opened: LogReader,
    desired: LogReader | None,
    episode: str,
    options: ReadOptions,
    robot: Robot | None,
    progress: Progress,
) -> Imported:
    if opened.run and not desired:
        run = opened.run()
        if not options.robot:
            return Imported(run, ("a run file, unchanged",), name)
        remark = f"a run file, its robot is now {options.robot}"
        return Imported(replace(run, robot=options.robot), (remark,), name)
    log = opened.read(episode, progress)
    remarks: tuple[str, ...] = ()
    if robot is None and log.urdf:
        robot, remarks = _robot_of(log.urdf)
    logs = [prepared(log, options, robot)]
    del log  # its tracks remain, and are freed one by one as they are resampled
    if desired:
        same_episode = episode if episode in desired.episodes else desired.episodes[0]
        if len(logs[0].in_degrees) == 2:  # of one robot, in one unit
            options = replace(options, units="degrees")
        logs.append(prepared(desired.read(same_episode, progress), options, robot))
    imported = run_of(logs, options, robot, name)
    return replace(imported, remarks=(*imported.remarks, *remarks))


def _robot_of(urdf: str) -> tuple[Robot | None, tuple[str, ...]]:
    """Robot of the URDF in a log, or None and a remark if it cannot be read."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "robot_description.urdf"
        path.write_text(urdf, encoding="utf-8")
        try:
            return Robot.load(path), ()
        except RobotError as error:
            problem = str(error).replace(str(path), "the log's robot description")
            return None, (f"{problem}; joints are not checked",)
