from math import isnan

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
    # Garwood (1936), 95 %; a set without an event changes nothing
    for events, bounds in ((0, (0.0, 3.6889)), (1, (0.0253, 5.5716)), (10, (4.7954, 18.3904))):
        assert fay_feuer(np.array([events, 0]), np.ones(2)) == pytest.approx(bounds, abs=1e-4)
    low, high = fay_feuer(np.array([3.0, 1.0]), np.array([0.5, 5.0]))
    assert low < 6.5 < high


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
    rate = rate_of(Resampling.of(["a"]), np.ones(1), np.ones(1))  # counting alone bounds a rate
    assert (rate.low, rate.high) == pytest.approx(garwood(1))
    low = [rate_of(each_its_own(n), 10.0 * (np.arange(n) < 1), np.ones(n)).low for n in (4, 5)]
    assert low == pytest.approx([garwood(10)[0] / 4, 0.0])


def test_only_runs_in_the_sample_of_a_measure_count():
    whole = np.array([0.0, 4.0, 4.0, 4.0, 4.0, 4.0, 0.0])
    assert share_of(each_its_own(7), whole, whole).low == pytest.approx(0.025 ** (1 / 5))
    nothing = np.zeros(7)
    for estimate in (share_of, rate_of):
        found = plain(estimate(each_its_own(7), nothing, nothing))
        assert found == {"value": None, "low": None, "high": None}


def test_the_mean_of_two_sets_that_are_the_same_is_the_share_of_the_set():
    random = np.random.default_rng(3)
    whole = random.uniform(1.0, 9.0, 40)
    whole[[1, 2]] = 0.0  # these count nowhere
    part = whole * random.uniform(0.0, 1.0, 40)
    own = np.arange(40) % 3 > 0
    alone, both = (each_its_own(40).mean_share(part, whole, sets) for sets in ([own], [own, own]))
    assert (both.value, both.low, both.high) == pytest.approx((alone.value, alone.low, alone.high))
    rate = each_its_own(40).mean_rate(part, whole, [own, own])
    assert rate.value == pytest.approx(alone.value)


def test_sets_are_the_same_each_time_and_in_any_order_of_the_runs():
    names = [f"g{number // 3}" for number in range(60)]
    part, whole = np.arange(60.0) % 7, np.full(60, 7.0)
    first = share_of(Resampling.of(names), part, whole)
    assert share_of(Resampling.of(names), part, whole) == first
    back = share_of(Resampling.of(names[::-1]), part[::-1], whole)
    assert (back.low, back.high) == pytest.approx((first.low, first.high))


def test_the_bounds_of_a_mean_allow_for_its_least_certain_part():
    resampling, whole = each_its_own(40), np.ones(40)
    every, few = np.ones(40, dtype=bool), np.arange(40) < 6
    mean = resampling.mean_share(whole, whole, [every, few])
    assert mean.low == pytest.approx((0.025 ** (1 / 40) + 0.025 ** (1 / 6)) / 2)
    assert isnan(resampling.mean_share(whole, whole, [every, np.arange(40) < 4]).low)
