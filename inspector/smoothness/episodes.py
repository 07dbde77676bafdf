"""Episodes of logs, folders of logs and data sets: read one by one, and scored."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from inspector.analysis.verdict import EXPECTED
from inspector.errors import without_path
from inspector.library import Library
from inspector.logs.importing import Imported
from inspector.logs.options import ReadOptions
from inspector.logs.reading import jobs_of
from inspector.smoothness.scores import Episode, scored

SUFFIXES = (".npz", ".csv", ".tsv", ".parquet", ".h5", ".hdf5", ".bag", ".mcap", ".db3")
"""Of the files of a folder that are taken as logs."""


@dataclass(frozen=True)
class Unread:
    """An episode that is not read yet.

    Attributes:
        log: Path of its log.
        episode: Its name within the log, empty if that holds one only.
        source: The argument of the command that it came from.
        read: Reads it.
    """

    log: str
    episode: str
    source: str
    read: Callable[[], Imported]


@dataclass(frozen=True)
class Failed:
    """A log or an episode that cannot be read.

    Attributes:
        name: Its name.
        problem: Why, in one line.
    """

    name: str
    problem: str


def episodes_of(
    paths: Sequence[Path], options: ReadOptions
) -> tuple[tuple[Unread, ...], tuple[Failed, ...]]:
    """List the episodes of logs, without reading them.

    Args:
        paths: Logs that `import` reads, run files, data sets, and folders of these.
        options: How to read them.

    Returns:
        The episodes, and the logs that cannot be read.
    """
    found: list[Unread] = []
    failed: list[Failed] = []
    for source in paths:
        logs = tuple(_logs_in(source))
        if not logs:
            failed.append(Failed(str(source), f"holds no log ({', '.join(SUFFIXES)})"))
        for log in logs:
            try:
                jobs = jobs_of(log, options)
            except EXPECTED as error:
                failed.append(Failed(str(log), without_path(error, Path(log))))
                continue
            found += [Unread(str(log), job.episode, str(source), job.read) for job in jobs]
    return tuple(found), tuple(failed)


def scored_episodes(
    episodes: Sequence[Unread], library: Library | None
) -> Iterator[Episode | Failed]:
    """Read and score episodes; one that cannot be read never stops the rest.

    Args:
        episodes: The episodes.
        library: Models to choose from; None for no labels.

    Yields:
        An episode with its scores, or why it cannot be read.
    """
    for episode in episodes:
        try:
            run = episode.read().run
            yield scored(
                run, episode.log, episode=episode.episode, source=episode.source, library=library
            )
        except EXPECTED as error:
            name = f"{episode.log} episode {episode.episode}" if episode.episode else episode.log
            yield Failed(name, without_path(error, Path(episode.log)))


def _logs_in(path: Path) -> Iterator[Path]:
    """Take a log as it is, and a folder that is none as the logs in it."""
    if not path.is_dir() or _is_log(path):
        yield path
        return
    for child in sorted(path.iterdir()):
        hidden = child.name.startswith(".")
        if not hidden and (child.is_dir() or child.suffix.lower() in SUFFIXES):
            yield from _logs_in(child)


def _is_log(folder: Path) -> bool:
    """Whether a folder is a LeRobot data set or a ROS 2 bag."""
    return any((folder / name).is_file() for name in ("meta/info.json", "metadata.yaml"))
