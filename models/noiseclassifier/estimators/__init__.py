"""The estimators that there are; each has its training and its arrays in a model file.

All have the same methods: `fit` trains one, `of` makes one from the arrays of a model file, and
`arrays` gives them, which have the shapes that `shapes` expects. `decision` turns standardised
features, shape (frames, features), into decision values, shape (frames, width), of which the others
give the class of each frame (`choose`, an index; beyond the last is unknown), the frames above the
alarm threshold (None: all failures), those that are out of distribution (`novel`, None: not
measured), and the `score` of each class, larger meaning more certain.
"""

from collections.abc import Mapping
from typing import TypeAlias

from noiseclassifier.estimators.networks import Networks
from noiseclassifier.estimators.svm import SupportVectorMachines
from noiseclassifier.estimators.trees import Detector, Trees
from noiseclassifier.profile import EstimatorKind

Estimator: TypeAlias = SupportVectorMachines | Networks | Trees

ESTIMATORS: Mapping[EstimatorKind, type[Estimator]] = {
    "svm": SupportVectorMachines,
    "networks": Networks,
    "trees": Trees,
    "detector": Detector,
}
"""Class of each estimator, by the name that profiles have for it."""
