"""Ways to decide on a frame: ours, scikit-learn's on our features, and aeon's on the samples.

Conventions: to train is to turn annotated frames into a function that decides on frames. All grade
alike: a class for each frame, and a failure score, which ranks frames by how surely something is
wrong. aeon's see the samples in one of `VIEWS`.
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

import models
from models.estimators.estimator import ESTIMATORS
from models.features import feature_count, standard

RATE = 1000.0
"""Of the frames, in [Hz]."""

Answer = tuple[np.ndarray, np.ndarray]
"""Class called, as an index, and failure score, larger if more certain; shape (frames,) each."""
Decide = Callable[[np.ndarray], Answer]
Train = Callable[[models.Dataset], Decide]


@dataclass(frozen=True)
class Contender:
    """A way to decide.

    Attributes:
        signals: What it hears, in a word.
        name: What it is called.
        profile: Whose frames it sees.
        train: Learns from them.
        needs_aeon: Whether it is of aeon; some of it is compiled at first use, which is not timed.
    """

    signals: str
    name: str
    profile: models.Profile
    train: Train
    needs_aeon: bool = False


def loudness(frames: np.ndarray) -> np.ndarray:
    """Compress amplitudes as our features do: far below 10⁻³ rad/s, all is the same."""
    return np.log(np.abs(frames) + 1e-3)


VIEWS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "as they are": lambda frames: frames,
    "differences": partial(np.diff, axis=-1),
    "arcsinh": lambda frames: np.arcsinh(frames / 1e-2),
    "logarithm": loudness,
    "differences of logarithms": lambda frames: np.diff(loudness(frames), axis=-1),
}
"""What is made of the samples before aeon sees them."""


def targets(dataset: models.Dataset) -> np.ndarray:
    """Class of each frame as an index, shape (frames,)."""
    return np.array([models.CLASSES.index(label) for label in dataset.labels.tolist()])


def described(frames: np.ndarray, profile: models.Profile) -> np.ndarray:
    """Our features, a few frames at a time, shape (frames, features)."""
    parts = np.split(frames, range(64, len(frames), 64))
    return np.concatenate([models.features(part, profile) for part in parts])


def on_features(profile: models.Profile, learnt: Callable[..., Decide]) -> Train:
    """Let something decide on our features; it learns from them and the frames that they are of."""

    def train(dataset: models.Dataset) -> Decide:
        plain = described(dataset.frames, profile)
        mean, scale = standard(plain, profile)
        decide = learnt((plain - mean) / scale, dataset)
        return lambda frames: decide((described(frames, profile) - mean) / scale)

    return train


def ours(profile: models.Profile, scaled: np.ndarray, dataset: models.Dataset) -> Decide:
    """Let a machine of our own learn: networks, trees, or support vectors."""
    groups = np.array([models.group_of(run) for run in dataset.runs.tolist()])
    estimator = ESTIMATORS[profile.estimator].fit(scaled, targets(dataset), groups, profile)

    def decide(scaled: np.ndarray) -> Answer:
        decisions = estimator.decision(scaled)
        if profile.estimator != "svm":
            return estimator.choose(decisions), 1.0 - estimator.score(decisions)[:, 0]
        # The first pairs are `ok` against each failure; votes would rank too coarsely.
        against = -decisions[:, : len(models.CLASSES) - 1]
        return estimator.choose(decisions), against.max(axis=1)

    return decide


def theirs(make: Callable[[], Any], scaled: np.ndarray, dataset: models.Dataset) -> Decide:
    """Let a classifier of scikit-learn learn."""
    return partial(answer, make().fit(scaled, targets(dataset)))


def on_samples(view: Callable[[np.ndarray], np.ndarray], make: Callable[[], Any]) -> Train:
    """Let a classifier of aeon decide on the samples."""

    def seen(frames: np.ndarray) -> np.ndarray:
        several = frames if frames.ndim == 3 else frames[:, None]
        return np.ascontiguousarray(view(several), dtype=np.float32)

    def train(dataset: models.Dataset) -> Decide:
        estimator = make().fit(seen(dataset.frames), targets(dataset))
        return lambda frames: answer(estimator, seen(frames))

    return train


def answer(estimator: Any, seen: np.ndarray) -> Answer:
    """Call the class of the highest grade; a failure is the more certain, the less `ok` has."""
    grades = getattr(estimator, "predict_proba", None) or estimator.decision_function
    graded = grades(seen)
    return graded.argmax(axis=1), -graded[:, 0]


def minirocket() -> Any:
    """Make aeon's MiniRocket with ridge regression, its usual head, that chooses its penalty."""
    from aeon.transformations.collection.convolution_based import MiniRocket

    penalties = np.logspace(-3.0, 6.0, 10)
    head = RidgeClassifierCV(penalties, class_weight="balanced")
    return make_pipeline(MiniRocket(random_state=0), StandardScaler(with_mean=False), head)


def quant() -> Any:
    """Make aeon's QUANT: quantiles of intervals, and extra trees."""
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
"""aeon's, and the view that each has unless all are asked for; a choice that was not tuned."""


def contenders(*, views: bool) -> Iterator[Contender]:
    """List who takes part.

    Args:
        views: Whether aeon's see the samples in each way, and not in the usual one alone.
    """
    for signals, settings in (("three", models.GENERAL), ("noise", models.SCALAR)):
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
        for name, (make, usual) in ON_SAMPLES.items():
            for view in VIEWS if views else (usual,):
                train = on_samples(VIEWS[view], make)
                yield Contender(signals, f"{name}, {view}", profile, train, needs_aeon=True)
