"""Good runs of one robot, from files: what baselines and adapted models learn from."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import NamedTuple

import noiseclassifier as nc
from inspector.audit.placeholder import without_placeholder
from inspector.errors import InspectorError
from inspector.logs.opening import Reading, open_source, sources
from inspector.logs.opening import Source as LogSource
from inspector.progress import progress
from inspector.training.part import Part
from inspector.training.recordings import in_part, of_run, of_sample
from inspector.wrongrobot import check_joints, limit_warnings
from noiseclassifier.scenarios.sample import Sample, is_sample
from noiseclassifier.scenarios.signals import WHOLE


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


def without_remarks(line: str) -> None:
    """Ignore a remark."""


def good_runs(
    inputs: Sequence[Path],
    what: str,
    *,
    rate: float | None = None,
    highest: float = inf,
    part: Part = Part.ALL,
    task: str = "read",
    reading: Reading | None = None,
    remark: Callable[[str], None] = without_remarks,
) -> Iterator[nc.Recording]:
    """Recordings of good runs of one nominal rate and robot, as `inspector classify` takes them.

    Args:
        inputs: Run files, logs, samples, folders of them, or NoisyTest folders.
        what: What they are for, in messages: "a baseline".
        rate: Rate to which faster runs are decimated, in [Hz]; by default their own.
        highest: Rate to which runs above it are decimated in any case, in [Hz].
        part: The part of the recordings to read.
        task: Name of the progress bar.
        reading: How logs are read.
        remark: Called with a line for what was assumed of a log, or hints at another robot.

    Raises:
        InspectorError: If runs are of different rates or robots, or there is none.
    """
    files = list(_files(inputs, reading))
    first: Source | None = None
    for file in progress(files, task, total=len(files)):
        for source, recording in _read(file, rate, highest, reading, remark):
            if in_part(recording, part):
                first = first or source
                _check(source, first, what)
                yield replace(recording, signal=_signals(recording))
    if first is None:
        raise InspectorError(f"no run in {', '.join(map(str, inputs))}, expected good ones")


def _files(inputs: Sequence[Path], reading: Reading | None) -> Iterator[LogSource]:
    """Runs, samples, and folders of NoisyTest."""
    for path in inputs:
        if _is_noisytest(path):
            yield LogSource(path)
        else:
            yield from sources([path], reading)[0]


def _is_noisytest(path: Path) -> bool:
    return path.is_dir() and any(path.glob("*.toml"))


def _read(
    file: LogSource,
    rate: float | None,
    highest: float,
    reading: Reading | None,
    remark: Callable[[str], None],
) -> Iterator[tuple[Source, nc.Recording]]:
    path = file.path
    if _is_noisytest(path):
        for each in nc.noisytest.read_folder(path, rate=rate):
            yield Source(path / each.name, each.rate), each
    elif path.suffix == ".npz" and is_sample(path):
        own = Sample.load(path, only=WHOLE)
        wanted = min(rate or own.rate, highest)
        yield Source(path, wanted, own.robot), of_sample(path, wanted)
    else:
        opened = open_source(file, reading)
        check_joints(opened.run.joint_names, opened.run.robot)
        for line in (opened.assumed, *limit_warnings(opened.run)):
            if line:
                remark(f"{file.shown}: {line}")
        run, _ = without_placeholder(opened.run)
        wanted = min(rate or run.rate, highest)
        source = Source(file.shown, wanted, run.robot or "", frozenset(run.joint_names))
        recording = of_run(file.shown, run, wanted, sha256=opened.sha256)
        yield source, recording


def _check(source: Source, first: Source, what: str) -> None:
    """Refuse a recording of another rate or robot than the first."""
    if abs(source.rate / first.rate - 1) > nc.profile.NOMINAL:
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


def _signals(recording: nc.Recording) -> dict[str, nc.types.Real]:
    """Signals by name, without the error if the desired motion is the measured one."""
    return nc.signals.without_zero_error(nc.signals.named(recording.signal))
