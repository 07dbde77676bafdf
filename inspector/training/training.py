"""Classifiers trained on annotated runs, from files."""

from collections.abc import Callable, Sequence
from pathlib import Path

import models
from inspector.errors import InspectorError
from inspector.progress import progress
from inspector.training.part import Part
from inspector.training.recordings import count, recordings
from noisemodel.atomic import refuse_existing

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
"""Profiles by name, at a rate in [Hz]."""


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
        rate: Rate of the model, in [Hz], to which faster runs are decimated.
        output: The model file to write.
        part: The part of the recordings to train on.
        overwrite: Whether a file that exists may be replaced.

    Returns:
        The measures of the model on its own training frames.

    Raises:
        InspectorError: If there is no such profile, or it does not exist at this rate.
        OutputError: If the file exists or cannot be written.
    """
    chosen = profile_at(profile, rate)
    refuse_existing(output, overwrite=overwrite)
    found = progress(recordings(inputs, rate, part), "read", total=count(inputs))
    try:
        examples = models.Examples.read(found, chosen)
    except models.MissingSignalError as error:
        raise InspectorError(f"{error}; --profile scalar takes the noise alone") from error
    classifier = models.Classifier.train(examples, chosen)
    classifier.save(output, overwrite=overwrite)
    predicted = classifier.predict_features(examples.features)
    return models.Evaluation.of(examples.labels, predicted, classifier.classes)


def profile_at(name: str, rate: float) -> models.Profile:
    """A profile by its name.

    Args:
        name: One of ``PROFILES``.
        rate: The rate that it is to have, in [Hz].

    Raises:
        InspectorError: If there is no such profile, or it does not exist at this rate.
    """
    if name not in PROFILES:
        raise InspectorError(f"no profile {name!r}; there are {', '.join(PROFILES)}")
    found = PROFILES[name](rate)
    if found.rate != rate:
        raise InspectorError(f"profile {name} exists at {found.rate:g} Hz only, not {rate:g}")
    return found
