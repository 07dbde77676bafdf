"""Features and classifier of frames as a transformer and an estimator of scikit-learn.

Runs of a group share their motion, and their frames overlap: cross-validation has to keep groups
together, in scikit-learn by a splitter such as ``GroupKFold``.

>>> import numpy as np
>>> from sklearn.linear_model import LogisticRegression
>>> from sklearn.model_selection import GroupKFold, cross_val_score
>>> from sklearn.pipeline import make_pipeline
>>> from sklearn.preprocessing import StandardScaler
>>> from noiseclassifier.sklearn import NoiseClassifier, NoiseFeatures
>>> time = np.arange(400) / 1000.0  # frames of 0.4 s at 1 kHz
>>> random = np.random.default_rng(0)
>>> frames = 1.0 + 0.01 * random.standard_normal((120, 400))
>>> labels = np.tile(["ok", "oscillations"], 60)
>>> groups = np.repeat([f"run {number}" for number in range(6)], 20)
>>> frames[labels != "ok"] += 0.1 * np.sin(2 * np.pi * 90.0 * time)
>>> pipeline = make_pipeline(NoiseFeatures(), StandardScaler(), LogisticRegression())
>>> cross_val_score(pipeline, frames, labels, groups=groups, cv=GroupKFold(3)).round(2).tolist()
[1.0, 1.0, 1.0]

`NoiseClassifier` uses groups in training, too, for the calibration of its probabilities.
scikit-learn's metadata routing passes them on:

>>> import sklearn
>>> with sklearn.config_context(enable_metadata_routing=True):
...     classifier = NoiseClassifier().set_fit_request(groups=True)
...     params = {"groups": groups}
...     scores = cross_val_score(classifier, frames, labels, params=params, cv=GroupKFold(3))
>>> scores.round(2).tolist()
[1.0, 1.0, 1.0]
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Self, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import (
    BaseEstimator,
    ClassifierMixin,
    ClassNamePrefixFeaturesOutMixin,
    TransformerMixin,
)
from sklearn.utils.metaestimators import available_if
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import check_is_fitted, validate_data

from noiseclassifier.dataset import features_in_chunks
from noiseclassifier.errors import ProfileError, SignalError
from noiseclassifier.estimators import ESTIMATORS
from noiseclassifier.estimators.decision import Probable
from noiseclassifier.features import feature_count, standard
from noiseclassifier.profile import GENERAL, SCALAR, LogBands, Profile
from noiseclassifier.signals import Array

RECIPES = {"scalar": SCALAR, "general": GENERAL}
"""Profiles that have a name here."""
LEAST_SAMPLES = 2
"""Samples of the shortest frame; a Hann window of one sample is 0."""

Recipe: TypeAlias = str | LogBands | Profile


class _Framed(BaseEstimator):  # type: ignore[misc]
    """The settings of frames, which the transformer and the classifier share."""

    def __init__(
        self,
        profile: Recipe = "scalar",
        *,
        rate: float = 1000.0,
        settings: Mapping[str, Any] | None = None,
    ) -> None:
        self.profile = profile
        self.rate = rate
        self.settings = settings

    def _profile(self, width: int) -> Profile:
        """The profile for rows of so many numbers."""
        recipe = _recipe(self.profile)
        found = recipe.at(self.rate) if isinstance(recipe, LogBands) else recipe
        found = Profile.of({**found.as_dict(), **(self.settings or {})})
        length, rest = divmod(width, len(found.signals))
        if rest or length < LEAST_SAMPLES:
            raise SignalError(
                f"rows of {width} numbers, expected frames of {LEAST_SAMPLES} samples or more of"
                f" {', '.join(found.signals)}"
            )
        if not isinstance(recipe, LogBands):
            return found
        if length < found.window:
            bins = np.linspace(0.0, self.rate / 2, length // 2 + 2)
            found = replace(found, window=length, edges=tuple(bins.tolist()), quick_window=0)
        return replace(found, length=length)

    def _features(self, X: ArrayLike) -> Array:
        """Features of rows of frames that fit what was fitted."""
        check_is_fitted(self)
        return _features(validate_data(self, X, dtype=np.float64, reset=False), self.profile_)


class NoiseFeatures(ClassNamePrefixFeaturesOutMixin, TransformerMixin, _Framed):  # type: ignore[misc]
    """Log-band energies of frames, pooled over time, as a transformer.

    Args:
        profile: ``"scalar"``, the noise alone; ``"general"``, the signals *desired*, *measured* and
            *error*; a `LogBands`; or a `Profile`, which fixes rate and length of the frames.
        rate: Sample rate of the frames, in [Hz].
        settings: Settings of the profile that differ, by name.

    Attributes:
        profile_: The profile at the rate and for the frames given. A frame that is shorter than a
            window is a single window, whose bands are the bins of its Fourier transform.
        n_features_in_: Samples of a frame, times the number of signals.
    """

    def fit(self, X: ArrayLike, y: object = None) -> Self:
        """Choose windows and bands for the length of the frames.

        Args:
            X: Frames of the noise, shape (frames, length); of several signals one after the other,
                shape (frames, signals * length).
        """
        frames = validate_data(self, X, dtype=np.float64, ensure_min_features=LEAST_SAMPLES)
        self.profile_ = self._profile(frames.shape[1])
        self._n_features_out = feature_count(self.profile_)
        return self

    def transform(self, X: ArrayLike) -> Array:
        """Features of frames, not standardised, shape (frames, features)."""
        return self._features(X)


def _has_probabilities(classifier: "NoiseClassifier") -> bool:
    settings = classifier.settings or {}
    kind = settings.get("estimator", _recipe(classifier.profile).estimator)
    return issubclass(ESTIMATORS[kind], Probable)


class NoiseClassifier(ClassifierMixin, _Framed):  # type: ignore[misc]
    """Classifier of frames: features of a profile, standardised, and its estimator.

    A frame has the class with the highest score: the alarm threshold, the unknown frames and the
    debouncing of `noiseclassifier.Classifier` are for the frames of a whole signal.

    Args:
        rate: Sample rate of the frames, in [Hz].
        settings: Settings of the profile that differ, by name: ``{"estimator": "svm"}``.

    Attributes:
        classes_: The classes, sorted.
        profile_: The profile at the rate and for the frames given.
        mean_: Mean of each feature, shape (features,).
        scale_: Scale of each feature, shape (features,).
        estimator_: One of `noiseclassifier.estimators`.
        n_features_in_: Samples of a frame, times the number of signals.
    """

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.classifier_tags.poor_score = True  # spectra do not separate points of a plane
        return tags

    def fit(self, X: ArrayLike, y: ArrayLike, groups: ArrayLike | None = None) -> Self:
        """Train on labelled frames.

        Args:
            y: Class of each frame, shape (frames,).
            groups: Group of each frame, shape (frames,); runs of a group share their motion. By
                default all frames are one group, and probabilities are not calibrated.
        """
        frames, labels = validate_data(
            self, X, y, dtype=np.float64, ensure_min_features=LEAST_SAMPLES
        )
        check_classification_targets(labels)
        self.classes_, targets = np.unique(labels, return_inverse=True)
        if len(self.classes_) < 2:
            raise ValueError(
                f"training requires 2 classes or more; y has {len(self.classes_)} class"
            )
        names = np.full(len(frames), "") if groups is None else np.asarray(groups).astype(str)
        if names.shape != (len(frames),):
            raise ValueError(f"groups of shape {names.shape}, expected {(len(frames),)}")
        self.profile_ = self._profile(frames.shape[1])
        plain = _features(frames, self.profile_)
        self.mean_, self.scale_ = standard(plain, self.profile_)
        scaled = (plain - self.mean_) / self.scale_
        estimator = ESTIMATORS[self.profile_.estimator]
        self.estimator_ = estimator.fit(scaled, targets, names, self.profile_)
        return self

    def predict(self, X: ArrayLike) -> NDArray[Any]:
        """Class of each frame, shape (frames,)."""
        scores = self._scores(X)
        predicted: NDArray[Any] = self.classes_[scores.argmax(axis=1)]
        return predicted

    def decision_function(self, X: ArrayLike) -> Array:
        """Scores of the classes, shape (frames, classes); of two, the difference, (frames,).

        Scores are logarithms of probabilities, or of support vector machines votes and margins.
        """
        scores = self._scores(X)
        return scores[:, 1] - scores[:, 0] if len(self.classes_) == 2 else scores

    @available_if(_has_probabilities)  # type: ignore[untyped-decorator]
    def predict_proba(self, X: ArrayLike) -> Array:
        """Probability of each class, shape (frames, classes); not of support vector machines."""
        return np.exp(self._scores(X))

    def _scores(self, X: ArrayLike) -> Array:
        plain = self._features(X)
        decisions = self.estimator_.decision((plain - self.mean_) / self.scale_)
        probable = isinstance(self.estimator_, Probable)
        scores: Array = decisions[:, :-1] if probable else self.estimator_.score(decisions)
        return scores


def _recipe(profile: Recipe) -> LogBands | Profile:
    if not isinstance(profile, str):
        return profile
    if profile not in RECIPES:
        raise ProfileError(f"no profile {profile!r}; there are {', '.join(RECIPES)}")
    return RECIPES[profile]


def _features(frames: Array, profile: Profile) -> Array:
    signals = len(profile.signals)
    rows = frames.reshape(len(frames), signals, -1) if signals > 1 else frames
    return features_in_chunks(rows, profile)
