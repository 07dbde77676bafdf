"""Classifiers of frames: ours, those of scikit-learn on our features, those of aeon on samples.

Conventions: training turns annotated frames into a function that classifies frames. All return a
class for each frame, and a failure score that ranks frames by confidence in a failure. Those of
aeon take the samples through one of `TRANSFORMS`.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from sklearn.ensemble import ExtraTreesClassifier, HistGradientBoostingClassifier
from sklearn.linear_model import LogisticRegression, RidgeClassifierCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

import noiseclassifier as nc
from noiseclassifier.estimators.estimator import ESTIMATORS
from noiseclassifier.features import feature_count, standard

RATE = 1000.0
"""Rate of the frames, in [Hz]."""

Prediction = tuple[np.ndarray, np.ndarray]
"""Predicted class, as an index, and failure score; shape (frames,) each."""
Classify = Callable[[np.ndarray], Prediction]
Train = Callable[[nc.Dataset], Classify]


@dataclass(frozen=True)
class Contender:
    """A classifier in the comparison.

    Attributes:
        signals: Its signals, in a word.
        name: Its name.
        profile: The profile that cuts its frames.
        train: Trains it.
        needs_aeon: Whether it is of aeon, which compiles code at first use; this is not timed.
    """

    signals: str
    name: str
    profile: nc.Profile
    train: Train
    needs_aeon: bool = False


def log_amplitude(frames: np.ndarray) -> np.ndarray:
    """Logarithm of amplitudes with a floor of 10⁻³ rad/s, as our features have it."""
    return np.log(np.abs(frames) + 1e-3)


TRANSFORMS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "as they are": lambda frames: frames,
    "differences": partial(np.diff, axis=-1),
    "arcsinh": lambda frames: np.arcsinh(frames / 1e-2),
    "logarithm": log_amplitude,
    "differences of logarithms": lambda frames: np.diff(log_amplitude(frames), axis=-1),
}
"""Transforms of the samples for the classifiers of aeon."""


def targets(dataset: nc.Dataset) -> np.ndarray:
    """Class of each frame as an index, shape (frames,)."""
    return np.array([nc.CLASSES.index(label) for label in dataset.labels.tolist()])


def features_of(frames: np.ndarray, profile: nc.Profile) -> np.ndarray:
    """Our features, computed 64 frames at a time, shape (frames, features)."""
    parts = np.split(frames, range(64, len(frames), 64))
    return np.concatenate([nc.features(part, profile) for part in parts])


def on_features(profile: nc.Profile, learnt: Callable[..., Classify]) -> Train:
    """Training of a classifier on our standardised features."""

    def train(dataset: nc.Dataset) -> Classify:
        plain = features_of(dataset.frames, profile)
        mean, scale = standard(plain, profile)
        decide = learnt((plain - mean) / scale, dataset)
        return lambda frames: decide((features_of(frames, profile) - mean) / scale)

    return train


def ours(profile: nc.Profile, scaled: np.ndarray, dataset: nc.Dataset) -> Classify:
    """Train an estimator of ours: networks, trees, or support vectors."""
    groups = np.array([nc.group_of(run) for run in dataset.runs.tolist()])
    estimator = ESTIMATORS[profile.estimator].fit(scaled, targets(dataset), groups, profile)

    def decide(scaled: np.ndarray) -> Prediction:
        decisions = estimator.decision(scaled)
        if profile.estimator != "svm":
            return estimator.choose(decisions), 1.0 - estimator.score(decisions)[:, 0]
        # The first pairs are `ok` against each failure; votes would rank too coarsely.
        against = -decisions[:, : len(nc.CLASSES) - 1]
        return estimator.choose(decisions), against.max(axis=1)

    return decide


def theirs(make: Callable[[], Any], scaled: np.ndarray, dataset: nc.Dataset) -> Classify:
    """Train a classifier of scikit-learn."""
    return partial(predict, make().fit(scaled, targets(dataset)))


def on_samples(view: Callable[[np.ndarray], np.ndarray], make: Callable[[], Any]) -> Train:
    """Training of a classifier of aeon on transformed samples."""

    def transformed(frames: np.ndarray) -> np.ndarray:
        several = frames if frames.ndim == 3 else frames[:, None]
        return np.ascontiguousarray(view(several), dtype=np.float32)

    def train(dataset: nc.Dataset) -> Classify:
        estimator = make().fit(transformed(dataset.frames), targets(dataset))
        return lambda frames: predict(estimator, transformed(frames))

    return train


def predict(estimator: Any, inputs: np.ndarray) -> Prediction:
    """Class of the highest score; the failure score is the negative score of `ok`."""
    scoring = getattr(estimator, "predict_proba", None) or estimator.decision_function
    scores = scoring(inputs)
    return scores.argmax(axis=1), -scores[:, 0]


def minirocket() -> Any:
    """MiniRocket of aeon with its default head: ridge regression with a cross-validated penalty."""
    from aeon.transformations.collection.convolution_based import MiniRocket

    penalties = np.logspace(-3.0, 6.0, 10)
    head = RidgeClassifierCV(penalties, class_weight="balanced")
    return make_pipeline(MiniRocket(random_state=0), StandardScaler(with_mean=False), head)


def quant() -> Any:
    """QUANT of aeon: quantiles of intervals, and extra trees."""
    from aeon.classification.interval_based import QUANTClassifier

    return QUANTClassifier(random_state=0)


ON_FEATURES: dict[str, Callable[[], Any]] = {
    "logistic regression": partial(LogisticRegression, max_iter=1000),
    "boosted trees": partial(HistGradientBoostingClassifier, early_stopping=False, random_state=0),
    "extra trees": partial(
        ExtraTreesClassifier, 400, criterion="entropy", max_features=0.1, random_state=0
    ),
}
ON_SAMPLES = {"MiniRocket": (minirocket, "logarithm"), "QUANT": (quant, "logarithm")}
"""Classifiers of aeon, and the default transform of each, which was not tuned."""


def contenders(*, views: bool) -> Iterator[Contender]:
    """All classifiers of the comparison.

    Args:
        views: Whether those of aeon take part with each transform, not only with the default one.
    """
    for signals, settings in (("three", nc.GENERAL), ("noise", nc.SCALAR)):
        profile = settings.at(RATE)
        gamma = 0.5 / feature_count(profile)
        vectors = replace(profile, estimator="svm", regularization=100.0, gamma=gamma)
        yield Contender(
            signals,
            f"our {profile.estimator}",
            profile,
            on_features(profile, partial(ours, profile)),
        )
        yield Contender(
            signals, "RBF support vectors", profile, on_features(profile, partial(ours, vectors))
        )
        for name, make in ON_FEATURES.items():
            yield Contender(signals, name, profile, on_features(profile, partial(theirs, make)))
        for name, (make, default) in ON_SAMPLES.items():
            for view in TRANSFORMS if views else (default,):
                train = on_samples(TRANSFORMS[view], make)
                yield Contender(signals, f"{name}, {view}", profile, train, needs_aeon=True)
