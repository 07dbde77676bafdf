"""The front door: logs by their paths, as runs."""

import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from inspector.errors import LogError
from inspector.logs.columns import listed
from inspector.logs.formats import open_log
from inspector.logs.importing import Imported, run_of
from inspector.logs.opened import Opened, Watch, unwatched
from inspector.logs.reading import Reading, parse_mapping
from inspector.logs.side import side_of
from noisemodel import Robot, RobotError


@dataclass(frozen=True)
class Job:
    """A run that can be read.

    Attributes:
        name: What to call it.
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
    """Read a run from a log of any known format.

    Args:
        path: A CSV, Parquet, HDF5 or npz file, a ROS bag, a LeRobot data set, or a run file.
        desired: Another log with the desired motion, which may have a clock of its own.
        episode: Which episode to read, where the log holds several.
        mapping: What columns and arrays hold that have names of their own:
            ``SIGNAL.JOINT=COLUMN``, ``SIGNAL=ARRAY`` or ``time=COLUMN``.
        **options: ``robot``, ``rate``, ``units``, ``joints``, ``topics`` and ``offset``, as
            ``inspector.logs.reading.Reading`` has them.

    Returns:
        The run, and what was decided on the way.

    Raises:
        InspectorError: If an option makes no sense, or the log cannot be read as one robot's
            motion.
        RobotError: If the robot cannot be read, or lacks the joints that the log names.

    Example:
        >>> read_log("bag/", robot="panda").run.rate  # doctest: +SKIP
        1000.0
    """
    reading = reading_of(mapping, **options)
    jobs = jobs_of(Path(path), reading, desired=Path(desired) if desired else None)
    if episode is None and len(jobs) > 1:
        raise LogError(
            Path(path),
            f"holds {len(jobs)} episodes ({listed([job.episode for job in jobs])}); choose one"
            " (episode), or read all (read_logs)",
        )
    return _chosen(Path(path), jobs, None if episode is None else [episode])[0].read()


def read_logs(
    path: str | Path,
    reading: Reading | None = None,
    *,
    desired: str | Path | None = None,
    episodes: Sequence[str] | None = None,
    watch: Watch = unwatched,
) -> Iterator[Imported]:
    """Read the runs of a log, one after the other.

    Args:
        path: The log.
        reading: What a person said of it.
        desired: Another log with the desired motion.
        episodes: Which episodes to read, all unless given.
        watch: Is told how reading goes on.

    Yields:
        A run per episode.

    Raises:
        InspectorError: As ``read_log``.
        RobotError: As ``read_log``.
    """
    jobs = jobs_of(
        Path(path), reading or Reading(), desired=Path(desired) if desired else None, watch=watch
    )
    for job in _chosen(Path(path), jobs, episodes):
        yield job.read()


def jobs_of(
    path: Path,
    reading: Reading,
    *,
    desired: Path | None = None,
    episodes: Sequence[str] | None = None,
    watch: Watch = unwatched,
) -> tuple[Job, ...]:
    """Recognise a log, and offer to read its runs.

    Args:
        path: The log.
        reading: What a person said of it.
        desired: Another log with the desired motion.
        episodes: Which episodes to offer, all unless given.
        watch: Is told how reading goes on.

    Raises:
        InspectorError: As ``read_log``.
        RobotError: If the robot cannot be read.
    """
    robot = Robot.load(reading.robot) if reading.robot else None
    opened = open_log(path, reading)
    other = open_log(desired, reading) if desired else None
    jobs = []
    for episode in opened.episodes:
        name = f"{path.stem}-{episode}" if episode else path.stem
        read = partial(_one, path, name, opened, other, episode, reading, robot, watch)
        jobs.append(Job(name, episode, read))
    return _chosen(path, tuple(jobs), episodes)


def reading_of(
    mapping: Sequence[str] = (), *, saved: str | Path | None = None, **options: Any
) -> Reading:
    """Make a reading of options as people give them.

    Args:
        mapping: What columns and arrays hold, as ``parse_mapping`` has it.
        saved: A mapping that was saved; what else is given goes before it.
        **options: The other attributes of ``Reading``; None for what nobody said.

    Raises:
        InspectorError: If one of them makes no sense.
    """
    before = Reading.load(Path(saved)) if saved else Reading()
    given = {name: value for name, value in options.items() if value is not None}
    for name in {"joints", "topics"} & set(given):
        given[name] = tuple(given[name])
    if "robot" in given:
        given["robot"] = str(given["robot"])
    entries = parse_mapping(mapping)
    targets = {entry.target for entry in entries}
    kept = tuple(entry for entry in before.entries if entry.target not in targets)
    return replace(before, **given, entries=(*entries, *kept))


def listing(path: Path, reading: Reading) -> tuple[str, ...]:
    """List what is inside a log, a line each.

    Raises:
        LogError: If it cannot be read.
    """
    opened = open_log(path, reading)
    return (f"{path}: {opened.kind}", *(f"  {line}" for line in opened.listing()))


def _chosen(path: Path, jobs: tuple[Job, ...], episodes: Sequence[str] | None) -> tuple[Job, ...]:
    by_name = {job.episode: job for job in jobs}
    for episode in episodes or ():
        if episode not in by_name:
            known = listed([each or "no episodes" for each in by_name])
            raise LogError(path, f"there is no episode {episode!r}; it has {known}")
    return tuple(by_name[episode] for episode in episodes) if episodes else jobs


def _one(
    path: Path,
    name: str,
    opened: Opened,
    desired: Opened | None,
    episode: str,
    reading: Reading,
    robot: Robot | None,
    watch: Watch,
) -> Imported:
    if opened.run and not desired:
        return Imported(opened.run(), ("a run file, taken as it is",), name)
    log = opened.read(episode, watch)
    remarks: tuple[str, ...] = ()
    if robot is None and log.urdf:
        robot, remarks = _described(log.urdf)
    sides = [side_of(log, reading, robot)]
    del log  # its tracks live on, and go one by one as they are resampled
    if desired:
        partner = episode if episode in desired.episodes else desired.episodes[0]
        sides.append(side_of(desired.read(partner, watch), reading, robot))
    imported = run_of(sides, reading, robot, name)
    return replace(imported, remarks=(*imported.remarks, *remarks))


def _described(urdf: str) -> tuple[Robot | None, tuple[str, ...]]:
    """Read the robot that came with a log; one that cannot be read is none."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "robot_description.urdf"
        path.write_text(urdf, encoding="utf-8")
        try:
            return Robot.load(path), ()
        except RobotError as error:
            problem = str(error).replace(str(path), "the log's robot description")
            return None, (f"{problem}; joints are not checked",)
