"""The general model: one for any rate and for whatever signals a log has.

A log has the bands up to half its rate, and the features of its signals; all others are missing.
Trees are trained on logs of many rates and of all inputs together, and learn where frames without a
feature belong. Bound to a rate and to signals (`General.at`), the model is a `Classifier` like any
other, without missing features.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Self, TypeAlias

import numpy as np

from noiseclassifier import modelfile
from noiseclassifier.classifier import Classifier, targets_of
from noiseclassifier.dataset import Examples
from noiseclassifier.errors import MissingSignalError, RateError
from noiseclassifier.estimators.trees import Detector, Trees
from noiseclassifier.features import frame_features, standard
from noiseclassifier.labels import UNKNOWN
from noiseclassifier.matching import OK, UNCLEAR, truth_of, within
from noiseclassifier.measures import Evaluation
from noiseclassifier.profile import HIGHEST, INPUTS, LOWEST, RELATIVE, TOLERANCE, LogBands
from noiseclassifier.recording import Recording
from noiseclassifier.signals import EFFORT, NOISE, Array, feeds, named

LEARNT = (INPUTS[0], INPUTS[1], INPUTS[4], INPUTS[6])
"""Of the inputs, those that training takes of each log: the others lack features of the first."""
UNBOUNDED = 1e9
"""Highest value of features relative to the run: they say nothing of novelty."""


@dataclass(frozen=True, eq=False)
class General:
    """A model for any rate, and for whatever signals there are.

    Attributes:
        recipe: Bands, frames and settings of the estimator, for any rate.
        estimator: Trees on all features.
        mean, scale, classes, runs, metrics, versions, sha256: As of a `Classifier`.
    """

    recipe: LogBands
    classes: tuple[str, ...]
    estimator: Trees
    mean: Array
    scale: Array
    runs: Mapping[str, str] = field(default_factory=dict)
    metrics: Mapping[str, Any] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    sha256: str = ""

    @classmethod
    def train(cls, frames: Examples, recipe: LogBands, *, thin: int = 1) -> Self:
        """Train a model; needs scikit-learn.

        Args:
            frames: Of logs of any rates and signals, see `frames_of`.
            recipe: All settings.
            thin: They hold every ``thin``-th `ok` frame, for which the odds are corrected.

        Returns:
            The model; equal input gives an equal one.

        Raises:
            DatasetError: If the frames are of fewer than two classes.
        """
        classes, targets = targets_of(frames.labels, recipe.classes)
        # A feature that no frame has tells nothing, wherever its frames would be.
        unknown = np.isnan(frames.features).all(axis=0)
        features = np.where(unknown, 0.0, frames.features)
        profile = recipe.bound(HIGHEST)
        mean, scale = standard(features, profile)
        scaled = (features - mean) / scale
        trees = Detector.fit(scaled, targets, frames.groups, profile, recipe.rising)
        relative = np.array([name.startswith(RELATIVE) for name in recipe.columns])
        shift = np.zeros(1 + len(classes))
        shift[1] = np.log(thin)  # of the odds of `ok`
        trees = replace(
            trees,
            known=np.where(relative | unknown, UNBOUNDED, trees.known),
            calibration=trees.calibration + shift,
        )
        model = cls(recipe, classes, trees, mean, scale, dict(frames.hashes))
        metrics = {"training": model.evaluate(frames).as_dict()}
        return replace(model, metrics=metrics, versions=modelfile.versions())

    def evaluate(self, frames: Examples) -> Evaluation:
        """Measures of the model on frames."""
        decisions = self.estimator.decision((frames.features - self.mean) / self.scale)
        names = np.array((*self.classes, UNKNOWN))
        return Evaluation.of(frames.labels, names[self.estimator.choose(decisions)], self.classes)

    def at(self, rate: float, signals: Collection[str] = (NOISE,)) -> Classifier:
        """Bind the model to a rate and to the signals of a log.

        Args:
            rate: Sample rate, in [Hz]; above ``HIGHEST``, the log has to be decimated to that.
            signals: Names of the signals that there are.

        Returns:
            A classifier of that rate, which takes as many of the signals as it can.

        Raises:
            RateError: If the rate is below ``LOWEST``.
            MissingSignalError: If there is none of the signals that it takes.
        """
        if rate < LOWEST * (1.0 - TOLERANCE):
            raise RateError(rate, [LOWEST])
        taken = next((names for names in INPUTS if feeds(signals, names)), None)
        if taken is None:
            raise MissingSignalError([NOISE], signals)
        profile = self.recipe.bound(min(rate, HIGHEST), taken)
        there = self.recipe.places(profile)
        return Classifier(
            profile,
            self.classes,
            self.estimator.at(there),
            self.mean[there],
            self.scale[there],
            self.runs,
            self.metrics,
            self.versions,
            self.sha256,
        )

    @classmethod
    def of(cls, manifest: Mapping[str, Any], arrays: Mapping[str, Array], sha256: str = "") -> Self:
        """Make a model of what `modelfile.read` gave."""
        recipe = LogBands.of(manifest["recipe"])
        return cls(
            recipe,
            tuple(manifest["classes"]),
            Detector.of(arrays, recipe.bound(HIGHEST)),
            arrays["mean"],
            arrays["scale"],
            manifest["runs"],
            manifest["metrics"],
            manifest["versions"],
            sha256,
        )

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write a model file, whole or not at all; the same model gives the same bytes.

        Raises:
            OutputError: If the file exists or cannot be written.
        """
        profile = self.recipe.bound(HIGHEST).as_dict()
        settings = {"recipe": asdict(self.recipe), "profile": profile, "rate": HIGHEST}
        modelfile.write(path, self, settings, overwrite=overwrite)


def frames_of(
    recordings: Iterable[Recording],
    recipe: LogBands,
    *,
    thin: int = 1,
    inputs: Sequence[Sequence[str]] = LEARNT,
) -> Iterator[Examples]:
    """Labelled frames of recordings, once for each of the inputs that they feed.

    Frames are those that classifying would cut, relative to the recording itself. Frames of which
    the annotations tell no class are left out. Of inputs after the first that a recording feeds,
    every other frame is enough.

    Args:
        recordings: Annotated, of any rates.
        recipe: How they are framed, and what to compute.
        thin: Keep every ``thin``-th `ok` frame.
        inputs: Signals to take.

    Yields:
        Frames of a recording in all features that there are, NaN where one is missing.
    """
    efforts = np.array([name.startswith(EFFORT) for name in recipe.columns])
    for recording in recordings:
        fed = [names for names in inputs if feeds(named(recording.signal), names)]
        for number, names in enumerate(fed):
            profile = recipe.bound(recording.rate, names)
            starts, features = frame_features(recording.signal, profile, recording.valid)
            begin, step = recording.start + starts / recording.rate, 1.0 / recording.rate
            truth = truth_of(begin, begin + profile.duration, within(recording), step=step)
            ok = truth == OK
            kept = np.flatnonzero((truth != UNCLEAR) & (~ok | (np.cumsum(ok) % thin == 0)))
            kept = kept[::2] if number else kept
            full = np.full((len(kept), len(efforts)), np.nan, dtype=np.float32)
            full[:, recipe.places(profile)] = features[kept]
            full[:, efforts] = np.nan  # their unit is not known, but relative to the run it is none
            runs = np.full(len(full), recording.name)
            yield Examples(full, truth[kept], runs, {recording.name: recording.sha256})


# --- files, and the choice of a model

Model: TypeAlias = Classifier | General
"""A model of one rate, or of any."""


def load(path: str | Path) -> Model:
    """Read a model file, of one rate or of any; nothing in it is unpickled or run.

    Raises:
        FileError: If the file is missing, damaged, no model file, or of another version.
    """
    manifest, arrays = modelfile.read(path)
    kind = General if "recipe" in manifest else Classifier
    return kind.of(manifest, arrays, modelfile.digest(path))


def nearest(
    models: Mapping[str, Model], rate: float, signals: Collection[str] = (NOISE,)
) -> tuple[str, Classifier]:
    """Model of the nearest rate at or below the signals' rate, bound to them.

    Of models of one rate, it is the one of most signals. A general model has any rate.

    Args:
        models: Models of any rates, by name.
        rate: Sample rate of the signals, in [Hz].
        signals: Names of the signals that there are.

    Returns:
        Its name, and the model at its rate.

    Raises:
        MissingSignalError: If each model needs a signal that is missing.
        RateError: If all others are of higher rates, or there are no models.
    """
    found: dict[str, Classifier] = {}
    lacking: list[MissingSignalError] = []
    rates: list[float] = []
    for name, model in models.items():
        try:
            found[name] = model.at(rate, signals)
        except MissingSignalError as error:
            lacking.append(error)
        except RateError as error:
            rates += error.known
    if found:
        name = max(found, key=lambda each: (found[each].rate, len(found[each].profile.signals)))
        return name, found[name]
    if lacking and not rates:
        raise min(lacking, key=lambda error: len(error.lacking))
    raise RateError(rate, rates)
