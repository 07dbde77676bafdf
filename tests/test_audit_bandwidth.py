import numpy as np
import pytest
from checks import memory_below
from scipy.signal import butter, savgol_filter, sosfilt

from inspector.audit.signals import (
    CENTRAL,
    ENCODER_NOISE,
    SMOOTH,
    bandwidth,
    differentiator_of,
    spectrum,
    step_of,
)
from noisemodel import Run
from noisemodel.hold import hold_length

RATES = [200.0, 1000.0, 10_000.0]
WIDTHS = np.array([0.3, 0.41, 0.53, 0.27, 0.6, 0.35])


def motion(rate, seconds=10.0):
    """Time, and smooth positions and velocities of six joints."""
    time = np.arange(round(seconds * rate)) / rate
    angle = 2 * np.pi * np.outer(time, WIDTHS) + np.arange(6)
    return time, 1.1 * np.sin(angle), 2.2 * np.pi * WIDTHS * np.cos(angle)


def noise(shape, level=0.003, seed=0):
    return np.random.default_rng(seed).normal(0, level, shape)


def run_of(velocity, rate, **signals):
    names = tuple(f"joint{number}" for number in range(velocity.shape[1]))
    time = np.arange(len(velocity)) / rate
    return Run(time=time, velocity=velocity, joint_names=names, **signals)


def low_passed(signal, cutoff, rate, order):
    return sosfilt(butter(order, cutoff, fs=rate, output="sos"), signal, axis=0)


@pytest.mark.parametrize("rate", RATES)
def test_the_power_of_white_noise_is_spread_evenly_and_adds_up(rate):
    velocity = noise((40_000, 3), level=0.1)
    found = spectrum(velocity, rate, np.ones(40_000, dtype=bool))
    width = found.frequency[1] - found.frequency[0]
    assert found.total.sum() * width == pytest.approx(3 * 0.1**2, rel=0.05)
    low, high = np.array_split(found.total, 2)
    assert low.mean() == pytest.approx(high.mean(), rel=0.1)


def test_the_spectrum_of_a_minute_of_many_joints_takes_less_than_the_minute_itself():
    velocity = noise((60_000, 20))
    with memory_below(2 * velocity.nbytes):
        spectrum(velocity, 1000.0, np.ones(60_000, dtype=bool))


def test_a_sine_has_its_power_at_its_frequency():
    time = np.arange(20_000) / 1000
    velocity = 0.2 * np.sin(2 * np.pi * 50 * time)[:, None]
    found = spectrum(velocity, 1000.0, np.ones(20_000, dtype=bool))
    assert found.frequency[found.total.argmax()] == pytest.approx(50.0)
    near = np.abs(found.frequency - 50) < 10
    width = found.frequency[1] - found.frequency[0]
    assert found.total[near].sum() * width == pytest.approx(0.2**2 / 2, rel=0.01)


def test_no_segment_reaches_over_a_gap():
    valid = np.ones(4000, dtype=bool)
    valid[2000] = False
    velocity = noise((4000, 1))
    velocity[2000] = 1e6
    assert spectrum(velocity, 1000.0, valid).total.max() < 1e-3
    assert spectrum(velocity[1990:2200], 1000.0, valid[1990:2200]) is None


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("order", [2, 4])
@pytest.mark.parametrize("share", [0.15, 0.2, 0.4])
def test_the_corner_of_a_filter_is_found(rate, order, share):
    _, _, velocity = motion(rate)
    cutoff = share * rate
    filtered = low_passed(velocity + noise(velocity.shape), cutoff, rate, order)
    found = bandwidth(run_of(filtered, rate))
    assert found.corner == pytest.approx(cutoff, rel=0.2)
    assert (found.usable, found.limit) == (found.corner, "the log looks filtered")


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("level", [0.0, 3e-4, 3e-3, 3e-2])
def test_sensor_noise_alone_is_no_filter(rate, level):
    _, position, velocity = motion(rate)
    found = bandwidth(run_of(velocity + noise(velocity.shape, level), rate, position=position))
    assert found.corner is found.differentiator is found.floor_from is None
    assert (found.hold, found.usable) == (1.0, rate / 2)
    assert differentiator_of(run_of(velocity, rate)) is None


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("band", [(0.1, 0.15), (0.05, 0.15), (0.1, 0.3)])
def test_a_vibration_in_one_band_is_no_filter(rate, band):
    _, _, velocity = motion(rate)
    sections = butter(4, np.array(band) * rate, "bandpass", fs=rate, output="sos")
    rattle = sosfilt(sections, noise(velocity.shape, 0.5, seed=1), axis=0)
    found = bandwidth(run_of(velocity + noise(velocity.shape) + rattle, rate))
    assert found.corner is None


def test_an_encoder_filter_of_first_order_gives_no_warning():
    _, _, velocity = motion(10_000.0)
    noisy = velocity + low_passed(noise(velocity.shape), 500.0, 10_000.0, 1)
    assert bandwidth(run_of(noisy, 10_000.0)).corner is None


def test_the_step_of_quantised_values_is_found():
    values = np.random.default_rng(0).normal(size=5000)
    for step in (0.1, 1e-3, 2 * np.pi / 4096):
        assert step_of(np.round(values / step) * step) == pytest.approx(step)
    for other in (values, np.zeros(100), np.arange(3.0)):
        assert step_of(other) == 0.0


def test_the_quantisation_floor_begins_where_quantisation_noise_is_louder():
    _, _, velocity = motion(1000.0)
    fast = 0.01 * np.sin(2 * np.pi * 60 * np.arange(len(velocity)) / 1000)[:, None]
    step = 1e-3
    rounded = bandwidth(run_of(np.round((velocity + fast) / step) * step, 1000.0))
    assert rounded.step == pytest.approx(step)
    assert rounded.floor_from == pytest.approx(80, abs=25)
    # step² / 12 over half the rate and six joints, a 10 Hz band of it, as an amplitude
    assert rounded.floor_amplitude == pytest.approx(
        np.sqrt(2 * 10 * 6 * step**2 / 12 / 500), rel=1e-6
    )
    assert rounded.usable == 500.0


def test_quantisation_below_the_sensor_noise_masks_nothing():
    _, _, velocity = motion(1000.0)
    noisy = np.round((velocity + noise(velocity.shape)) / 1e-3) * 1e-3
    assert bandwidth(run_of(noisy, 1000.0)).floor_from is None
    assert bandwidth(run_of(noisy.astype(np.float32), 1000.0)).floor_from is None


def test_quantised_positions_mask_their_differences():
    _, position, _ = motion(1000.0)
    coarse = np.round(position / 1e-3) * 1e-3
    found = bandwidth(run_of(np.gradient(coarse, 1e-3, axis=0), 1000.0, position=coarse))
    assert found.differentiator is CENTRAL
    assert found.step == pytest.approx(1e-3)
    assert found.floor_from < 20.0


def test_a_level_below_any_encoders_noise_is_reported():
    _, _, velocity = motion(1000.0)
    assert bandwidth(run_of(velocity, 1000.0)).quiet_from == pytest.approx(35, abs=15)
    assert bandwidth(run_of(velocity + noise(velocity.shape), 1000.0)).quiet_from is None
    assert ENCODER_NOISE == 3e-5


def test_standstill_has_no_limits():
    found = bandwidth(run_of(np.zeros((5000, 2)), 1000.0))
    assert found.corner is found.floor_from is found.quiet_from is None
    assert found.usable == 500.0


@pytest.mark.parametrize(("length", "near"), [(2, 1e-6), (8, 1e-6), (33, 1e-6), (100 / 3, 1e-3)])
def test_a_zero_order_hold_is_found_with_its_length(length, near):
    _, _, velocity = motion(1000.0)
    held = velocity[(np.arange(len(velocity)) // length * length).astype(int)]
    found = bandwidth(run_of(held, 1000.0))
    assert found.hold == pytest.approx(length, rel=near)
    assert found.usable == pytest.approx(500.0 / length, rel=near)
    assert found.corner is None


def test_quantisation_and_rest_are_no_hold():
    _, _, velocity = motion(1000.0)
    ramp = np.floor(np.arange(len(velocity)) / 7)[:, None]  # of an encoder at a steady speed
    rest = np.vstack((velocity[:2000], np.tile(velocity[2000], (6000, 1)), velocity[8000:]))
    for signal in (np.round(velocity, 2), np.round(velocity[:, :1], 1), ramp, rest):
        assert hold_length(signal, np.ones(len(signal), dtype=bool)) == 1.0


def test_the_slope_of_a_sine_is_right_at_low_frequencies():
    low = np.array([1.0])
    for method in (CENTRAL, SMOOTH):
        assert method.response(low, 1000.0) == pytest.approx(2 * np.pi, rel=1e-3)
    assert CENTRAL.corner(1000.0) == pytest.approx(221.5, abs=1)  # sin(x) / x = sqrt(1 / 2)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_differences_of_positions_are_recognised(dtype):
    _, position, _ = motion(100.0)
    position = (position + noise(position.shape, 1e-4)).astype(dtype)
    differences = np.diff(position, axis=0, append=position[-1:]) * dtype(100)
    assert "after" in differentiator_of(run_of(differences, 100.0, position=position)).name
    backward = np.vstack((differences[:1], differences[:-1]))
    assert "before" in differentiator_of(run_of(backward, 100.0, position=position)).name
    central = np.gradient(position, 0.01, axis=0).astype(dtype)
    assert differentiator_of(run_of(central, 100.0, position=position)) is CENTRAL


def test_velocities_that_a_simulator_integrated_were_measured():
    _, _, velocity = motion(500.0)
    run = run_of(velocity, 500.0, position=np.cumsum(velocity / 500.0, axis=0))
    assert differentiator_of(run) is None
    way = np.diff(run.position, axis=0, prepend=run.position[:1])
    for by in (way * 500.0, way / np.diff(run.time, prepend=-0.002)[:, None]):
        assert differentiator_of(run_of(by, 500.0, position=run.position)) is not None


def test_velocities_differentiated_on_import_are_known(tmp_path):
    time, position, _ = motion(1000.0)
    position += noise(position.shape, 1e-5)
    np.savez(tmp_path / "run.npz", time=time, position=position)
    run = Run.load(tmp_path / "run.npz")
    assert differentiator_of(run) is SMOOTH
    assert bandwidth(run).usable == pytest.approx(194.5, abs=1)
    expected = savgol_filter(position, 7, 3, deriv=1, delta=1e-3, axis=0)
    inner = slice(10, -10)
    weights = np.array(SMOOTH.weights) * 1000
    ours = np.apply_along_axis(lambda x: np.convolve(x, weights[::-1], mode="same"), 0, position)
    np.testing.assert_allclose(ours[inner], expected[inner], atol=1e-9)
