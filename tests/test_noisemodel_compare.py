import sys
from contextlib import nullcontext

import numpy as np
import pytest
from chains import BAR, chain, motion

from noisemodel import (
    GeometryError,
    NoiseModelError,
    Robot,
    Surface,
    UnknownKindError,
    compare,
    extended,
    simplified,
)
from noisemodel.compare import (
    check_length,
    contrasts,
    correlation,
    envelopes,
    log_spectra,
    spectral_distances,
)

RATE = 1000.0


@pytest.fixture(scope="module")
def panda():
    robot = Robot.load("panda")
    return robot, Surface.of(robot)


def swinging(robot, samples=2000):
    """Every joint swings at its own rate."""
    time = np.arange(samples)[:, None] / RATE
    rates = 2 * np.pi * np.linspace(0.7, 3.1, robot.nv)
    return np.sin(rates * time) / rates, np.cos(rates * time)


@pytest.fixture(scope="module")
def comparison(panda):
    return compare(panda[0], *swinging(panda[0]), rate=RATE, surface=panda[1], events=[(500, 700)])


def test_each_kind_is_as_itself(comparison):
    assert np.allclose(np.diag(comparison.correlation), 1.0, rtol=1e-12)
    assert not np.diag(comparison.distance).any()


def test_comparing_has_no_direction(comparison):
    assert np.allclose(comparison.correlation, comparison.correlation.T, rtol=1e-12)
    assert np.array_equal(comparison.distance, comparison.distance.T)
    assert (np.abs(comparison.correlation) <= 1 + 1e-12).all()


def test_one_revolute_joint_alone_makes_the_same_noise_in_every_kind(tmp_path):
    """With one degree of freedom all kinds are the same up to a factor."""
    robot = chain(tmp_path, "revolute")
    found = compare(robot, *swinging(robot), rate=RATE, events=[(0, 100)])
    assert np.allclose(found.correlation, 1.0, rtol=1e-9)
    assert np.allclose(found.distance, 0.0, atol=1e-6)
    assert np.ptp(found.contrast) < 1e-9
    assert np.allclose(found.shares, 1.0)
    assert np.allclose(found.terms, [[0, 0, 1]], atol=1e-9)


def test_a_factor_is_no_difference(panda):
    robot, surface = panda
    q, v = swinging(robot)
    one, ten = (compare(robot, q, scale * v, rate=RATE, surface=surface) for scale in (1, 10))
    assert np.allclose(one.correlation, ten.correlation, rtol=1e-9)
    assert np.allclose(one.distance, ten.distance, rtol=1e-9)
    assert np.allclose(one.terms, ten.terms, rtol=1e-9)


def test_shares_are_those_of_the_noise(panda, comparison):
    robot, surface = panda
    for kind in ("paper", "normal"):
        noise = extended(robot, surface, *swinging(robot), kind)
        found = comparison.shares[comparison.kinds.index(kind)]
        assert np.allclose(found, noise.shares()[0], rtol=1e-12)
    assert np.allclose(comparison.shares.sum(axis=1), 1.0, rtol=1e-12)


def test_the_simplified_noise_shares_by_joint_velocity(panda, comparison):
    _, v = swinging(panda[0])
    squares = (v**2).sum(axis=0)
    assert np.allclose(comparison.shares[0], squares / squares.sum(), rtol=1e-12)


def test_a_joint_that_follows_has_no_share_of_the_simplified_noise(panda):
    robot = Robot.load("panda", mimic=True)
    q, v = swinging(robot)
    found = compare(robot, q, v, ["simplified"], rate=RATE)
    assert found.shares[0, -1] == 0.0
    assert found.shares[0, -2] > 0.0
    assert found.shares[0].sum() == pytest.approx(1.0)


def test_the_terms_are_shares_of_the_power_of_paper(panda, comparison):
    assert comparison.terms.shape == (9, 3)
    assert comparison.terms.sum() == pytest.approx(1.0, rel=1e-12)
    paper = comparison.shares[comparison.kinds.index("paper")]
    assert np.allclose(comparison.terms.sum(axis=1), paper, rtol=1e-12)


def test_an_event_stands_out_by_its_level(tmp_path):
    robot = chain(tmp_path, "revolute")
    v = np.ones((1000, 1))
    v[400:500] = 10.0
    found = compare(robot, np.zeros((1000, 1)), v, rate=RATE, events=[(400, 500)])
    assert np.allclose(found.contrast, 20.0, rtol=1e-9)


def test_a_contrast_is_the_ratio_of_mean_powers():
    powers = np.array([[1.0, 1, 40, 60, 30, 1], [2, 2, 2, 2, 2, 2]])
    np.testing.assert_allclose(contrasts(powers, [(2, 4), (3, 5)]), [10 * np.log10(130 / 3), 0.0])
    for events in ([], [(0, 6)], [(0, 3), (3, 6)]):
        assert np.isnan(contrasts(powers, events)).all()
    silent = np.array([[0.0, 0, 5, 5]])
    assert contrasts(silent, [(2, 4)]) == [np.inf]


def test_envelopes_are_root_mean_squares_of_whole_stretches():
    powers = np.array([[1.0, 7, 9, 9, 5], [0, 2, 8, 0, 99]])
    np.testing.assert_allclose(envelopes(powers, 2), [[2.0, 3.0], [1.0, 2.0]])


def test_signals_are_correlated_as_numpy_does():
    signals = np.random.default_rng(6).normal([[1.0], [2.0], [3.0]], size=(3, 50))
    np.testing.assert_allclose(correlation(signals), np.corrcoef(signals), rtol=1e-12)
    assert np.isnan(correlation(np.array([[1.0, 1, 1], [1, 2, 3]]))[0]).all()


def test_spectra_are_of_windows_that_overlap_by_half():
    time = np.arange(64)
    signal = np.sin(2 * np.pi * time / 4) * (time >= 32)
    spectra = log_spectra(signal, 16)
    assert spectra.shape == (7, 9)  # 64 / 8 - 1 windows, lines up to half the rate
    assert spectra.max() == spectra[4:, 4].max() == 0.0
    np.testing.assert_array_equal(spectra[:3], -100.0)
    window = np.abs(np.fft.rfft(signal[40:56] * np.hanning(16))) ** 2
    np.testing.assert_allclose(
        spectra[5, 3:6], 10 * np.log10(window / window.max())[3:6] + spectra[5, 4], atol=1e-9
    )
    np.testing.assert_array_equal(log_spectra(0 * signal, 16), np.full((7, 9), -100.0))


def test_spectra_differ_by_the_mean_square_after_the_mean():
    one, other = np.array([[0.0, -4], [0, -8]]), np.array([[-3.0, -3], [-9, -5]])
    found = spectral_distances([one, other, one - 7.0])
    difference = (one - other) - (one - other).mean()
    np.testing.assert_allclose(found[0, 1], (difference**2).mean(axis=0))
    np.testing.assert_array_equal(found[1, 0], found[0, 1])
    np.testing.assert_allclose(found[1, 2], found[1, 0])
    np.testing.assert_array_equal(found[0, 2], 0.0)
    np.testing.assert_array_equal(found[[0, 1, 2], [0, 1, 2]], 0.0)


def test_without_events_there_is_no_contrast(panda):
    found = compare(panda[0], *swinging(panda[0]), ["paper", "simplified"], rate=RATE)
    assert np.isnan(found.contrast).all()
    assert "contrast" not in str(found)


def test_a_vibration_that_one_kind_lacks_is_found_in_its_frequencies(tmp_path):
    """A slider's carrier without geometry vibrates: "C" has no link that shows it."""
    robot = chain(tmp_path, "revolute", "prismatic", shapes=["", BAR])
    q, v = swinging(robot, samples=4000)
    v[:, 0] += 0.5 * np.cos(2 * np.pi * 200 * np.arange(4000) / RATE)
    found = compare(robot, q, v, ["C", "paper"], rate=RATE)
    assert found.distance_by_frequency.shape == (2, 2, len(found.frequency))
    assert found.frequency[0] == 0.0
    assert found.frequency[-1] == pytest.approx(RATE / 2, rel=1e-12)
    overall = np.sqrt(np.mean(found.distance_by_frequency[0, 1] ** 2))
    assert overall == pytest.approx(found.distance[0, 1], rel=1e-12)
    apart = found.distance_by_frequency[0, 1]
    assert apart[np.abs(found.frequency - 200).argmin()] > 2 * np.median(apart)


def test_silence_is_compared_without_a_warning(panda):
    robot, surface = panda
    q, v = swinging(robot)
    found = compare(robot, q, 0 * v, rate=RATE, surface=surface)
    assert np.isnan(found.correlation).all()
    assert not found.distance.any()
    assert not found.shares.any()
    assert not found.terms.any()


def test_a_comparison_prints_as_a_table(comparison):
    text = str(comparison)
    for word in ("simplified", "normal", "correlation", "spectral distance [dB]", "contrast"):
        assert word in text
    assert "of the energy of paper: A " in text
    assert max(map(len, text.splitlines())) <= 28 + 6 * 11


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"kinds": ["paper", "loud"]}, UnknownKindError, "no kind 'loud' of noise; .* simplified"),
        ({"kinds": []}, NoiseModelError, "no kinds to compare, expected some of simplified"),
        ({"rate": 0.0}, NoiseModelError, "rate is 0 Hz"),
        ({"rate": 30.0}, NoiseModelError, "2000 samples at 30 Hz, expected .* 40 Hz"),
        ({"rate": 1e6}, NoiseModelError, r"2000 samples at 1e\+06 Hz, expected 0\.1024 s at least"),
        ({"events": [(5, 5)]}, NoiseModelError, "a stretch from sample 5 to 5"),
    ],
)
def test_what_cannot_be_compared_is_refused(panda, options, error, message):
    with pytest.raises(error, match=message):
        compare(panda[0], *swinging(panda[0]), **({"rate": RATE} | options))


def test_the_surface_of_another_robot_is_refused(panda, tmp_path):
    robot = chain(tmp_path, "revolute")
    with pytest.raises(GeometryError, match="which has 1"):
        compare(robot, *motion(robot, samples=200), rate=RATE, surface=panda[1])


@pytest.mark.parametrize(
    ("samples", "rate", "fits"),
    [
        (1024, 10_000.0, True),
        (1023, 10_000.0, False),
        (4, 40.0, True),
        (3, 40.0, False),
        (100, 34.0, False),
    ],
)
def test_a_motion_has_one_spectrum_at_least_of_four_samples(samples, rate, fits):
    text = rf"^{samples} samples at {rate:g} Hz, expected 0\.1024 s at least and 40 Hz$"
    with nullcontext() if fits else pytest.raises(NoiseModelError, match=text):
        check_length(samples, rate)


def test_envelopes_are_root_mean_squares_of_20_milliseconds(tmp_path):
    robot = chain(tmp_path, "revolute", "prismatic")
    q, v = swinging(robot, samples=1990)
    found = compare(robot, q, v, ["simplified", "mean", "rms"], rate=RATE)
    surface = Surface.of(robot)
    power = [simplified(v) ** 2]
    power += [extended(robot, surface, q, v, kind).power.sum(axis=1) for kind in ("mean", "rms")]
    rms = np.sqrt(np.array(power)[:, :1980].reshape(3, 99, 20).mean(axis=2))
    np.testing.assert_allclose(found.correlation, np.corrcoef(rms), rtol=1e-9)
    np.testing.assert_allclose(found.frequency, np.arange(52) * RATE / 102)
    odd = compare(robot, q, v, ["simplified", "mean"], rate=1010.0)
    np.testing.assert_allclose(odd.frequency, np.arange(52) * 1010.0 / 103)
    assert odd.distance_by_frequency.shape == (2, 2, 52)


def test_motions_are_estimated_in_chunks_as_whole(tmp_path, monkeypatch):
    robot = chain(tmp_path, "revolute", "prismatic", floating_base=True)
    q, v = motion(robot, samples=200)
    whole = compare(robot, q, v, rate=RATE)
    monkeypatch.setattr(sys.modules["noisemodel.compare"], "CHUNK", 7)
    chunks = compare(robot, q, v, rate=RATE)
    for name in ("correlation", "distance", "shares", "terms"):
        np.testing.assert_allclose(getattr(chunks, name), getattr(whole, name), rtol=1e-9)
    squares = np.mean(v**2, axis=0)
    shares = np.array([squares[:6].sum(), squares[6], squares[7]]) / squares.sum()
    np.testing.assert_allclose(whole.shares[0], shares, rtol=1e-12)


def test_q_v_and_their_rate_belong_together(tmp_path):
    robot = chain(tmp_path, "revolute")
    q, v = swinging(robot)
    whole = {"q": q, "v": v, "rate": RATE}
    assert compare(robot, **whole).kinds == ("simplified", "C", "paper", "mean", "rms", "normal")
    for name in ("q", "v", "rate"):
        with pytest.raises(NoiseModelError, match="^expected q, v and their rate, and no other mo"):
            compare(robot, **{key: each for key, each in whole.items() if key != name})
    with pytest.raises(NoiseModelError, match="^expected q, v and their rate, and no other mo"):
        compare(robot, **whole, motion="excitation")
    with pytest.raises(NoiseModelError, match=r"^q and v are given; expected one Robot, or motion"):
        compare([robot], **whole)
