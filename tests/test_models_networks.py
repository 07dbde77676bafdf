"""Networks predict as those of scikit-learn that they were made of."""

from dataclasses import replace

import numpy as np
import pytest

import noiseclassifier as nc
from noiseclassifier.estimators.decision import calibrate, calibrated
from noiseclassifier.estimators.networks import Networks, _fit, _parts


@pytest.mark.filterwarnings("ignore:Stochastic Optimizer")
def test_networks_have_the_probabilities_of_scikit_learn():
    from sklearn.neural_network import MLPClassifier

    generator = np.random.default_rng(0)
    features = generator.normal(size=(300, 5))
    targets = (features[:, 0] > 0).astype(int) + (features[:, 1] > 0.5)
    profile = nc.SCALAR.at(1000.0)
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


def drawn(classes, count=120):
    generator = np.random.default_rng(0)
    targets = generator.integers(classes, size=count)
    features = generator.normal(size=(count, 5))
    features[np.arange(count), targets] += 1.5
    return features, targets


def of_scikit_learn(profile, seed, features, targets):
    """A network whose rare classes have larger weights, by the root of how much rarer they are."""
    from sklearn.neural_network import MLPClassifier

    shares = np.bincount(targets)
    return MLPClassifier(
        (profile.units,), alpha=profile.decay, batch_size=min(256, len(targets)),
        learning_rate_init=2e-3, max_iter=profile.epochs, n_iter_no_change=99, random_state=seed,
    ).fit(features, targets, np.sqrt(shares.max() / shares[targets]))  # fmt: skip


@pytest.mark.filterwarnings("ignore:Stochastic Optimizer")
def test_networks_leave_groups_out_in_turn_and_their_mean_is_calibrated_there():
    features, targets = drawn(3)
    groups = np.repeat([f"group {number}" for number in range(6)], 20)
    profile = replace(nc.SCALAR.at(1000.0), units=4, epochs=5, networks=3, decay=0.01)
    ours = Networks.fit(features, targets, groups, profile)
    parts = _parts(targets, groups, 3)
    assert sorted(np.concatenate([test for _, test in parts])) == list(range(len(targets)))
    theirs, logits, truth = [], [], []
    for seed, (train, test) in enumerate(parts):
        assert len(set(groups[test])) == 2
        assert not set(groups[train]) & set(groups[test])
        theirs.append(of_scikit_learn(profile, seed, features[train], targets[train]))
        logits.append(theirs[-1].predict_log_proba(features[test]))
        truth.append(targets[test])
    calibration = calibrate(np.concatenate(logits), np.concatenate(truth))
    np.testing.assert_allclose(ours.calibration, calibration, rtol=1e-3)
    inside = np.maximum(features, ours.known[0])
    mean = np.mean([each.predict_proba(inside) for each in theirs], axis=0)
    expected = np.exp(calibrated(np.log(mean), calibration))
    np.testing.assert_allclose(ours.score(ours.decision(features)), expected, atol=1e-4)
    assert ours.frequency.tolist() == pytest.approx((np.bincount(targets) / 120).tolist())


@pytest.mark.filterwarnings("ignore:Stochastic Optimizer")
@pytest.mark.parametrize(("classes", "there"), [(3, [0, 2]), (4, [0, 2, 3])])
def test_a_class_without_training_frames_is_never_probable(classes, there):
    features, targets = drawn(classes)
    train = np.flatnonzero(np.isin(targets, there))
    profile = replace(nc.SCALAR.at(1000.0), units=4, epochs=3)
    ours = _fit(1, features[train], targets[train], profile, classes)
    expected = np.zeros((len(features), classes))
    dense = np.searchsorted(there, targets[train])
    theirs = of_scikit_learn(profile, 1, features[train], dense)
    expected[:, there] = theirs.predict_proba(features)
    np.testing.assert_allclose(np.exp(ours.average(features)), expected, atol=1e-6)


def test_a_part_without_a_second_class_to_learn_from_is_not_left_out():
    targets = np.array([0, 0, 0, 0, 1, 0, 1])
    groups = np.array(["calm"] * 4 + ["bad"] * 3)
    found = [(train.tolist(), test.tolist()) for train, test in _parts(targets, groups, 5)]
    everything, learnt = (list(range(7)), []), ([4, 5, 6], [0, 1, 2, 3])
    assert sorted(found[:2]) == sorted([everything, learnt])
    assert found == [*found[:2], *found[:2], found[0]]
    assert [train.tolist() for train, _ in _parts(targets, groups[:1].repeat(7), 2)] == [
        list(range(7)),
        list(range(7)),
    ]


@pytest.mark.filterwarnings("ignore:Stochastic Optimizer")
def test_a_thousandth_of_the_training_frames_lies_below_a_feature_and_above_it():
    order = np.random.default_rng(0).permutation(10_000).astype(float)
    features = np.stack((order, -2.0 * order), axis=1) / 10_000
    profile = replace(nc.SCALAR.at(1000.0), units=1, epochs=1, networks=1)
    targets = (order > 5000).astype(int)
    ours = Networks.fit(features, targets, np.array(["one"] * len(order)), profile)
    assert (features < ours.known[0]).sum(axis=0).tolist() == [10, 10]
    assert (features > ours.known[1]).sum(axis=0).tolist() == [10, 10]
    low = ours.known[:1] - 1.0
    np.testing.assert_array_equal(ours.logits(low), ours.logits(ours.known[:1]))
    assert ours.decision(ours.known[1:] + np.array([[0.5, -3.0]]))[0, -1] == pytest.approx(0.5)
