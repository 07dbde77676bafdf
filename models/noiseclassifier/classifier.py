"""Models: a classifier of one rate labels signals whole, in pieces or as a stream; one of any rate.

A log has the bands up to half its rate, and the features of its signals; all others are missing.
The trees of a general model are trained on logs of many rates and of all inputs together, and learn
where frames without a feature belong. Bound to a rate and to signals (`General.at`), it is a
`Classifier` like any other, without missing features.
"""

import hashlib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Self, TypeAlias

import numpy as np

from noiseclassifier import modelfile
from noiseclassifier.dataset import Dataset
from noiseclassifier.errors import DatasetError, MissingSignalError, ProfileError, RateError
from noiseclassifier.estimators import ESTIMATORS, LEARNT, Detector, Estimator, Trees
from noiseclassifier.features import (
    CHUNK,
    FrameFeatures,
    Frames,
    WholeReference,
    features_of_pieces,
    frame_features,
    standard,
)
from noiseclassifier.labels import UNKNOWN, Labels
from noiseclassifier.matching import OK, UNCLEAR, truth_of, within
from noiseclassifier.measures import Evaluation
from noiseclassifier.profile import (
    HIGHEST,
    INPUTS,
    LOWEST,
    NOMINAL,
    RELATIVE,
    TOLERANCE,
    LogBands,
    Profile,
)
from noiseclassifier.recording import Recording
from noiseclassifier.signals import (
    EFFORT,
    NOISE,
    Array,
    Index,
    Mask,
    Real,
    Signals,
    Words,
    feeds,
    named,
    stacked,
)

# Of the inputs, those that training takes of each log: the others lack features of the first.
TAKEN = (INPUTS[0], INPUTS[1], INPUTS[4], INPUTS[6])
LOUD = 1.0  # mean of the features relative to the run above which a frame is loud
UNBOUNDED = 1e9  # highest value of features relative to the run: they say nothing of novelty


@dataclass(frozen=True, eq=False)
class Classifier:
    """A trained model: predicts the class of frames of noise."""

    profile: Profile
    classes: tuple[str, ...]  #: that it was trained with, in the profile's order
    estimator: Estimator  #: decides on standardised features
    mean: Array  #: of each feature, to be subtracted, shape (features,)
    scale: Array  #: of each feature, to be divided by, shape (features,)
    #: SHA-256 of training recordings, by name
    runs: Mapping[str, str] = field(default_factory=dict)
    metrics: Mapping[str, Any] = field(default_factory=dict)  #: of training and validation set
    versions: Mapping[str, str] = field(default_factory=dict)  #: of the software that trained it
    sha256: str = ""  #: of the file that it was loaded from

    @classmethod
    def train(
        cls, dataset: Dataset, profile: Profile, *, validation: Dataset | None = None
    ) -> Self:
        """Train a classifier; equal input gives an equal one. It needs scikit-learn.

        Args:
            dataset: Annotated frames by their features of the same profile.
            validation: Others, for measures.

        Raises:
            DatasetError: If the frames are of fewer than two classes.
            ProfileError: If the estimator is of earlier versions.
        """
        if profile.estimator not in LEARNT:
            raise ProfileError(
                f"estimator {profile.estimator} cannot be trained, only {', '.join(LEARNT)}"
            )
        classes, targets = targets_of(dataset.labels, profile.classes)
        mean, scale = standard(dataset.features, profile)
        scaled = (dataset.features - mean) / scale
        estimator = LEARNT[profile.estimator].fit(scaled, targets, dataset.groups, profile)
        model = cls(profile, classes, estimator, mean, scale, dict(dataset.hashes))
        metrics = {"training": model.evaluate(dataset).as_dict()}
        if validation is not None:
            metrics["validation"] = model.evaluate(validation).as_dict()
        return replace(model, metrics=metrics, versions=modelfile.versions())

    def evaluate(self, dataset: Dataset) -> Evaluation:
        """Measures of the model on frames, by their features."""
        return Evaluation.of(dataset.labels, self.predict(dataset.features), self.classes)

    def at(self, rate: float, signals: Collection[str]) -> "Classifier":
        """The model itself, if a log of that rate, in [Hz], and of these signals feeds it.

        Raises:
            MissingSignalError: If it needs another one.
            RateError: If the rate is lower than the model's.
        """
        if not feeds(signals, self.profile.signals):
            lacking = [name for name in self.profile.signals if name not in signals]
            raise MissingSignalError(lacking, signals)
        if self.rate > rate * (1.0 + NOMINAL):
            raise RateError(rate, [self.rate])
        return self

    @property
    def rate(self) -> float:
        """Sample rate of its signals, in [Hz]."""
        return self.profile.rate

    def predict(self, features: Real) -> Words:
        """Class of each frame by its features, not yet standardised, shape (frames, features)."""
        return self._choose(self.decide(features))

    def decide(self, plain: Real) -> Array:
        """Decision values by features, not yet standardised; `noiseclassifier.estimators` has them.

        The shapes are (frames, features) and (frames, decisions).
        """
        chunks = range(0, max(len(plain), 1), CHUNK)
        parts = ((plain[first : first + CHUNK] - self.mean) / self.scale for first in chunks)
        return np.concatenate([self.estimator.decision(part) for part in parts])

    def classify(
        self, signal: Signals, rate: float, *, start: float = 0.0, valid: Mask | None = None
    ) -> Labels:
        """Label all frames of a signal.

        Args:
            signal: The noise estimate, shape (samples,), or signals by name, each of that shape.
            rate: Its sample rate, in [Hz], which must be the model's, up to ``profile.NOMINAL``.
            start: Time of its first sample, in [s].
            valid: False in gaps, shape (samples,); frames that touch a gap are left out.

        Raises:
            RateError: If the model is of another rate.
            SignalError: If the signal is too short for a frame, or not finite, or not 1-D, or the
                model needs another one.
        """
        return self.classify_pieces([(signal, valid)], rate, start=start)

    def classify_pieces(
        self,
        pieces: Iterable[tuple[Signals, Mask | None]],
        rate: float,
        *,
        start: float = 0.0,
        whole: bool = False,
    ) -> Labels:
        """Label all frames of a signal that comes in pieces, as of the whole one.

        Memory does not grow with the signal, but for the labels. Features are relative to the past
        of the signal, which is silent before a robot's first step.

        Args:
            pieces: Signals and their validity, one piece or more; all else as `classify` has it.
            whole: Whether what is found has to stand out from the whole signal, too: of both
                decisions, the one with the lower failure score counts then.
        """
        self.check_rate(rate, "lower the signal's rate, or take another model")
        starts: list[Index] = []
        decisions: list[Array] = []
        reference = WholeReference() if whole and self.profile.reference else None
        for first, plain, pace in features_of_pieces(pieces, self.profile):
            starts.append(first)
            decisions.append(self.decide(plain))
            if reference is not None:
                own = plain[:, : plain.shape[1] // 2]  # the other half is relative to the past
                reference.add(own, self._choose(decisions[-1]) != "ok", pace)
        found, begins = np.concatenate(decisions), np.concatenate(starts)
        labels = self.labels(found, begins, rate, start=start)
        again = reference.relative(labels.flagged) if reference is not None else None
        if again is None:
            return labels
        places, features = again
        other = self.decide(features)
        own, others = (
            self.estimator.score(each)[:, 1:].sum(axis=1) for each in (found[places], other)
        )
        fewer = others < own
        found[places[fewer]] = other[fewer]
        return self.labels(found, begins, rate, start=start)

    def labels(self, decisions: Array, starts: Index, rate: float, *, start: float) -> Labels:
        """Labels of frames by their decision values and first samples; the signal has a start."""
        return Labels(
            start + starts / rate,
            start + (starts + self.profile.length) / rate,
            self._choose(decisions),
            self.estimator.score(decisions),
            self.classes,
            self.estimator.above_threshold(decisions),
            self.estimator.novel(decisions),
            hop=self.profile.hop / rate,
        )

    def check_rate(self, rate: float, advice: str) -> None:
        """Refuse signals of another rate."""
        if not abs(rate / self.rate - 1.0) <= NOMINAL:
            raise RateError(rate, [self.rate], advice)

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write a model file, whole or not at all; the same model gives the same bytes.

        Raises:
            OutputError: If the file exists or cannot be written.
        """
        settings = {"profile": self.profile.as_dict(), "rate": self.rate}
        modelfile.write(path, self, settings, overwrite=overwrite)

    def _choose(self, decisions: Array) -> Words:
        return np.array((*self.classes, UNKNOWN))[self.estimator.choose(decisions)]


class Stream:
    """A classifier of samples one by one, or in chunks of any size.

    `Classifier.classify` gives the same labels for the whole signal: both have the same features
    and decision values of each frame, bit for bit (of support vector machines, up to rounding). The
    label of a frame comes with its last sample.

    Args:
        rate: Sample rate of the signal, in [Hz]; the model's unless given.
        start: Time of the first sample, in [s].
        joints: Number of joints, if the model takes signals joint by joint.

    Raises:
        RateError: If the model is of another rate. Motion can be decimated before it becomes
            noise; the noise itself cannot.
    """

    def __init__(
        self,
        classifier: Classifier,
        *,
        rate: float | None = None,
        start: float = 0.0,
        joints: int = 1,
    ) -> None:
        self.classifier = classifier
        self.rate = classifier.rate if rate is None else rate
        self.start = start
        classifier.check_rate(self.rate, "lower the motion's rate, or take another model")
        profile = classifier.profile
        rows = profile.norms + (len(profile.signals) - profile.norms) * joints
        self._frames = FrameFeatures(profile, rows)
        nothing = np.empty((0, classifier.estimator.width))
        self._nothing = classifier.labels(nothing, np.empty(0, np.intp), self.rate, start=start)

    @property
    def count(self) -> int:
        """Samples so far."""
        return self._frames.count

    def push(self, samples: Signals, valid: Mask | None = None) -> Labels:
        """Labels of the frames that samples complete.

        Args:
            samples: Any number of them, also none, shape (samples,), or of each signal by name,
                of that shape or, joint by joint, (joints, samples).
            valid: False in gaps, shape (samples,); frames that touch a gap are left out.

        Raises:
            SignalError: If the samples are not finite, not one-dimensional, or not all that the
                model needs; none is taken.
        """
        plain = stacked(samples, self.classifier.profile.signals)
        return self._labels(self._frames.push(plain, valid))

    def skip(self, samples: int) -> None:
        """Skip a gap: the same as pushing so many samples that are not valid, at once."""
        self._frames.skip(samples)

    def finish(self) -> Labels:
        """End the signal; what is pushed next begins another one.

        Returns the label of a last frame, flush with the end, if the profile asks for one.
        """
        return self._labels(self._frames.finish())

    def _labels(self, frames: Frames) -> Labels:
        if not len(frames.starts):
            return self._nothing
        decisions = self.classifier.decide(frames.features)
        return self.classifier.labels(decisions, frames.starts, self.rate, start=self.start)


def targets_of(labels: Words, known: Sequence[str]) -> tuple[tuple[str, ...], Index]:
    """Classes that the frames of a training set have, in order, and the number of each frame's."""
    there = set(labels.tolist())
    classes = tuple(name for name in known if name in there)
    if len(classes) < 2 or there - set(classes):
        raise DatasetError(
            f"training takes two classes or more of {', '.join(known)};"
            f" the frames are {', '.join(sorted(there))}"
        )
    return classes, np.array([classes.index(label) for label in labels.tolist()])


@dataclass(frozen=True, eq=False)
class General:
    """A model for any rate, and for whatever signals there are; fields as of a `Classifier`."""

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
    def train(cls, frames: Dataset, recipe: LogBands, *, thin: int = 1) -> Self:
        """Train a model; equal input gives an equal one. It needs scikit-learn.

        Args:
            frames: Of logs of any rates and signals, see `frames_of`.
            thin: What `frames_of` was given: each quiet `ok` frame counts for so many.

        Raises:
            DatasetError: If the frames are of fewer than two classes.
        """
        classes, targets = targets_of(frames.labels, recipe.classes)
        # A feature that no frame has tells nothing, wherever its frames would be.
        unknown = np.isnan(frames.features).all(axis=0)
        features = np.where(unknown, 0.0, frames.features)
        profile = recipe.at(HIGHEST, INPUTS[0])
        mean, scale = standard(features, profile)
        scaled = (features - mean) / scale
        weight = None  # scikit-learn takes minutes for thresholds of few frames that have weights
        if thin > 1:
            quiet = (frames.labels == OK) & ~loud(frames.features, recipe)
            weight = np.where(quiet, float(thin), 1.0)
        trees = Detector.fit(scaled, targets, frames.groups, profile, recipe.rising, weight)
        known = np.where(relative(recipe) | unknown, UNBOUNDED, trees.known)
        model = cls(recipe, classes, replace(trees, known=known), mean, scale, dict(frames.hashes))
        metrics = {"training": model.evaluate(frames).as_dict()}
        return replace(model, metrics=metrics, versions=modelfile.versions())

    def evaluate(self, frames: Dataset) -> Evaluation:
        """Measures of the model on frames."""
        decisions = self.estimator.decision((frames.features - self.mean) / self.scale)
        names = np.array((*self.classes, UNKNOWN))
        return Evaluation.of(frames.labels, names[self.estimator.choose(decisions)], self.classes)

    def at(self, rate: float, signals: Collection[str] = (NOISE,)) -> Classifier:
        """Bind the model to a rate and to the signals of a log: to as many of these as it can take.

        Args:
            rate: Sample rate, in [Hz]; above ``HIGHEST``, the log has to be decimated to that.

        Raises:
            RateError: If the rate is below ``LOWEST``.
            MissingSignalError: If there is none of the signals that it takes.
        """
        if rate < LOWEST * (1.0 - TOLERANCE):
            raise RateError(rate, [LOWEST])
        taken = next((names for names in INPUTS if feeds(signals, names)), None)
        if taken is None:
            raise MissingSignalError([NOISE], signals)
        return _bound(self, min(rate, HIGHEST), taken)

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write a model file, as `Classifier.save` does."""
        profile = self.recipe.at(HIGHEST, INPUTS[0]).as_dict()
        settings = {"recipe": asdict(self.recipe), "profile": profile, "rate": HIGHEST}
        modelfile.write(path, self, settings, overwrite=overwrite)


@lru_cache(maxsize=4)  # many logs have one rate and the same signals
def _bound(model: General, rate: float, signals: Sequence[str]) -> Classifier:
    profile = model.recipe.at(rate, signals)
    there = model.recipe.places(profile)
    estimator, mean, scale = model.estimator.at(there), model.mean[there], model.scale[there]
    known = (model.runs, model.metrics, model.versions, model.sha256)
    return Classifier(profile, model.classes, estimator, mean, scale, *known)


def frames_of(
    recordings: Iterable[Recording], recipe: LogBands, *, thin: int = 1
) -> Iterator[Dataset]:
    """Labelled frames of recordings, once for each of the inputs that they feed.

    Frames are those that classifying would cut, relative to the recording itself. Frames of which
    the annotations tell no class are left out. Of inputs after the first that a recording feeds,
    every other frame is enough.

    Args:
        thin: Keep every ``thin``-th of the quiet `ok` frames. Loud ones, which are most like
            failures, are all kept.

    Yields:
        Frames of a recording in all features that there are, NaN where one is missing.
    """
    efforts = np.array([name.startswith(EFFORT) for name in recipe.columns])
    for recording in recordings:
        fed = [names for names in TAKEN if feeds(named(recording.signal), names)]
        for number, names in enumerate(fed):
            profile = recipe.at(recording.rate, names)
            starts, features, _ = frame_features(recording.signal, profile, recording.valid)
            begin, step = recording.start + starts / recording.rate, 1.0 / recording.rate
            truth = truth_of(begin, begin + profile.duration, within(recording), step=step)
            full = np.full((len(starts), len(efforts)), np.nan, dtype=np.float32)
            full[:, recipe.places(profile)] = features
            full[:, efforts] = np.nan  # their unit is not known, but relative to the run it is none
            ok = truth == OK
            quiet = ok & ~loud(full, recipe)
            kept = np.flatnonzero((truth != UNCLEAR) & (~quiet | (np.cumsum(quiet) % thin == 0)))
            kept = kept[::2] if number else kept
            runs = np.full(len(kept), recording.name)
            yield Dataset(full[kept], truth[kept], runs, {recording.name: recording.sha256})


def loud(features: Real, recipe: LogBands) -> Mask:
    """Frames that are louder than their run so far, by features of shape (frames, features)."""
    found: Mask = np.nanmean(features[:, relative(recipe)], axis=1) > LOUD
    return found


def relative(recipe: LogBands) -> Mask:
    """Which features are relative to the run."""
    return np.array([name.startswith(RELATIVE) for name in recipe.columns])


# --- files, and the choice of a model

Model: TypeAlias = Classifier | General  # a model of one rate, or of any


def load(path: str | Path) -> Model:
    """Read a model file, of one rate or of any; nothing in it is unpickled or run.

    Raises:
        FileError: If the file is missing, damaged, no model file, or of another version.
    """
    manifest, arrays, profile, recipe = modelfile.read(path)
    classes, mean, scale = tuple(manifest["classes"]), arrays["mean"], arrays["scale"]
    sha256 = hashlib.sha256(Path(path).read_bytes()).hexdigest()
    known = *(manifest[name] for name in ("runs", "metrics", "versions")), sha256
    if recipe is not None:
        return General(recipe, classes, Detector.of(arrays, profile), mean, scale, *known)
    estimator = ESTIMATORS[profile.estimator].of(arrays, profile)
    return Classifier(profile, classes, estimator, mean, scale, *known)


def nearest(
    models: Mapping[str, Model],
    rate: float,
    signals: Collection[str] = (NOISE,),
    *,
    logged: float | None = None,
) -> tuple[str, Classifier]:
    """Model of the nearest rate at or below the signals' rate, in [Hz], by name and bound to them.

    Of models of one rate, it is the one of most signals. A general model has any rate.

    Args:
        logged: Rate at which values that are held were logged, in [Hz]: if no model takes their own
            rate, it is a model of one rate that takes this one.

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
    single = {name: model for name, model in models.items() if isinstance(model, Classifier)}
    if single and logged not in (None, rate):
        return nearest(single, logged, signals)
    if lacking and not rates:
        raise min(lacking, key=lambda error: len(error.lacking))
    raise RateError(rate, rates)
