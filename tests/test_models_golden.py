"""NoisyTest 0.0.1, decision by decision: its own outputs on the stand-in data are the reference."""

import numpy as np
import pytest

import noiseclassifier as nc
from noiseclassifier.dataset import cut_frames

SETS = ("training", "validation", "validation_reduced_joints")
COUNTS = {"training": [208, 22, 14, 47], "validation": [129, 11, 12, 39]}


@pytest.fixture(scope="module")
def recordings(lola):
    return {name: list(nc.noisytest.read_folder(lola / name)) for name in SETS}


@pytest.fixture(scope="module", params=["rbf", "linear"])
def trial(request, recordings, golden):
    """A kernel's profile, data sets and classifier, with NoisyTest's arrays and results."""
    arrays, results = golden
    kernel = request.param
    profile = nc.Profile.noisytest(kernel)
    sets = {
        name: nc.Dataset.of(recordings[name], profile, training=name == "training") for name in SETS
    }
    classifier = nc.Classifier.train(sets["training"], profile)
    mine = {
        name.removeprefix(f"{kernel}_"): array
        for name, array in arrays.items()
        if not name.startswith({"rbf": "linear", "linear": "rbf"}[kernel])
    }
    return profile, sets, classifier, mine, results[kernel]


def classes(indices):
    return np.array(nc.CLASSES)[indices]


@pytest.mark.parametrize("name", ["training", "validation"])
def test_frames_are_noisytests_to_the_bit(trial, name, recordings):
    profile, sets, _, theirs, _ = trial
    labels = sets[name].labels
    assert [int((labels == each).sum()) for each in nc.CLASSES] == COUNTS[name]
    assert np.array_equal(labels, classes(theirs[f"{name}_target"]))
    training = name == "training"
    cut = (cut_frames(each, profile, training=training) for each in recordings[name])
    frames = np.concatenate([frames for each in cut for _, frames in each])
    assert frames.dtype == np.float32
    assert np.array_equal(frames[theirs[f"{name}_idx"]], theirs[f"{name}_frames"])
    # In 32 bits, a quiet bin under a line of 1e3 is off by up to 4.4e-3; ours are exact here.
    features = nc.features(theirs[f"{name}_frames"], profile)
    assert np.abs(features - theirs[f"{name}_flat"]).max() < 4.5e-3


@pytest.mark.parametrize("name", SETS)
def test_every_decision_is_noisytests(trial, name):
    _, sets, classifier, theirs, _ = trial
    decisions = classifier.decide(sets[name].features)
    # libsvm stops at 1e-3, so that its result depends on the last bits of its input.
    assert np.abs(decisions - theirs[f"{name}_dec_ovo"]).max() < 2.2e-3
    if name == "validation":
        scores = classifier.estimator.score(decisions)
        assert np.abs(scores - theirs[f"{name}_dec_ovr"]).max() < 2.2e-3


def test_every_label_of_a_run_is_noisytests(trial, lola):
    _, _, classifier, _, results = trial
    for name, run in results["run"].items():
        time, noise = nc.read_log(lola / name.removeprefix("data/"))
        labels = classifier.classify(noise, nc.nominal_rate(time), start=float(time[0]))
        assert labels.label.tolist() == classes(run["pred"]).tolist()
        warnings = [
            f"WARNING:possible {label} in time region {start:.2}-{stop:.2}"
            for start, stop, label in zip(labels.start, labels.stop, labels.label, strict=True)
            if label != "ok"
        ]
        assert warnings == run["warnings"]


@pytest.mark.parametrize("name", SETS)
def test_every_measure_is_noisytests(trial, name):
    _, sets, classifier, _, results = trial
    report, theirs = classifier.evaluate(sets[name]), results[name]
    assert report.confusion.tolist() == theirs["confusion_rows_true"]
    measures = report.as_dict()
    assert measures["false_negative_errors"] == pytest.approx(theirs["FN"])
    assert measures["false_positive_errors"] == pytest.approx(theirs["FP"])
    for ours, other in (
        ("subset_accuracy", "subset_accuracy"),
        ("failure_detection_rate", "failure_detection_rate"),
        ("failure_recall", "true_failure_recall"),
        ("false_alarm_rate", "false_alarm_rate"),
        ("balanced_accuracy", "balanced_accuracy"),
    ):
        assert measures[ours] == pytest.approx(theirs[other])


def test_our_own_profile_beats_both_on_the_same_data(recordings):
    def balanced(profile):
        training, validation = (
            nc.Dataset.of(recordings[name], profile, training=name == "training")
            for name in ("training", "validation")
        )
        classifier = nc.Classifier.train(training, profile)
        return classifier.evaluate(validation).measures["balanced_accuracy"]

    ours = balanced(nc.LogBands().at(10_000.0))
    assert ours > 0.9
    for theirs in (nc.Profile.noisytest(), nc.Profile.paper(), nc.Profile.paper("linear")):
        assert ours > balanced(theirs)
