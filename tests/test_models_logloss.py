from math import log

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from noiseclassifier.tuning import balanced_log_loss, class_margins

RANDOM = np.random.default_rng(5)


def test_the_margin_of_a_class_is_the_least_of_its_pairs():
    # pairs (0, 1), (0, 2), (1, 2): 0 wins by 1 and by 3, and 2 beats 1 by 2
    margins = class_margins(np.array([[1.0, 3.0, -2.0]]), classes=3, multiclass="one-vs-one")
    assert margins.tolist() == [[1.0, -2.0, -3.0]]


def test_two_classes_have_the_margin_of_one_pair():
    margins = class_margins(np.array([[0.5], [-2.0]]), classes=2, multiclass="one-vs-one")
    assert margins.tolist() == [[0.5, -0.5], [-2.0, 2.0]]


def test_one_vs_rest_decision_values_are_margins():
    decisions = RANDOM.standard_normal((5, 4))
    assert np.array_equal(class_margins(decisions, classes=4, multiclass="one-vs-rest"), decisions)


def test_certain_and_right_margins_have_no_loss():
    truth = np.array([0, 1, 2, 1])
    assert balanced_log_loss(np.eye(3)[truth], truth) == pytest.approx(0.0, abs=1e-12)


def test_equal_margins_have_the_logarithm_of_the_classes_as_their_loss():
    assert balanced_log_loss(np.zeros((6, 3)), np.arange(6) % 3) == pytest.approx(log(3))


def test_wrong_margins_have_hardly_more_loss_than_equal_ones():
    truth = np.arange(6) % 3
    assert balanced_log_loss(-np.eye(3)[truth], truth) == pytest.approx(log(3), abs=0.02)


def sample(frames=200, classes=4):
    truth = np.arange(frames) % classes
    return np.eye(classes)[truth] + RANDOM.standard_normal((frames, classes)), truth


def test_the_width_of_margins_does_not_matter():
    margins, truth = sample()
    assert balanced_log_loss(7.0 * margins, truth) == pytest.approx(
        balanced_log_loss(margins, truth)
    )


def test_a_shift_of_all_margins_does_not_matter():
    margins, truth = sample()
    shifted = margins + RANDOM.standard_normal((len(margins), 1))
    assert balanced_log_loss(shifted, truth) == pytest.approx(balanced_log_loss(margins, truth))


def test_each_class_counts_the_same_however_many_frames_it_has():
    margins, truth = sample()
    often = np.concatenate([np.arange(len(truth)), *[np.flatnonzero(truth == 2)] * 9])
    assert balanced_log_loss(margins[often], truth[often]) == pytest.approx(
        balanced_log_loss(margins, truth)
    )


def test_a_frame_with_a_larger_margin_lowers_the_loss():
    margins, truth = sample()
    surer = margins.copy()
    surer[0, truth[0]] += 1.0
    assert balanced_log_loss(surer, truth) < balanced_log_loss(margins, truth)


def test_the_slope_is_the_best_one():
    margins, truth = sample()

    def loss(power):
        shares = np.exp(2.0**power * margins)
        own = shares[np.arange(len(truth)), truth] / shares.sum(axis=1)
        return np.mean([-np.log(own[truth == each]).mean() for each in range(4)])

    best = minimize_scalar(loss, bounds=(-6, 6), method="bounded", options={"xatol": 1e-6})
    assert balanced_log_loss(margins, truth) == pytest.approx(best.fun, abs=1e-8)
