"""Trees predict as those of scikit-learn that they were made of."""

from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

import noiseclassifier as nc
from noiseclassifier.estimators import trees as module
from noiseclassifier.estimators.decision import calibrate
from noiseclassifier.estimators.trees import Detector, Trees


@pytest.mark.parametrize("leaves", [2, 5, 16])
@pytest.mark.parametrize("classes", [2, 3])
def test_trees_have_the_probabilities_of_scikit_learn(leaves, classes):
    from sklearn.ensemble import HistGradientBoostingClassifier

    generator = np.random.default_rng(0)
    features = generator.normal(size=(500, 5))
    targets = (features[:, 0] > features[:, 2]).astype(int) + (features[:, 1] > 0.5)
    targets = np.minimum(targets, classes - 1)
    profile = replace(nc.GENERAL.at(1000.0), rounds=30, leaves=leaves)
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


def drawn(classes, count=400, seed=0):
    """Features whose first columns tell the classes apart, but for some noise."""
    generator = np.random.default_rng(seed)
    targets = generator.integers(classes, size=count)
    features = generator.normal(size=(count, 5))
    features[np.arange(count), targets % 5] += 1.5
    return features, targets


def of_scikit_learn(profile, rounds, **options):
    from sklearn.ensemble import HistGradientBoostingClassifier

    return HistGradientBoostingClassifier(
        max_iter=rounds, learning_rate=profile.learning_rate, max_leaf_nodes=profile.leaves,
        l2_regularization=profile.penalty, early_stopping=False, random_state=0, **options,
    )  # fmt: skip


@pytest.mark.parametrize(("rounds", "naming"), [(1, 1), (2, 1), (9, 3), (11, 3)])
def test_a_detector_tells_failures_from_ok_and_then_names_them(rounds, naming):
    features, targets = drawn(4)
    rising = np.array([1, 1, 0, 0, 0])
    profile = replace(nc.ANY.bound(1000.0), rounds=rounds, leaves=4, learning_rate=0.2)
    groups = np.array(["one"] * len(targets))
    ours = Detector.fit(features, targets, groups, profile, rising)
    failing = targets > 0
    with threadpool_limits(1):
        detects = of_scikit_learn(profile, rounds, monotonic_cst=rising).fit(features, failing)
        names = of_scikit_learn(profile, naming).fit(features[failing], targets[failing])
    points = 2.0 * np.random.default_rng(1).normal(size=(70, 5))
    expected = detects.predict_proba(points)
    expected = np.hstack((expected[:, :1], expected[:, 1:] * names.predict_proba(points)))
    np.testing.assert_allclose(ours.score(ours.decision(points)), expected, rtol=1e-9)


@pytest.mark.parametrize(("classes", "there"), [(3, [0, 2]), (4, [0, 2, 3]), (3, [1])])
def test_a_class_without_training_frames_is_never_probable(classes, there):
    features, targets = drawn(classes)
    train = np.flatnonzero(np.isin(targets, there))
    profile = replace(nc.GENERAL.at(1000.0), rounds=5, leaves=4)
    ours = Trees.uncalibrated(features, targets, train, profile)
    expected = np.zeros((len(features), classes))
    if len(there) > 1:
        with threadpool_limits(1):
            theirs = of_scikit_learn(profile, 5).fit(features[train], targets[train])
        expected[:, there] = theirs.predict_proba(features)
    else:
        expected[:, there] = 1.0
    np.testing.assert_allclose(ours.score(ours.decision(features)), expected, atol=1e-9)
    share = [float(np.mean(targets[train] == number)) for number in range(classes)]
    assert ours.frequency.tolist() == pytest.approx(share)


def test_trees_are_calibrated_by_trees_that_left_a_third_of_the_groups_out():
    features, targets = drawn(3, 300)
    groups = np.repeat([f"group {number}" for number in range(6)], 50)
    profile = replace(nc.GENERAL.at(1000.0), rounds=4)
    parts = module._parts(targets, groups)
    assert [len(test) for _, test in parts] == [100, 100, 100]
    assert sorted(np.concatenate([test for _, test in parts])) == list(range(300))
    logits, truth = [], []
    for train, test in parts:
        assert not set(groups[train]) & set(groups[test])
        assert len(train) + len(test) == 300
        logits.append(Trees.uncalibrated(features, targets, train, profile).logits(features[test]))
        truth.append(targets[test])
    ours = Trees.fit(features, targets, groups, profile)
    expected = calibrate(np.concatenate(logits), np.concatenate(truth))
    np.testing.assert_allclose(ours.calibration, expected)
    alone = Trees.fit(features, targets, np.repeat("one", 300), profile)
    assert alone.calibration.tolist() == [1.0, 0.0, 0.0, 0.0]


def test_parts_whose_training_frames_are_of_one_class_do_not_calibrate():
    targets = np.array([0, 0, 0, 0, 1, 0, 1])
    groups = np.array(["calm"] * 4 + ["bad"] * 3)
    ((train, test),) = module._parts(targets, groups)
    assert train.tolist() == [4, 5, 6]
    assert test.tolist() == [0, 1, 2, 3]


def test_a_thousandth_of_the_training_frames_lies_above_the_bound_of_a_feature():
    order = np.random.default_rng(0).permutation(10_000).astype(float)
    features = np.stack((order, -order), axis=1)
    profile = replace(nc.GENERAL.at(1000.0), rounds=1, leaves=2)
    targets = (order > 5000).astype(int)
    ours = Trees.fit(features, targets, np.array(["one"] * len(order)), profile)
    assert (features > ours.known).sum(axis=0).tolist() == [10, 10]
    assert ours.decision(ours.known[None] + [[0.5, -3.0]])[0, -1] == pytest.approx(0.5)


def test_the_first_leaf_that_is_left_is_the_lowest_bit():
    assert len(module._FIRST) == 1 << 16
    few = np.random.default_rng(0).integers(1, 1 << 16, size=500).tolist()
    for number in (*range(1, 40), *few, *(1 << place for place in range(16))):
        assert module._FIRST[number] == f"{number:b}"[::-1].index("1")
