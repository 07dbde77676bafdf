"""Features relative to a reference: the signal as far as it has come, or all of it."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import noiseclassifier as nc
from noiseclassifier.features import (
    ALIKE,
    LEAST_SPREAD,
    NORMAL,
    RunningReference,
    WholeReference,
    frame_features,
)

module = sys.modules["noiseclassifier.features"]
RECIPE = replace(nc.ANY, rounds=5)
RATES = (80.0, 125.0, 500.0, 1000.0)


def frames(seed=0, count=40, features=5):
    """Features of good frames, in [Np]."""
    return -2.0 + 0.5 * np.random.default_rng(seed).normal(size=(count, features))


def signal(rate, seconds=6.0, seed=0):
    """A walk that hums in its second half."""
    time, random = np.arange(round(seconds * rate)) / rate, np.random.default_rng(seed)
    hum = 0.2 * np.sin(60 * np.pi * time) * (time > seconds / 2)
    return 1.0 + 0.3 * np.sin(7.0 * time) + 0.02 * random.normal(size=len(time)) + hum


def relative_part(features):
    return features[:, features.shape[1] // 2 :]


def by_median(good, features):
    """Features less the median of good ones, in their deviations, within 15."""
    location = np.median(good, axis=0)
    spread = NORMAL * np.median(np.abs(good - location), axis=0)
    return np.clip((features - location) / (spread + LEAST_SPREAD), -15.0, 15.0)


def test_a_running_reference_has_a_memory_of_a_minute():
    # Frames come every 0.1 s; a shift within the spread fades as exp(-t / 60 s).
    sway = np.where(np.arange(3000) % 2, 0.5, -0.5)
    running = RunningReference()
    running.relative((sway + 0.05 * (np.arange(3000) >= 2400))[:, None])
    assert running._location[0] == pytest.approx(0.05 * (1.0 - np.exp(-1.0)), abs=2e-3)


def test_a_running_reference_is_the_mean_of_frames_within_its_spread():
    running = RunningReference()
    for count, frame in enumerate((0.0, 0.03, -0.06, 0.05), start=1):
        running.relative(np.array([[frame]]))
        mean = np.mean((0.0, 0.03, -0.06, 0.05)[:count])
        assert running._location[0] == pytest.approx(mean, abs=1e-12)


def test_the_first_frame_of_a_signal_is_its_own_reference():
    np.testing.assert_array_equal(RunningReference().relative(frames()[:1]), np.zeros((1, 5)))
    second = RunningReference().relative(np.array([[0.0], [0.01]]))[1, 0]
    assert 0.0 < second < 0.01 / LEAST_SPREAD  # the spread before anything is known is not 0


@given(first=st.integers(0, 40), louder=st.floats(-50.0, 50.0))
def test_a_running_reference_knows_nothing_of_frames_to_come(first, louder):
    known = frames()
    other = known.copy()
    other[first:] += louder
    ours, theirs = (RunningReference().relative(each) for each in (known, other))
    np.testing.assert_array_equal(ours[:first], theirs[:first])


@given(
    place=st.integers(0, 39),
    column=st.integers(0, 4),
    steps=st.lists(st.floats(0.0, 20.0), min_size=1, max_size=4),
    seed=st.integers(0, 20),
)
def test_a_relative_feature_never_falls_when_its_frame_becomes_louder(place, column, steps, seed):
    features, before = frames(seed), -np.inf
    for louder in np.cumsum([0.0, *steps]):
        each = features.copy()
        each[place, column] += louder
        found = RunningReference().relative(each)[place, column]
        assert found >= before - 1e-12
        before = found


def test_a_running_reference_approaches_median_and_deviation_of_all_frames():
    good = frames(count=600)
    found = RunningReference().relative(np.vstack((good, good)))[600:]
    np.testing.assert_allclose(found, by_median(good, good), atol=0.5)
    assert np.abs(np.median(found)) < 0.1


def test_a_lasting_change_becomes_the_reference():
    before, after = np.zeros((100, 1)), np.full((600, 1), 2.0)
    found = RunningReference().relative(np.vstack((before, after)))[:, 0]
    assert found[100] > 4.0
    assert found[-1] < found[100] / 4
    assert (np.diff(found[101:]) <= 0.0).all()


@pytest.mark.parametrize("rate", RATES)
def test_relative_features_do_not_change_with_the_scale_of_all_amplitudes(rate):
    profile = replace(RECIPE, floor=1e-9).at(rate, ("measured",))
    plain, *louder = (
        frame_features({"measured": scale * signal(rate)}, profile)[1]
        for scale in (1.0, 30.0, 1000.0)
    )
    for each, scale in zip(louder, (30.0, 1000.0), strict=True):
        np.testing.assert_allclose(relative_part(each), relative_part(plain), atol=1e-3)
        more = (each - plain)[:, : each.shape[1] // 2]
        np.testing.assert_allclose(more, np.log(scale), atol=1e-3)


def taken(features, flagged, pace, every=7):
    whole = WholeReference()
    for first in range(0, len(features), every):
        part = slice(first, first + every)
        whole.add(features[part], flagged[part], pace[part])
    return whole


@pytest.mark.parametrize("moves", [ALIKE, ALIKE - 1])
def test_motion_is_compared_with_all_motion_if_there_is_enough_and_standing_with_the_rest(moves):
    good, number = frames(count=60), np.arange(60)
    flagged, pace = number % 4 == 1, np.where(number < moves, 2.0, 0.1)
    places, features = taken(good, flagged, pace).relative(flagged)
    motion = good[:moves] if moves >= ALIKE else good[~flagged]
    expected = [by_median(motion, good[flagged & (pace > 1.0)])]
    expected.append(by_median(good[~flagged], good[flagged & (pace < 1.0)]))
    np.testing.assert_array_equal(places, np.flatnonzero(flagged))
    np.testing.assert_array_equal(features, np.hstack((good[flagged], np.vstack(expected))))


def test_standing_before_and_after_a_motion_changes_nothing_of_it():
    motion, still = frames(count=40), frames(count=50) - 5.0
    flagged, moves = np.ones(40, bool), np.full(40, 3.0)
    _, alone = taken(motion, flagged, moves).relative(flagged)
    flagged = np.arange(140) // 10 % 9 > 4
    pace = np.concatenate((np.full(50, 0.01), moves, np.zeros(50)))
    _, whole = taken(np.vstack((still, motion, still)), flagged, pace).relative(flagged)
    np.testing.assert_array_equal(whole, alone)


def test_a_signal_without_another_frame_is_compared_with_its_past_alone():
    whole, none = taken(frames(count=20), np.ones(20, bool), np.ones(20)), np.zeros(20, bool)
    assert WholeReference().relative(none[:0]) is None
    assert whole.relative(~none) is whole.relative(none) is None


def test_memory_of_the_whole_reference_does_not_grow_with_the_signal(monkeypatch):
    monkeypatch.setattr(module, "KEPT", 50)
    failures = np.arange(2000) % 17 < 7
    whole = taken(frames(count=2000) + 3.0 * failures[:, None], failures, np.ones(2000), every=13)
    assert len(whole._features) <= 2 * 50 + 13 + failures.sum()
    places, features = whole.relative(failures)
    np.testing.assert_array_equal(places, np.flatnonzero(failures))
    assert np.median(relative_part(features)) > 1.0  # failures count no more than other frames
