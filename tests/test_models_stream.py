import pickle
import sys
from dataclasses import replace
from functools import cache
from itertools import cycle, pairwise
from pathlib import Path

import numpy as np
import pytest
from checks import holds
from commandline import python
from generalmodel import relative
from hypothesis import given, settings
from hypothesis import strategies as st

import noiseclassifier as nc
from noiseclassifier.features import FrameFeatures, frame_features
from noiseclassifier.profile import INPUTS
from noiseclassifier.signals import BY_JOINT, JOINTS, MOTION, stacked

module = sys.modules["noiseclassifier.features"]
RATE = 1000.0
OURS = nc.LogBands().at(RATE)
PROFILES = {
    "ours": OURS,
    # Windows of different frames never coincide, and some frames share none.
    "noisytest": replace(
        nc.Profile.noisytest(), rate=RATE, length=400, hop=100, window=64, stride=71
    ),
    "paper": replace(nc.Profile.paper(), rate=RATE, length=400, hop=100, window=64, stride=48),
    "frames apart": replace(OURS, hop=650, stride=37),
    "two windows": replace(relative(), estimator="svm"),
}
CORES = {name: (profile, 1) for name, profile in PROFILES.items()} | {
    "norms": (relative(MOTION), 1),
    "one joint": (relative((*MOTION, *JOINTS)), 1),
    "twelve joints": (relative((*MOTION, *JOINTS)), 12),
    # Its short windows have a single band.
    "low rate": (relative((*MOTION, *JOINTS), 250.0), 12),
}


def noise(samples, seed=0):
    """A walk that hums in its second half and knocks once."""
    time, random = np.arange(samples) / RATE, np.random.default_rng(seed)
    signal = 1.0 + 0.3 * np.sin(7.0 * time) + 0.01 * random.standard_normal(samples)
    signal[samples // 2 :] += 0.2 * np.sin(240 * np.pi * time[samples // 2 :])
    signal[samples // 4 : samples // 4 + 9] += 1.0
    return signal


@cache
def classifier(name):
    """A classifier that is trained to find a hum."""
    blocks = [(0.0, 1.9, "ok"), (2.1, 4.0, "oscillations")]
    blocks = tuple(nc.Block(start, stop, label) for start, stop, label in blocks)
    recording = nc.Recording("walk", noise(4000, seed=1), RATE, blocks)
    profile = PROFILES[name]
    return nc.Classifier.train(nc.Dataset.of([recording], profile), profile)


def streamed(stream, signal, cuts, valid=None):
    """Push a signal in pieces, and finish it."""
    edges = [0, *sorted(cuts), len(signal)]
    pieces = [slice(a, b) for a, b in pairwise(edges)]
    parts = []
    for piece in pieces:
        if valid is not None and not valid[piece].any():
            stream.skip(len(signal[piece]))  # the same as a push
        else:
            parts.append(stream.push(signal[piece], None if valid is None else valid[piece]))
    return joined([*parts, stream.finish()])


def joined(parts):
    """The labels of several chunks as those of one."""
    fields = ("start", "stop", "label", "scores")
    return nc.Labels(
        *(np.concatenate([getattr(part, name) for part in parts]) for name in fields),
        parts[0].classes,
    )


def assert_equal(ours, batch):
    holds(ours, classes=batch.classes, start=batch.start, stop=batch.stop, label=batch.label)
    np.testing.assert_allclose(ours.scores, batch.scores, atol=1e-9)


@settings(max_examples=40, deadline=None)
@given(data=st.data())
@pytest.mark.parametrize("name", PROFILES)
def test_frames_that_touch_a_gap_are_left_out_as_in_the_whole_signal(name, data):
    samples = data.draw(st.integers(401, 3000))
    cuts = data.draw(st.lists(st.integers(0, samples), max_size=10))
    valid = np.ones(samples, dtype=bool)
    for first in data.draw(st.lists(st.integers(0, samples - 1), max_size=3)):
        lost = data.draw(st.integers(1, 900))
        valid[first : first + lost] = False
        cuts += data.draw(st.sampled_from(([], [first, min(first + lost, samples)])))
    signal = noise(samples) * valid
    batch = classifier(name).classify(signal, RATE, valid=valid)
    assert_equal(streamed(nc.Stream(classifier(name)), signal, cuts, valid), batch)


def cut_features(samples, profile, cuts, valid):
    """Features of the frames of a signal in pieces."""
    frames = FrameFeatures(profile, len(samples))
    pieces = [slice(a, b) for a, b in pairwise([0, *sorted(cuts), samples.shape[1]])]
    found = [frames.push(samples[:, piece], valid[piece]) for piece in pieces]
    return [np.concatenate(each) for each in zip(*found, frames.finish(), strict=True)]


@settings(max_examples=30, deadline=None)
@given(data=st.data())
@pytest.mark.parametrize("name", CORES)
def test_features_do_not_depend_on_the_chunks_bit_for_bit(name, data):
    profile, joints = CORES[name]
    count = data.draw(st.integers(profile.length + 1, 6 * profile.length))
    cuts = data.draw(st.lists(st.integers(0, count), max_size=30))
    valid = np.ones(count, dtype=bool)
    for first in data.draw(st.lists(st.integers(0, count - 1), max_size=2)):
        valid[first : first + data.draw(st.integers(1, 900))] = False
    signals = random_signals(profile, joints, count)
    whole = frame_features(signals, profile, valid)
    starts, features, _ = whole
    samples = np.atleast_2d(stacked(signals, profile.signals))
    for ours, theirs in zip(cut_features(samples, profile, cuts, valid), whole, strict=True):
        assert np.array_equal(ours, theirs)
    frames = np.array([samples[:, start : start + profile.length] for start in starts])
    if len(frames):
        alone = nc.features(frames if len(samples) > 1 else frames[:, 0], profile)
        np.testing.assert_allclose(features, alone, rtol=1e-9, atol=1e-9)


def random_signals(profile, joints, count):
    """White noise about 1, shape (samples,) or (joints, samples), by name."""
    random = np.random.default_rng(count)
    return {
        name: 1.0 + 0.1 * random.standard_normal((joints,) * (name in BY_JOINT) + (count,))
        for name in profile.signals
    }


SHIPPED = Path(__file__).parents[1] / "models" / "general.npz"


@pytest.mark.parametrize(("signals", "rate"), [*zip(INPUTS, cycle((80.0, 1000.0, 10_000.0)))])
def test_the_shipped_model_decides_the_same_whole_and_in_chunks_bit_for_bit(
    rate, signals, monkeypatch
):
    decided, original = [], nc.Classifier.decide

    def decide(self, features):
        decided.append(original(self, features))
        return decided[-1]

    monkeypatch.setattr(nc.Classifier, "decide", decide)
    model = nc.load(SHIPPED).at(rate, signals)
    hop = model.profile.hop
    count = round(3.037 * rate)
    signals, valid = random_signals(model.profile, 12, count), np.ones(count, dtype=bool)
    valid[round(1.2 * rate) : round(1.21 * rate)] = False
    whole = model.classify(signals, rate, valid=valid)
    expected = np.concatenate(decided)
    decided.clear()
    for chunk in (max(round(rate / 1000), 7), round(rate / 50), hop, 3 * hop + 1):
        stream = nc.Stream(model, joints=12)
        pieces = [slice(first, first + chunk) for first in range(0, count, chunk)]
        parts = [
            stream.push({name: each[..., piece] for name, each in signals.items()}, valid[piece])
            for piece in pieces
        ]
        labels = joined([*parts, stream.finish()])
        assert np.array_equal(np.concatenate(decided), expected)
        holds(labels, start=whole.start, label=whole.label, scores=whole.scores)
        decided.clear()


def test_a_label_comes_with_the_last_sample_of_its_frame():
    stream, signal = nc.Stream(classifier("ours")), noise(1000)
    complete = [i for i in range(1000) if len(stream.push(signal[i : i + 1]))]
    assert complete == [399, 499, 599, 699, 799, 899, 999]
    assert stream.count == 1000


def test_a_gap_of_a_year_is_passed_at_once_and_the_clock_goes_on():
    stream = nc.Stream(classifier("ours"))
    stream.push(noise(1000))
    year = round(365 * 86_400 * RATE)
    stream.skip(year)
    labels = stream.push(noise(1000))
    assert stream.count == year + 2000
    assert labels.start[0] == pytest.approx((year + 1000) / RATE)
    assert set(labels.label[-2:]) == {"oscillations"}


def test_after_its_end_another_signal_begins():
    stream, signal, other = nc.Stream(classifier("ours")), noise(1234), 2.0 * noise(900, 1)
    once, changed, again = (streamed(stream, each, [17]) for each in (signal, other, signal))
    assert_equal(once, again)
    assert_equal(changed, streamed(nc.Stream(classifier("ours")), other, [17]))
    assert stream.count == 0
    assert streamed(stream, noise(399), [5]).scores.shape == (0, 2)  # shorter than a frame


def test_memory_does_not_grow():
    stream, signal, sizes = nc.Stream(classifier("noisytest")), noise(1000), []
    for _ in range(20):
        stream.push(signal)
        sizes.append(len(pickle.dumps(stream._frames)))
    assert max(sizes[1:]) == min(sizes[1:])


def test_every_transform_is_computed_once(monkeypatch):
    transformed = []

    def counted(windows, profile, resolution):
        transformed.append(windows.shape[-2])
        return original(windows, profile, resolution)

    original = module.log_band_energies
    stream = nc.Stream(classifier("ours"))
    monkeypatch.setattr(module, "log_band_energies", counted)
    for sample in np.split(noise(1000), 40):
        stream.push(sample)
    assert sum(transformed) == 1 + (1000 - OURS.window) // OURS.stride
    transformed.clear()
    classifier("ours").classify(noise(5000), RATE)
    assert sum(transformed) == 1 + 1 + (5000 - OURS.window) // OURS.stride  # one for its shape


@pytest.mark.parametrize("rate", [10_000.0, 970.0, 0.0, float("nan")])
def test_a_signal_of_another_rate_is_refused(rate):
    with pytest.raises(nc.RateError, match="rates are 1000 Hz: lower the motion's rate"):
        nc.Stream(classifier("ours"), rate=rate)


def test_a_rate_that_is_nearly_the_models_counts_time_by_its_own():
    signal = noise(1500)
    stream = nc.Stream(classifier("ours"), rate=1000.5)
    batch = classifier("ours").classify(signal, 1000.5)
    assert_equal(streamed(stream, signal, [700]), batch)


@pytest.mark.parametrize(
    ("samples", "valid", "reason"),
    [
        (np.zeros((3, 2)), None, r"noise \(3, 2\), expected \(samples,\)"),
        (np.zeros(3), np.ones(2, bool), r"validity of shape \(2,\), expected \(samples,\) for"),
        (np.array([0.0, np.nan]), None, r"sample 11 of the signal is not finite \(nan\)"),
    ],
)
def test_samples_that_make_no_signal_are_refused_and_none_is_taken(samples, valid, reason):
    stream = nc.Stream(classifier("ours"))
    stream.push(np.zeros(10))
    with pytest.raises(nc.SignalError, match=reason):
        stream.push(samples, valid)
    assert stream.count == 10


def test_streaming_needs_neither_scikit_learn_nor_scipy(tmp_path):
    classifier("ours").save(tmp_path / "model.npz")
    code = (
        "import sys, numpy, noiseclassifier\n"
        "stream = noiseclassifier.Stream(noiseclassifier.load(sys.argv[1]))\n"
        "print(len(stream.push(numpy.zeros(2000))))\n"
        "print(sorted({'sklearn', 'scipy', 'noisemodel', 'joblib'} & set(sys.modules)))\n"
    )
    done = python("-c", code, tmp_path / "model.npz")
    assert done.stdout.split("\n")[:2] == ["17", "[]"]
