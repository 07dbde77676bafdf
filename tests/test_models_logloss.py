from math import log

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from models.tuning.logloss import balanced_log_loss, grades

RANDOM = np.random.default_rng(5)


def test_a_class_is_graded_by_its_worst_duel():
    # pairs (0, 1), (0, 2), (1, 2): 0 wins by 1 and by 3, and 2 beats 1 by 2
    graded = grades(np.array([[1.0, 3.0, -2.0]]), classes=3, multiclass="one-vs-one")
    assert graded.tolist() == [[1.0, -2.0, -3.0]]


def test_two_classes_are_graded_by_one_duel():
    graded = grades(np.array([[0.5], [-2.0]]), classes=2, multiclass="one-vs-one")
    assert graded.tolist() == [[0.5, -0.5], [-2.0, 2.0]]


def test_machines_against_the_rest_grade_their_own_class():
    decisions = RANDOM.standard_normal((5, 4))
    assert np.array_equal(grades(decisions, classes=4, multiclass="one-vs-rest"), decisions)


def test_whoever_is_sure_and_right_loses_nothing():
    truth = np.array([0, 1, 2, 1])
    assert balanced_log_loss(np.eye(3)[truth], truth) == pytest.approx(0.0, abs=1e-12)


def test_grades_that_say_nothing_lose_the_logarithm_of_the_classes():
    assert balanced_log_loss(np.zeros((6, 3)), np.arange(6) % 3) == pytest.approx(log(3))


def test_grades_that_mislead_lose_hardly_more_than_those_that_say_nothing():
    truth = np.arange(6) % 3
    assert balanced_log_loss(-np.eye(3)[truth], truth) == pytest.approx(log(3), abs=0.02)


def sample(frames=200, classes=4):
    truth = np.arange(frames) % classes
    return np.eye(classes)[truth] + RANDOM.standard_normal((frames, classes)), truth


def test_the_width_of_margins_does_not_matter():
    graded, truth = sample()
    assert balanced_log_loss(7.0 * graded, truth) == pytest.approx(balanced_log_loss(graded, truth))


def test_a_shift_of_all_grades_does_not_matter():
    graded, truth = sample()
    shifted = graded + RANDOM.standard_normal((len(graded), 1))
    assert balanced_log_loss(shifted, truth) == pytest.approx(balanced_log_loss(graded, truth))


def test_each_class_counts_the_same_however_many_frames_it_has():
    graded, truth = sample()
    often = np.concatenate([np.arange(len(truth)), *[np.flatnonzero(truth == 2)] * 9])
    assert balanced_log_loss(graded[often], truth[often]) == pytest.approx(
        balanced_log_loss(graded, truth)
    )


def test_a_frame_that_gets_surer_lowers_the_loss():
    graded, truth = sample()
    surer = graded.copy()
    surer[0, truth[0]] += 1.0
    assert balanced_log_loss(surer, truth) < balanced_log_loss(graded, truth)


def test_the_slope_is_the_best_one():
    graded, truth = sample()

    def loss(power):
        shares = np.exp(2.0**power * graded)
        own = shares[np.arange(len(truth)), truth] / shares.sum(axis=1)
        return np.mean([-np.log(own[truth == each]).mean() for each in range(4)])

    best = minimize_scalar(loss, bounds=(-6, 6), method="bounded", options={"xatol": 1e-6})
    assert balanced_log_loss(graded, truth) == pytest.approx(best.fun, abs=1e-8)
