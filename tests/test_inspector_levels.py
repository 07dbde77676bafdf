"""Levels in decibels and the colours that show them."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from inspector import colors
from inspector.levels import (
    COLUMNS,
    FLOOR_DB,
    JOINTS,
    LINKS,
    STEP,
    amplitudes,
    extremes,
    in_bands,
    link_levels,
    spectrogram,
    velocity_levels,
)
from noisemodel.noise import LinkNoise

RATE = 1000.0


def everywhere(signal):
    return np.ones(len(signal), dtype=bool)


def tone(amplitude, seconds=2.0, hertz=100.0):
    time = np.arange(round(seconds * RATE)) / RATE
    return amplitude * np.sin(2 * np.pi * hertz * time)[:, None]


def links(vibration, width=0.01):
    time, names = width * (np.arange(len(vibration)) + 0.5), tuple("abc"[: vibration.shape[1]])
    signals = {"time": time, "power": vibration, "vibration": vibration}
    return LinkNoise("normal", names, (frozenset(),) * len(names), remarks=(), **signals)


def test_a_tone_of_one_rad_per_second_effective_is_at_zero_decibels():
    time, level = velocity_levels(tone(np.sqrt(2)), everywhere(tone(1.0)), RATE, start=3.0)
    assert time[0] == 3.0
    np.testing.assert_allclose(np.diff(time), STEP)
    np.testing.assert_allclose(level[2:-2], 0.0, atol=0.2)
    turning = np.hstack((tone(np.sqrt(2)), 9.0 + tone(0.0)))  # hides nothing of the other joint
    _, both = velocity_levels(turning, everywhere(turning), RATE, together=True)
    np.testing.assert_allclose(both, level, atol=1e-6)


def test_slow_motion_and_standstill_have_no_level():
    slow = tone(1.0, hertz=0.5)
    _, level = velocity_levels(np.hstack((slow, 0 * slow)), everywhere(slow), RATE)
    assert level[2:-2, 0].max() < -35.0
    assert (level[:, 1] == FLOOR_DB).all()


def test_a_step_in_a_gap_has_no_level_and_one_beside_it_has_that_of_its_samples():
    signal, valid = tone(np.sqrt(2)), everywhere(tone(1.0))
    valid[1000:1125] = False
    _, level = velocity_levels(signal, valid, RATE)
    assert np.flatnonzero(np.isnan(level[:, 0])).tolist() == [20, 21]
    assert level[22, 0] == pytest.approx(0.0, abs=1.0)


def test_a_link_of_one_watt_is_at_120_decibels():
    time, level = link_levels(links(np.tile([1.0, 0.0], (100, 1))))
    assert time[0] == pytest.approx(0.0)
    np.testing.assert_allclose(np.diff(time), STEP)
    np.testing.assert_allclose(level[:, 0], 120.0)
    assert np.isneginf(level[:, 1]).all()


@pytest.mark.parametrize("scale", [JOINTS, LINKS])
@pytest.mark.parametrize("shades", [0, 16])
def test_what_is_louder_is_never_darker(scale, shades):
    level = np.concatenate(([-np.inf], np.linspace(scale.low - 20, scale.high + 20, 200)))
    shown = scale.colours(level, shades=shades)[:, :3].astype(float)
    lightness = shown @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(lightness) >= 0).all()
    assert tuple(shown[0]) == tuple(colors.HEAT[0])
    assert tuple(shown[-1]) == tuple(colors.HEAT[-1])


def test_ticks_span_a_scale():
    assert JOINTS.ticks == (-60.0, -40.0, -20.0, 0.0)
    assert LINKS.ticks == (60.0, 80.0, 100.0, 120.0)


@pytest.mark.parametrize(("loudest", "high"), [(13.0, 20.0), (-18.0, -10.0), (-90.0, -30.0)])
def test_a_scale_follows_a_run_but_a_quiet_run_looks_quiet(loudest, high):
    scale = JOINTS.following(np.array([-np.inf, np.nan, loudest, loudest - 30.0]))
    assert (scale.low, scale.high, scale.unit) == (high - 60.0, high, JOINTS.unit)


def wave(hertz, rate, seconds):
    time = np.arange(round(rate * seconds)) / rate
    return np.sin(2 * np.pi * hertz * time)


@pytest.mark.parametrize(("hertz", "rate"), [(300.0, 10_000.0), (120.0, 1000.0), (20.0, 250.0)])
@pytest.mark.parametrize("constant", [0.0, 1000.0])
def test_a_tone_is_loudest_at_its_frequency_and_a_constant_is_not_shown(hertz, rate, constant):
    signal = constant + wave(hertz, rate, 2.0)
    shown = spectrogram(signal, rate, start=0.0, valid=everywhere(signal))
    loudest = shown.frequency[shown.amplitude.argmax(axis=0)]
    assert np.abs(loudest - hertz).max() <= shown.frequency[1] - shown.frequency[0]


@pytest.mark.parametrize(("amplitude", "level"), [(1.0, 0.0), (0.1, -20.0), (0.02, -33.98)])
def test_a_tenth_of_the_amplitude_is_20_decibels_less_in_a_spectrogram(amplitude, level):
    signal = amplitude * wave(312.5, 10_000.0, 1.0)  # 32 periods in a window of 1024 samples
    shown = spectrogram(signal, 10_000.0, start=0.0, valid=everywhere(signal))
    np.testing.assert_allclose(shown.decibel.max(axis=0), level, atol=0.01)


def test_windows_that_touch_a_gap_are_silent():
    signal = wave(100.0, 1000.0, 4.0)
    valid = everywhere(signal)
    valid[2000:2010] = False
    shown = spectrogram(signal, 1000.0, start=0.0, valid=valid)
    silent = (shown.amplitude == 0.0).all(axis=0)
    assert silent[np.abs(shown.time - 2.0) < 0.04].all()
    assert not silent[np.abs(shown.time - 2.0) > 0.07].any()


def test_times_are_those_of_the_run():
    signal = np.zeros(10_000)
    signal[5000:5010] = 1.0
    shown = spectrogram(signal, 10_000.0, start=7.0, valid=everywhere(signal))
    assert shown.time[shown.amplitude.max(axis=0).argmax()] == pytest.approx(7.5, abs=0.03)


def test_a_window_does_not_see_a_sample_at_its_edge_where_it_is_zero():
    np.testing.assert_allclose(amplitudes(np.eye(1, 64)), 0.0, atol=1e-15)


@pytest.mark.parametrize("seconds", [30.0, 41.0, 300.0, 1000.0])
def test_columns_are_few_and_show_a_tone_wherever_it_is_in_a_long_run(seconds):
    for start in np.linspace(1.0, seconds - 1.0, 7):
        signal, now = np.zeros(round(1000 * seconds)), slice(round(1000 * start), None)
        signal[now][:200] = wave(83.0, 1000.0, 0.2)
        shown = spectrogram(signal, 1000.0, start=5.0, valid=everywhere(signal))
        level = shown.decibel.max(axis=0)
        assert shown.amplitude.shape[1] <= COLUMNS
        assert level.max() == pytest.approx(0.0, abs=1.5)
        assert shown.time[level.argmax()] == pytest.approx(5.1 + start, abs=0.1 + seconds / 400)


def test_a_band_has_the_largest_amplitude_within_it_or_that_of_the_nearest_bin():
    frequency, amplitude = np.arange(1.0, 11.0), np.arange(20.0).reshape(10, 2)
    found = in_bands(frequency, amplitude, np.array([1.0, 4.0, 11.0]))
    np.testing.assert_allclose(found, [[4.0, 5.0], [18.0, 19.0]])
    frequency, amplitude = np.array([10.0, 20.0, 30.0]), np.array([[1.0], [5.0], [2.0]])
    found = in_bands(frequency, amplitude, np.array([11.0, 12.0, 18.5, 19.0]))
    np.testing.assert_allclose(found[[0, 2], 0], [1.0, 5.0])


@example(10, 10, 0)
@given(st.integers(1, 5000), st.integers(2, 300), st.integers(0, 2**32 - 1))
def test_no_peak_is_lost_and_points_are_few(samples, points, seed):
    values = np.random.default_rng(seed).normal(size=(samples, 3))
    time = np.arange(samples) / 100
    kept_time, kept = extremes(time, values, points=points)
    assert len(kept) <= max(points, 2)
    assert len(kept_time) == len(kept)
    np.testing.assert_array_equal(kept.max(axis=0), values.max(axis=0))
    np.testing.assert_array_equal(kept.min(axis=0), values.min(axis=0))
    assert (np.diff(kept_time) >= 0).all()
    if samples <= points:
        np.testing.assert_array_equal(kept, values)
        np.testing.assert_array_equal(kept_time, time)
