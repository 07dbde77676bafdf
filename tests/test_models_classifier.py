from dataclasses import replace

import numpy as np
import pytest

import noiseclassifier as nc
from noiseclassifier import classifier as classifier_module

RATE = 1000.0
RANDOM = np.random.default_rng(11)


def noise(seconds, hum=0.0):
    """A walk with a hum of 120 Hz where something oscillates."""
    time = np.arange(round(seconds * RATE)) / RATE
    gait = 1.0 + 0.3 * np.sin(2 * np.pi * 1.2 * time)
    return gait + 0.01 * RANDOM.standard_normal(len(time)) + hum * np.sin(240 * np.pi * time)


def knocks(seconds):
    """A walk with three blows a second."""
    signal = noise(seconds)
    for first in range(100, len(signal) - 40, 333):
        signal[first : first + 40] += RANDOM.standard_normal(40) * np.exp(-np.arange(40) / 10)
    return signal


def recordings():
    made = {"ok": noise(6.0), "impact": knocks(4.0), "oscillations": noise(4.0, hum=0.2)}
    for label, signal in made.items():
        block = nc.Block(0.0, float("inf"), label)
        yield nc.Recording(label, signal, RATE, (block,))


DATA = list(recordings())
OURS = nc.LogBands().at(RATE)
PAPER = replace(nc.Profile.paper(), rate=RATE, length=400, hop=100, window=256, stride=48)


def trained(profile):
    return nc.Classifier.train(nc.Dataset.of(DATA, profile), profile)


@pytest.fixture(scope="module")
def ours():
    return trained(OURS)


def test_the_training_set_is_classified_right(ours):
    report = ours.evaluate(nc.Dataset.of(DATA, OURS))
    assert report.measures["subset_accuracy"] == 1.0
    assert ours.metrics["training"] == report.as_dict()
    assert not trained(PAPER).mean.any()
    assert ours.classes == ("ok", "impact", "oscillations")
    assert ours.rate == RATE
    assert dict(ours.runs) == {each.name: each.sha256 for each in DATA}


def test_features_that_hardly_change_are_not_amplified():
    features = nc.Dataset.of(DATA, OURS).features
    scale = trained(replace(OURS, least_deviation=1.0)).scale
    changing = features.std(axis=0) > 1.0
    assert 0 < changing.sum() < len(scale)
    np.testing.assert_allclose(scale[changing], features.std(axis=0)[changing])
    assert (scale[~changing] == 1.0).all()


@pytest.mark.parametrize("profile", [OURS, PAPER], ids=["ours", "paper"])
def test_scores_are_largest_for_what_is_predicted(profile):
    classifier = trained(profile)
    features = nc.Dataset.of(DATA, profile).features
    decisions = classifier.decide(features)
    scores = classifier.estimator.score(decisions)
    assert scores.shape == decisions.shape == (len(features), 3)
    best = np.array(classifier.classes)[scores.argmax(axis=1)]
    assert np.array_equal(best, classifier.predict(features))


def test_a_hum_in_a_walk_is_found_when_it_hums(ours):
    signal = noise(8.0)
    signal[3000:5000] += 0.2 * np.sin(240 * np.pi * np.arange(2000) / RATE)
    (event,) = ours.classify(signal, RATE, start=100.0).events()
    assert event.label == "oscillations"
    assert event.start == pytest.approx(103.0, abs=0.4)
    assert event.stop == pytest.approx(105.0, abs=0.4)
    assert event.score > 1.5
    assert str(event).startswith("oscillations from 10")


def test_a_walk_without_failures_is_ok_from_end_to_end(ours):
    labels = ours.classify(noise(3.0), RATE)
    assert labels.events() == ()
    assert set(labels.label) == {"ok"}
    assert str(labels) == "no findings\nin 27 frames"


def test_frames_have_their_times_and_leave_no_tail(ours):
    labels = ours.classify(noise(1.05), RATE, start=10.0)
    np.testing.assert_allclose(
        labels.start, 10.0 + np.array([0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.65])
    )
    np.testing.assert_allclose(labels.stop - labels.start, 0.4)
    assert labels.scores.shape == (len(labels), 3)


def test_noisytests_profile_loses_the_first_sample_and_the_tail():
    labels = trained(replace(PAPER, bands="comb")).classify(noise(1.05), RATE)
    np.testing.assert_allclose(labels.start, 0.001 + 0.1 * np.arange(7))


def test_labels_do_not_depend_on_chunks(ours, monkeypatch):
    signal = np.concatenate([noise(4.0, hum=0.2), knocks(6.0), noise(5.0)])
    whole = ours.classify(signal, RATE)
    monkeypatch.setattr(classifier_module, "CHUNK", 7)
    chunked = ours.classify(signal, RATE)
    assert len(whole) > classifier_module.CHUNK
    assert np.array_equal(whole.label, chunked.label)
    np.testing.assert_allclose(whole.scores, chunked.scores, atol=1e-9)


def test_labels_are_those_of_the_frames_alone(ours):
    signal = np.concatenate([knocks(2.0), noise(2.0)])
    frames = nc.frame(signal, length=400, hop=100)
    labels = ours.classify(signal, RATE)
    assert np.array_equal(labels.label, ours.predict(nc.features(frames, OURS)))
    pieces = ours.classify_pieces([(signal[:1500], None), (signal[1500:], None)], RATE)
    assert np.array_equal(pieces.label, labels.label)
    assert pieces.start[0] == labels.start[0] == 0.0


def test_frames_that_touch_a_gap_are_not_classified(ours):
    signal, valid = noise(3.0, hum=0.2), np.ones(3000, bool)
    signal[1000:1200], valid[1000:1200] = 0.0, False
    labels = ours.classify(signal, RATE, valid=valid)
    assert not ((labels.start < 1.2 - 1e-9) & (labels.stop > 1.0 + 1e-9)).any()
    before, after = labels.events()
    assert before.stop == pytest.approx(1.0)
    assert after.start == pytest.approx(1.2)


def test_all_gaps_are_no_labels(ours):
    labels = ours.classify(np.zeros(1000), RATE, valid=np.zeros(1000, bool))
    assert len(labels) == 0
    assert labels.scores.shape == (0, 3)
    assert labels.events() == ()


@pytest.mark.parametrize(
    ("signal", "reason"),
    [
        (np.zeros(399), "signal of 399 samples is too short: a frame takes 400"),
        (np.zeros((400, 2)), r"noise \(400, 2\), expected \(samples,\)"),
        (np.where(np.arange(500) == 9, np.nan, 1.0), r"sample 9 of the signal is not finite \(nan"),
    ],
)
def test_signals_that_cannot_be_classified_are_refused(ours, signal, reason):
    with pytest.raises(nc.SignalError, match=reason):
        ours.classify(signal, RATE)
    with pytest.raises(nc.SignalError, match=r"validity of shape \(3,\)"):
        ours.classify(np.zeros(500), RATE, valid=np.ones(3, bool))


@pytest.mark.parametrize("rate", [970.0, 10_000.0, 0.0, float("nan")])
def test_a_signal_of_another_rate_is_refused(ours, rate):
    with pytest.raises(nc.RateError, match="rates are 1000 Hz: lower the signal's rate"):
        ours.classify(np.zeros(500), rate)


def test_one_class_is_not_enough_to_learn_and_two_are_without_ok():
    alone, failures = nc.Dataset.of(DATA[:1], OURS), nc.Dataset.of(DATA[1:], OURS)
    with pytest.raises(nc.DatasetError, match="two classes or more of .*; the frames are ok"):
        nc.Classifier.train(alone, OURS)
    classifier = nc.Classifier.train(failures, OURS, validation=failures)
    assert classifier.classes == ("impact", "oscillations")
    assert classifier.classify(noise(1.0, hum=0.2), RATE).events()[0].label == "oscillations"
    assert classifier.metrics["validation"] == classifier.metrics["training"]


def test_the_nearest_model_is_the_one_below(ours):
    fast = replace(ours, profile=nc.LogBands().at(10_000.0))
    library = {"fast": fast, "ours": ours}
    assert nc.nearest(library, 10_000.0) == ("fast", fast)
    assert nc.nearest(library, 9_995.0) == ("fast", fast)  # within 0.1 %
    assert nc.nearest(library, 9_000.0) == ("ours", ours)
    assert nc.nearest(library, 48_000.0) == ("fast", fast)
    with pytest.raises(nc.RateError, match="logged at 500 Hz, the model needs 1000 Hz or more"):
        nc.nearest(library, 500.0)
    with pytest.raises(nc.RateError, match="the models' rates are none Hz"):
        nc.nearest({}, 500.0)
