"""The classifier: a profile, its machines, and where they were learnt."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from models import modelfile, svm
from models.dataset import Dataset
from models.errors import DatasetError, RateError, SignalError
from models.evaluation import evaluate
from models.features import features
from models.framing import frame_starts
from models.labels import Labels
from models.profile import TOLERANCE, Profile
from models.svm import Machines
from models.types import Array, Index, Mask, Real, Words

CHUNK = 64
"""Frames that are looked at together, which bounds the memory that a long signal takes."""


@dataclass(frozen=True, eq=False)
class Classifier:
    """A trained model: frames of a noise signal become class names.

    Attributes:
        profile: How a signal becomes features.
        classes: What frames can be called, in the profile's order: those it was trained with.
        machines: The support vector machines.
        mean: What is subtracted from the features, shape (features,).
        scale: What they are divided by then, shape (features,).
        runs: SHA-256 of each training recording, by name.
        metrics: Measures of the training set, and of a validation set if one was given.
        versions: Of the software that trained it.
    """

    profile: Profile
    classes: tuple[str, ...]
    machines: Machines
    mean: Array
    scale: Array
    runs: Mapping[str, str] = field(default_factory=dict)
    metrics: Mapping[str, Any] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def train(
        cls, dataset: Dataset, profile: Profile, *, validation: Dataset | None = None
    ) -> Self:
        """Learn a classifier; needs scikit-learn.

        Args:
            dataset: Annotated frames, cut by the same profile.
            profile: What to learn.
            validation: Other frames, to be measured by.

        Returns:
            The classifier; equal input gives an equal model.

        Raises:
            DatasetError: If the frames are of fewer than two classes.
            SignalError: If the frames do not fit the profile.
        """
        from models.training import fit, versions

        there = set(dataset.labels.tolist())
        classes = tuple(name for name in profile.classes if name in there)
        if len(classes) < 2 or there != set(classes):
            raise DatasetError(
                f"training takes two classes or more of {', '.join(profile.classes)};"
                f" the frames are {', '.join(sorted(there))}"
            )
        plain = np.concatenate(
            [features(dataset.frames[chunk], profile) for chunk in _chunks(np.arange(len(dataset)))]
        )
        mean, scale = _standard(plain, profile)
        targets = np.array([classes.index(label) for label in dataset.labels.tolist()])
        machines = fit((plain - mean) / scale, targets, profile).condensed()
        classifier = cls(profile, classes, machines, mean, scale, dict(dataset.hashes))
        sets = {"training": dataset} | ({"validation": validation} if validation else {})
        metrics = {name: evaluate(classifier, each).as_dict() for name, each in sets.items()}
        return replace(classifier, metrics=metrics, versions=versions())

    @property
    def rate(self) -> float:
        """Sample rate of the signals that it takes, in [Hz]."""
        return self.profile.rate

    def predict(self, frames: Real) -> Words:
        """Name the class of each frame.

        Args:
            frames: Stretches of noise signal, shape (frames, length).

        Returns:
            Class names, shape (frames,).

        Raises:
            SignalError: If the frames have another shape or values that are not finite.
        """
        return self._choose(self.decision(frames))

    def decision(self, frames: Real) -> Array:
        """Evaluate the two-class machines.

        Args:
            frames: Stretches of noise signal, shape (frames, length).

        Returns:
            Decisions, shape (frames, machines); `svm` says what they mean.

        Raises:
            SignalError: If the frames have another shape or values that are not finite.
        """
        return self._decide(frames, np.arange(len(frames)))

    def scores(self, frames: Real) -> Array:
        """Grade all classes for each frame, larger meaning more certain.

        Args:
            frames: Stretches of noise signal, shape (frames, length).

        Returns:
            Scores, shape (frames, classes); `svm.score` says what they mean.

        Raises:
            SignalError: If the frames have another shape or values that are not finite.
        """
        return self._score(self.decision(frames))

    def classify(
        self, signal: Real, rate: float, *, start: float = 0.0, valid: Mask | None = None
    ) -> Labels:
        """Label all frames of a signal.

        Args:
            signal: The noise estimate, shape (samples,).
            rate: Its sample rate, in [Hz], which must be the model's.
            start: Time of its first sample, in [s].
            valid: False in gaps, shape (samples,); frames that touch a gap are left out.

        Returns:
            Start, stop, class and scores of each frame.

        Raises:
            RateError: If the model is of another rate.
            SignalError: If the signal is too short for a frame, or not finite, or not 1-D.
        """
        if not abs(rate / self.rate - 1.0) <= TOLERANCE:
            raise RateError(rate, [self.rate], "lower the signal's rate, or take another model")
        signal = np.asarray(signal, dtype=np.float64)
        valid = np.ones(signal.shape, dtype=bool) if valid is None else np.asarray(valid, bool)
        first, length = int(self.profile.drop_first_sample), self.profile.length
        _check_signal(signal, valid, least=first + length)
        starts = first + frame_starts(
            len(signal) - first,
            length=length,
            hop=self.profile.hop,
            flush_end=self.profile.flush_end,
        )
        gaps = np.concatenate(([0], np.cumsum(~valid)))
        starts = starts[gaps[starts + length] == gaps[starts]]
        view = np.lib.stride_tricks.sliding_window_view(signal, length)
        return self.labels(self._decide(view, starts), starts, rate, start=start)

    def labels(self, decisions: Array, starts: Index, rate: float, *, start: float) -> Labels:
        """Say what decisions on frames mean.

        Args:
            decisions: Of all machines, shape (frames, machines).
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
        )

    def judge(self, plain: Array) -> Array:
        """Evaluate the two-class machines on features.

        Args:
            plain: Features, not yet standardised, shape (frames, features).

        Returns:
            Decisions, shape (frames, machines).
        """
        return self.machines.decision((plain - self.mean) / self.scale)

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
        arrays = {
            "vectors": self.machines.vectors,
            "coefficients": self.machines.coefficients,
            "intercept": self.machines.intercept,
            "mean": self.mean,
            "scale": self.scale,
        }
        modelfile.write(path, manifest, arrays, overwrite=overwrite)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a model file; nothing in it is unpickled or run.

        Args:
            path: The file.

        Raises:
            ModelFileError: If the file is missing, damaged, foreign, or of another version.
        """
        manifest, arrays = modelfile.read(path)
        profile = Profile.of(manifest["profile"])
        machines = Machines(
            arrays["vectors"],
            arrays["coefficients"],
            arrays["intercept"],
            profile.kernel,
            profile.gamma,
        )
        return cls(
            profile,
            tuple(manifest["classes"]),
            machines,
            arrays["mean"],
            arrays["scale"],
            runs=manifest["runs"],
            metrics=manifest["metrics"],
            versions=manifest["versions"],
        )

    def _decide(self, frames: Real, index: Index) -> Array:
        return np.concatenate(
            [self.judge(features(frames[chunk], self.profile)) for chunk in _chunks(index)]
        )

    def _choose(self, decisions: Array) -> Words:
        chosen = svm.choose(
            decisions, classes=len(self.classes), multiclass=self.profile.multiclass
        )
        return np.array(self.classes)[chosen]

    def _score(self, decisions: Array) -> Array:
        return svm.score(decisions, classes=len(self.classes), multiclass=self.profile.multiclass)


def _chunks(index: Index) -> list[Index]:
    return np.split(index, range(CHUNK, len(index), CHUNK))


def _standard(plain: Array, profile: Profile) -> tuple[Array, Array]:
    """Learn mean and scale of each feature; 0 and 1 where features stay as they are."""
    if not profile.least_deviation:
        return np.zeros(plain.shape[1]), np.ones(plain.shape[1])
    return plain.mean(axis=0), np.maximum(plain.std(axis=0), profile.least_deviation)


def _check_signal(signal: Real, valid: Mask, *, least: int) -> None:
    if signal.ndim != 1 or valid.shape != signal.shape:
        raise SignalError(
            f"a signal of shape {signal.shape} and validity of shape {valid.shape},"
            " expected (samples,) for both"
        )
    if len(signal) < least:
        raise SignalError(f"a signal of {len(signal)} samples is too short: a frame takes {least}")
    if not np.isfinite(signal).all():
        row = int(np.flatnonzero(~np.isfinite(signal))[0])
        raise SignalError(f"sample {row} of the signal is not finite ({signal[row]})")
