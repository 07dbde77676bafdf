"""Train and measure models on annotated runs, from files."""

import hashlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import models
import noisemodel as nm
from inspector.errors import InspectorError
from noisemodel.atomic import refuse_existing

PROFILES: dict[str, Callable[[float], models.Profile]] = {
    "logbands": lambda rate: models.LogBands().at(rate),
    "noisytest-rbf": lambda _: models.Profile.noisytest("rbf"),
    "noisytest-linear": lambda _: models.Profile.noisytest("linear"),
    "paper-rbf": lambda _: models.Profile.paper("rbf"),
    "paper-linear": lambda _: models.Profile.paper("linear"),
}


def train(
    inputs: Sequence[Path], profile: str, rate: float, output: Path, *, overwrite: bool = False
) -> models.Evaluation:
    """Train a model and write it.

    Args:
        inputs: Run files with blocks, or NoisyTest folders.
        profile: One of ``PROFILES``.
        rate: Rate of the model, in [Hz]; faster runs are lowered to it.
        output: The model file to write.
        overwrite: Whether a file that exists may be replaced.

    Returns:
        How the model does on what it was trained on.

    Raises:
        InspectorError: If there is no such profile, or it does not exist at this rate.
        OutputError: If the file exists or cannot be written.
    """
    if profile not in PROFILES:
        raise InspectorError(f"no profile {profile!r}; there are {', '.join(PROFILES)}")
    settings = PROFILES[profile](rate)
    if settings.rate != rate:
        raise InspectorError(f"profile {profile} exists at {settings.rate:g} Hz only, not {rate:g}")
    refuse_existing(output, overwrite=overwrite)
    dataset = models.Dataset.of(list(recordings(inputs, rate)), settings)
    classifier = models.Classifier.train(dataset, settings)
    classifier.save(output, overwrite=overwrite)
    return models.evaluate(classifier, dataset)


def evaluate(model: Path, inputs: Sequence[Path]) -> models.Evaluation:
    """Measure a model.

    Args:
        model: A model file.
        inputs: Run files with blocks, or NoisyTest folders, that it was not trained on.

    Returns:
        The paper's metrics and the honest ones.
    """
    classifier = models.Classifier.load(model)
    found = list(recordings(inputs, classifier.profile.rate))
    return models.evaluate(classifier, models.Dataset.of(found, classifier.profile, training=False))


def recordings(inputs: Sequence[Path], rate: float) -> Iterator[models.Recording]:
    """Read annotated noise from run files and NoisyTest folders.

    Args:
        inputs: Files and folders.
        rate: The rate to bring runs to, in [Hz].

    Yields:
        One recording per run or log.
    """
    for path in inputs:
        if path.is_dir() and any(path.glob("*.toml")):
            yield from models.noisytest.read_folder(path, rate=rate)
        elif path.is_dir():
            for file in sorted(path.glob("*.npz")):
                yield of_run(file, rate)
        else:
            yield of_run(path, rate)


def of_run(path: Path, rate: float) -> models.Recording:
    """Read the annotated noise of a run file.

    Args:
        path: A run file.
        rate: The rate to bring it to, in [Hz].

    Returns:
        Its simplified noise with its blocks.

    Raises:
        InspectorError: If the run is slower than that.
    """
    run = nm.Run.load(path)
    if run.rate < rate * (1 - 1e-3):
        raise InspectorError(f"{path}: recorded at {run.rate:g} Hz, the model needs {rate:g} Hz")
    if not run.blocks:
        raise InspectorError(f"{path}: has no annotated blocks")
    slower = nm.lowered(run, rate)
    return models.Recording(
        name=path.stem,
        signal=nm.simplified(slower.motion, slower.velocity_desired),
        rate=rate,
        blocks=tuple(models.Block(b.start, b.stop, b.label) for b in slower.blocks),
        start=float(slower.time[0]),
        valid=slower.mask,
        sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
    )
