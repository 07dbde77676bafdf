import numpy as np
import pytest
from chains import BAR, chain

from noisemodel import KINDS, CornerError, NoiseModelError, Surface, extended, extended_chunks
from noisemodel.extended import corner_frequencies

RATE = 20_000.0
SPHERE = '<visual><geometry><sphere radius="0.1"/></geometry></visual>'


def slider(tmp_path, *shapes):
    robot = chain(tmp_path, *["prismatic"] * len(shapes), shapes=shapes)
    return robot, Surface.of(robot)


def shaking(robot, frequency, samples=4000):
    """All joints go to and fro with the velocity of a cosine."""
    phase = 2 * np.pi * frequency * np.arange(samples) / RATE
    ones = np.ones((1, robot.nv))
    q = np.sin(phase)[:, None] / (2 * np.pi * frequency) * ones
    return q, np.cos(phase)[:, None] * ones


def shaken(robot, surface, frequency, kind="normal", **options):
    """Mean power after the filter's transient."""
    motion = shaking(robot, frequency)
    return extended(robot, surface, *motion, kind, **options).total[1000:].mean()


@pytest.mark.parametrize("frequency", [50.0, 200.0, 770.0, 2000.0])
def test_a_shaking_sphere_radiates_as_acoustics_has_it(tmp_path, frequency):
    """sigma = x^4 / (4 + x^4) with x = 2 pi f a / c."""
    robot, surface = slider(tmp_path, SPHERE)
    x = 2 * np.pi * frequency * np.sqrt(surface.area[0] / (4 * np.pi)) / 343.2
    full = shaken(robot, surface, frequency)
    radiated = shaken(robot, surface, frequency, efficiency="dipole", rate=RATE)
    assert radiated / full == pytest.approx(x**4 / (4 + x**4), rel=0.03)


def test_the_corner_of_a_sphere_is_where_its_efficiency_is_half(tmp_path):
    _, surface = slider(tmp_path, SPHERE, BAR, "")
    corners = corner_frequencies(surface, sound_speed=343.2)
    assert corners[0] == pytest.approx(np.sqrt(2) * 343.2 / (2 * np.pi * 0.1), rel=1e-2)
    radius = np.sqrt(surface.area / (4 * np.pi))[:2]
    np.testing.assert_allclose(corners[:2] * radius, np.sqrt(2) * 343.2 / (2 * np.pi), rtol=1e-12)
    assert corners[2] == np.inf


def test_uniform_motion_is_silent_from_the_first_sample_on(tmp_path):
    robot, surface = slider(tmp_path, SPHERE)
    q = np.linspace(0, 1, 500)[:, None]
    loud = extended(robot, surface, q, np.full_like(q, 3.0))
    radiated = extended(robot, surface, q, np.full_like(q, 3.0), efficiency="dipole", rate=RATE)
    assert radiated.total.max() < 1e-20 * loud.total.max()


@pytest.mark.parametrize("kind", KINDS)
def test_chunks_carry_on_with_the_filters_of_the_chunk_before(tmp_path, kind):
    robot, surface = slider(tmp_path, SPHERE, BAR)
    q, v = shaking(robot, 130.0, samples=300)
    options = {"efficiency": "dipole", "rate": RATE, "v_desired": v[::-1] ** 3}
    whole = extended(robot, surface, q, v, kind, **options).power
    for chunk in (1, 64):
        parts = extended_chunks(robot, surface, q, v, kind, chunk=chunk, **options)
        together = np.concatenate([part.power for part in parts])
        assert np.allclose(together, whole, rtol=1e-9, atol=1e-12 * whole.max())


def test_terms_add_up_after_the_filter_too(tmp_path):
    robot, surface = slider(tmp_path, SPHERE, BAR)
    q, v = shaking(robot, 130.0)
    roots = {
        kind: np.sqrt(extended(robot, surface, q, v, kind, efficiency="dipole", rate=RATE).power)
        for kind in ("paper", "A", "B", "C")
    }
    assert np.allclose(roots["paper"], roots["A"] + roots["B"] + roots["C"], rtol=1e-9)
    assert roots["A"][:, 1].any()


def test_the_slower_the_quieter(tmp_path):
    robot, surface = slider(tmp_path, SPHERE)
    powers = [
        shaken(robot, surface, frequency, "paper", efficiency="dipole", rate=RATE)
        for frequency in (100.0, 200.0, 400.0)
    ]
    assert powers[0] < powers[1] / 10 < powers[2] / 100


def test_links_that_are_too_small_for_the_rate_are_named(tmp_path):
    tiny = SPHERE.replace("0.1", "0.001")
    robot, surface = slider(tmp_path, SPHERE, tiny, "")
    q, v = shaking(robot, 100.0)
    message = (
        r"at 20000 Hz .* below 10000 Hz, these links are too small: link2 \(77\d\d\d Hz\); give"
    )
    with pytest.raises(CornerError, match=message) as caught:
        extended(robot, surface, q, v, efficiency="dipole", rate=RATE)
    assert caught.value.links == ("link2",)
    assert isinstance(caught.value, NoiseModelError)
    with pytest.raises(CornerError, match="link1"):
        extended(robot, surface, q, v, efficiency="dipole", rate=1000.0)


def test_links_without_geometry_are_no_hindrance(tmp_path):
    robot, surface = slider(tmp_path, SPHERE, "")
    noise = extended(robot, surface, *shaking(robot, 300.0), efficiency="dipole", rate=RATE)
    assert not noise.power[:, 1].any()
    assert noise.power[:, 0].any()
