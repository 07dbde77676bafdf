"""Trees predict as those of scikit-learn that they were made of."""

from dataclasses import replace

import numpy as np
import pytest

import models
from models.estimators.trees import Trees


@pytest.mark.parametrize("leaves", [2, 5, 16])
@pytest.mark.parametrize("classes", [2, 3])
def test_trees_have_the_probabilities_of_scikit_learn(leaves, classes):
    from sklearn.ensemble import HistGradientBoostingClassifier

    generator = np.random.default_rng(0)
    features = generator.normal(size=(500, 5))
    targets = (features[:, 0] > features[:, 2]).astype(int) + (features[:, 1] > 0.5)
    targets = np.minimum(targets, classes - 1)
    profile = replace(models.GENERAL.at(1000.0), rounds=30, leaves=leaves)
    ours = Trees.fit(features, targets, np.array(["one"] * 500), profile)
    theirs = HistGradientBoostingClassifier(
        max_iter=30, learning_rate=0.15, max_leaf_nodes=leaves, l2_regularization=1.0,
        early_stopping=False, random_state=0,
    ).fit(features, targets)  # fmt: skip
    points = 3.0 * generator.normal(size=(100, 5))
    np.testing.assert_allclose(
        ours.score(ours.decision(points)), theirs.predict_proba(points), rtol=1e-9
    )


def test_two_trees_by_hand_add_up():
    trees = Trees(
        feature=np.array([[0.0, 1.0], [0.0, 0.0]]),
        threshold=np.array([[0.5, 2.0], [-1.0, 0.0]]),
        # 0: leaf 0 where x0 <= 0.5, else leaf 1 where x1 <= 2, else leaf 2. 1: one split alone.
        left=np.array([[[0.0, 1.0], [0.0, 0.0]], [[1.0, 2.0], [1.0, 0.0]]]),
        missing=np.array([[0.0, 1.0], [1.0, 0.0]]),
        leaf=np.array([[1.0, 2.0, 3.0], [10.0, 20.0, 0.0]]),
        prior=np.array([0.25, -0.25]),
        calibration=np.array([1.0, 0.0, 0.0]),
        frequency=np.array([0.5, 0.5]),
        known=np.array([9.0, 9.0]),
        alarm=0.5,
    )
    features = np.array([[0.5, 9.0], [0.6, 2.0], [0.6, 2.1], [-1.0, 0.0]])
    expected = [[1.25, 19.75], [2.25, 19.75], [3.25, 19.75], [1.25, 9.75]]
    np.testing.assert_array_equal(trees.logits(features), expected)
