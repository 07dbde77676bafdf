"""Good runs of one robot, from files: what baselines and adapted models learn from."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import NamedTuple

import models
import noisemodel as nm
from inspector.audit.placeholder import without_placeholder
from inspector.errors import InspectorError
from inspector.progress import progress
from inspector.training.part import Part
from inspector.training.recordings import in_part, of_run, of_sample
from scenarios.sample import Sample, is_sample
from scenarios.signals import WHOLE


class Source(NamedTuple):
    """The properties that all good runs must share."""

    path: Path
    """The file."""
    rate: float
    """In [Hz]."""
    robot: str = ""
    """Empty if the file does not name it."""
    joints: frozenset[str] = frozenset()
    """Their names; empty if there is only a noise."""


def good_runs(
    inputs: Sequence[Path],
    what: str,
    *,
    rate: float | None = None,
    highest: float = inf,
    part: Part = Part.ALL,
    task: str = "read",
) -> Iterator[models.Recording]:
    """Recordings of good runs, all of one rate and robot, as `inspector classify` takes them.

    Args:
        inputs: Run files, samples, folders of them, or NoisyTest folders.
        what: What they are for, in messages: "a baseline".
        rate: Rate to which faster runs are decimated, in [Hz]; by default their own.
        highest: Rate to which runs above it are decimated in any case, in [Hz].
        part: The part of the recordings to read.
        task: Name of the progress bar.

    Raises:
        InspectorError: If runs are of different rates or robots, or there is none.
    """
    files = list(_files(inputs))
    first: Source | None = None
    for path in progress(files, task, total=len(files)):
        for source, recording in _read(path, rate, highest):
            if in_part(recording, part):
                first = first or source
                _check(source, first, what)
                yield replace(recording, signal=_signals(recording))
    if first is None:
        raise InspectorError(f"no run in {', '.join(map(str, inputs))}, expected good ones")


def _files(inputs: Sequence[Path]) -> Iterator[Path]:
    """Run files, samples, and folders of NoisyTest."""
    for path in inputs:
        if path.is_dir() and not any(path.glob("*.toml")):
            yield from sorted(path.rglob("*.npz"))
        else:
            yield path


def _read(
    path: Path, rate: float | None, highest: float
) -> Iterator[tuple[Source, models.Recording]]:
    if path.is_dir():
        for each in models.noisytest.read_folder(path, rate=rate):
            yield Source(path / each.name, each.rate), each
    elif is_sample(path):
        own = Sample.load(path, only=WHOLE)
        wanted = min(rate or own.rate, highest)
        yield Source(path, wanted, own.robot), of_sample(path, wanted)
    else:
        run, _ = without_placeholder(nm.Run.load(path))
        wanted = min(rate or run.rate, highest)
        source = Source(path, wanted, run.robot or "", frozenset(run.joint_names))
        yield source, of_run(path, run, wanted)


def _check(source: Source, first: Source, what: str) -> None:
    """Refuse a recording of another rate or robot than the first."""
    if abs(source.rate / first.rate - 1) > models.profile.TOLERANCE:
        lower = min(source.rate, first.rate)
        raise InspectorError(
            f"{source.path}: recorded at {source.rate:g} Hz, {first.path} at {first.rate:g} Hz;"
            f" --rate {lower:g} decimates the faster ones"
        )
    if source.robot and first.robot and source.robot != first.robot:
        raise InspectorError(
            f"{source.path}: a run of {source.robot}, but {first.path} of {first.robot};"
            f" {what} is of one robot"
        )
    if source.joints and first.joints and source.joints != first.joints:
        differing = sorted(source.joints ^ first.joints)
        raise InspectorError(
            f"{source.path}: has other joints than {first.path} ({', '.join(differing[:3])});"
            f" {what} is of one robot"
        )


def _signals(recording: models.Recording) -> dict[str, models.types.Real]:
    """Signals by name, without the error if the desired motion is the measured one."""
    return models.signals.without_zero_error(models.signals.named(recording.signal))
