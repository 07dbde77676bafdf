"""Measures of frames, and their intervals."""

from math import isnan

import numpy as np
import pytest
from predicted_runs import garwood

import noiseclassifier as nc
from noiseclassifier.measures import Evaluation, Resampling, fay_feuer, plain

TRUTH = np.array(["ok"] * 6 + ["impact"] * 2 + ["oscillations"] * 2)
CLASSES = ("ok", "impact", "oscillations")


def evaluation(*labels):
    return Evaluation.of(TRUTH, np.array(labels), CLASSES)


PERFECT = evaluation(*TRUTH)
MIXED = evaluation(*["ok"] * 5, "impact", "impact", "ok", "oscillations", "impact")


def test_a_perfect_classifier_scores_one():
    for name, value in PERFECT.measures.items():
        errors = name.endswith("errors") or name == "false_alarm_rate"
        assert np.all(value == (0.0 if errors else 1.0)), name


def test_measures_are_counted_by_hand():
    assert MIXED.confusion.tolist() == [[5, 1, 0], [1, 1, 0], [0, 1, 1]]
    assert MIXED.as_dict() == {
        "frames": 10,
        "classes": list(CLASSES),
        "confusion": MIXED.confusion.tolist(),
        "recall": dict(zip(CLASSES, (5 / 6, 1 / 2, 1 / 2), strict=True)),
        "precision": dict(zip(CLASSES, (5 / 6, 1 / 3, 1.0), strict=True)),
        "false_negative_errors": dict.fromkeys(CLASSES, 0.1),
        "false_positive_errors": dict(zip(CLASSES, (0.1, 0.2, 0.0), strict=True)),
        "balanced_accuracy": pytest.approx(11 / 18),
        "failure_recall": 0.75,  # which failure it is does not matter here
        "false_alarm_rate": 1 / 6,
        "failure_detection_rate": 0.9,
        "subset_accuracy": 0.7,
    }


def test_what_cannot_be_measured_is_none():
    only_ok = Evaluation.of(np.array(["ok"]), np.array(["ok"]), CLASSES).as_dict()
    assert only_ok["failure_recall"] is None
    assert only_ok["recall"] == {"ok": 1.0, "impact": None, "oscillations": None}
    assert only_ok["balanced_accuracy"] == 1.0


def test_a_label_that_the_classifier_does_not_have_counts_as_missed():
    strange = Evaluation.of(np.array(["ok", "rattle"]), np.array(["ok", "ok"]), CLASSES)
    assert strange.classes == (*CLASSES, "rattle")
    assert strange.measures["failure_recall"] == 0.0


def test_it_prints_a_small_evaluation_whole():
    head = "10 frames                 " + "".join(each.rjust(19) for each in CLASSES)
    rows = {
        "False negative errors": ("10.0%", "10.0%", "10.0%"),
        "False positive errors": ("10.0%", "20.0%", "0.0%"),
        "Failure detection rate": ("90.0%",),
        "Subset accuracy": ("70.0%",),
        "Recall": ("83.3%", "50.0%", "50.0%"),
        "Precision": ("83.3%", "33.3%", "100.0%"),
        "Balanced accuracy": ("61.1%",),
        "Failure recall": ("75.0%",),
        "False alarm rate": ("16.7%",),
        "ok": ("5", "1", "0"),
        "impact": ("1", "1", "0"),
        "oscillations": ("0", "1", "1"),
    }
    lines = [name.ljust(26) + "".join(cell.rjust(19) for cell in row) for name, row in rows.items()]
    foot = (
        "The paper divides by all frames: predicting ok for all of them would detect",
        "60.0% of failures by its measure, and none by failure recall.",
    )
    assert str(MIXED).split("\n") == [
        *(head, "", "As the paper measures", *lines[:4], ""),
        *("Of the frames in question", *lines[4:9], ""),
        *("Frames of (row) predicted (column)", *lines[9:], "", *foot),
    ]
    only = Evaluation.of(np.array(["ok"]), np.array(["ok"]), ("ok", "a" * 30))
    found = str(only).split("\n")
    assert found[0] == "1 frames".ljust(32) + "ok".rjust(19) + "a" * 30
    assert "Recall".ljust(32) + "100.0%".rjust(19) + "-".rjust(19) in found


def test_nothing_to_compare_is_refused():
    with pytest.raises(nc.DatasetError, match="0 labels and 0 predictions"):
        Evaluation.of(np.array([]), np.array([]), CLASSES)
    with pytest.raises(nc.DatasetError, match="10 labels and 1 predictions"):
        Evaluation.of(TRUTH, np.array(["ok"]), CLASSES)


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
