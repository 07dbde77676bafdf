import tracemalloc

import numpy as np
import pytest
from chains import BAR, chain, motion

from noisemodel import (
    KINDS,
    Noise,
    NoiseModelError,
    Robot,
    Surface,
    UnknownKindError,
    extended,
    extended_chunks,
    surface_speed,
)

IMPEDANCE = 1.204 * 343.2


@pytest.fixture(scope="module")
def solo():
    robot = Robot.load("solo12")
    return robot, Surface.of(robot)


def test_power_is_impedance_times_area_times_squared_speed(solo):
    robot, surface = solo
    q, v = motion(robot)
    for kind in KINDS:
        noise = extended(robot, surface, q, v, kind)
        speed = surface_speed(robot, surface, q, v, kind)
        assert np.allclose(noise.power, IMPEDANCE * surface.area * speed**2, rtol=1e-12)
        assert np.allclose(noise.total, noise.power.sum(axis=1), rtol=1e-14)


def test_standstill_is_silent(solo):
    robot, surface = solo
    q, v = motion(robot)
    noise = extended(robot, surface, q, 0 * v)
    assert not noise.power.any()
    assert (noise.level == -np.inf).all()
    assert (noise.pressure_level(1.0) == -np.inf).all()
    assert not noise.shares().any()


def test_twice_the_velocity_is_four_times_the_power(solo):
    robot, surface = solo
    q, v = motion(robot)
    once, twice = (extended(robot, surface, q, scale * v) for scale in (1, 2))
    assert np.allclose(twice.power, 4 * once.power, rtol=1e-12)
    assert np.allclose(twice.level - once.level, 20 * np.log10(2), rtol=1e-10)


def test_pressure_halves_with_twice_the_distance_and_spreads_over_a_sphere(solo):
    robot, surface = solo
    noise = extended(robot, surface, *motion(robot))
    near = noise.pressure(0.5)
    # the intensity p² / (rho c) over the sphere is the power
    assert np.allclose(near**2 / IMPEDANCE * 4 * np.pi * 0.5**2, noise.total, rtol=1e-12)
    assert np.allclose(noise.pressure(1.0), near / 2, rtol=1e-14)


def test_a_watt_has_120_decibels_and_a_pascal_has_94():
    watt = Noise(np.array([[0.25, 0.75]]), ("left", "right"))
    assert watt.level[0] == pytest.approx(120.0, abs=1e-12)
    distance = float(watt.pressure(1.0)[0])  # where the pressure is 1 Pa
    assert watt.pressure_level(distance)[0] == pytest.approx(93.979, abs=1e-3)


@pytest.mark.parametrize(("watts", "decibels"), [(1.0, "120.0"), (1e-3, "90.0"), (2.0, "123.0")])
def test_a_noise_prints_the_level_of_its_mean_power(watts, decibels):
    noise = Noise(watts * np.array([[0.5, 0.5], [0.25, 0.75], [0.0, 1.0]]), ("left", "right"))
    assert str(noise).startswith(f"3 samples, mean sound power {decibels} dB re 1 pW\n")


def test_air_and_efficiency_scale_the_power(solo):
    robot, surface = solo
    q, v = motion(robot)
    plain = extended(robot, surface, q, v)
    thin = extended(robot, surface, q, v, density=0.602, sound_speed=2 * 343.2, efficiency=0.5)
    assert np.allclose(thin.power, 0.5 * plain.power, rtol=1e-12)
    each = np.linspace(0.1, 1.0, len(surface.links))
    weighed = extended(robot, surface, q, v, efficiency=each)
    assert np.allclose(weighed.power, each * plain.power, rtol=1e-12)


def test_desired_motion_adds_its_own_power_with_a_resting_base(solo):
    robot, surface = solo
    (q, v), (q_desired, v_desired) = motion(robot), motion(robot, seed=2)
    both = extended(robot, surface, q, v, q_desired=q_desired, v_desired=v_desired)
    rests = v_desired.copy()
    rests[:, :6] = 0
    apart = [extended(robot, surface, *states) for states in ((q, v), (q_desired, rests))]
    assert np.allclose(both.power, apart[0].power + apart[1].power, rtol=1e-12)
    assert v_desired[:, :6].all()  # what was given is as it was
    same = extended(robot, surface, q, v, v_desired=v_desired)
    assert np.allclose(
        same.power, apart[0].power + extended(robot, surface, q, rests).power, rtol=1e-12
    )


@pytest.mark.parametrize("chunk", [1, 7, 40, 1000])
def test_chunks_put_together_are_the_whole(solo, chunk):
    robot, surface = solo
    q, v = motion(robot)
    whole = extended(robot, surface, q, v, v_desired=v[::-1])
    chunks = list(extended_chunks(robot, surface, q, v, v_desired=v[::-1], chunk=chunk))
    assert len(chunks[0].power) == min(chunk, len(q))
    together = np.concatenate([part.power for part in chunks])
    assert np.allclose(together, whole.power, rtol=1e-12, atol=1e-15)


def test_chunks_need_no_memory_for_the_whole(solo):
    robot, surface = solo
    q, v = np.zeros((40_000, robot.nq)), np.ones((40_000, robot.nv))
    twists = len(q) * len(surface.links) * 6 * 8
    tracemalloc.start()
    for _ in extended_chunks(robot, surface, q, v, chunk=500):
        pass
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 0.1 * twists


def test_shares_add_up_link_by_link_and_stretch_by_stretch(solo):
    robot, surface = solo
    noise = extended(robot, surface, *motion(robot))
    stretches = [(0, 15), (15, 40), (0, 40)]
    shares = noise.shares(stretches)
    assert shares.shape == (3, len(surface.links))
    assert np.allclose(shares.sum(axis=1), 1.0, rtol=1e-14)
    first, second, whole = (noise.total[start:stop].sum() for start, stop in stretches)
    assert np.allclose(shares[0] * first + shares[1] * second, shares[2] * whole, rtol=1e-12)
    assert np.array_equal(noise.shares(), shares[2:])
    assert noise.shares([]).shape == (0, len(surface.links))


def test_the_shares_of_a_silent_stretch_are_zero(solo):
    robot, surface = solo
    q, v = motion(robot)
    v[:10] = 0
    shares = extended(robot, surface, q, v).shares([(0, 10), (0, 40)])
    assert not shares[0].any()
    assert shares[1].sum() == pytest.approx(1.0)


def test_a_link_without_geometry_radiates_nothing(tmp_path):
    robot = chain(tmp_path, "revolute", "revolute", shapes=["", BAR])
    noise = extended(robot, Surface.of(robot), *motion(robot))
    assert not noise.power[:, 0].any()
    assert noise.power[:, 1].all()


def test_noise_prints_its_level_and_its_loudest_links(solo):
    robot, surface = solo
    text = str(extended(robot, surface, *motion(robot)))
    assert "40 samples, mean sound power" in text
    assert "dB re 1 pW" in text
    assert surface.names[0] in text


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"density": 0.0}, "density is 0 kg/m³, expected a positive number"),
        ({"density": np.nan}, "density is nan kg/m³"),
        ({"sound_speed": -1.0}, "sound_speed is -1 m/s, expected a positive number"),
        ({"efficiency": 0.0}, "efficiency is 0, expected positive numbers"),
        ({"efficiency": [1.0] * 12 + [-0.5]}, r"efficiency is -0\.5, expected positive"),
        ({"efficiency": [1.0, 1.0]}, r"efficiency has shape \(2,\), expected one number or \(13,"),
        ({"efficiency": np.inf}, "efficiency is inf, expected positive numbers"),
        ({"efficiency": "monopole"}, "efficiency is 'monopole', expected numbers or 'dipole'"),
        ({"efficiency": "dipole"}, "efficiency 'dipole' needs the rate of the samples"),
        ({"efficiency": "dipole", "rate": 0.0}, "rate is 0 Hz, expected a positive number"),
        ({"q_desired": np.zeros((40, 19))}, "q_desired is given and v_desired is not"),
        ({"v_desired": np.zeros((40, 12))}, r"v_desired has shape \(40, 12\), expected \(40, 18"),
        ({"v_desired": np.full((40, 18), np.nan)}, "v_desired: nan in row 0, column 0"),
        (
            {"v_desired": np.zeros((30, 18)), "q_desired": np.zeros((30, 19))},
            "v has 40 samples, v_desired 30",
        ),
    ],
)
def test_numbers_and_motions_that_cannot_be_are_refused(solo, options, message):
    robot, surface = solo
    with pytest.raises(NoiseModelError, match=message):
        extended(robot, surface, *motion(robot), **options)


def test_unknown_kinds_and_chunks_of_nothing_are_refused_before_the_first_chunk(solo):
    robot, surface = solo
    with pytest.raises(UnknownKindError, match="no kind 'ABC'"):
        extended_chunks(robot, surface, *motion(robot), "ABC")
    with pytest.raises(NoiseModelError, match="chunk is 0 samples, expected a positive number"):
        extended_chunks(robot, surface, *motion(robot), chunk=0)


@pytest.mark.parametrize("distance", [0.0, -1.0, np.nan, np.inf])
def test_distances_that_are_not_positive_are_refused(distance):
    with pytest.raises(NoiseModelError, match="distance is .* m, expected a positive number"):
        Noise(np.ones((1, 1)), ("link",)).pressure(distance)


@pytest.mark.parametrize("stretch", [(0, 0), (3, 2), (-1, 2), (0, 5)])
def test_stretches_outside_of_the_samples_are_refused(stretch):
    with pytest.raises(
        NoiseModelError, match="a stretch from sample .* expected one within 0 to 4"
    ):
        Noise(np.ones((4, 1)), ("link",)).shares([stretch])
