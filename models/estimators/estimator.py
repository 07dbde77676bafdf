"""Machines: what decides on features, of whatever kind."""

from collections.abc import Mapping
from importlib import metadata
from typing import Protocol

import numpy as np

from models.estimators.baseline import Baseline
from models.estimators.mlp import Networks, fit_networks
from models.estimators.svm import SupportVectorMachines, fit, machine_count
from models.estimators.trees import Trees, fit_trees
from models.profile import Profile
from models.types import Array, Index, Mask, Words


class Estimator(Protocol):
    """What decides on standardised features."""

    @property
    def width(self) -> int:
        """Decisions on one frame."""

    def decision(self, features: Array) -> Array:
        """Decide on features, shape (frames, features); shape (frames, width)."""

    def choose(self, decisions: Array) -> Index:
        """Choose a class for each frame, shape (frames,); beyond the last is unknown."""

    def above_threshold(self, decisions: Array) -> Mask | None:
        """Say which frames may raise an alarm, shape (frames,); None: all that are failures."""

    def novel(self, decisions: Array) -> Mask | None:
        """Say which frames are out of distribution, shape (frames,); None: not measured."""

    def score(self, decisions: Array) -> Array:
        """Grade all classes for each frame, shape (frames, classes)."""

    def arrays(self) -> dict[str, Array]:
        """Give what a model file keeps."""


def rebuilt(arrays: Mapping[str, Array], profile: Profile) -> Estimator:
    """Make a machine of the arrays of a model file."""
    own = {name: arrays[name] for name in DIMENSIONS[profile.estimator]}
    if profile.estimator == "baseline":
        return Baseline(**own)
    if profile.estimator == "networks":
        return Networks(**own, alarm=profile.alarm)
    if profile.estimator == "trees":
        return Trees(**own, alarm=profile.alarm)
    return SupportVectorMachines(
        **own, kernel=profile.kernel, gamma=profile.gamma, multiclass=profile.multiclass
    )


def shapes(
    arrays: Mapping[str, Array], profile: Profile, *, features: int, classes: int
) -> dict[str, tuple[int, ...]]:
    """Say which shapes the arrays of a machine have to have.

    Args:
        arrays: Its arrays, each of the right number of dimensions.
        profile: What they are to fit.
        features: Features of a frame.
        classes: How many classes there are.
    """
    if profile.estimator == "baseline":
        return {"good": (max(len(arrays["good"]), 1), features), "limit": (1,)}
    if profile.estimator == "networks":
        count, units = profile.networks, profile.units
        return {
            "hidden": (count, features, units),
            "hidden_bias": (count, units),
            "output": (count, units, classes),
            "output_bias": (count, classes),
            "calibration": (1 + classes,),
            "frequency": (classes,),
            "known": (2, features),
        }
    if profile.estimator == "trees":
        trees, leaves = profile.rounds * classes, profile.leaves
        return {
            "feature": (trees, leaves - 1),
            "threshold": (trees, leaves - 1),
            "left": (2, trees, leaves - 1),
            "leaf": (trees, leaves),
            "prior": (classes,),
            "calibration": (1 + classes,),
            "frequency": (classes,),
            "known": (features,),
        }
    vectors, machines = len(arrays["vectors"]), machine_count(classes, profile.multiclass)
    return {
        "vectors": (vectors, features),
        "coefficients": (machines, vectors),
        "intercept": (machines,),
    }


DIMENSIONS = {
    "svm": {"vectors": 2, "coefficients": 2, "intercept": 1},
    "networks": {
        "hidden": 3,
        "hidden_bias": 2,
        "output": 3,
        "output_bias": 2,
        "calibration": 1,
        "frequency": 1,
        "known": 2,
    },
    "trees": {
        "feature": 2,
        "threshold": 2,
        "left": 3,
        "leaf": 2,
        "prior": 1,
        "calibration": 1,
        "frequency": 1,
        "known": 1,
    },
    "baseline": {"good": 2, "limit": 1},
}
"""Arrays of each kind of machine in a model file, and their dimensions."""


def learn(features: Array, targets: Index, groups: Words, profile: Profile) -> Estimator:
    """Learn what a profile asks for.

    Args:
        features: Feature vectors, shape (frames, features).
        targets: Class of each, as an index from 0 without a gap, shape (frames,).
        groups: What each shares its motion with, shape (frames,).
        profile: What decides, its parameters, and how machines make a choice.

    Returns:
        The machines.
    """
    if profile.estimator == "networks":
        return fit_networks(features, targets, groups, profile)
    if profile.estimator == "trees":
        return fit_trees(features, targets, groups, profile)
    return fit(features, targets, profile).condensed()


def versions() -> dict[str, str]:
    """Name the software that a model is trained with."""
    import sklearn

    try:
        own = metadata.version("noise-inspector")
    except metadata.PackageNotFoundError:
        own = "not installed"
    return {"noise-inspector": own, "numpy": np.__version__, "scikit-learn": sklearn.__version__}
