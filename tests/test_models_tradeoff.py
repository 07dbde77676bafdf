from dataclasses import replace

import numpy as np
import pytest
from predicted_runs import CLASSES, GOOD, IMPACT, OSCILLATION, frames, many, perfect, predicted

from noiseclassifier.evaluation.calibration import are_probabilities, reliability
from noiseclassifier.evaluation.eventscore import score
from noiseclassifier.evaluation.intervals import Resampling
from noiseclassifier.evaluation.matching import Matched
from noiseclassifier.evaluation.tradeoff import POINTS, failure_score, trade_off
from noiseclassifier.labels import Labels

COUNT = len(frames())


def graded(name, blocks, risk):
    """A recording whose frames have failure scores: a failure is predicted from 0 on."""
    risk = np.asarray(risk, dtype=float)
    scores = np.full((len(risk), 4), -9.0)
    scores[:, 0], scores[:, 1] = 0.0, risk
    labels = np.where(risk > 0, "impact", "ok").tolist()
    return predicted(name, blocks, labels, scores=scores)


def noisy(seeds, spread=1.0):
    random = np.random.default_rng(7)
    return [
        graded(
            f"talos/{scenario}-{seed:03d}",
            blocks,
            np.array([-1.0 if label == "ok" else 1.0 for label in perfect(blocks)])
            + spread * random.normal(size=COUNT),
        )
        for seed in range(seeds)
        for scenario, blocks in (("good", GOOD), ("blow", IMPACT), ("swing", OSCILLATION))
    ]


def read(recordings, *budgets):
    resampling = Resampling.of([each.group for each in recordings])
    return trade_off(Matched.of(recordings)).at_budgets(budgets, resampling)


def test_perfect_scores_find_everything_without_false_alarms():
    curve = trade_off(Matched.of(many(3))).curve()
    assert curve["failure_recall"][0] == curve["events_found"][0] == 1.0
    assert curve["false_alarms_per_hour"][0] == 0.0
    recall, found = read(many(6), 0.0)[0]
    assert recall.value == found.value == 1.0
    assert recall.low == pytest.approx(0.025 ** (1 / 12))  # twelve runs have failures


def test_constant_scores_find_nothing_without_false_alarms():
    dull = [graded(f"talos/blow-{seed:03d}", IMPACT, np.zeros(COUNT)) for seed in range(6)]
    curve = trade_off(Matched.of(dull)).curve()
    assert curve["failure_recall"].tolist() == [0.0]
    assert read(dull, 1000.0)[0][0].value == 0.0


def test_recall_rises_as_the_threshold_falls():
    curve = trade_off(Matched.of(noisy(5))).curve()
    assert (np.diff(curve["threshold"]) < 0).all()
    assert (np.diff(curve["failure_recall"]) >= 0).all()
    assert (np.diff(curve["events_found"]) >= 0).all()
    assert curve["false_alarms_per_hour"][0] == 0.0


def test_the_curve_counts_as_events_are_counted():
    recordings = noisy(4)
    found = trade_off(Matched.of(recordings))
    for point in (0, 5, 40, -1):
        threshold = found.thresholds[point]
        moved = [
            graded(each.name, each.blocks, each.labels.scores[:, 1] - threshold)
            for each in recordings
        ]
        result = score(Matched.of(moved))
        assert found.false[:, point].sum() == result.alarms.false.sum()
        assert found.found[:, point].sum() == result.found.sum()


def confirming(name, annotated, risk, novel, apart, threshold=0.5):
    """A recording of a model whose findings take two frames of evidence."""
    starts = frames() + 5.0 * np.cumsum(apart)
    scores = np.stack((1.0 - risk, risk, 0.0 * risk, 0.0 * risk), axis=1)
    above = risk > threshold
    label = np.where(above | (risk > 0.2), "impact", "ok")
    label = np.where(novel & ~above, "unknown", label)
    labels = Labels(starts, starts + 0.4, label, scores, CLASSES, above, novel)
    return replace(predicted(name, annotated), labels=labels)


def test_where_findings_take_two_frames_the_curve_counts_as_labels_do():
    random = np.random.default_rng(2)
    names = [f"talos/{name}-{seed:03d}" for name in ("good", "blow") for seed in range(6)]
    drawn = [
        (
            name,
            GOOD if "good" in name else IMPACT,
            random.random(COUNT) ** 2,
            random.random(COUNT) < 0.05,
            random.random(COUNT) < 0.1,
        )
        for name in names
    ]
    found = trade_off(Matched.of([confirming(*each) for each in drawn]))
    assert len(found.thresholds) <= POINTS
    for point in range(0, len(found.thresholds), 3):
        threshold = found.thresholds[point]
        moved = [confirming(*each, threshold) for each in drawn]
        result = score(Matched.of(moved))
        assert found.false[:, point].sum() == result.alarms.false.sum(), threshold
        assert found.found[:, point].sum() == result.found.sum(), threshold


def test_thresholds_reach_from_the_highest_score_in_ok_motion_to_the_lowest():
    recordings = noisy(10)
    matched = Matched.of(recordings)
    found = trade_off(matched)
    scores = matched.frames.scores[:, 1][matched.frames.in_ok]
    assert found.thresholds[[0, -1]].tolist() == [scores.max(), scores.min()]
    assert 100 < len(found.thresholds) <= POINTS < len(np.unique(scores))
    few = noisy(1)[:1]
    assert len(trade_off(Matched.of(few)).thresholds) == COUNT
    # At the last threshold, nothing but that score is left out.
    failing = matched.frames.failing & (matched.frames.truth != "")
    above = matched.frames.scores[failing, 1] > scores.min()
    assert found.recalled[:, -1].sum() == above.sum()
    assert found.frames.sum() == failing.sum()
    curve = found.curve()
    assert curve["failure_recall"][-1] == pytest.approx(above.mean())
    hours = 10 * (5.0 + 2 * 2.0 + 1.0 + 1.4) / 3600
    assert found.hours.sum() == pytest.approx(hours, rel=0.02)
    rate = found.false.sum(axis=0) / found.hours.sum()
    assert curve["false_alarms_per_hour"] == pytest.approx(rate)


def test_what_is_read_stays_within_the_budget_and_grows_with_it():
    recordings = noisy(8)
    curve = trade_off(Matched.of(recordings)).curve()
    budgets = (0.0, 50.0, 200.0, 1000.0)
    recalls = [recall.value for recall, _ in read(recordings, *budgets)]
    assert recalls == sorted(recalls)
    assert recalls[0] < recalls[-1]
    for budget, recall in zip(budgets, recalls, strict=True):
        affordable = curve["false_alarms_per_hour"] <= budget
        prefix = np.cumprod(affordable).astype(bool)
        assert recall == curve["failure_recall"][prefix][-1]


def test_alarms_that_merge_do_not_reduce_the_false_alarms():
    # At a low threshold, one alarm lasts through the run; a little above, there are five.
    risk = np.where(np.arange(COUNT) % 10 == 0, -1.0, -2.0)
    loud = np.array([5.0 if label != "ok" else -3.0 for label in perfect(IMPACT)])
    loud[20] = -1.5  # the last frame that holds the blow, found below that threshold alone
    recordings = [graded(f"talos/good-{seed:03d}", GOOD, risk) for seed in range(5)]
    recordings += [graded(f"talos/blow-{seed:03d}", IMPACT, loud) for seed in range(5)]
    curve = trade_off(Matched.of(recordings)).curve()
    assert curve["false_alarms_per_hour"][-1] < curve["false_alarms_per_hour"].max()
    hours = Matched.of(recordings).ok_covered.sum() / 3600
    cheapest = curve["false_alarms_per_hour"][-1]
    assert cheapest == pytest.approx(5 / hours)
    last = trade_off(Matched.of(recordings)).at_budgets(
        [cheapest], Resampling.of([each.group for each in recordings])
    )
    assert last[0][0].value == curve["failure_recall"][0] == pytest.approx(2 / 3)
    assert curve["failure_recall"][-1] == 1.0


def test_without_ok_motion_nothing_is_read():
    swings = [
        predicted(f"talos/swing-{seed:03d}", OSCILLATION[1:2], labels=perfect(OSCILLATION))
        for seed in range(6)
    ]
    assert np.isnan(read(swings, 5.0)[0][0].value)


def test_intervals_of_what_is_read_shrink_with_more_groups():
    widths = [each.high - each.low for each in (read(noisy(n), 200.0)[0][0] for n in (6, 48))]
    assert widths[1] < 0.7 * widths[0]


def test_probabilities_differ_from_margins():
    above_threshold = np.array([[0.7, 0.1, 0.2, 0.0], [0.0, 0.0, 0.5, 0.5]])
    assert are_probabilities(above_threshold)
    assert failure_score(above_threshold, CLASSES).tolist() == pytest.approx([0.3, 1.0])
    votes = np.array([[3.1, 2.0, 1.0, -0.1]])
    assert not are_probabilities(votes)
    assert failure_score(votes, CLASSES).tolist() == pytest.approx([-1.1])
    assert not are_probabilities(np.array([[1.5, -0.5]]))
    assert not are_probabilities(np.array([[0.5, 0.5], [0.5, 0.4]]))


def confident(name, confidence, right, random):
    """A recording of a model with such a confidence, and right so often."""
    hits = random.random(COUNT) < right
    labels = np.where(hits, "ok", "impact")
    scores = np.full((COUNT, 4), (1 - confidence) / 3)
    scores[np.arange(COUNT), np.where(hits, 0, 1)] = confidence
    return predicted(name, GOOD, labels.tolist(), scores=scores)


@pytest.mark.parametrize(("confidence", "right"), [(0.75, 0.75), (0.99, 0.69), (0.55, 0.95)])
def test_the_calibration_error_is_how_far_confidence_is_from_truth(confidence, right):
    random = np.random.default_rng(0)
    recordings = [confident(f"r{number}", confidence, right, random) for number in range(60)]
    table = reliability(Matched.of(recordings))
    error = table.error(Resampling.of([each.group for each in recordings]))
    assert error.value == pytest.approx(abs(confidence - right), abs=0.02)
    assert error.low <= error.value <= error.high
    bins = table.table()
    (full,) = np.flatnonzero(bins["frames"])
    assert bins["low"][full] <= confidence <= bins["high"][full]
    assert bins["frames"].sum() == 60 * COUNT
    assert bins["confidence"][full] == pytest.approx(confidence)
    assert bins["right"][full] == pytest.approx(right, abs=0.02)


def test_two_bins_with_errors_of_opposite_sign_do_not_cancel():
    random = np.random.default_rng(0)
    recordings = [confident(f"a{number}", 0.99, 0.79, random) for number in range(40)]
    recordings += [confident(f"b{number}", 0.65, 0.85, random) for number in range(40)]
    error = reliability(Matched.of(recordings)).error(Resampling.of([r.name for r in recordings]))
    assert error.value == pytest.approx(0.2, abs=0.02)


def test_a_confidence_of_one_has_a_bin():
    table = reliability(Matched.of([confident("a", 1.0, 1.0, np.random.default_rng(0))]))
    assert table.table()["frames"].tolist() == [0.0] * 9 + [COUNT]


def test_votes_have_no_calibration():
    assert reliability(Matched.of(many(1))) is None
