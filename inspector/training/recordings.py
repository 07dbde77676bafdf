"""Recordings of run files, samples and NoisyTest folders, at the rate of a model."""

import hashlib
from collections.abc import Iterator, Sequence
from pathlib import Path

import models
import noisemodel as nm
from inspector.errors import InspectorError
from inspector.training.part import Part
from scenarios.sample import Sample, is_sample
from scenarios.signals import WHOLE


def recordings(
    inputs: Sequence[Path], rate: float, part: Part = Part.ALL
) -> Iterator[models.Recording]:
    """Annotated noise of runs, samples and NoisyTest folders.

    Args:
        inputs: Files, and folders of them, however deep.
        rate: The rate to decimate runs to, in [Hz].
        part: The part of these recordings to read.

    Yields:
        One recording per run, sample or log. A sample may have no annotated block: its failures
        were too faint to be labelled either way.
    """
    for recording in _recordings(inputs, rate):
        if in_part(recording, part):
            yield recording


def in_part(recording: models.Recording, part: Part) -> bool:
    """Whether a recording belongs to a part of a data set."""
    return part.has(held_out=models.held_out(models.group_of(recording.name)))


def _recordings(inputs: Sequence[Path], rate: float) -> Iterator[models.Recording]:
    for path in inputs:
        if path.is_dir() and any(path.glob("*.toml")):
            yield from models.noisytest.read_folder(path, rate=rate)
            continue
        for file in sorted(path.rglob("*.npz")) if path.is_dir() else [path]:
            yield of_sample(file, rate) if is_sample(file) else of_annotated_run(file, rate)


def of_annotated_run(path: Path, rate: float) -> models.Recording:
    """Annotated noise of a run file.

    Args:
        path: A run file.
        rate: The rate to decimate it to, in [Hz].

    Returns:
        Its norms and joints with its blocks.

    Raises:
        InspectorError: If the run's rate is lower, or it has no blocks.
    """
    found = of_run(path, nm.Run.load(path), rate)
    if not found.blocks:
        raise InspectorError(f"{path}: has no annotated blocks")
    return found


def of_run(path: Path, run: nm.Run, rate: float) -> models.Recording:
    """Noise of a run, annotated or not.

    Args:
        path: The run file.
        run: Its content.
        rate: The rate to decimate it to, in [Hz].

    Returns:
        Its norms and joints with its blocks, if it has any.

    Raises:
        InspectorError: If the run's rate is lower.
    """
    if run.rate < rate * (1 - 1e-3):
        raise InspectorError(f"{path}: recorded at {run.rate:g} Hz, the model needs {rate:g} Hz")
    decimated = nm.decimated(run, rate)
    return models.Recording(
        name=path.stem,
        signal={**nm.norms(decimated), **nm.by_joint(decimated)},
        rate=rate,
        blocks=tuple(models.Block(b.start, b.stop, b.label) for b in decimated.blocks),
        start=float(decimated.time[0]),
        valid=decimated.mask,
        sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
    )


def of_sample(path: Path, rate: float) -> models.Recording:
    """Annotated noise of a sample.

    Args:
        path: A sample, as `inspector simulate dataset` makes it.
        rate: A rate at which the sample has its noise, in [Hz]: noise cannot be decimated as
            velocities can.

    Returns:
        Its norms, and joints if it has any at that rate, with its blocks, named by robot, scenario
        and seed, with the hash of the run that it was made of.

    Raises:
        ScenarioError: If it cannot be read, or has no noise of that rate.
    """
    sample = Sample.load(path, only=WHOLE).at(rate)
    return models.Recording(
        name=sample.name,
        signal={**{name: sample.signals[name] for name in WHOLE}, **sample.joints},
        rate=rate,
        blocks=tuple(models.Block(b.start, b.stop, b.label) for b in sample.blocks),
        sha256=str(sample.meta["sha256"]),
    )


def count(inputs: Sequence[Path]) -> int:
    """Number of recordings in files and folders, or a few more: the length of a progress bar."""
    return sum(
        sum(1 for file in path.rglob("*.*") if file.suffix in (".npz", ".toml")) or 1
        for path in inputs
    )
