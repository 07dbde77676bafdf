from math import isnan, nan

import numpy as np
import pytest
from predicted_runs import garwood

from noiseclassifier.measures import Resampling, fay_feuer, plain


def each_its_own(runs):
    return Resampling.of([f"run{number}" for number in range(runs)])


def share_of(resampling, part, whole):
    return resampling.mean_share(part, whole, [np.ones(len(part), bool)])


def rate_of(resampling, events, time):
    return resampling.mean_rate(events, time, [np.ones(len(events), bool)])


def test_bounds_of_rare_events_are_those_of_the_tables():
    # Garwood (1936), 95 %
    assert fay_feuer(np.array([0]), np.ones(1)) == pytest.approx((0.0, 3.6889), abs=1e-4)
    assert fay_feuer(np.array([1]), np.ones(1)) == pytest.approx((0.0253, 5.5716), abs=1e-4)
    assert fay_feuer(np.array([10]), np.ones(1)) == pytest.approx((4.7954, 18.3904), abs=1e-4)


def test_clustered_events_have_wider_intervals_than_single_ones():
    hours, alone, crowd = np.full(50, 0.1), np.zeros(50), np.zeros(50)
    alone[:20] = 1
    crowd[:2] = 10
    resampling = each_its_own(50)
    assert rate_of(resampling, crowd, hours).value == pytest.approx(4.0)
    exact = np.array(garwood(20)) / 5.0
    assert rate_of(resampling, alone, hours).low == pytest.approx(exact[0])
    assert rate_of(resampling, crowd, hours).high > 1.3 * exact[1]
    assert rate_of(resampling, crowd, hours).low == 0.0 < exact[0]
    mean = resampling.mean_rate(crowd, hours, [np.arange(50) < 25, np.arange(50) >= 25])
    assert (mean.low, mean.value) == (0.0, pytest.approx(20 / 2.5 / 2))
    assert mean.high > 1.3 * exact[1]


def test_runs_without_a_mistake_have_the_bound_of_their_number():
    for runs in (5, 20, 500):
        perfect = share_of(each_its_own(runs), np.full(runs, 7.0), np.full(runs, 7.0))
        assert perfect.value == perfect.high == 1.0
        assert perfect.low == pytest.approx(0.025 ** (1 / runs))
        nothing = share_of(each_its_own(runs), np.zeros(runs), np.full(runs, 7.0))
        assert (nothing.low, nothing.high) == (0.0, pytest.approx(1.0 - 0.025 ** (1 / runs)))


def test_intervals_hold_what_is_true_in_95_of_100_cases_and_those_by_frames_do_not():
    random = np.random.default_rng(5)
    held, naive = 0, 0
    for _ in range(200):
        own = random.beta(8, 2, 40)  # groups differ; their mean is 0.8
        right = random.binomial(50, own).astype(float)
        share = share_of(each_its_own(40), right, np.full(40, 50.0))
        held += share.low <= 0.8 <= share.high
        half = 1.96 * np.sqrt(share.value * (1 - share.value) / 2000)
        naive += abs(share.value - 0.8) <= half
    assert held >= 180
    assert naive <= 140


def test_fewer_than_five_groups_have_no_interval():
    share = share_of(Resampling.of(["a", "b", "c", "d", "d", "d"]), np.ones(6), np.ones(6))
    assert share.value == 1.0
    assert isnan(share.low)
    assert isnan(share.high)
    assert (share.runs, share.groups) == (6, 4)
    rate = rate_of(Resampling.of(["a"]), np.ones(1), np.ones(1))  # counting alone bounds a rate
    assert (rate.low, rate.high) == pytest.approx(garwood(1))


def test_only_runs_in_the_sample_of_a_measure_count():
    whole = np.array([0.0, 4.0, 4.0, 4.0, 4.0, 4.0, 0.0])
    assert share_of(each_its_own(7), whole / 2, whole).runs == 5
    nothing = share_of(each_its_own(7), np.zeros(7), np.zeros(7))
    assert isnan(nothing.value)
    assert plain(nothing) == {"value": None, "low": None, "high": None, "runs": 0, "groups": 0}


def test_the_mean_of_two_sets_that_are_the_same_is_the_share_of_the_set():
    random = np.random.default_rng(3)
    whole = random.uniform(1.0, 9.0, 40)
    whole[[1, 2]] = 0.0  # these count nowhere
    part = whole * random.uniform(0.0, 1.0, 40)
    own = np.arange(40) % 3 > 0
    alone, both = (each_its_own(40).mean_share(part, whole, sets) for sets in ([own], [own, own]))
    assert (both.runs, both.groups) == (alone.runs, alone.groups) == (24, 24)
    assert (both.value, both.low, both.high) == pytest.approx((alone.value, alone.low, alone.high))
    rate = each_its_own(40).mean_rate(part, whole, [own, own])
    assert rate.value == pytest.approx(alone.value)


def test_a_quantile_has_the_runs_that_hold_its_values():
    owner = np.repeat(np.arange(2, 10), 3)
    alike = each_its_own(12).quantile(np.full(24, 7.0), owner, 0.5)
    assert (alike.value, alike.low, alike.high, alike.runs, alike.groups) == (7, 7, 7, 8, 8)
    values = np.random.default_rng(0).permutation(24).astype(np.float64)
    for share in (0.1, 0.5, 0.9):
        found = each_its_own(12).quantile(values, owner, share)
        assert found.value == np.quantile(values, share, method="inverted_cdf")
        assert 0.0 <= found.low <= found.value <= found.high <= 23.0
        assert found.low < found.high
    few = each_its_own(12).quantile(values[:6], owner[:6], 0.5)
    assert (few.runs, few.groups) == (2, 2)
    assert isnan(few.low)


def test_sets_are_the_same_each_time_and_in_any_order_of_the_runs():
    names = [f"g{number // 3}" for number in range(60)]
    part, whole = np.arange(60.0) % 7, np.full(60, 7.0)
    first = share_of(Resampling.of(names), part, whole)
    assert share_of(Resampling.of(names), part, whole) == first
    back = share_of(Resampling.of(names[::-1]), part[::-1], whole)
    assert (back.low, back.high) == pytest.approx((first.low, first.high))


def test_the_bounds_of_a_mean_allow_for_its_least_certain_part():
    resampling = each_its_own(40)
    both = [np.ones(40, dtype=bool), np.arange(40) < 6]
    mean = resampling.bounded(1.0, np.ones(2000), both)
    assert mean.low == pytest.approx((0.025 ** (1 / 40) + 0.025 ** (1 / 6)) / 2)
    assert mean.groups == 6
    assert isnan(resampling.bounded(1.0, np.ones(2000), [both[0], np.arange(40) < 4]).low)
    assert isnan(resampling.unbounded(nan, np.full(2000, nan), both[0]).low)
