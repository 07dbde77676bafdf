import numpy as np
import pytest

from inspector.levels import COLUMNS, in_bands, spectrogram


def everywhere(signal):
    return np.ones(len(signal), dtype=bool)


def tone(hertz, rate, seconds):
    time = np.arange(round(rate * seconds)) / rate
    return np.sin(2 * np.pi * hertz * time)


@pytest.mark.parametrize(("hertz", "rate"), [(300.0, 10_000.0), (120.0, 1000.0), (20.0, 250.0)])
def test_a_tone_is_loudest_at_its_frequency(hertz, rate):
    signal = tone(hertz, rate, 2.0)
    shown = spectrogram(signal, rate, start=0.0, valid=everywhere(signal))
    loudest = shown.frequency[shown.amplitude.argmax(axis=0)]
    assert np.abs(loudest - hertz).max() <= shown.frequency[1] - shown.frequency[0]


def test_the_constant_part_of_a_noise_is_not_shown():
    signal = 1000.0 + tone(200.0, 10_000.0, 1.0)
    shown = spectrogram(signal, 10_000.0, start=0.0, valid=everywhere(signal))
    assert shown.frequency[shown.amplitude.mean(axis=1).argmax()] == pytest.approx(200.0, abs=10.0)


def test_standstill_is_silent_and_finite():
    signal = np.zeros(5000)
    shown = spectrogram(signal, 1000.0, start=0.0, valid=everywhere(signal))
    assert (shown.amplitude == 0.0).all()


def test_windows_that_touch_a_gap_are_silent():
    signal = tone(100.0, 1000.0, 4.0)
    valid = everywhere(signal)
    valid[2000:2010] = False
    shown = spectrogram(signal, 1000.0, start=0.0, valid=valid)
    silent = (shown.amplitude == 0.0).all(axis=0)
    assert silent[np.abs(shown.time - 2.0) < 0.04].all()
    assert not silent[np.abs(shown.time - 2.0) > 0.07].any()


def test_columns_are_few_however_long_the_run():
    signal = tone(50.0, 1000.0, 300.0)
    shown = spectrogram(signal, 1000.0, start=0.0, valid=everywhere(signal))
    assert shown.amplitude.shape[1] <= COLUMNS
    assert shown.time[-1] > 299.0


def test_times_are_those_of_the_run():
    signal = np.zeros(10_000)
    signal[5000:5010] = 1.0
    shown = spectrogram(signal, 10_000.0, start=7.0, valid=everywhere(signal))
    assert shown.time[shown.amplitude.max(axis=0).argmax()] == pytest.approx(7.5, abs=0.03)


def test_a_band_has_the_largest_amplitude_within_it():
    frequency, amplitude = np.arange(1.0, 11.0), np.arange(20.0).reshape(10, 2)
    found = in_bands(frequency, amplitude, np.array([1.0, 4.0, 11.0]))
    np.testing.assert_allclose(found, [[4.0, 5.0], [18.0, 19.0]])


def test_a_band_narrower_than_the_bins_has_that_of_the_nearest():
    frequency, amplitude = np.array([10.0, 20.0, 30.0]), np.array([[1.0], [5.0], [2.0]])
    found = in_bands(frequency, amplitude, np.array([11.0, 12.0, 18.5, 19.0]))
    np.testing.assert_allclose(found[[0, 2], 0], [1.0, 5.0])
