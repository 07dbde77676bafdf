"""Choose a model for a run and let it label the run's noise."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import models
import noisemodel as nm
from inspector import assets
from inspector.errors import InspectorError
from noisemodel.types import Array, Real

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


def load_library(paths: Sequence[Path] = ()) -> Library:
    """Read models, by the stems of their files.

    Args:
        paths: Model files; those that ship unless given.

    Raises:
        ModelFileError: If a file is no model.
    """
    return {path.stem: models.Classifier.load(path) for path in paths or assets.model_files()}


def for_robot(library: Library, robot: str | None) -> Library:
    """Leave out what goes joint by joint and has learnt from other robots alone.

    What single joints do carries over to a robot that was not met less than what norms do. A model
    whose runs name no robot stays, and so do all if none would be left.

    Args:
        library: Models to choose from.
        robot: The robot that they are to hear, if it has a name.
    """
    kept = {name: model for name, model in library.items() if _knows(model, robot)}
    return kept or library


def _knows(model: models.Classifier, robot: str | None) -> bool:
    if not any(map(models.signals.by_joint, model.profile.signals)):
        return True
    met = {models.splitting.robot_of(name) for name in model.runs} - {""}
    return not met or robot in met


def label_run(run: nm.Run, library: Library) -> Labelled:
    """Label a run by the model of the nearest rate at or below its own that it can feed.

    Args:
        run: The run.
        library: Models to choose from.

    Returns:
        Labels on the time axis of the run.

    Raises:
        CannotTellError: If the run is slower than every model, feeds none, or has no frame without
            a gap.
        SignalError: If the run is too short for a frame.
    """
    signals = signals_of(run)
    name, classifier = _choose(for_robot(library, run.robot), run.rate, signals)
    rate, remark = classifier.rate, ""
    if not _close(run.rate, rate):
        run = nm.decimated(run, rate)
        signals = signals_of(run)
        remark = f"Labelled at {rate:g} Hz, the rate of model {name}."
    labels = classifier.classify(signals, rate, start=float(run.time[0]), valid=run.mask)
    if not len(labels):
        raise CannotTellError(
            f"no stretch of {classifier.profile.duration:g} s without a gap, which model {name}"
            " takes to tell anything"
        )
    return _counted(Labelled(labels, name, remark))


def signals_of(run: nm.Run) -> dict[str, Real]:
    """Take what models listen to, without the error where what is desired is what was measured.

    Args:
        run: The run.

    Returns:
        Norms by name, each of shape (samples,), and velocities joint by joint, shape
        (joints, samples), in [rad/s].
    """
    return models.signals.without_zero_error({**nm.norms(run), **nm.by_joint(run)})


def _counted(labelled: Labelled) -> Labelled:
    """Say how many frames are out of distribution."""
    labels = labelled.labels
    novel = 0 if labels.novel is None else int(labels.novel.sum())
    if not novel:
        return labelled
    line = f"{novel} of {len(labels)} frames are out of distribution for model {labelled.model}."
    return replace(labelled, remark=" ".join(filter(None, (labelled.remark, line))))


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
    name, classifier = _choose(library, rate, (models.NOISE,))
    if not _close(rate, classifier.rate):
        raise CannotTellError(
            f"a noise of {rate:g} Hz cannot be lowered to the {classifier.rate:g} Hz of"
            f" model {name} without joint velocities"
        )
    labels = classifier.classify(noise, classifier.rate, start=float(time[0]))
    return _counted(Labelled(labels, name))


def _choose(
    library: Library, rate: float, signals: Collection[str]
) -> tuple[str, models.Classifier]:
    try:
        chosen = models.nearest(tuple(library.values()), rate, signals)
    except models.ModelsError as error:
        raise CannotTellError(str(error)) from error
    return next((name, model) for name, model in library.items() if model is chosen)


def _close(rate: float, other: float) -> bool:
    return abs(rate / other - 1) < 1e-3
