import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inspector.smoothness import (
    level_above,
    log_dimensionless_jerk,
    sparc,
    speed_of,
    squared_difference,
)

RATE = 200.0


def minimum_jerk(duration=1.0, amplitude=1.0, rate=RATE):
    """Velocity of a minimum-jerk movement from rest to rest (Flash and Hogan, 1985)."""
    share = np.linspace(0.0, 1.0, round(duration * rate) + 1)
    return (amplitude / duration * 30 * share**2 * (1 - share) ** 2)[:, None]


def with_oscillation(velocity, frequency, size, rate=RATE, phase=0.0):
    time = np.arange(len(velocity)) / rate
    return velocity + size * np.sin(2 * np.pi * frequency * time + phase)[:, None]


def test_a_minimum_jerk_movement_has_its_analytic_dimensionless_jerk():
    # Integral of the squared jerk: 720 A² / T⁵; peak speed: 15/8 A / T (Hogan and Sternad, 2009).
    exact = -np.log(720.0 / 1.875**2)
    found = log_dimensionless_jerk(minimum_jerk(rate=5000.0), 5000.0)
    assert found == pytest.approx(exact, abs=2e-3)


def test_sparc_of_a_gaussian_speed_is_that_of_its_authors():
    time = np.arange(-1, 1, 0.01)
    assert sparc(np.exp(-5 * time**2), 100.0) == pytest.approx(-1.41403, abs=1e-5)


@pytest.mark.parametrize("frequency", [3.0, 6.0, 9.0])
def test_an_oscillation_lowers_sparc_and_log_dimensionless_jerk(frequency):
    clean = minimum_jerk()
    rough = with_oscillation(clean, frequency, 0.3)
    assert sparc(speed_of(rough), RATE) < sparc(speed_of(clean), RATE)
    assert log_dimensionless_jerk(rough, RATE) < log_dimensionless_jerk(clean, RATE)


def test_two_submovements_are_less_smooth_than_one():
    one = minimum_jerk()
    two = np.vstack((one, one))
    assert sparc(speed_of(two), RATE) < sparc(speed_of(one), RATE)
    assert log_dimensionless_jerk(two, RATE) < log_dimensionless_jerk(one, RATE)


@settings(deadline=None, max_examples=25)
@given(st.floats(1e-3, 1e3))
def test_amplitude_does_not_count_in_dimensionless_measures(amplitude):
    rough = with_oscillation(minimum_jerk(), 6.0, 0.2)
    assert sparc(speed_of(amplitude * rough), RATE) == pytest.approx(sparc(speed_of(rough), RATE))
    assert log_dimensionless_jerk(amplitude * rough, RATE) == pytest.approx(
        log_dimensionless_jerk(rough, RATE)
    )


@pytest.mark.parametrize("factor", [0.5, 2.0, 4.0])
def test_duration_does_not_count_in_dimensionless_measures(factor):
    rough = with_oscillation(minimum_jerk(), 6.0, 0.2)
    slower = log_dimensionless_jerk(rough, RATE / factor)  # the same samples, further apart
    assert slower == pytest.approx(log_dimensionless_jerk(rough, RATE))
    speed = speed_of(minimum_jerk())  # its spectrum ends far below the cut-off
    assert sparc(speed, RATE / factor) == pytest.approx(sparc(speed, RATE), rel=1e-3)


def test_sparc_is_blind_above_its_cut_off():
    clean = 0.5 + minimum_jerk(2.0)
    chatter = with_oscillation(clean, 40.0, 0.4)  # the speed stays positive
    assert sparc(speed_of(chatter), RATE) == pytest.approx(sparc(speed_of(clean), RATE), abs=0.02)
    wider = sparc(speed_of(chatter), RATE, cutoff=RATE / 2)
    assert wider < sparc(speed_of(clean), RATE, cutoff=RATE / 2)


@pytest.mark.parametrize("rate", [50.0, 200.0, 10_000.0])
def test_the_level_of_a_fast_sine_is_its_root_mean_square_and_slow_motion_has_none(rate):
    time = np.arange(round(4 * rate)) / rate
    fast, slow = np.sin(2 * np.pi * 20.0 * time), np.sin(2 * np.pi * 1.0 * time)
    assert level_above(fast[:, None], rate, 10.0) == pytest.approx(np.sqrt(0.5), rel=0.03)
    assert level_above(slow[:, None], rate, 10.0) < 0.01
    both = np.column_stack((fast, slow, fast))
    assert level_above(both, rate, 10.0) == pytest.approx(1.0, rel=0.03)


def test_differences_count_steps_and_the_second_one_passes_constant_rates():
    ramp = np.outer(np.arange(10), (3.0, 4.0))
    assert squared_difference(ramp) == pytest.approx(25.0)
    assert squared_difference(ramp, order=2) == 0.0
    zigzag = np.tile([0.0, 1.0], 5)[:, None]
    assert squared_difference(zigzag) == 1.0
    assert squared_difference(zigzag, order=2) == 4.0


@pytest.mark.parametrize("samples", range(4))
def test_signals_that_are_too_short_have_no_measure(samples):
    signal = np.ones((samples, 2)) * np.arange(samples)[:, None]
    assert level_above(signal, RATE, 10.0) is None
    assert log_dimensionless_jerk(signal, RATE) is None
    if samples < 2:
        assert sparc(speed_of(signal), RATE) is None
        assert squared_difference(signal) is None


def test_standstill_and_constant_speed_are_not_nan():
    still, constant = np.zeros((100, 3)), np.ones((100, 3))
    assert sparc(speed_of(still), RATE) is None
    assert log_dimensionless_jerk(still, RATE) is None
    assert log_dimensionless_jerk(constant, RATE) is None
    assert level_above(still, RATE, 10.0) == 0.0
    assert squared_difference(still) == 0.0


def test_a_rate_that_is_too_low_has_no_level():
    assert level_above(np.ones((100, 1)), 20.0, 10.0) is None
