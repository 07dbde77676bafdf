"""Networks say how probable each class is, and know what they do not know."""

from dataclasses import replace

import numpy as np
import pytest

import models
from models.examples import Examples
from models.networktraining import fit_networks

RATE = 1000.0
PROFILE = replace(models.GENERAL.at(RATE), machine="networks", units=16, epochs=40)
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
    blocks = (models.Block(0.5, SECONDS - 0.5, label),)
    return models.Recording(f"{robot}/{label}-{seed:03d}", signals, RATE, blocks)


RECORDINGS = [
    recording("panda", seed, label)
    for seed in range(6)
    for label in ("ok", "impact", "oscillations")
]


@pytest.fixture(scope="module")
def classifier():
    return models.Classifier.train(Examples.read(RECORDINGS[:12], PROFILE), PROFILE)


def test_what_networks_have_learnt_they_hear_in_other_runs(classifier):
    for each in RECORDINGS[12:]:
        labels = classifier.classify(each.signal, RATE)
        inside = (labels.start >= 0.5) & (labels.stop <= SECONDS - 0.5)
        assert (labels.label[inside] == each.blocks[0].label).mean() > 0.9


def test_scores_are_probabilities(classifier):
    scores = classifier.classify(RECORDINGS[13].signal, RATE).scores
    assert (scores >= 0).all()
    np.testing.assert_allclose(scores.sum(axis=1), 1.0, rtol=1e-12)


@pytest.mark.filterwarnings("ignore:Stochastic Optimizer")
def test_networks_answer_as_scikit_learns_do():
    from sklearn.neural_network import MLPClassifier

    generator = np.random.default_rng(0)
    features = generator.normal(size=(300, 5))
    targets = (features[:, 0] > 0).astype(int) + (features[:, 1] > 0.5)
    alone = replace(PROFILE, networks=1, decay=0.0)
    groups = np.array(["one"] * 300)
    ours = fit_networks(features, targets, groups, alone)
    counts = np.bincount(targets)
    theirs = MLPClassifier(
        (16,), alpha=0.0, batch_size=256, learning_rate_init=2e-3, max_iter=40,
        n_iter_no_change=99, random_state=0,
    ).fit(features, targets, np.sqrt(counts.max() / counts)[targets])  # fmt: skip
    known = np.clip(features, *ours.known)
    np.testing.assert_allclose(
        ours.score(ours.decision(known)), theirs.predict_proba(known), atol=1e-6
    )


@pytest.mark.parametrize("classes", [2, 3])
def test_a_class_that_is_not_there_is_never_heard(classes):
    generator = np.random.default_rng(1)
    features = generator.normal(size=(200, 4))
    there = [0, classes]
    targets = np.where(features[:, 0] > 0, there[1], there[0])
    patient = replace(PROFILE, epochs=300, decay=0.0)
    networks = fit_networks(features, targets, np.array(["one"] * 200), patient)
    scores = networks.score(networks.decision(features))
    assert scores.shape == (200, classes + 1)
    assert scores[:, 1:classes].max() < 1e-6
    assert (scores.argmax(axis=1) == targets).mean() > 0.95


def test_networks_know_how_frequent_each_class_was(classifier):
    examples = Examples.read(RECORDINGS[:12], PROFILE)
    shares = [(examples.labels == name).mean() for name in classifier.classes]
    np.testing.assert_allclose(classifier.machines.frequency, shares)


def test_what_is_louder_than_all_that_was_learnt_is_unknown(classifier):
    loud = 1e6 * np.random.default_rng(4).random(round(2 * RATE))
    labels = classifier.classify(dict.fromkeys(PROFILE.signals, loud), RATE)
    assert set(labels.label) == {"unknown"}
    assert labels.events() == ()


@pytest.mark.parametrize("level", [0.0, 0.3])
def test_silence_and_uniform_motion_are_no_failure(classifier, level):
    steady = np.full(round(2 * RATE), level)
    labels = classifier.classify(dict.fromkeys(PROFILE.signals, steady), RATE)
    assert set(labels.label) == {"ok"}


def test_what_was_learnt_is_known(classifier):
    labels = np.concatenate([classifier.classify(r.signal, RATE).label for r in RECORDINGS[12:]])
    assert "unknown" not in labels


@pytest.mark.parametrize("chunk", [1, 37, 400, 999, 5000])
def test_a_stream_hears_the_same(classifier, chunk):
    each = RECORDINGS[14]
    batch = classifier.classify(each.signal, RATE)
    stream, found = models.Stream(classifier), []
    for first in range(0, each.samples, chunk):
        piece = slice(first, first + chunk)
        found.append(stream.push({name: signal[piece] for name, signal in each.signal.items()}))
    found.append(stream.finish())
    together = {
        name: np.concatenate([getattr(part, name) for part in found])
        for name in ("start", "stop", "label", "scores")
    }
    for name in ("start", "stop", "label"):
        np.testing.assert_array_equal(together[name], getattr(batch, name))
    np.testing.assert_allclose(together["scores"], batch.scores, atol=1e-12)


def test_training_twice_gives_the_same_bytes_and_they_are_read_back(classifier, tmp_path):
    again = models.Classifier.train(Examples.read(RECORDINGS[:12], PROFILE), PROFILE)
    for name, each in (("a", classifier), ("b", again)):
        each.save(tmp_path / f"{name}.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    read = models.Classifier.load(tmp_path / "a.npz")
    signal = RECORDINGS[13].signal
    np.testing.assert_array_equal(
        read.classify(signal, RATE).scores, classifier.classify(signal, RATE).scores
    )
    assert read.profile == PROFILE
