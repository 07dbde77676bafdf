"""Features of frames as a transformer of scikit-learn, for any of its estimators.

Runs of a group share their motion, and their frames overlap: cross-validation has to keep groups
together, in scikit-learn by a splitter such as ``GroupKFold``.

>>> import numpy as np
>>> from sklearn.linear_model import LogisticRegression
>>> from sklearn.model_selection import GroupKFold, cross_val_score
>>> from sklearn.pipeline import make_pipeline
>>> from sklearn.preprocessing import StandardScaler
>>> from noiseclassifier.sklearn import NoiseFeatures
>>> time = np.arange(400) / 1000.0  # frames of 0.4 s at 1 kHz
>>> random = np.random.default_rng(0)
>>> frames = 1.0 + 0.01 * random.standard_normal((120, 400))
>>> labels = np.tile(["ok", "oscillations"], 60)
>>> groups = np.repeat([f"run {number}" for number in range(6)], 20)
>>> frames[labels != "ok"] += 0.1 * np.sin(2 * np.pi * 90.0 * time)
>>> pipeline = make_pipeline(NoiseFeatures(), StandardScaler(), LogisticRegression())
>>> cross_val_score(pipeline, frames, labels, groups=groups, cv=GroupKFold(3)).round(2).tolist()
[1.0, 1.0, 1.0]
"""

from dataclasses import replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator, ClassNamePrefixFeaturesOutMixin, TransformerMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from noiseclassifier.errors import SignalError
from noiseclassifier.features import feature_count, features
from noiseclassifier.profile import LogBands, Profile
from noiseclassifier.signals import Array

LEAST_SAMPLES = 2
"""Samples of the shortest frame; a Hann window of one sample is 0."""


class NoiseFeatures(ClassNamePrefixFeaturesOutMixin, TransformerMixin, BaseEstimator):  # type: ignore[misc]
    """Log-band energies of frames, pooled over time, as a transformer.

    Args:
        profile: A `LogBands`, by default of the noise alone, or a `Profile`, which fixes rate and
            length of the frames.
        rate: Sample rate of the frames, in [Hz].

    Attributes:
        profile_: The profile at the rate and for the frames given. A frame that is shorter than a
            window is a single window, whose bands are the bins of its Fourier transform.
        n_features_in_: Samples of a frame, times the number of signals.
    """

    def __init__(self, profile: LogBands | Profile | None = None, *, rate: float = 1000.0) -> None:
        self.profile = profile
        self.rate = rate

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
        check_is_fitted(self)
        frames = validate_data(self, X, dtype=np.float64, reset=False)
        signals = len(self.profile_.signals)
        rows = frames.reshape(len(frames), signals, -1) if signals > 1 else frames
        return features(rows, self.profile_)

    def _profile(self, width: int) -> Profile:
        """The profile for rows of so many numbers."""
        recipe = LogBands() if self.profile is None else self.profile
        found = recipe.at(self.rate) if isinstance(recipe, LogBands) else recipe
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
