"""Train and measure models on annotated runs, from files."""

import hashlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import models
import noisemodel as nm
from inspector.errors import InspectorError
from inspector.progress import progress
from inspector.training.part import Part
from noisemodel.atomic import refuse_existing
from scenarios.sample import Sample, is_sample
from scenarios.signals import WHOLE

PROFILES: dict[str, Callable[[float], models.Profile]] = {
    "joints": lambda rate: models.EACH.at(rate),
    "general": lambda rate: models.GENERAL.at(rate),
    "scalar": lambda rate: models.SCALAR.at(rate),
    "logbands": lambda rate: models.LogBands().at(rate),
    "noisytest-rbf": lambda _: models.Profile.noisytest("rbf"),
    "noisytest-linear": lambda _: models.Profile.noisytest("linear"),
    "paper-rbf": lambda _: models.Profile.paper("rbf"),
    "paper-linear": lambda _: models.Profile.paper("linear"),
}


def train(
    inputs: Sequence[Path],
    profile: str,
    rate: float,
    output: Path,
    *,
    part: Part = Part.ALL,
    overwrite: bool = False,
) -> models.Evaluation:
    """Train a model and write it.

    Args:
        inputs: Annotated run files, samples, folders of them, or NoisyTest folders.
        profile: One of ``PROFILES``.
        rate: Rate of the model, in [Hz]; faster runs are lowered to it.
        output: The model file to write.
        part: Which of the recordings to learn from.
        overwrite: Whether a file that exists may be replaced.

    Returns:
        How the model does on what it was trained on.

    Raises:
        InspectorError: If there is no such profile, or it does not exist at this rate.
        OutputError: If the file exists or cannot be written.
    """
    chosen = settings(profile, rate)
    refuse_existing(output, overwrite=overwrite)
    watched = progress(recordings(inputs, rate, part), "read", total=sum(map(_count, inputs)))
    try:
        examples = models.Examples.read(watched, chosen)
    except models.MissingSignalError as error:
        raise InspectorError(f"{error}; --profile scalar takes the noise alone") from error
    classifier = models.Classifier.train(examples, chosen)
    classifier.save(output, overwrite=overwrite)
    called = classifier.predict_features(examples.features)
    return models.Evaluation.of(examples.labels, called, classifier.classes)


def settings(profile: str, rate: float) -> models.Profile:
    """Look up a profile.

    Args:
        profile: One of ``PROFILES``.
        rate: The rate that it is wanted at, in [Hz].

    Raises:
        InspectorError: If there is no such profile, or it does not exist at this rate.
    """
    if profile not in PROFILES:
        raise InspectorError(f"no profile {profile!r}; there are {', '.join(PROFILES)}")
    found = PROFILES[profile](rate)
    if found.rate != rate:
        raise InspectorError(f"profile {profile} exists at {found.rate:g} Hz only, not {rate:g}")
    return found


def evaluate(
    model: Path, inputs: Sequence[Path], *, part: Part = Part.ALL, seen_too: bool = False
) -> models.Assessment:
    """Measure a model.

    Args:
        model: A model file.
        inputs: Annotated runs, samples or NoisyTest folders that it was not trained on.
        part: Which of the recordings to measure on.
        seen_too: Whether runs count that it was trained on, or that share their motion with such.

    Returns:
        The paper's metrics and the honest ones.

    Raises:
        SeenError: If it was trained on a run, unless that is asked for.
    """
    classifier = models.Classifier.load(model)
    found = recordings(inputs, classifier.rate, part)
    watched = progress(found, "evaluate", total=sum(map(_count, inputs)))
    return models.assess(classifier, watched, seen_too=seen_too)


def recordings(
    inputs: Sequence[Path], rate: float, part: Part = Part.ALL
) -> Iterator[models.Recording]:
    """Read annotated noise from runs, samples and NoisyTest folders.

    Args:
        inputs: Files, and folders of them, however deep.
        rate: The rate to bring runs to, in [Hz].
        part: Which of them are meant.

    Yields:
        One recording per run, sample or log. A sample may have no annotated block: what went wrong
        in it was too faint to be called one thing or the other.
    """
    for recording in _recordings(inputs, rate):
        held_out = models.held_out(models.group_of(recording.name))
        if part is Part.ALL or held_out == (part is Part.TEST):
            yield recording


def _recordings(inputs: Sequence[Path], rate: float) -> Iterator[models.Recording]:
    for path in inputs:
        if path.is_dir() and any(path.glob("*.toml")):
            yield from models.noisytest.read_folder(path, rate=rate)
            continue
        for file in sorted(path.rglob("*.npz")) if path.is_dir() else [path]:
            yield of_sample(file, rate) if is_sample(file) else of_run(file, rate)


def of_run(path: Path, rate: float) -> models.Recording:
    """Read the annotated noise of a run file.

    Args:
        path: A run file.
        rate: The rate to bring it to, in [Hz].

    Returns:
        Its norms and joints with its blocks.

    Raises:
        InspectorError: If the run is slower than that, or has no blocks.
    """
    found = recording_of(path, nm.Run.load(path), rate)
    if not found.blocks:
        raise InspectorError(f"{path}: has no annotated blocks")
    return found


def recording_of(path: Path, run: nm.Run, rate: float) -> models.Recording:
    """Take the noise of a run, annotated or not.

    Args:
        path: The run file.
        run: What is in it.
        rate: The rate to bring it to, in [Hz].

    Returns:
        Its norms and joints with its blocks, if it has any.

    Raises:
        InspectorError: If the run is slower than that.
    """
    if run.rate < rate * (1 - 1e-3):
        raise InspectorError(f"{path}: recorded at {run.rate:g} Hz, the model needs {rate:g} Hz")
    slower = nm.decimated(run, rate)
    return models.Recording(
        name=path.stem,
        signal={**nm.norms(slower), **nm.by_joint(slower)},
        rate=rate,
        blocks=tuple(models.Block(b.start, b.stop, b.label) for b in slower.blocks),
        start=float(slower.time[0]),
        valid=slower.mask,
        sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
    )


def of_sample(path: Path, rate: float) -> models.Recording:
    """Read the annotated noise of a sample.

    Args:
        path: A sample, as `inspector simulate dataset` makes it.
        rate: A rate that it keeps its noise at, in [Hz]: noise cannot be lowered as velocities can.

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


def _count(path: Path) -> int:
    """Say how many recordings there are to be read, or a few more."""
    return sum(1 for file in path.rglob("*.*") if file.suffix in (".npz", ".toml")) or 1
