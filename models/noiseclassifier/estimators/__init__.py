"""The estimators that there are, and what each of them offers."""

from collections.abc import Mapping
from typing import ClassVar, Protocol

from noiseclassifier.estimators.networks import Networks
from noiseclassifier.estimators.svm import SupportVectorMachines
from noiseclassifier.estimators.trees import Detector, Trees
from noiseclassifier.profile import EstimatorKind, Profile
from noiseclassifier.types import Array, Index, Mask, Words


class Estimator(Protocol):
    """A classifier of standardised features, with its training and its arrays in a model file."""

    DIMENSIONS: ClassVar[Mapping[str, int]]
    """Number of dimensions of each array in a model file, by name."""

    @classmethod
    def fit(cls, features: Array, targets: Index, groups: Words, profile: Profile) -> "Estimator":
        """Train an estimator; needs scikit-learn."""

    @classmethod
    def of(cls, arrays: Mapping[str, Array], profile: Profile) -> "Estimator":
        """Make an estimator from the arrays of a model file."""

    @staticmethod
    def shapes(
        arrays: Mapping[str, Array], profile: Profile, *, features: int, classes: int
    ) -> dict[str, tuple[int, ...]]:
        """Expected shape of each array."""

    @staticmethod
    def highest(profile: Profile, *, features: int) -> dict[str, int]:
        """Highest value of each array that holds indices; the lowest is 0."""

    @property
    def width(self) -> int:
        """Decision values of one frame."""

    def decision(self, features: Array) -> Array:
        """Decision values, shape (frames, width), of features, shape (frames, features)."""

    def choose(self, decisions: Array) -> Index:
        """Class of each frame, as an index, shape (frames,); beyond the last is unknown."""

    def above_threshold(self, decisions: Array) -> Mask | None:
        """Frames that may raise an alarm, shape (frames,); None: all that are failures."""

    def novel(self, decisions: Array) -> Mask | None:
        """Which frames are out of distribution, shape (frames,); None: not measured."""

    def score(self, decisions: Array) -> Array:
        """Score of each class, larger meaning more certain, shape (frames, classes)."""

    def arrays(self) -> dict[str, Array]:
        """Arrays for a model file, by name."""


ESTIMATORS: Mapping[EstimatorKind, type[Estimator]] = {
    "svm": SupportVectorMachines,
    "networks": Networks,
    "trees": Trees,
    "detector": Detector,
}
"""Class of each estimator, by the name that profiles have for it."""
