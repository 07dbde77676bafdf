import json
from dataclasses import replace

import numpy as np
import pytest
from generalmodel import trained
from predicted_runs import (
    CLASSES,
    GOOD,
    IMPACT,
    OSCILLATION,
    blocks,
    frames,
    many,
    perfect,
    predicted,
)

import noiseclassifier as nc
from noiseclassifier.assessment import measure, table
from noiseclassifier.labels import Event
from noiseclassifier.matching import Unanswered, are_probabilities, failure_score
from noiseclassifier.measures import (
    BY_CLASS,
    OF_ALL,
    Resampling,
    calibration,
)
from noiseclassifier.recording import Fault

RATE = 1000.0
PROFILE = nc.LogBands(classes=("ok", "oscillations")).at(RATE)


def recording(name, seed, *, swings=True):
    """Four seconds of noise that swings in the last two."""
    time = np.arange(4000) / RATE
    noise = 1 + 0.01 * np.random.default_rng(seed).normal(size=4000)
    swing = 0.3 * np.sin(2 * np.pi * 200 * time) * (time >= 2)
    blocks = [nc.Block(0.0, 1.95, "ok"), nc.Block(2.0, 4.0, "oscillations")]
    if not swings:
        return nc.Recording(name, noise, RATE, (nc.Block(0.0, 4.0, "ok"),))
    return nc.Recording(name, noise + swing, RATE, tuple(blocks))


@pytest.fixture(scope="module")
def classifier():
    training = [recording(f"panda/swing-{seed:03d}", seed) for seed in range(3)]
    return nc.Classifier.train(nc.Dataset.of(training, PROFILE), PROFILE)


def fresh(seeds=range(10, 16)):
    return [recording(f"panda/swing-{seed:03d}", seed) for seed in seeds] + [
        recording(f"panda/good-{seed:03d}", seed + 100, swings=False) for seed in seeds
    ]


def test_a_model_is_measured_by_runs_outside_of_its_training_set(classifier):
    found = nc.assess(classifier, iter(fresh()))
    assert (found.runs, found.groups) == (12, 6)
    assert found.blocks == {"ok": 12, "oscillations": 6}
    assert found.runs_with == {"ok": 12, "oscillations": 6}
    assert found.protocol.pooled["class_recall"].value == 1.0
    assert found.protocol.counts["false_alarms"] == 0
    assert found.protocol.counts["ok_hours"] == pytest.approx(6 * (4.0 + 1.95) / 3600)
    assert found.frames["balanced_accuracy"].value > 0.95
    assert found.calibration_error is None


def test_frames_are_those_that_were_always_counted(classifier):
    found = nc.assess(classifier, fresh())
    dataset = nc.Dataset.of(fresh(), PROFILE, training=False)
    whole = nc.evaluate(classifier, dataset)
    assert found.evaluation.confusion.tolist() == whole.confusion.tolist()


def test_measures_with_intervals_are_the_measures_without():
    cut = ["ok", "impact", "ok"], ["ok", "ok", "highaccelerations"], ["ok", "impact", "impact"]
    runs = [
        predicted(f"talos/blow-{seed:03d}", IMPACT, cut=cut[seed % 3] if seed else ["unknown"] * 3)
        for seed in range(7)
    ]
    found = measure(runs)
    assert found.evaluation.classes == (*CLASSES, "unknown")
    measures = found.evaluation.as_dict()
    for name in OF_ALL:
        assert found.frames[name].value == pytest.approx(measures[name]), name
    for name in BY_CLASS:
        for label, each in found.frames[name].items():
            assert each.value == pytest.approx(measures[name][label] or each.value, nan_ok=True)
            assert np.isnan(each.value) == (measures[name][label] is None), (name, label)


def test_perfect_predictions_score_one_with_the_exact_bound_of_their_groups():
    found = measure(many(6))
    for each in (found.frames["balanced_accuracy"], found.frames["failure_recall"]):
        assert each.value == each.high == 1.0
    assert found.frames["failure_recall"].low == pytest.approx(0.025 ** (1 / 12))
    bounds = [0.025 ** (1 / runs) for runs in (18, 6, 6)]
    assert found.frames["balanced_accuracy"].low == pytest.approx(np.mean(bounds))


def test_runs_of_the_training_set_are_refused_or_listed(classifier):
    known = recording("panda/swing-001", 1)
    with pytest.raises(nc.DatasetError, match=r"panda/swing-001: .* on the same recording as"):
        nc.assess(classifier, [*fresh(), known])
    sibling = recording("panda/good-002", 50, swings=False)
    with pytest.raises(nc.DatasetError, match="'panda/swing-002', which shares its motion"):
        nc.assess(classifier, [sibling])
    found = nc.assess(classifier, [*fresh(), known, sibling], seen_too=True)
    assert list(found.seen) == ["panda/swing-001", "panda/good-002"]
    assert "NOT A TEST: 2 of these runs were trained on" in str(found)
    assert found.runs == 14


def test_a_run_that_equals_another_is_no_more_evidence(classifier):
    runs = fresh()
    found = nc.assess(classifier, [*runs, replace(runs[0], name="panda/copy-010")])
    assert found.copies == {"panda/copy-010": "panda/swing-010"}
    assert found.as_dict()["frames"] == nc.assess(classifier, runs).as_dict()["frames"]
    assert "panda/copy-010 (panda/swing-010)" in str(found)


def test_names_that_repeat_and_runs_without_blocks_are_refused(classifier):
    run = fresh()[0]
    short = replace(run, signal=run.signal[:100], blocks=(), sha256="")
    with pytest.raises(
        nc.DatasetError,
        match="none of 1 recordings has a verdict; panda/swing-010: .* too short",
    ):
        nc.assess(classifier, [short])
    with pytest.raises(nc.DatasetError, match="two recordings are called 'panda/swing-010'"):
        nc.assess(classifier, [run, replace(run, signal=run.signal + 1.0, sha256="")])
    with pytest.raises(nc.DatasetError, match="no annotated frame in 1 recordings"):
        nc.assess(classifier, [replace(run, blocks=())])
    with pytest.raises(nc.DatasetError, match="no annotated frame in 0 recordings"):
        nc.assess(classifier, [])


@pytest.mark.parametrize("model", ["of one rate", "general"])
def test_a_label_that_is_no_class_is_refused(classifier, model):
    run = replace(fresh()[0], blocks=(nc.Block(0.0, 1.0, "ok"), nc.Block(1.0, 2.0, "rattle")))
    measured = trained() if model == "general" else classifier
    with pytest.raises(nc.RecordingError, match="swing-010: label 'rattle' is no class; there are"):
        nc.assess(measured, [run])


def test_a_run_without_a_verdict_is_listed_and_not_left_out_in_silence(classifier):
    short = replace(fresh()[0], name="panda/short-010", signal=np.ones(100), blocks=(), sha256="")
    slow = nc.Unanswered("slow", {"robot": "ur5"}, "rate 200 Hz < 1000 Hz")
    found = nc.assess(classifier, [*fresh(), short, slow])
    assert found.runs == 12
    assert found.protocol.not_answered == pytest.approx(2 / 14)
    text = str(found)
    assert "not answered: 1 run (rate 200 Hz < 1000 Hz) of ur5" in text
    assert "is too short: a frame takes 400) of panda" in text
    with pytest.raises(nc.DatasetError, match="two recordings are called 'slow'"):
        nc.assess(classifier, [slow, slow])


def test_a_run_whose_blocks_lie_in_gaps_is_classified_from_end_to_end(classifier):
    valid = np.ones(4000, dtype=bool)
    valid[1000:3000:100] = False
    gappy = replace(fresh()[0], valid=valid, blocks=(nc.Block(1.2, 2.8, "oscillations"),))
    found = nc.assess(classifier, [gappy, *fresh()[1:]])
    assert found.evaluation.confusion.sum() < count_frames(classifier)
    assert found.blocks["oscillations"] == 6


def count_frames(classifier):
    return nc.assess(classifier, fresh()).evaluation.confusion.sum()


def test_everything_goes_through_json(classifier):
    plain = nc.assess(classifier, fresh()).as_dict()
    assert json.loads(json.dumps(plain, allow_nan=False)) == plain
    assert plain["format"] == "noise-evaluation/3"
    assert plain["calibration_error"] is plain["reliability"] is None
    assert plain["protocol"]["pooled"]["false_alarms_per_hour"]["value"] == 0.0


def test_lines_are_short_and_lists_too():
    text = str(measure(many(40, ["ok"] * 47)))
    assert max(map(len, text.splitlines())) <= 120
    assert "and 75 more" in text


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
    hits = random.random(len(frames())) < right
    labels = np.where(hits, "ok", "impact")
    scores = np.full((len(frames()), 4), (1 - confidence) / 3)
    scores[np.arange(len(frames())), np.where(hits, 0, 1)] = confidence
    return predicted(name, GOOD, labels.tolist(), scores=scores)


@pytest.mark.parametrize(("confidence", "right"), [(0.75, 0.75), (0.99, 0.69), (0.55, 0.95)])
def test_the_calibration_error_is_how_far_confidence_is_from_truth(confidence, right):
    random = np.random.default_rng(0)
    recordings = [confident(f"r{number}", confidence, right, random) for number in range(60)]
    groups = Resampling.of([each.group for each in recordings])
    bins, error = calibration(recordings, groups)
    assert error.value == pytest.approx(abs(confidence - right), abs=0.02)
    assert error.low <= error.value <= error.high
    (full,) = np.flatnonzero(bins["frames"])
    assert bins["low"][full] <= confidence <= bins["high"][full]
    assert bins["frames"].sum() == 60 * len(frames())
    assert bins["confidence"][full] == pytest.approx(confidence)
    assert bins["right"][full] == pytest.approx(right, abs=0.02)


def test_votes_have_no_calibration():
    assert calibration(many(1), Resampling.of(["a"])) is None


def sure(name, annotated, labels, confidence, findings, *, cut=None, faults=(), **facts):
    """A recording of a model with such a confidence, and with these findings."""
    scores = np.full((len(labels), 4), (1.0 - confidence) / 3)
    scores[np.arange(len(labels)), [CLASSES.index(each) for each in labels]] = confidence
    spans = tuple(Event(*each) for each in findings)
    one = predicted(name, annotated, labels, scores=scores, cut=cut)
    return replace(one, events=faults, facts=facts, located=(spans, spans))


def of_two_robots():
    """Four groups, so that shares have no interval; each kind of mistake in other numbers."""
    calm = ["ok"] * len(frames())
    false = ["impact" if n in (3, 4, 30, 31, 32) else "ok" for n in range(len(calm))]
    late = ["highaccelerations" if 20 < n < 40 else "ok" for n in range(len(calm))]
    series = blocks(*((0.5 * n + 0.1, 0.5 * n + 0.2, "impact") for n in range(6)), (3.5, 4.5, "ok"))
    faults = (Fault(2.03, 2.2, "impact"), Fault(4.0, 4.1, "impact", felt=False))
    stiff, soft = ({"domain": domain} for domain in ("stiff", "soft"))
    runs = [
        sure(
            *("talos/good-000", GOOD, false, 0.85),
            [("impact", 0.35, 0.75, 0.9), ("unknown", 3.0, 3.6, 0.4)],
            cut=["impact"],
            **stiff,
            scenario="good",
        ),
        sure(
            *("talos/blow-000", IMPACT, perfect(IMPACT), 0.95),
            [("impact", 2.01, 2.2, 0.9)],
            **stiff,
            scenario="blow",
        ),
        sure(
            *("talos/blow-001", IMPACT, calm, 0.75),
            [("impact", 2.6, 2.7, 0.9)],
            faults=faults,
            **soft,
            scenario="blow",
        ),
        sure(
            *("go2/swing-002", OSCILLATION, late, 0.65),
            [("highaccelerations", 2.1, 4.2, 0.9)],
            cut=["ok", "highaccelerations", "ok"],
            **soft,
            scenario="swing",
        ),
        sure(
            *("go2/blow-003", series, calm, 0.55),
            [],
            cut=["ok", *["impact"] * 4, "oscillations", "ok"],
            **soft,
            scenario="blow",
        ),
    ]
    slow = Unanswered("a1/slow-000", {"robot": "a1", "domain": "field"}, "rate 50 Hz < 80 Hz")
    return measure(
        runs,
        unanswered=[slow],
        copies={"go2/blow-009": "go2/blow-003"},
        known={"talos/blow-000": "a recording of this name"},
    )


def test_it_prints_a_small_assessment_whole():
    assert f"{of_two_robots()}\n" == WHOLE


def test_the_table_of_one_key_takes_the_place_of_the_others():
    paragraphs = table(of_two_robots(), "scenario").split("\n\n")
    assert [each for each in paragraphs if each.startswith("By ")] == [BY_SCENARIO]
    others = [each for each in WHOLE.removesuffix("\n").split("\n\n") if each[:3] != "By "]
    assert [each for each in paragraphs if each[:3] != "By "] == others


WHOLE = """\
5 runs in 4 groups (runs of a group share their motion) of 3 robots (a1, go2, talos) in 3 domains (field, soft, stiff)
10 injected faults (9 detectable), 0.00456 h of ok time, 0.00145 h unlabelled
NOT A TEST: 1 of these runs were trained on, or share their motion with such:
  talos/blow-000: a recording of this name
left out, since they equal others bit for bit:
  go2/blow-009 (go2/blow-003)

At the operating point that ships: findings as `inspector classify` reports them
                                      robots alike              all runs pooled           by chance   counts
False alarms per hour of ok time      277 [33.5, 2229]          439 [53.2, 1586]                      2
  by findings unknown                 138 [3.51, 2087]          220 [5.56, 1223]                      1
Ok time flagged                       12.7%                     9.8%
Alarms per hour of unlabelled time    1084 [27.5, 6042]         691 [17.5, 3850]                      1
Faults found, of all injected         23.8%                     20.0%                     10.9%       2 of 10
Faults found, of detectable           32.1%                     22.2%                     10.3%       2 of 9
Onset right within 0.2 s, of found    50.0%                     50.0%                     31.5%       1 of 2
Events by class, precision            12.5%                     20.0%                     2.8%        1 of 5
  recall                              16.7%                     10.0%                     3.8%        1 of 10
  F1                                  14.3%                     13.3%                     3.2%
Events of any class, precision        62.5%                     40.0%                     52.8%       2 of 5
  recall                              23.8%                     20.0%                     10.9%       2 of 10
  F1                                  26.8%                     26.7%                     15.7%
Delay until a live listener knows     0.96 s, 90 %: 0.96 s      0.47 s
AUC of runs, mean over domains        100.0%                                              50.0%
pAUC (FPR up to 10 %)                 100.0%                                              50.0%
Score of DCASE task 2 (harmonic mean) 100.0%                                              50.0%
Runs without a verdict                16.7%                                                           1 of 6

not answered: 1 run (rate 50 Hz < 80 Hz) of a1

The worst 2 of robot and scenario, by injected faults found
  go2 blow                            0.0%                      0 of 6 injected, 0 of 6 detectable
  talos blow                          33.3%                     1 of 3 injected, 1 of 2 detectable
The worst 1 of robot and domain, by alarms per hour of ok time
  talos stiff                         800 per hour              2 in 0.0025 h
The worst 1 of robot and domain, by alarms per hour of unlabelled time
  talos soft                          4337 per hour             1 in 0.000231 h

By robot                             runs     ok h  false/h  ok flagged  unlab./h    found  detectable  F1 class    delay
a1                                    0+1        0        -           -         -        -           -         -        -
go2                                     2 0.000944        0       17.6%         0    14.3%       14.3%      0.0%   1.45 s
talos                                   3  0.00361      554        7.7%      2169    33.3%       50.0%     28.6%   0.47 s
(+n: runs without a verdict)

By domain                            runs     ok h  false/h  ok flagged  unlab./h    found  detectable  F1 class    delay      AUC     pAUC
field                                 0+1        0        -           -         -        -           -         -        -        -        -
soft                                    3  0.00206        0        8.1%       822    11.1%       12.5%      0.0%   1.45 s        -        -
stiff                                   2   0.0025      800       11.1%         0   100.0%      100.0%     50.0%   0.47 s   100.0%   100.0%
(+n: runs without a verdict)

Missed, of the detectable faults
  impact in talos/blow-001, 2.03 s to 2.20 s
  impact in go2/blow-003, 0.10 s to 0.20 s
  impact in go2/blow-003, 0.60 s to 0.70 s
  impact in go2/blow-003, 1.10 s to 1.20 s
  impact in go2/blow-003, 1.60 s to 1.70 s
  and 2 more
False alarms
  impact in talos/good-000, 0.35 s to 0.75 s
  unknown in talos/good-000, 3.00 s to 3.60 s

Frames that are cut from annotated blocks, as the paper does
                        recall                     precision                      frames    blocks      runs
ok                      87.5%                      87.5%                               8         8         5
impact                  75.0%                      85.7%                               8         8         3
highaccelerations       -                          0.0%                                0         0         0
oscillations            0.0%                       0.0%                                1         1         1
Balanced accuracy       54.2%
Failure recall          88.9%
False alarm rate        12.5%
Calibration error       17.1% in ten bins

As the paper measures, in shares of ALL frames
                        false negative errors      false positive errors
ok                      5.9%                       5.9%
impact                  11.8%                      5.9%
highaccelerations       0.0%                       5.9%
oscillations            5.9%                       5.9%
Failure detection rate  94.1%                      (calling all frames ok: 47.1%)
Subset accuracy         76.5%

Frames of row predicted                  ok             impact  highaccelerations       oscillations
ok                                        7                  1                  0                  0
impact                                    1                  6                  0                  1
highaccelerations                         0                  0                  0                  0
oscillations                              0                  0                  1                  0

Brackets are 95 % confidence intervals over groups of runs.
Measures of fewer than 5 groups have none.
"""  # noqa: E501
BY_SCENARIO = """\
By scenario                          runs     ok h  false/h  ok flagged  unlab./h    found  detectable  F1 class    delay
blow                                    3   0.0025        0        0.0%       711    11.1%       12.5%     18.2%   0.47 s
good                                    1  0.00139     1440       20.0%         -        -           -      0.0%        -
swing                                   1 0.000667        0       25.0%         0   100.0%      100.0%      0.0%   1.45 s
unnamed                               0+1        0        -           -         -        -           -         -        -
(+n: runs without a verdict)"""  # noqa: E501
