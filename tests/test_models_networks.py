"""Networks predict as those of scikit-learn that they were made of."""

from dataclasses import replace

import numpy as np
import pytest

import models
from models.estimators.mlp import Networks


@pytest.mark.filterwarnings("ignore:Stochastic Optimizer")
def test_networks_have_the_probabilities_of_scikit_learn():
    from sklearn.neural_network import MLPClassifier

    generator = np.random.default_rng(0)
    features = generator.normal(size=(300, 5))
    targets = (features[:, 0] > 0).astype(int) + (features[:, 1] > 0.5)
    profile = models.SCALAR.at(1000.0)
    alone = replace(profile, units=16, epochs=40, networks=1, decay=0.0)
    groups = np.array(["one"] * 300)
    ours = Networks.fit(features, targets, groups, alone)
    counts = np.bincount(targets)
    theirs = MLPClassifier(
        (16,), alpha=0.0, batch_size=256, learning_rate_init=2e-3, max_iter=40,
        n_iter_no_change=99, random_state=0,
    ).fit(features, targets, np.sqrt(counts.max() / counts)[targets])  # fmt: skip
    known = np.clip(features, *ours.known)
    np.testing.assert_allclose(
        ours.score(ours.decision(known)), theirs.predict_proba(known), atol=1e-6
    )
