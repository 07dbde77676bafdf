"""Choose a model for a run and let it label the run's noise."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import models
import noisemodel as nm
from inspector.errors import InspectorError
from noisemodel.types import Array

Library = Mapping[str, models.Classifier]
"""Models by name."""


class CannotTellError(InspectorError):
    """A run in which no model can see anything."""


@dataclass(frozen=True)
class Labelled:
    """What a model said.

    Attributes:
        labels: One label per frame.
        model: The model's name.
        remark: What was done to the run before, a sentence; empty if nothing was.
    """

    labels: models.Labels
    model: str
    remark: str = ""


def load_library(paths: Sequence[Path]) -> Library:
    """Read models, by the stems of their files.

    Raises:
        ModelFileError: If a file is no model.
    """
    return {path.stem: models.Classifier.load(path) for path in paths}


def label_run(run: nm.Run, library: Library) -> Labelled:
    """Label a run by the model of the nearest rate at or below its own.

    Args:
        run: The run.
        library: Models to choose from.

    Returns:
        Labels on the time axis of the run.

    Raises:
        CannotTellError: If the run is slower than every model, or no frame is free of gaps.
        SignalError: If the run is too short for a frame.
    """
    name, classifier = _choose(library, run.rate)
    rate, remark = classifier.rate, ""
    if not _close(run.rate, rate):
        run = nm.lowered(run, rate)
        remark = f"Labelled at {rate:g} Hz, the rate of model {name}."
    noise = nm.simplified(run.motion, run.velocity_desired)
    labels = classifier.classify(noise, rate, start=float(run.time[0]), valid=run.mask)
    if not len(labels):
        raise CannotTellError(
            f"no stretch of {classifier.profile.duration:g} s without a gap, which model {name}"
            " takes to tell anything"
        )
    return Labelled(labels, name, remark)


def label_noise(time: Array, noise: Array, library: Library) -> Labelled:
    """Label a scalar noise, as NoisyTest's logs hold it.

    Args:
        time: Uniform, shape (samples,), in [s].
        noise: Shape (samples,), in [rad/s].
        library: Models to choose from.

    Returns:
        Labels on the time axis of the log.

    Raises:
        CannotTellError: If no model has the rate of the noise; it cannot be lowered, since the
            joint velocities are not there.
        SignalError: If the noise is too short for a frame.
    """
    rate = models.nominal_rate(time)
    name, classifier = _choose(library, rate)
    if not _close(rate, classifier.rate):
        raise CannotTellError(
            f"a noise of {rate:g} Hz cannot be lowered to the {classifier.rate:g} Hz of"
            f" model {name} without joint velocities"
        )
    labels = classifier.classify(noise, classifier.rate, start=float(time[0]))
    return Labelled(labels, name)


def _choose(library: Library, rate: float) -> tuple[str, models.Classifier]:
    try:
        chosen = models.nearest(tuple(library.values()), rate)
    except models.RateError as error:
        raise CannotTellError(str(error)) from error
    return next((name, model) for name, model in library.items() if model is chosen)


def _close(rate: float, other: float) -> bool:
    return abs(rate / other - 1) < 1e-3
