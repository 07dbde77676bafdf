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
from noiseclassifier.matching import Unanswered
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
    runs = fresh()
    found = nc.assess(classifier, iter(runs))
    assert (found.runs, found.groups) == (12, 6)
    assert found.protocol.pooled["class_recall"].value == 1.0
    assert found.protocol.counts["false_alarms"] == 0
    assert found.protocol.counts["ok_hours"] == pytest.approx(6 * (4.0 + 1.95) / 3600)
    assert found.evaluation.measures["balanced_accuracy"] > 0.95
    whole = classifier.evaluate(nc.Dataset.of(runs, PROFILE, training=False))
    assert found.evaluation.confusion.tolist() == whole.confusion.tolist()
    plain = found.as_dict()
    assert json.loads(json.dumps(plain, allow_nan=False)) == plain
    assert plain["format"] == "noise-evaluation/3"
    assert plain["protocol"]["pooled"]["false_alarms_per_hour"]["value"] == 0.0
    assert plain["frames"] == whole.as_dict()


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
    message = "none of 1 recordings has a verdict; panda/swing-010: .* too short"
    with pytest.raises(nc.DatasetError, match=message):
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
    assert "not answered: 1 run (rate 200 Hz < 1000 Hz) of 1 robot (ur5)" in text
    assert "is too short: a frame takes 400) of 1 robot (panda)" in text
    with pytest.raises(nc.DatasetError, match="two recordings are called 'slow'"):
        nc.assess(classifier, [slow, slow])


def test_a_run_whose_blocks_lie_in_gaps_is_classified_from_end_to_end(classifier):
    valid = np.ones(4000, dtype=bool)
    valid[1000:3000:100] = False
    gappy = replace(fresh()[0], valid=valid, blocks=(nc.Block(1.2, 2.8, "oscillations"),))
    found, alone = (nc.assess(classifier, runs) for runs in ([gappy, *fresh()[1:]], fresh()[1:]))
    assert found.runs == 12
    assert found.evaluation.frames == alone.evaluation.frames


def test_lines_are_short_and_lists_too():
    text = str(measure(many(40, ["ok"] * 47)))
    assert max(map(len, text.splitlines())) <= 120
    assert "and 75 more" in text
    assert ["have none" in str(measure(many(groups))) for groups in (4, 5)] == [True, False]


def sure(name, annotated, labels, confidence, findings, domain, *, cut=None):
    """A recording of a model with such a confidence, and with these findings."""
    scores = np.full((len(labels), 4), (1.0 - confidence) / 3)
    scores[np.arange(len(labels)), [CLASSES.index(each) for each in labels]] = confidence
    words = [each.split() for each in findings.split(";") if each]
    spans = tuple(Event(label, *map(float, numbers)) for label, *numbers in words)
    one = predicted(name, annotated, labels, scores=scores, cut=cut)
    facts = {"domain": domain, "scenario": name.split("/")[1].split("-")[0]}
    return replace(one, facts=facts, located=(spans, spans))


def of_two_robots():
    """Four groups, so that shares have no interval; each kind of mistake in other numbers."""
    calm = ["ok"] * len(frames())
    false = ["impact" if n in (3, 4, 30, 31, 32) else "ok" for n in range(len(calm))]
    late = ["highaccelerations" if 20 < n < 40 else "ok" for n in range(len(calm))]
    series = blocks(*((0.5 * n + 0.1, 0.5 * n + 0.2, "impact") for n in range(6)), (3.5, 4.5, "ok"))
    faults = (Fault(2.03, 2.2, "impact"), Fault(4.0, 4.1, "impact", felt=False))
    stiff, soft = "stiff", "soft"
    rows = [
        ("talos/good-000", GOOD, false, 0.85, "impact 0.35 0.75 0.9; unknown 3.0 3.6 0.4", stiff),
        ("talos/blow-000", IMPACT, perfect(IMPACT), 0.95, "impact 2.01 2.2 0.9", stiff),
        ("talos/blow-001", IMPACT, calm, 0.75, "impact 2.6 2.7 0.9", soft),
        ("go2/swing-002", OSCILLATION, late, 0.65, "highaccelerations 2.1 4.2 0.9", soft),
        ("go2/blow-003", series, calm, 0.55, "", soft),
    ]
    cuts = {
        "talos/good-000": ["impact"],
        "go2/swing-002": ["ok", "highaccelerations", "ok"],
        "go2/blow-003": ["ok", *["impact"] * 4, "oscillations", "ok"],
    }
    runs = [sure(*row, cut=cuts.get(row[0])) for row in rows]
    runs[2] = replace(runs[2], events=faults)
    slow = Unanswered("a1/slow-000", {"robot": "a1", "domain": "field"}, "rate 50 Hz < 80 Hz")
    return measure(
        runs,
        unanswered=[slow],
        copies={"go2/blow-009": "go2/blow-003"},
        known={"talos/blow-000": "a recording of this name"},
    )


def test_it_prints_a_small_assessment_whole():
    found = of_two_robots()
    assert str(found) == f"{WHOLE}{found.evaluation}\n\n{FOOT}"


def test_the_table_of_one_key_takes_the_place_of_the_others():
    found = of_two_robots()
    paragraphs, others = (table(found, by).split("\n\n") for by in ("scenario", ""))
    assert [each for each in paragraphs if each.startswith("By ")] == [BY_SCENARIO]
    rest = ([each for each in some if each[:3] != "By "] for some in (paragraphs, others))
    assert next(rest) == next(rest)


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
Ok time flagged                       12.7%                     9.8%
Alarms per hour of unlabelled time    1084 [27.5, 6042]         691 [17.5, 3850]                      1
Faults found, of all injected         23.8%                     20.0%                     10.9%       2 of 10
Faults found, of detectable           32.1%                     22.2%                     10.3%       2 of 9
Onset right within 0.2 s, of found    50.0%                     50.0%                     31.5%       1 of 2
Events by class, precision            12.5%                     20.0%                     2.8%        1 of 5
  recall                              16.7%                     10.0%                     3.8%        1 of 10
  F1                                  14.3%                     13.3%                     3.2%
Delay until a live listener knows     0.96 s                    0.47 s
  90 %                                0.96 s                    1.45 s
AUC of runs, mean over domains        100.0%                                              50.0%
pAUC (FPR up to 10 %)                 100.0%                                              50.0%
Runs without a verdict                16.7%                                                           1 of 6

not answered: 1 run (rate 50 Hz < 80 Hz) of 1 robot (a1)

By robot                             runs     ok h  false/h  ok flagged    found  detectable  F1 class    delay      AUC     pAUC
a1                                    0+1        0        -           -        -           -         -        -        -        -
go2                                     2 0.000944        0       17.6%    14.3%       14.3%      0.0%   1.45 s        -        -
talos                                   3  0.00361      554        7.7%    33.3%       50.0%     28.6%   0.47 s    50.0%    73.7%
(+n: runs without a verdict)

By domain                            runs     ok h  false/h  ok flagged    found  detectable  F1 class    delay      AUC     pAUC
field                                 0+1        0        -           -        -           -         -        -        -        -
soft                                    3  0.00206        0        8.1%    11.1%       12.5%      0.0%   1.45 s        -        -
stiff                                   2   0.0025      800       11.1%   100.0%      100.0%     50.0%   0.47 s   100.0%   100.0%
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

Frames that are cut from annotated blocks
"""  # noqa: E501
FOOT = """\
Brackets are 95 % confidence intervals over groups of runs.
Measures of fewer than 5 groups have none."""
BY_SCENARIO = """\
By scenario                          runs     ok h  false/h  ok flagged    found  detectable  F1 class    delay      AUC     pAUC
blow                                    3   0.0025        0        0.0%    11.1%       12.5%     18.2%   0.47 s        -        -
good                                    1  0.00139     1440       20.0%        -           -      0.0%        -        -        -
swing                                   1 0.000667        0       25.0%   100.0%      100.0%      0.0%   1.45 s        -        -
unnamed                               0+1        0        -           -        -           -         -        -        -        -
(+n: runs without a verdict)"""  # noqa: E501
