import numpy as np
import pytest

from inspector.regression.levels import levels, octaves
from noisemodel import Run


def run(rate=1000.0, duration=2.0, valid=None, **signals):
    time = np.arange(round(rate * duration)) / rate
    velocity = np.column_stack([signal(time) for signal in signals.values()])
    velocity = velocity if valid is None else velocity * valid[:, None]
    return Run(time=time, velocity=velocity, joint_names=tuple(signals), valid=valid)


def tone(amplitude, frequency):
    return lambda time: amplitude * np.sin(2 * np.pi * frequency * time)


def test_a_tone_has_half_its_squared_amplitude_in_its_octave():
    found = levels(run(elbow=tone(0.3, 64.0), wrist=tone(0.0, 1.0)))
    assert found.bands == (16.0, 32.0, 64.0, 128.0, 256.0)
    power = found.power.mean(axis=0)
    assert power[0, 2] == pytest.approx(0.3**2 / 2, rel=1e-3)
    assert power[0, [0, 1, 3, 4]].max() < 1e-6
    assert (power[1] == 0.0).all()


def test_octaves_end_below_half_the_rate():
    assert octaves(1000.0)[-1] == 256.0
    assert octaves(10_000.0)[-1] == 2048.0
    assert octaves(45.0) == ()


def test_windows_that_touch_a_gap_are_left_out():
    valid = np.ones(2000, dtype=bool)
    valid[900:910] = False
    found = levels(run(valid=valid, elbow=tone(0.3, 64.0)))
    assert not ((found.time > 0.8) & (found.time < 1.0)).any()
    assert found.power.mean(axis=0)[0, 2] == pytest.approx(0.3**2 / 2, rel=1e-3)


def test_a_run_shorter_than_a_window_has_no_step():
    assert levels(run(duration=0.1, elbow=tone(1.0, 64.0))).power.shape == (0, 1, 5)
