import sys

import numpy as np
import pinocchio as pin
import pytest
from chains import chain, motion

from noisemodel import (
    KINDS,
    GeometryError,
    NoiseModelError,
    Robot,
    Surface,
    UnknownKindError,
    link_twists,
    noise,
    surface_speed,
)

EVERY = ("revolute", "continuous", "prismatic", "planar", "floating", "revolute")


@pytest.fixture(scope="module")
def panda():
    robot = Robot.load("panda")
    return robot, Surface.of(robot)


@pytest.fixture(params=["0 0 1", "1 2 3"])
def every(request, tmp_path):
    """A robot that has every kind of joint, and a moving base."""
    robot = chain(tmp_path, *EVERY, axis=request.param, floating_base=True)
    return robot, Surface.of(robot)


def terms(robot, surface, q, v):
    return [surface_speed(robot, surface, q, v, kind) for kind in "ABC"]


@pytest.mark.parametrize("kind", KINDS)
def test_standstill_is_silent(every, kind):
    robot, surface = every
    q, v = motion(robot)
    assert not surface_speed(robot, surface, q, 0 * v, kind).any()


@pytest.mark.parametrize("kind", KINDS)
def test_twice_the_velocity_is_twice_the_speed(every, kind):
    robot, surface = every
    q, v = motion(robot)
    once = surface_speed(robot, surface, q, v, kind)
    assert once[:, surface.area > 0].any()
    twice = surface_speed(robot, surface, q, -2 * v, kind)
    assert np.allclose(twice, 2 * once, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("kind", KINDS)
def test_noise_does_not_depend_on_the_place_of_the_base(every, kind):
    robot, surface = every
    q, v = motion(robot)
    elsewhere = q.copy()
    elsewhere[:, :7] = [5, -3, 1, 0.5, 0.5, 0.5, 0.5]
    here = surface_speed(robot, surface, q, v, kind)
    assert np.array_equal(surface_speed(robot, surface, elsewhere, v, kind), here)


def test_the_sum_of_the_terms_is_above_the_mean_which_is_below_the_root_mean_square(every):
    robot, surface = every
    q, v = motion(robot, samples=200)
    paper, mean, rms, normal = (
        surface_speed(robot, surface, q, v, kind) for kind in ("paper", "mean", "rms", "normal")
    )
    assert (mean <= paper * (1 + 1e-3)).all()  # B comes from a table
    assert (mean <= rms * (1 + 1e-12)).all()
    assert (normal <= rms * (1 + 1e-12)).all()
    assert (normal[:, surface.area > 0] > 0).all()
    assert np.array_equal(paper, sum(terms(robot, surface, q, v)))


def test_a_revolute_joint_alone_drives_its_link_at_rate_times_lever(tmp_path):
    robot = chain(tmp_path, "revolute", axis="1 2 3")
    surface = Surface.of(robot)
    q, v = motion(robot)
    a, b, c = terms(robot, surface, q, v)
    assert np.allclose(a, 0, atol=1e-15)
    assert np.allclose(b, 0, atol=1e-15)
    assert np.allclose(c, np.abs(v) * surface.lever, rtol=1e-12)
    mean = surface_speed(robot, surface, q, v, "mean")
    assert np.allclose(c, mean, rtol=5e-4)


def test_a_prismatic_joint_drives_its_link_at_its_own_speed(tmp_path):
    robot = chain(tmp_path, "prismatic", "prismatic", axis="0 3 4")
    surface = Surface.of(robot)
    q, v = motion(robot)
    a, b, c = terms(robot, surface, q, v)
    assert np.allclose(c, np.abs(v), rtol=1e-12)
    assert np.allclose(a[:, 1], np.abs(v[:, 0]), rtol=1e-12)
    assert np.allclose(b, 0, atol=1e-15)


def test_a_mimic_joint_drives_its_link_by_its_multiple_of_the_leader(tmp_path):
    mimic = '<mimic joint="joint1" multiplier="-3" offset="0.2"/>'
    robot = Robot.load(chain(tmp_path, "revolute", "revolute", follow=mimic).path, mimic=True)
    surface = Surface.of(robot)
    q, v = motion(robot)
    _, b, c = terms(robot, surface, q, v)
    assert np.allclose(c, np.abs(v) * [1, 3] * surface.lever, rtol=1e-12)
    assert b[:, 1].all()


def test_a_floating_base_is_carried_by_nothing():
    robot = Robot.load("solo12")
    surface = Surface.of(robot)
    q, v = motion(robot)
    a, b, c = terms(robot, surface, q, v)
    assert not a[:, 0].any()
    assert not b[:, 0].any()
    slides = v.copy()
    slides[:, 3:] = 0
    only = surface_speed(robot, surface, q, slides, "C")[:, 0]
    assert np.allclose(only, np.linalg.norm(v[:, :3], axis=1), rtol=1e-14)
    assert (c[:, 0] > only).all()


def test_only_the_part_that_a_parent_carries_is_in_a_and_b(panda):
    """With the last joint alone moving nothing carries; with the first alone all else does."""
    robot, surface = panda
    q, v = motion(robot)
    first = np.zeros_like(v)
    first[:, 0] = v[:, 0]
    a, b, c = terms(robot, surface, q, first)
    assert not c[:, 1:].any()
    assert (b[:, 1:] > 0).all()
    last = np.zeros_like(v)
    last[:, -1] = v[:, -1]
    a, b, c = terms(robot, surface, q, last)
    assert np.abs(a).max() < 1e-15
    assert not b.any()
    assert np.allclose(c[:, -1], np.abs(v[:, -1]))


def test_mean_squares_are_the_kinetic_energy_of_bodies_with_the_surfaces_for_masses():
    """2 T = sum of S <v²> for inertias of mass S, centroid r and S times the surface's own."""
    robot = Robot.load("solo12")
    surface = Surface.of(robot)
    q, v = motion(robot)
    model = robot.model.copy()
    for index, link in zip(surface.joint, surface.links, strict=True):
        about_origin = link.mean_square[3:, 3:]
        cross = pin.skew(link.centroid)
        inertia = link.area * (about_origin + cross @ cross)  # of the covariance, by Steiner
        model.inertias[int(index)] = pin.Inertia(link.area, link.centroid, inertia)
    data = model.createData()
    energy = [2 * pin.computeKineticEnergy(model, data, *state) for state in zip(q, v, strict=True)]
    squares = surface_speed(robot, surface, q, v, "rms") ** 2 @ surface.area
    assert np.allclose(squares, energy, rtol=1e-12)


def test_speeds_are_those_of_pinocchios_twists(panda):
    robot, surface = panda
    q, v = motion(robot)
    twists = link_twists(robot, q, v)[:, surface.joint]
    for kind, forms in (("rms", surface.mean_square), ("normal", surface.mean_square_normal)):
        squares = np.einsum("sli,lij,slj->sl", twists, forms, twists)
        assert np.allclose(surface_speed(robot, surface, q, v, kind) ** 2, squares, rtol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_a_run_is_the_same_in_one_piece_and_in_many(panda, kind, monkeypatch):
    robot, surface = panda
    q, v = motion(robot)
    whole = surface_speed(robot, surface, q, v, kind)
    monkeypatch.setattr(sys.modules["noisemodel.extended"], "CHUNK", 7)
    assert noise.CHUNK != 7
    assert np.allclose(surface_speed(robot, surface, q, v, kind), whole, rtol=1e-12, atol=1e-15)


def test_single_precision_is_computed_in_double(panda):
    robot, surface = panda
    q, v = (state.astype(np.float32) for state in motion(robot))
    exact = surface_speed(robot, surface, q.astype(np.float64), v.astype(np.float64))
    assert np.array_equal(surface_speed(robot, surface, q, v), exact)


def test_an_unknown_kind_is_refused_with_those_that_there_are(panda):
    with pytest.raises(UnknownKindError, match=r"no kind 'loud' of noise; there are paper, A, B"):
        surface_speed(*panda, *motion(panda[0]), "loud")


def test_the_surface_of_another_robot_is_refused(panda, tmp_path):
    robot = chain(tmp_path, "revolute")
    with pytest.raises(GeometryError, match="a surface of 9 links for 'chain', which has 1"):
        surface_speed(robot, panda[1], *motion(robot))


@pytest.mark.parametrize(
    ("q", "v", "message"),
    [
        (np.zeros((5, 8)), np.zeros((5, 9)), r"q has shape \(5, 8\), expected \(5, 9\)"),
        (np.zeros((5, 9)), np.zeros((4, 9)), r"v has shape \(4, 9\), expected \(5, 9\)"),
        (np.zeros(9), np.zeros(9), r"q has shape \(9,\), expected \(9, 9\)"),
        (np.zeros((5, 9)), np.full((5, 9), np.nan), "v: nan in row 0, column 0"),
        (np.full((5, 9), np.inf), np.zeros((5, 9)), "q: inf in row 0, column 0"),
    ],
)
def test_motions_that_cannot_be_are_refused(panda, q, v, message):
    with pytest.raises(NoiseModelError, match=message):
        surface_speed(*panda, q, v)
