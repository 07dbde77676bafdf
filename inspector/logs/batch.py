"""Logs imported as run files: one file, or a folder of them.

In a folder, ``meta`` of each run file has a digest of its log and of how it was read. By that, an
interrupted import knows which run files it has written when it is called again.
"""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from inspector.errors import InspectorError
from inspector.logs.importing import Imported
from inspector.logs.log import Progress, without_progress
from inspector.logs.opening import SUFFIXES, logs_in
from inspector.logs.options import ReadOptions
from inspector.logs.reading import Job, jobs_of
from inspector.wrongrobot import limit_warnings
from noiseclassifier.jsontext import from_json
from noisemodel import NoiseModelError, OutputError, archive
from noisemodel.atomic import also_reading, refuse_existing, replacing


@dataclass(frozen=True)
class Written:
    """Result of importing one log, or one of its episodes.

    Attributes:
        path: The run file; if the log could not be read, the log.
        duration: Of the run, in [s].
        rate: Of the run, in [Hz].
        remarks: What was decided during the import, a sentence each.
        problem: Why there is no run file; empty if there is one.
        lost: Whether the log could be read and the run file not be written.
        kept: Whether the run file is there already, from a call that was interrupted.
    """

    path: Path
    duration: float = 0.0
    rate: float = 0.0
    remarks: tuple[str, ...] = ()
    problem: str = ""
    lost: bool = False
    kept: bool = False


DIGEST = "import_sha256"
"""Key of ``meta`` with the digest of what a run file was made of."""

READ = (*SUFFIXES, ".json", ".yaml")
"""Suffixes of the files of a folder that are read if it is a log."""


@dataclass(eq=False)
class _Log:
    """A log, and how it is read."""

    path: Path
    options: ReadOptions
    desired: Path | None

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the options, the robot's file, and what is read of the logs."""
        found = hashlib.sha256(repr(self.options).encode(errors="surrogatepass"))
        for log in (self.path, self.desired or Path(), Path(self.options.robot)):
            files = sorted(log.rglob("*")) if log != Path() and log.is_dir() else [log]
            for path in files:  # not the videos of a data set
                if path.is_file() and (path == log or path.suffix.lower() in READ):
                    with path.open("rb") as stream:
                        found.update(hashlib.file_digest(stream, "sha256").digest())
        return found.hexdigest()


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

    Args:
        logs: The logs, and folders of them.
        output: A run file; for several logs or episodes a folder, which is created.
        options: How to read the logs.
        desired: A log with the desired motion, for a single log.
        episodes: Which episodes to read, all unless given.
        overwrite: Whether files that exist may be replaced.
        progress: Wraps what is read, to show how much is done.

    Yields:
        The result of each; a log that cannot be read does not stop the others.

    Raises:
        InspectorError: If the output does not fit the logs, or a single log cannot be read.
        NoiseModelError: If an output exists, or a single log makes no run.
    """
    logs = [log for path in logs for log in logs_in(path)[0]]
    also_reading(logs)
    several = len(logs) > 1
    if desired and several:
        raise InspectorError(f"{desired}: belongs to one log, {len(logs)} are given")
    jobs: list[tuple[_Log, Job]] = []
    failed: list[Written] = []
    for log in logs:
        try:
            inner = without_progress if several else progress  # there is one bar at a time
            found = jobs_of(
                log, options, desired=desired, episodes=episodes or None, progress=inner
            )
            one = _Log(log, options, desired)
            jobs += ((one, job) for job in found)
        except (InspectorError, NoiseModelError) as error:
            if not several:
                raise
            failed.append(Written(log, problem=str(error)))
    targets = _targets(jobs, output, several=several, overwrite=overwrite)
    in_folder = targets != (output,)
    there = {target for target in targets if target.exists() and not overwrite}
    yield from failed
    for (log, job), target in progress(zip(jobs, targets, strict=True), len(jobs)):
        if target in there:
            yield Written(target, kept=True)
            continue
        try:
            digest = log.digest if in_folder else ""
            yield _written(job.read(), target, digest, overwrite=overwrite)
        except (InspectorError, NoiseModelError) as error:
            if len(targets) == 1 and not several:
                raise
            lost = isinstance(error, OutputError) and isinstance(error.__cause__, OSError)
            yield Written(target, problem=str(error), lost=lost)


def _targets(
    jobs: Sequence[tuple[_Log, Job]], output: Path, *, several: bool, overwrite: bool
) -> tuple[Path, ...]:
    """Paths of the run files, checked before the logs are read."""
    if len(jobs) == 1 and not several and not output.is_dir():
        refuse_existing(output, overwrite=overwrite)
        return (output,)
    if output.suffix == ".npz" or output.is_file():
        raise InspectorError(
            f"{output}: {len(jobs)} runs do not fit into one file; name a folder, or choose one"
            " (--episode)"
        )
    targets = tuple(output / f"{job.name}.npz" for _, job in jobs)
    duplicates = [path for place, path in enumerate(targets) if path in targets[:place]]
    if duplicates:
        raise InspectorError(
            f"{duplicates[0]}: two logs would be written there; import them one by one"
        )
    try:
        output.mkdir(exist_ok=True)
    except OSError as error:
        raise InspectorError(f"{output}: cannot be created ({error.strerror})") from error
    for (log, _), target in zip(jobs, targets, strict=True):
        if not (target.exists() and _digest_in(target) == log.digest):
            refuse_existing(target, overwrite=overwrite)
    return targets


def _digest_in(target: Path) -> object:
    """What a run file was made of; None of another file."""
    try:
        held = archive.read(target, ["meta"])["meta"]
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
    remarks += limit_warnings(run)
    run.save(target, overwrite=overwrite)
    return Written(target, run.duration, run.rate, tuple(remarks))
