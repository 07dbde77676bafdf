"""Networks and trees give probabilities of classes, and mark frames that are out of distribution.

Both classify norms, and trees also joints.
"""

from dataclasses import replace

import numpy as np
import pytest

import noiseclassifier as nc
from noiseclassifier.dataset import Examples
from noiseclassifier.estimators import ESTIMATORS
from noiseclassifier.estimators.decision import calibrate, calibrated

RATE = 1000.0
PROFILE = nc.GENERAL.at(RATE)
PROFILES = {
    "networks": replace(PROFILE, estimator="networks", units=16, epochs=40),
    "trees": replace(PROFILE, estimator="trees", rounds=30, leaves=8),
    "joints": replace(nc.EACH.at(RATE), rounds=30, leaves=8),
}
JOINTS = 3
SECONDS = 6


def recording(robot, seed, label):
    """Measured, desired and error of a motion that hums; a failure rattles what is measured."""
    generator = np.random.default_rng([seed, len(label)])
    time = np.arange(round(SECONDS * RATE)) / RATE
    desired = 1.0 + 0.5 * np.sin(2 * np.pi * 0.7 * time) + 0.01 * generator.normal(size=len(time))
    rattle = {"ok": 0.0, "impact": 0.3, "oscillations": 0.3}[label]
    shape = np.sin(2 * np.pi * 90 * time)
    if label == "impact":
        shape = np.exp(-np.mod(time, 0.4) / 0.02) * generator.normal(size=len(time))
    error = rattle * shape + 0.01 * generator.normal(size=len(time))
    signals = {"desired": desired, "measured": desired + error, "error": np.abs(error)}
    mine = np.array([0.9, 0.1, 0.05])[:, None]
    signals |= {
        "desired_joints": mine * desired,
        "measured_joints": mine * (desired + error),
        "error_joints": mine * error,
    }
    blocks = (nc.Block(0.5, SECONDS - 0.5, label),)
    return nc.Recording(f"{robot}/{label}-{seed:03d}", signals, RATE, blocks)


def alike(signal):
    """The same for all norms and joints."""
    names = (*nc.EACH.signals[:3],), (*nc.EACH.signals[3:],)
    return dict.fromkeys(names[0], signal) | dict.fromkeys(names[1], np.tile(signal, (JOINTS, 1)))


RECORDINGS = [
    recording("panda", seed, label)
    for seed in range(6)
    for label in ("ok", "impact", "oscillations")
]


def fit(features, targets, groups, profile):
    return ESTIMATORS[profile.estimator].fit(features, targets, groups, profile)


@pytest.fixture(scope="module", params=PROFILES)
def classifier(request):
    profile = PROFILES[request.param]
    return nc.Classifier.train(Examples.read(RECORDINGS[:12], profile), profile)


def test_classes_are_found_in_other_runs(classifier):
    for each in RECORDINGS[12:]:
        labels = classifier.classify(each.signal, RATE)
        inside = (labels.start >= 0.5) & (labels.stop <= SECONDS - 0.5)
        assert (labels.label[inside] == each.blocks[0].label).mean() > 0.9


def test_a_single_frame_has_the_decision_values_that_it_has_among_others(classifier):
    features = np.random.default_rng(5).normal(size=(70, len(classifier.mean)))
    together = classifier.decide(features)
    alone = np.concatenate([classifier.decide(row[None]) for row in features])
    np.testing.assert_allclose(alone, together, rtol=1e-5)


@pytest.mark.parametrize("classes", [2, 3])
@pytest.mark.parametrize("estimator", PROFILES)
def test_a_class_without_frames_is_never_predicted(estimator, classes):
    generator = np.random.default_rng(1)
    features = generator.normal(size=(200, 4))
    there = [0, classes]
    targets = np.where(features[:, 0] > 0, there[1], there[0])
    long = replace(PROFILES[estimator], epochs=300, decay=0.0)
    learnt = fit(features, targets, np.array(["one"] * 200), long)
    scores = learnt.score(learnt.decision(features))
    assert scores.shape == (200, classes + 1)
    assert scores[:, 1:classes].max() < 1e-6
    assert (scores.argmax(axis=1) == targets).mean() > 0.95


@pytest.mark.parametrize("estimator", PROFILES)
def test_a_class_of_one_group_alone_leaves_other_probabilities_as_they_are(estimator):
    generator = np.random.default_rng(0)
    features = generator.normal(size=(1200, 6))
    groups = np.array([f"g{number % 6}" for number in range(1200)])
    targets = (features[:, 0] > 1.0).astype(int)
    rare = np.where((groups == "g5") & (features[:, 0] > 1.5), 2, targets)
    above_threshold = []
    for truth in (targets, rare):
        learnt = fit(features, truth, groups, PROFILES[estimator])
        good = learnt.score(learnt.decision(features))[:, 0]
        above_threshold.append([good[truth == 0].mean(), good[truth > 0].mean()])
    np.testing.assert_allclose(above_threshold[1], above_threshold[0], atol=0.05)
    assert learnt.calibration[3] == 0.0


@pytest.mark.parametrize("estimator", PROFILES)
def test_groups_of_one_class_each_cannot_calibrate(estimator):
    features = np.repeat([[0.0], [1.0]], 60, axis=0)
    targets = np.repeat([0, 1], 60)
    groups = np.repeat(["good", "bad"], 60)
    learnt = fit(features, targets, groups, PROFILES[estimator])
    np.testing.assert_array_equal(learnt.calibration, [1.0, 0.0, 0.0])


def test_calibration_finds_the_scale_of_overconfident_logits():
    generator = np.random.default_rng(2)
    true = generator.normal(size=(20_000, 3)) * 1.5
    log_true = true - np.log(np.exp(true).sum(axis=1, keepdims=True))
    drawn = np.array([generator.choice(3, p=np.exp(row)) for row in log_true])
    calibration = calibrate(2.5 * log_true, drawn)
    assert calibration[0] == pytest.approx(1 / 2.5, rel=0.05)
    np.testing.assert_allclose(calibrated(2.5 * log_true, calibration), log_true, atol=0.2)


def test_of_two_failures_the_one_that_exceeds_its_frequency_more_is_named(classifier):
    shares = {"impact": 0.1, "oscillations": 0.4}
    estimator = replace(classifier.estimator, frequency=np.array([0.5, *shares.values()]))
    probabilities = np.log([[0.2, 0.35, 0.45], [0.2, 0.05, 0.75], [0.9, 0.09, 0.01]])
    decisions = np.hstack((probabilities, np.zeros((3, 1))))
    named = [classifier.classes[index] for index in estimator.choose(decisions)]
    assert named == ["impact", "oscillations", "ok"]


def test_a_frame_louder_than_all_of_the_training_set_is_unknown(classifier):
    loud = 1e6 * np.random.default_rng(4).random(round(2 * RATE))
    labels = classifier.classify(alike(loud), RATE)
    assert set(labels.label) == {"unknown"}
    assert [(event.label, event.novel) for event in labels.events()] == [("unknown", True)]
    assert replace(labels, unknown_is_finding=False).events() == ()


def test_a_stream_of_other_joints_is_refused():
    classifier = nc.Classifier.train(
        Examples.read(RECORDINGS[:12], PROFILES["joints"]), PROFILES["joints"]
    )
    with pytest.raises(nc.SignalError, match="12 rows of norms and joints, expected 15"):
        nc.Stream(classifier, joints=4).push(RECORDINGS[0].signal)
