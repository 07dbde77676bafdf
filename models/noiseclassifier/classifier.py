"""The classifier: a profile, its estimator, and the training set of it."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np

from noiseclassifier import modelfile
from noiseclassifier.confusion import Evaluation
from noiseclassifier.dataset import CHUNK, Dataset, Examples
from noiseclassifier.errors import DatasetError, FileError, MissingSignalError, RateError
from noiseclassifier.estimators import ESTIMATORS, Estimator
from noiseclassifier.features import features, standard
from noiseclassifier.framefeatures import frames_of
from noiseclassifier.labels import UNKNOWN, Labels
from noiseclassifier.profile import NOMINAL, Profile
from noiseclassifier.reference import Rest
from noiseclassifier.signals import Signals, feeds
from noiseclassifier.types import Array, Index, Mask, Real, Words


@dataclass(frozen=True, eq=False)
class Classifier:
    """A trained model: predicts the class of frames of noise.

    Attributes:
        profile: How a signal becomes features.
        classes: Names of the classes that it was trained with, in the profile's order.
        estimator: Decides on standardised features.
        mean: Mean of each feature, to be subtracted, shape (features,).
        scale: Scale of each feature, to divide by, shape (features,).
        runs: SHA-256 of each training recording, by name.
        metrics: Measures of the training set, and of a validation set if one was given.
        versions: Of the software that trained it.
        sha256: SHA-256 of the file that it was loaded from; empty if it was not.
    """

    profile: Profile
    classes: tuple[str, ...]
    estimator: Estimator
    mean: Array
    scale: Array
    runs: Mapping[str, str] = field(default_factory=dict)
    metrics: Mapping[str, Any] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    sha256: str = ""

    @classmethod
    def train(
        cls,
        dataset: Dataset | Examples,
        profile: Profile,
        *,
        validation: Dataset | Examples | None = None,
    ) -> Self:
        """Train a classifier; needs scikit-learn.

        Args:
            dataset: Annotated frames cut by the same profile, or their features.
            profile: All settings.
            validation: Others, for measures.

        Returns:
            The classifier; equal input gives an equal model.

        Raises:
            DatasetError: If the frames are of fewer than two classes.
            SignalError: If the frames do not fit the profile.
        """
        examples = _examples(dataset, profile)
        there = set(examples.labels.tolist())
        classes = tuple(name for name in profile.classes if name in there)
        if len(classes) < 2 or there - set(classes):
            raise DatasetError(
                f"training takes two classes or more of {', '.join(profile.classes)};"
                f" the frames are {', '.join(sorted(there))}"
            )
        mean, scale = standard(examples.features, profile)
        targets = np.array([classes.index(label) for label in examples.labels.tolist()])
        scaled = (examples.features - mean) / scale
        estimator = ESTIMATORS[profile.estimator].fit(scaled, targets, examples.groups, profile)
        classifier = cls(profile, classes, estimator, mean, scale, dict(examples.hashes))
        sets = {"training": examples}
        if validation is not None:
            sets["validation"] = _examples(validation, profile)
        metrics = {
            name: Evaluation.of(
                each.labels, classifier.predict_features(each.features), classes
            ).as_dict()
            for name, each in sets.items()
        }
        return replace(classifier, metrics=metrics, versions=modelfile.versions())

    def at(self, rate: float, signals: Collection[str]) -> "Classifier":
        """The model itself, if it fits.

        Args:
            rate: Sample rate of a log, in [Hz], which must be the model's or above.
            signals: Names of the signals that there are.

        Raises:
            MissingSignalError: If it needs another one.
            RateError: If the rate is lower.
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

    def predict(self, frames: Real) -> Words:
        """Class of each frame.

        Args:
            frames: Stretches of noise signal, shape (frames, length).

        Returns:
            Class names, shape (frames,).

        Raises:
            SignalError: If the frames have another shape or values that are not finite.
        """
        return self._choose(self.decision(frames))

    def decision(self, frames: Real) -> Array:
        """Decision values of frames.

        Args:
            frames: Stretches of noise signal, shape (frames, length), or (frames, signals, length).

        Returns:
            Shape (frames, decisions); `noiseclassifier.estimators` define their meaning.

        Raises:
            SignalError: If the frames have another shape or values that are not finite.
        """
        chunks = range(0, max(len(frames), 1), CHUNK)
        found = [features(frames[first : first + CHUNK], self.profile) for first in chunks]
        return self.decide(np.concatenate(found))

    def scores(self, frames: Real) -> Array:
        """Score of each class, larger meaning more certain.

        Args:
            frames: Stretches of noise signal, shape (frames, length).

        Returns:
            Shape (frames, classes): see `svm.score`; of networks and trees, probabilities.

        Raises:
            SignalError: If the frames have another shape or values that are not finite.
        """
        return self._score(self.decision(frames))

    def classify(
        self, signal: Signals, rate: float, *, start: float = 0.0, valid: Mask | None = None
    ) -> Labels:
        """Label all frames of a signal.

        Args:
            signal: The noise estimate, shape (samples,), or signals by name, each of that shape.
            rate: Its sample rate, in [Hz], which must be the model's, up to ``profile.NOMINAL``.
            start: Time of its first sample, in [s].
            valid: False in gaps, shape (samples,); frames that touch a gap are left out.

        Returns:
            Start, stop, class and scores of each frame.

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
        """Label all frames of a signal that comes in pieces, the same as those of the whole one.

        Memory does not grow with the signal, but for the labels.

        Features are relative to the past of the signal, which is silent before a robot's first
        step. Where the signal is whole, what is found has to stand out from the rest of it, too: of
        the decisions relative to the past and to the rest, that of the lower failure score counts.

        Args:
            pieces: The noise estimate, shape (samples,), or signals by name, each of that shape,
                and False in gaps, shape (samples,); one piece or more.
            rate: As `classify` takes it.
            start: Time of the first sample, in [s].
            whole: Whether what is found is compared with the rest of the signal.

        Returns:
            Start, stop, class and scores of each frame.

        Raises:
            RateError: If the model is of another rate.
            SignalError: As `classify`.
        """
        if not abs(rate / self.rate - 1.0) <= NOMINAL:
            raise RateError(rate, [self.rate], "lower the signal's rate, or take another model")
        starts: list[Index] = []
        decisions: list[Array] = []
        waiting = np.empty((0, len(self.mean)))
        rest = Rest() if whole and self.profile.reference else None

        def decide(plain: Array) -> None:
            decisions.append(self.decide(plain))
            if rest is not None:
                own = plain[:, : plain.shape[1] // 2]  # the other half is relative to the past
                rest.add(own, self._choose(decisions[-1]) != "ok")

        for first, plain in frames_of(pieces, self.profile):
            starts.append(first)
            waiting = np.concatenate((waiting, plain)) if len(waiting) else plain
            # The rounding of a decision depends on how many frames are decided at once.
            if count := len(waiting) // CHUNK * CHUNK:
                decide(waiting[:count])
                waiting = waiting[count:]
        if len(waiting) or not decisions:
            decide(waiting)
        found, begins = np.concatenate(decisions), np.concatenate(starts)
        labels = self.labels(found, begins, rate, start=start)
        again = rest.relative(labels.flagged) if rest is not None else None
        if again is None:
            return labels
        places, features = again
        other = self.decide(features)
        fewer = self._failure(other) < self._failure(found[places])
        found[places[fewer]] = other[fewer]
        return self.labels(found, begins, rate, start=start)

    def _failure(self, decisions: Array) -> Array:
        """Score of any failure, shape (frames,)."""
        return np.asarray(self._score(decisions)[:, 1:].sum(axis=1))

    def labels(self, decisions: Array, starts: Index, rate: float, *, start: float) -> Labels:
        """Labels of frames from their decision values.

        Args:
            decisions: Decision values, shape (frames, decisions).
            starts: First sample of each frame, shape (frames,).
            rate: Sample rate of the signal, in [Hz].
            start: Time of its first sample, in [s].
        """
        return Labels(
            start + starts / rate,
            start + (starts + self.profile.length) / rate,
            self._choose(decisions),
            self._score(decisions),
            self.classes,
            self.estimator.above_threshold(decisions),
            self.estimator.novel(decisions),
            hop=self.profile.hop / rate,
        )

    def decide(self, plain: Array) -> Array:
        """Decision values of features.

        Args:
            plain: Features, not yet standardised, shape (frames, features).

        Returns:
            Decisions, shape (frames, decisions).
        """
        chunks = range(0, max(len(plain), 1), CHUNK)
        parts = ((plain[first : first + CHUNK] - self.mean) / self.scale for first in chunks)
        return np.concatenate([self.estimator.decision(part) for part in parts])

    def predict_features(self, plain: Array) -> Words:
        """Class of each frame, from its features.

        Args:
            plain: Features, not yet standardised, shape (frames, features).

        Returns:
            Class names, shape (frames,).
        """
        return self._choose(self.decide(plain))

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write a model file, whole or not at all; the same model gives the same bytes.

        Args:
            path: The file to write, by convention ``*.npz``.
            overwrite: Whether a file that exists may be replaced.

        Raises:
            OutputError: If the file exists or cannot be written.
        """
        manifest = {
            "profile": self.profile.as_dict(),
            "classes": list(self.classes),
            "rate": self.rate,
            "runs": dict(self.runs),
            "metrics": dict(self.metrics),
            "versions": dict(self.versions),
        }
        arrays = {**self.estimator.arrays(), "mean": self.mean, "scale": self.scale}
        modelfile.write(path, manifest, arrays, overwrite=overwrite)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a model file; nothing in it is unpickled or run.

        Args:
            path: The file.

        Raises:
            FileError: If the file is missing, damaged, no model file, of another version, or
                a model for any rate.
        """
        manifest, arrays = modelfile.read(path)
        if "recipe" in manifest:
            raise FileError(path, "is a model for any rate; read it by models.load")
        return cls.of(manifest, arrays, modelfile.digest(path))

    @classmethod
    def of(cls, manifest: Mapping[str, Any], arrays: Mapping[str, Array], sha256: str = "") -> Self:
        """Make a classifier of what `modelfile.read` gave."""
        profile = Profile.of(manifest["profile"])
        return cls(
            profile,
            tuple(manifest["classes"]),
            ESTIMATORS[profile.estimator].of(arrays, profile),
            arrays["mean"],
            arrays["scale"],
            runs=manifest["runs"],
            metrics=manifest["metrics"],
            versions=manifest["versions"],
            sha256=sha256,
        )

    @cached_property
    def _names(self) -> Words:
        return np.array((*self.classes, UNKNOWN))

    def _choose(self, decisions: Array) -> Words:
        return self._names[self.estimator.choose(decisions)]

    def _score(self, decisions: Array) -> Array:
        return self.estimator.score(decisions)


def _examples(dataset: Dataset | Examples, profile: Profile) -> Examples:
    return Examples.of(dataset, profile) if isinstance(dataset, Dataset) else dataset
