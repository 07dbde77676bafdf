from dataclasses import replace

import numpy as np
import pytest
from sklearn.svm import SVC

import noiseclassifier as nc
from noiseclassifier.estimators.svm import choose, fit, score

RANDOM = np.random.default_rng(3)
CENTRES = RANDOM.standard_normal((4, 20))


def blobs(classes, frames=160):
    """Feature vectors about one centre for each class, unevenly many and overlapping."""
    share = np.arange(classes, 0.0, -1.0)
    targets = np.sort(RANDOM.choice(classes, frames, p=share / share.sum()))
    targets[:classes] = range(classes)
    return CENTRES[targets] + RANDOM.standard_normal((frames, 20)), targets


def theirs(features, targets, profile):
    """scikit-learn's own SVM, its weights being called "balanced"."""
    return SVC(
        C=profile.regularization,
        kernel=profile.kernel,
        gamma=profile.gamma,
        class_weight="balanced",
        decision_function_shape="ovo",
    ).fit(features, targets)


@pytest.fixture(params=["linear", "rbf"])
def one_vs_one(request):
    profile = nc.Profile.noisytest(request.param)
    return replace(profile, gamma=0.02, single_precision=False)


@pytest.mark.parametrize("classes", [3, 4])
@pytest.mark.parametrize("condense", [False, True])
def test_one_vs_one_decides_as_scikit_learn(one_vs_one, classes, condense):
    features, targets = blobs(classes)
    fresh, _ = blobs(classes)
    svc, svms = theirs(features, targets, one_vs_one), fit(features, targets, one_vs_one)
    decisions = (svms.condensed() if condense else svms).decision(fresh)
    np.testing.assert_allclose(decisions, svc.decision_function(fresh), atol=1e-9, rtol=0)
    chosen = choose(decisions, classes=classes, multiclass="one-vs-one")
    assert np.array_equal(chosen, svc.predict(fresh))


def test_one_vs_one_has_the_scores_of_scikit_learn(one_vs_one):
    features, targets = blobs(4)
    svc, svms = theirs(features, targets, one_vs_one), fit(features, targets, one_vs_one)
    svc.decision_function_shape = "ovr"
    grades = score(svms.decision(features), classes=4, multiclass="one-vs-one")
    np.testing.assert_allclose(grades, svc.decision_function(features), atol=1e-9, rtol=0)


def test_two_classes_are_one_svm_whose_positive_side_is_the_first(one_vs_one):
    features, targets = blobs(2)
    svc, svms = theirs(features, targets, one_vs_one), fit(features, targets, one_vs_one)
    decisions = svms.decision(features)
    np.testing.assert_allclose(decisions[:, 0], -svc.decision_function(features), atol=1e-9)
    chosen = choose(decisions, classes=2, multiclass="one-vs-one")
    assert np.array_equal(chosen, svc.predict(features))


@pytest.mark.parametrize("classes", [2, 4])
@pytest.mark.parametrize("kernel", ["linear", "rbf"])
def test_one_vs_rest_is_an_svm_for_each_class_with_its_own_c(kernel, classes):
    profile = replace(nc.Profile.paper(kernel), gamma=0.02)
    features, targets = blobs(classes)
    decisions = fit(features, targets, profile).condensed().decision(features)
    for estimator in range(classes):
        # C_cls = C N / (classes N_cls), paper Sec. III-B
        own = profile.regularization * len(targets) / (classes * (targets == estimator).sum())
        svc = SVC(C=own, kernel=kernel, gamma=0.02).fit(features, targets == estimator)
        expected = svc.decision_function(features)
        np.testing.assert_allclose(decisions[:, estimator], expected, atol=1e-9, rtol=0)
    chosen = choose(decisions, classes=classes, multiclass="one-vs-rest")
    assert np.array_equal(chosen, decisions.argmax(axis=1))
    assert score(decisions, classes=classes, multiclass="one-vs-rest") is decisions


def test_linear_svms_condense_to_one_vector_each():
    features, targets = blobs(4)
    svms = fit(features, targets, nc.Profile.noisytest("linear"))
    assert len(svms.vectors) > 6
    assert svms.condensed().vectors.shape == (6, 20)


def test_votes_decide_and_the_first_of_equals_wins():
    # 0 beats 1, 1 beats 2, 2 beats 0: a vote each
    circle = np.array([[1.0, -1.0, 1.0]])
    assert choose(circle, classes=3, multiclass="one-vs-one").tolist() == [0]
    # what is undecided goes to the second of a pair, as libsvm has it
    assert choose(np.zeros((1, 3)), classes=3, multiclass="one-vs-one").tolist() == [2]
