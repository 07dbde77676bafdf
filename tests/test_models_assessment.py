import json
from dataclasses import replace
from math import nan

import numpy as np
import pytest
from predicted_runs import CLASSES, GOOD, IMPACT, many, predicted

import models
from models.confusion import Evaluation
from models.evaluation.assessment import WORDS, measure, number
from models.evaluation.intervals import Estimate

RATE = 1000.0
PROFILE = models.LogBands(classes=("ok", "oscillations")).at(RATE)


def recording(name, seed, *, swings=True):
    """Four seconds of noise that swings in the last two."""
    time = np.arange(4000) / RATE
    noise = 1 + 0.01 * np.random.default_rng(seed).normal(size=4000)
    swing = 0.3 * np.sin(2 * np.pi * 200 * time) * (time >= 2)
    blocks = [models.Block(0.0, 1.95, "ok"), models.Block(2.0, 4.0, "oscillations")]
    if not swings:
        return models.Recording(name, noise, RATE, (models.Block(0.0, 4.0, "ok"),))
    return models.Recording(name, noise + swing, RATE, tuple(blocks))


@pytest.fixture(scope="module")
def classifier():
    training = [recording(f"panda/swing-{seed:03d}", seed) for seed in range(3)]
    return models.Classifier.train(models.Dataset.of(training, PROFILE), PROFILE)


def fresh(seeds=range(10, 16)):
    return [recording(f"panda/swing-{seed:03d}", seed) for seed in seeds] + [
        recording(f"panda/good-{seed:03d}", seed + 100, swings=False) for seed in seeds
    ]


def test_a_model_is_measured_by_runs_outside_of_its_training_set(classifier):
    found = models.assess(classifier, iter(fresh()))
    assert (found.runs, found.groups) == (12, 6)
    assert found.blocks == {"ok": 12, "oscillations": 6}
    assert found.runs_with == {"ok": 12, "oscillations": 6}
    assert found.events.all_found.value == found.events.all_named.value == 1.0
    assert found.events.false_alarms == 0
    assert found.events.ok_hours == pytest.approx(6 * (4.0 + 1.9) / 3600)
    assert found.frames.balanced_accuracy.value > 0.95
    assert found.calibration_error is None


def test_frames_are_those_that_were_always_counted(classifier):
    found = models.assess(classifier, fresh())
    dataset = models.Dataset.of(fresh(), PROFILE, training=False)
    whole = models.evaluate(classifier, dataset)
    assert found.frames.evaluation.confusion.tolist() == whole.confusion.tolist()


def test_the_events_of_a_robot_are_those_of_its_runs_alone():
    good = [predicted(f"go2/good-{seed:03d}", GOOD) for seed in range(2)]
    missed = [predicted("go2/blow-000", IMPACT, ["ok"] * len(good[0].labels))]
    found = measure([*many(2), *good, *missed])
    for robot, runs in (("talos", many(2)), ("go2", [*good, *missed])):
        own, alone = found.by_robot[robot], measure(runs).events
        assert own.all_found.value == alone.all_found.value
        assert own.false_alarms == alone.false_alarms
        assert own.ok_hours == pytest.approx(alone.ok_hours)
    assert found.by_robot["go2"].all_found.value < found.by_robot["talos"].all_found.value


def test_measures_with_intervals_are_the_measures_without():
    cut = ["ok", "impact", "ok"], ["ok", "ok", "highaccelerations"], ["ok", "impact", "impact"]
    runs = [
        predicted(f"talos/blow-{seed:03d}", IMPACT, cut=cut[seed % 3] if seed else ["unknown"] * 3)
        for seed in range(7)
    ]
    frames = measure(runs).frames
    plain = Evaluation.of(
        np.concatenate([run.truth for run in runs]),
        np.concatenate([run.predicted for run in runs]),
        CLASSES,
    )
    assert frames.evaluation.classes == (*CLASSES, "unknown")
    measures = plain.as_dict()
    for name in (
        "balanced_accuracy",
        "failure_recall",
        "false_alarm_rate",
        "failure_detection_rate",
        "subset_accuracy",
    ):
        assert getattr(frames, name).value == pytest.approx(measures[name]), name
    for name in ("recall", "precision", "false_negative_errors", "false_positive_errors"):
        for label, each in getattr(frames, name).items():
            assert each.value == pytest.approx(measures[name][label] or each.value, nan_ok=True)
            assert np.isnan(each.value) == (measures[name][label] is None), (name, label)


def test_perfect_predictions_score_one_with_the_exact_bound_of_their_groups():
    found = measure(many(6))
    for each in (found.frames.balanced_accuracy, found.frames.failure_recall):
        assert each.value == each.high == 1.0
    assert found.frames.failure_recall.low == pytest.approx(0.025 ** (1 / 12))
    bounds = [0.025 ** (1 / runs) for runs in (18, 6, 6)]
    assert found.frames.balanced_accuracy.low == pytest.approx(np.mean(bounds))


def test_runs_of_the_training_set_are_refused_or_listed(classifier):
    known = recording("panda/swing-001", 1)
    with pytest.raises(models.SeenError, match=r"panda/swing-001: .* on the same recording as"):
        models.assess(classifier, [*fresh(), known])
    sibling = recording("panda/good-002", 50, swings=False)
    with pytest.raises(models.SeenError, match="'panda/swing-002', which shares its motion"):
        models.assess(classifier, [sibling])
    found = models.assess(classifier, [*fresh(), known, sibling], seen_too=True)
    assert list(found.seen) == ["panda/swing-001", "panda/good-002"]
    assert "NOT A TEST: 2 of these runs were trained on" in str(found)
    assert found.runs == 14


def test_a_run_that_equals_another_is_no_more_evidence(classifier):
    runs = fresh()
    found = models.assess(classifier, [*runs, replace(runs[0], name="panda/copy-010")])
    assert found.copies == {"panda/copy-010": "panda/swing-010"}
    assert found.as_dict()["frames"] == models.assess(classifier, runs).as_dict()["frames"]
    assert "panda/copy-010 (panda/swing-010)" in str(found)


def test_names_that_repeat_and_runs_without_blocks_are_refused(classifier):
    run = fresh()[0]
    short = replace(run, signal=run.signal[:100], blocks=(), sha256="")
    with pytest.raises(
        models.DatasetError,
        match="none of 1 recordings has a verdict; panda/swing-010: .* too short",
    ):
        models.assess(classifier, [short])
    with pytest.raises(models.DatasetError, match="two recordings are called 'panda/swing-010'"):
        models.assess(classifier, [run, replace(run, signal=run.signal + 1.0, sha256="")])
    with pytest.raises(models.DatasetError, match="no annotated frame in 1 recordings"):
        models.assess(classifier, [replace(run, blocks=())])
    with pytest.raises(models.DatasetError, match="no annotated frame in 0 recordings"):
        models.assess(classifier, [])


def test_a_run_without_a_verdict_is_listed_and_not_left_out_in_silence(classifier):
    short = replace(fresh()[0], name="panda/short-010", signal=np.ones(100), blocks=(), sha256="")
    slow = models.Unanswered("slow", {"robot": "ur5"}, "rate 200 Hz < 1000 Hz")
    found = models.assess(classifier, [*fresh(), short, slow])
    assert found.runs == 12
    assert found.protocol.not_answered == pytest.approx(2 / 14)
    text = str(found)
    assert "not answered: 1 run (rate 200 Hz < 1000 Hz) of ur5" in text
    assert "is too short: a frame takes 400) of panda" in text
    with pytest.raises(models.DatasetError, match="two recordings are called 'slow'"):
        models.assess(classifier, [slow, slow])


def test_a_run_whose_blocks_lie_in_gaps_is_classified_from_end_to_end(classifier):
    valid = np.ones(4000, dtype=bool)
    valid[1000:3000:100] = False
    gappy = replace(fresh()[0], valid=valid, blocks=(models.Block(1.2, 2.8, "oscillations"),))
    found = models.assess(classifier, [gappy, *fresh()[1:]])
    assert found.frames.evaluation.confusion.sum() < count_frames(classifier)
    assert found.blocks["oscillations"] == 6
    assert len(found.score.missed()) == 1  # no frame of it can be classified


def count_frames(classifier):
    return models.assess(classifier, fresh()).frames.evaluation.confusion.sum()


def test_everything_goes_through_json(classifier):
    plain = models.assess(classifier, fresh()).as_dict()
    assert json.loads(json.dumps(plain, allow_nan=False)) == plain
    assert plain["format"] == "noise-evaluation/2"
    assert plain["calibration_error"] is plain["reliability"] is None
    assert plain["events"]["false_alarms_per_hour"]["value"] == 0.0
    assert len(plain["curve"]["threshold"]) == len(plain["curve"]["failure_recall"])
    assert [each["false_alarms_per_hour"] for each in plain["at_budgets"]] == [5.0, 20.0, 100.0]


def text_of(assessment):
    return {" ".join(line.split()) for line in str(assessment).splitlines()}


def test_numbers_have_three_digits_and_large_ones_no_exponent():
    words = [number(Estimate(value, nan, nan, 1, 1), "s").split()[0] for value in (0.12345, 1800.0)]
    assert words == ["0.123", "1800"]


def test_it_prints_each_figure_with_its_interval_and_what_is_behind_it():
    lines = text_of(measure([*many(6), predicted("talos/good-009", GOOD, ["impact"] * 47)]))
    assert "ok 100.0% [82.4, 100.0] 100.0% [82.4, 100.0] 31 31 19" in lines
    assert "impact 100.0% [54.1, 100.0] 100.0% [54.1, 100.0] 6 6 6" in lines
    assert "impact 100.0% [54.1, 100.0] 100.0% [54.1, 100.0] 6 6" in lines
    alarms = [line for line in lines if line.startswith("False alarms 1, or")]
    assert len(alarms) == 1
    assert "per hour [" in alarms[0]
    assert "impact in talos/good-009, 0.00 s to 5.00 s" in lines
    assert "Calibration error - (the scores are no probabilities)" in lines
    assert "highaccelerations - - 0 0 0" in lines
    for budget, share in ((5, "0.0%"), (20, "0.0%"), (100, "100.0%")):
        assert f"{budget} false alarms per h {share} [0.0, 100.0] {share} [0.0, 100.0]" in lines


def test_it_prints_the_papers_measures_under_the_papers_names():
    lines = text_of(measure(many(6, ["ok"] * 47)))
    assert any(line.startswith("Failure detection rate 100.0%") for line in lines)
    assert any("(calling all frames ok: 71.4%)" in line for line in lines)


def test_the_reason_for_missing_intervals_is_printed():
    text = str(measure(many(2)))
    assert "Measures of fewer than 5 groups have none." in text
    assert "Balanced accuracy       100.0%\n" in text


def test_several_robots_have_a_row_each():
    one, other = (
        many(6),
        [predicted(f"go2/blow-{seed:03d}", IMPACT, ["ok"] * 47) for seed in range(6)],
    )
    assert "By robot" not in str(measure(one))
    lines = text_of(measure([*one, *other]))
    assert "go2 6 0.00667 0 0.0% 0 0.0% 0.0% 0.0% -" in lines
    assert any(line.startswith("talos 18 ") for line in lines)


def test_lines_are_short_and_lists_too():
    text = str(measure(many(40, ["ok"] * 47)))
    assert max(map(len, text.splitlines())) <= 120
    assert "and 75 more" in text


def test_a_table_of_arrow_has_all_measures_in_long_form():
    many_robots = [predicted(f"go2/good-{seed:03d}", GOOD) for seed in range(6)]
    found = measure([*many(6), *many_robots])
    table = found.to_arrow()
    assert table.column_names[:4] == ["of", "measure", "class", "robot"]
    rows = {tuple(row[name] for name in (*WORDS, "budget")): row for row in table.to_pylist()}
    assert len(rows) == len(table)
    recall = rows["frames", "recall", "impact", None, None, None, None]
    expected = found.frames.recall["impact"].as_dict()
    assert {name: recall[name] for name in expected} == expected
    assert rows["events", "false_alarms", None, "talos", None, None, None]["value"] == 0.0
    assert (
        rows["events", "all_found", None, "go2", None, None, None]["value"] is None
    )  # it has no failures
    at_budget = rows["scores", "events_found", None, None, None, None, 5.0]
    assert at_budget["value"] == found.at_budgets[5.0][1].value
    f1 = found.protocol.alike["class_f1"]
    assert rows["protocol", "class_f1", None, None, None, None, None]["value"] == f1.value
    assert rows["protocol", "recall_felt", None, "talos", None, None, None]["value"] == 1.0
    assert rows["chance", "class_f1", None, None, None, None, None]["value"] < f1.value
    assert {row["class"] for row in rows.values()} == {None, *CLASSES}
    for domain, ranked in found.protocol.ranked.items():
        auc = rows["protocol", "auc", None, None, domain, None, None]
        assert auc["value"] == pytest.approx(ranked.auc, nan_ok=True)
    assert found.protocol.ranked
