import numpy as np
import pytest

import noiseclassifier as nc
from noiseclassifier.measures import Evaluation

TRUTH = np.array(["ok"] * 6 + ["impact"] * 2 + ["oscillations"] * 2)
CLASSES = ("ok", "impact", "oscillations")


def evaluation(*labels):
    return Evaluation.of(TRUTH, np.array(labels), CLASSES)


PERFECT = evaluation(*TRUTH)
ALL_OK = evaluation(*["ok"] * 10)
MIXED = evaluation(*["ok"] * 5, "impact", "impact", "ok", "oscillations", "impact")


def test_a_perfect_classifier_scores_one():
    for name, value in PERFECT.measures.items():
        errors = name.endswith("errors") or name == "false_alarm_rate"
        assert np.all(value == (0.0 if errors else 1.0)), name


def test_predicting_ok_everywhere_shows_why_the_papers_measures_mislead():
    found = ALL_OK.measures
    assert found["subset_accuracy"] == found["failure_detection_rate"] == 0.6
    assert found["failure_recall"] == found["false_alarm_rate"] == 0.0
    assert found["balanced_accuracy"] == pytest.approx(1 / 3)


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
