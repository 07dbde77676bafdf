"""Estimators decide as those of scikit-learn that they were made of."""

from dataclasses import replace

import numpy as np
import pytest
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.neural_network import MLPClassifier
from sklearn.svm import SVC
from threadpoolctl import threadpool_limits

import noiseclassifier as nc
from noiseclassifier import estimators as module
from noiseclassifier.estimators import (
    Detector,
    Networks,
    SupportVectorMachines,
    Trees,
    calibrate,
    calibrated,
    choose,
)
from noiseclassifier.profile import INPUTS

RANDOM = np.random.default_rng(3)
CENTRES = RANDOM.standard_normal((4, 20))
PROFILE = nc.ANY.at(1000.0, INPUTS[0])
ONE = np.array(["one"])


def blobs(classes, frames=160):
    """Feature vectors about one centre for each class, unevenly many and overlapping."""
    share = np.arange(classes, 0.0, -1.0)
    targets = np.sort(RANDOM.choice(classes, frames, p=share / share.sum()))
    targets[:classes] = range(classes)
    return CENTRES[targets] + RANDOM.standard_normal((frames, 20)), targets


def both(features, targets, profile):
    """scikit-learn's own SVM, its weights being called "balanced", and ours."""
    theirs = SVC(
        C=profile.regularization,
        kernel=profile.kernel,
        gamma=profile.gamma,
        class_weight="balanced",
        decision_function_shape="ovo",
    ).fit(features, targets)
    return theirs, SupportVectorMachines.fit(features, targets, ONE, profile)


@pytest.fixture(params=["linear", "rbf"])
def one_vs_one(request):
    return replace(nc.Profile.noisytest(request.param), gamma=0.02)


@pytest.mark.parametrize("classes", [3, 4])
def test_one_vs_one_decides_as_scikit_learn(one_vs_one, classes):
    features, targets = blobs(classes)
    fresh, _ = blobs(classes)
    svc, svms = both(features, targets, one_vs_one)
    decisions = svms.decision(fresh)
    np.testing.assert_allclose(decisions, svc.decision_function(fresh), atol=1e-9, rtol=0)
    assert np.array_equal(svms.choose(decisions), svc.predict(fresh))
    svc.decision_function_shape = "ovr"
    expected = svc.decision_function(fresh)
    np.testing.assert_allclose(svms.score(decisions), expected, atol=1e-9, rtol=0)
    if one_vs_one.kernel == "linear":
        assert svms.vectors.shape == (classes * (classes - 1) // 2, 20)


def test_two_classes_are_one_svm_whose_positive_side_is_the_first(one_vs_one):
    features, targets = blobs(2)
    svc, svms = both(features, targets, one_vs_one)
    decisions = svms.decision(features)
    np.testing.assert_allclose(decisions[:, 0], -svc.decision_function(features), atol=1e-9)
    assert np.array_equal(svms.choose(decisions), svc.predict(features))


@pytest.mark.parametrize("classes", [2, 4])
@pytest.mark.parametrize("kernel", ["linear", "rbf"])
def test_one_vs_rest_is_an_svm_for_each_class_with_its_own_c(kernel, classes):
    profile = replace(nc.Profile.paper(kernel), gamma=0.02)
    features, targets = blobs(classes)
    svms = SupportVectorMachines.fit(features, targets, ONE, profile)
    decisions = svms.decision(features)
    for estimator in range(classes):
        # C_cls = C N / (classes N_cls), paper Sec. III-B
        own = profile.regularization * len(targets) / (classes * (targets == estimator).sum())
        svc = SVC(C=own, kernel=kernel, gamma=0.02).fit(features, targets == estimator)
        expected = svc.decision_function(features)
        np.testing.assert_allclose(decisions[:, estimator], expected, atol=1e-9, rtol=0)
    assert np.array_equal(svms.choose(decisions), decisions.argmax(axis=1))
    assert svms.score(decisions) is decisions


def test_votes_decide_and_the_first_of_equals_wins():
    # 0 beats 1, 1 beats 2, 2 beats 0: a vote each
    circle = np.array([[1.0, -1.0, 1.0]])
    assert choose(circle, classes=3, multiclass="one-vs-one").tolist() == [0]
    # what is undecided goes to the second of a pair, as libsvm has it
    assert choose(np.zeros((1, 3)), classes=3, multiclass="one-vs-one").tolist() == [2]


@pytest.mark.filterwarnings("ignore:Stochastic Optimizer")
def test_networks_have_the_mean_probabilities_of_scikit_learn_calibrated():
    features, targets = drawn(3)
    theirs = [
        MLPClassifier((4,), max_iter=20, random_state=seed).fit(features, targets)
        for seed in range(2)
    ]
    calibration = np.array([0.8, 0.1, 0.0, -0.2])
    ours = Networks(
        hidden=np.stack([each.coefs_[0] for each in theirs]),
        hidden_bias=np.stack([each.intercepts_[0] for each in theirs]),
        output=np.stack([each.coefs_[1] for each in theirs]),
        output_bias=np.stack([each.intercepts_[1] for each in theirs]),
        calibration=calibration,
        frequency=np.full(3, 1 / 3),
        known=np.array([[-1.0] * 5, [2.0] * 5]),
        alarm=0.5,
    )
    raised = np.maximum(features, -1.0)
    mean = np.mean([each.predict_proba(raised) for each in theirs], axis=0)
    expected = np.exp(calibrated(np.log(mean), calibration))
    decisions = ours.decision(features)
    np.testing.assert_allclose(ours.score(decisions), expected, atol=1e-9)
    np.testing.assert_allclose(decisions[:, -1], (features - 2.0).max(axis=1))
    np.testing.assert_array_equal(ours.decision(features[:1]), decisions[:1])


def drawn(classes, count=400):
    """Features whose first columns tell the classes apart, but for some noise."""
    generator = np.random.default_rng(0)
    targets = generator.integers(classes, size=count)
    features = generator.normal(size=(count, 5))
    features[np.arange(count), targets % 5] += 1.5
    return features, targets


def trees(**changes):
    """Two trees of two features, with leaves that tell each other apart."""
    arrays = {
        "feature": [[0.0, 1.0], [0.0, 0.0]],
        "threshold": [[0.5, 2.0], [-1.0, 0.0]],
        # 0: leaf 0 where x0 <= 0.5, else leaf 1 where x1 <= 2, else leaf 2. 1: one split alone.
        "left": [[[0.0, 1.0], [0.0, 0.0]], [[1.0, 2.0], [1.0, 0.0]]],
        "missing": [[0.0, 1.0], [1.0, 0.0]],
        "leaf": [[1.0, 2.0, 3.0], [10.0, 20.0, 0.0]],
        "prior": [0.25, -0.25],
        "calibration": [1.0, 0.0, 0.0],
        "frequency": [0.5, 0.5],
        "known": [9.0, 9.0],
    }
    return Trees(**{name: np.array(each) for name, each in (arrays | changes).items()}, alarm=0.5)


def test_two_trees_by_hand_add_up():
    features = np.array([[0.5, 9.0], [0.6, 2.0], [0.6, 2.1], [-1.0, 0.0]])
    expected = [[1.25, 19.75], [2.25, 19.75], [3.25, 19.75], [1.25, 9.75]]
    np.testing.assert_array_equal(trees().logits(features), expected)


def test_a_split_sends_a_missing_feature_where_training_chose():
    ours = trees(
        feature=[[0.0], [1.0]],
        threshold=[[0.0], [0.0]],
        left=[[[0.0], [0.0]], [[1.0], [1.0]]],
        missing=[[1.0], [0.0]],
        leaf=[[1.0, 2.0], [10.0, 20.0]],
        prior=[0.0, 0.0],
    )
    features = np.array([[-1.0, 1.0], [np.nan, 1.0], [-1.0, np.nan], [np.nan, np.nan]])
    expected = [[1.0, 20.0], [2.0, 20.0], [1.0, 10.0], [2.0, 10.0]]
    np.testing.assert_array_equal(ours.logits(features), expected)
    fewer = ours.at(np.array([1]))
    np.testing.assert_array_equal(fewer.logits(features[:2, 1:]), [[2.0, 20.0], [2.0, 20.0]])
    np.testing.assert_array_equal(ours.at(np.array([0])).logits(features[:1, :1]), [[1.0, 10.0]])


def of_scikit_learn(rounds, leaves, **options):
    return HistGradientBoostingClassifier(
        max_iter=rounds, learning_rate=0.15, max_leaf_nodes=leaves, l2_regularization=1.0,
        early_stopping=False, random_state=0, **options,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("rounds", "naming", "leaves", "gaps"),
    [(1, 1, 4, 0.0), (2, 1, 2, 0.0), (9, 3, 16, 0.0), (11, 3, 4, 0.3)],
)
def test_a_detector_tells_failures_from_ok_and_then_names_them(rounds, naming, leaves, gaps):
    features, targets = drawn(4)
    points = 2.0 * np.random.default_rng(1).normal(size=(70, 5))
    for each in (features, points):
        each[np.random.default_rng(2).random(each.shape) < gaps] = np.nan
    rising = np.array([1, 1, 0, 0, 0])
    profile = replace(PROFILE, rounds=rounds, leaves=leaves)
    ours = Detector.fit(features, targets, ONE.repeat(len(targets)), profile, rising)
    failing = targets > 0
    with threadpool_limits(1):
        detects = of_scikit_learn(rounds, leaves, monotonic_cst=rising).fit(features, failing)
        names = of_scikit_learn(naming, leaves).fit(features[failing], targets[failing])
    expected = detects.predict_proba(points)
    expected = np.hstack((expected[:, :1], expected[:, 1:] * names.predict_proba(points)))
    np.testing.assert_allclose(ours.score(ours.decision(points)), expected, rtol=1e-9)
    share = [float(np.mean(targets == number)) for number in range(4)]
    assert ours.frequency.tolist() == pytest.approx(share)


@pytest.mark.parametrize("there", [[0, 2], [0, 1, 3], [1, 2]])
def test_a_class_without_training_frames_is_never_probable(there):
    features, targets = drawn(4)
    train = np.flatnonzero(np.isin(targets, there))
    ours = Detector.uncalibrated(features, targets, train, replace(PROFILE, rounds=5, leaves=4))
    scores = ours.score(ours.decision(features))
    assert np.delete(scores, there, axis=1).max() < 1e-6
    assert (scores.argmax(axis=1) == targets)[train].mean() > 0.7


def test_trees_are_calibrated_by_trees_that_left_a_third_of_the_groups_out():
    features, targets = drawn(3, 300)
    groups = np.repeat([f"group {number}" for number in range(6)], 50)
    profile = replace(PROFILE, rounds=4)
    parts = module._parts(targets, groups)
    assert [len(test) for _, test in parts] == [100, 100, 100]
    assert sorted(np.concatenate([test for _, test in parts])) == list(range(300))
    logits, truth = [], []
    for train, test in parts:
        assert not set(groups[train]) & set(groups[test])
        assert len(train) + len(test) == 300
        other = Detector.uncalibrated(features, targets, train, profile)
        logits.append(other.logits(features[test]))
        truth.append(targets[test])
    ours = Detector.fit(features, targets, groups, profile)
    expected = calibrate(np.concatenate(logits), np.concatenate(truth), np.ones(300))
    np.testing.assert_allclose(ours.calibration, expected)
    alone = Detector.fit(features, targets, ONE.repeat(300), profile)
    assert alone.calibration.tolist() == [1.0, 0.0, 0.0, 0.0]


def test_a_class_of_one_group_alone_leaves_other_probabilities_as_they_are():
    generator = np.random.default_rng(0)
    features = generator.normal(size=(1200, 6))
    groups = np.array([f"g{number % 6}" for number in range(1200)])
    targets = (features[:, 0] > 1.0).astype(int)
    rare = np.where((groups == "g5") & (features[:, 0] > 1.5), 2, targets)
    good = []
    for truth in (targets, rare):
        learnt = Detector.fit(features, truth, groups, replace(PROFILE, rounds=30, leaves=8))
        scores = learnt.score(learnt.decision(features))[:, 0]
        good.append([scores[truth == 0].mean(), scores[truth > 0].mean()])
    np.testing.assert_allclose(good[1], good[0], atol=0.05)
    assert learnt.calibration[3] == 0.0


def test_a_thousandth_of_the_training_frames_lies_above_the_bound_of_a_feature():
    order = np.random.default_rng(0).permutation(10_000).astype(float)
    features = np.stack((order, -order), axis=1)
    profile = replace(PROFILE, rounds=1, leaves=2)
    ours = Detector.fit(features, (order > 5000).astype(int), ONE.repeat(10_000), profile)
    assert (features > ours.known).sum(axis=0).tolist() == [10, 10]
    assert ours.decision(ours.known[None] + [[0.5, -3.0]])[0, -1] == pytest.approx(0.5)


def test_calibration_finds_the_scale_of_overconfident_logits():
    generator = np.random.default_rng(2)
    true = generator.normal(size=(20_000, 3)) * 1.5
    log_true = true - np.log(np.exp(true).sum(axis=1, keepdims=True))
    drawn = np.array([generator.choice(3, p=np.exp(row)) for row in log_true])
    calibration = calibrate(2.5 * log_true, drawn, np.ones(len(drawn)))
    assert calibration[0] == pytest.approx(1 / 2.5, rel=0.05)
    np.testing.assert_allclose(calibrated(2.5 * log_true, calibration), log_true, atol=0.2)


def test_trees_begin_with_the_odds_of_what_frames_count():
    features, targets = RANDOM.normal(size=(300, 3)), np.repeat([0, 0, 1], 100)
    weight = np.where(targets == 0, 8.0, 1.0)
    profile = replace(PROFILE, rounds=8)
    every = np.arange(300)
    for own, odds in ((None, 2.0), (weight, 16.0)):
        found = Detector.uncalibrated(features, targets, every, profile, None, own)
        assert found.prior[0] == pytest.approx(np.log(odds))


def test_a_frame_that_counts_thrice_calibrates_as_three_of_it():
    logits, targets = RANDOM.normal(size=(200, 3)), RANDOM.integers(3, size=200)
    count = RANDOM.integers(1, 4, size=200)
    expected = calibrate(logits.repeat(count, axis=0), targets.repeat(count), np.ones(count.sum()))
    np.testing.assert_allclose(calibrate(logits, targets, count), expected, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize(
    ("probabilities", "novelty", "chosen", "above", "novel"),
    [
        ([0.2, 0.35, 0.45], 0.0, 1, True, False),  # exceeds its frequency of 0.1 more
        ([0.2, 0.05, 0.75], 0.0, 2, True, False),
        ([0.9, 0.09, 0.01], 0.0, 0, False, False),
        ([0.79, 0.2, 0.01], 0.0, 1, False, False),
        ([0.9, 0.09, 0.01], 2.1, 3, False, True),
        ([0.2, 0.05, 0.75], 2.1, 2, True, True),
    ],
)
def test_a_failure_is_named_if_probable_and_else_a_novel_frame_is_unknown(
    probabilities, novelty, chosen, above, novel
):
    ours = trees(frequency=[0.5, 0.1, 0.4])
    decisions = np.array([[*np.log(probabilities), novelty]])
    assert ours.choose(decisions).tolist() == [chosen]
    assert ours.above_threshold(decisions).tolist() == [above]
    assert ours.novel(decisions).tolist() == [novel]
    np.testing.assert_allclose(ours.score(decisions), [probabilities])
