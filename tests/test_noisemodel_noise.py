"""Simplified noise and its norms; sound power of links by samples, and by moments in bins."""

import sys
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from chains import BAR, as_run, chain, motion, surface_speed
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import noisemodel as nm
from inspector.analysis import estimate
from noisemodel import (
    KINDS,
    GeometryError,
    Noise,
    NoiseModelError,
    Robot,
    Run,
    Surface,
    UnknownKindError,
    extended,
    simplified,
)
from noisemodel.compare import moving
from noisemodel.noise import by_moments, by_samples, link_noise, second_moments, vibrating

VELOCITIES = arrays(
    np.float64, st.tuples(st.integers(1, 20), st.integers(0, 5)), elements=st.floats(-100, 100)
)


def test_measured_and_desired_motion_add_as_powers_and_one_joint_is_its_speed():
    assert simplified(np.array([[3.0, 0.0]]), np.array([[4.0]])) == [5.0]
    assert np.array_equal(simplified(np.array([[3.0], [-4.0], [0.0]])), [3.0, 4.0, 0.0])


@given(VELOCITIES, st.floats(0, 10))
def test_noise_grows_with_the_speed_whatever_the_signs_and_the_order_of_joints(velocity, factor):
    once, faster = (simplified(way * velocity, way * velocity) for way in (1.0, factor))
    assert np.allclose(faster, factor * once, rtol=1e-12, atol=1e-12)
    assert np.allclose(simplified(velocity), simplified(-velocity[:, ::-1]), rtol=1e-14)


def test_single_precision_is_summed_in_double():
    velocity = np.full((1, 40), 0.1, dtype=np.float32)
    noise = simplified(velocity)
    assert noise.dtype == np.float64
    assert noise[0] == pytest.approx(float(np.float32(0.1)) * np.sqrt(40), rel=1e-15)


def test_velocities_of_another_length_or_without_a_joint_axis_are_refused():
    with pytest.raises(NoiseModelError, match="velocity has 3 samples, velocity_desired 4"):
        simplified(np.zeros((3, 2)), np.zeros((4, 2)))
    with pytest.raises(NoiseModelError, match=r"shape \(3,\), expected \(samples, joints\)"):
        simplified(np.zeros(3))


SAMPLES = 40
generator = np.random.default_rng(5)
velocity, desired, base = (generator.normal(size=(SAMPLES, width)) for width in (3, 3, 6))


def run(**signals):
    names = {"joint_names": ("a", "b", "c"), **signals}
    return nm.Run(time=np.arange(SAMPLES) / 1000, velocity=velocity, **names)


def test_measured_and_desired_norms_make_the_noise():
    norms = nm.norms(run(velocity_desired=desired, base_velocity=base))
    np.testing.assert_allclose(
        norms["noise"], np.hypot(norms["measured"], norms["desired"]), rtol=1e-12
    )
    whole = np.hstack((base, velocity))
    np.testing.assert_allclose(norms["measured"], np.linalg.norm(whole, axis=1), rtol=1e-12)


def test_errors_are_between_joints_of_one_name():
    swapped = nm.norms(run(velocity_desired=velocity[:, ::-1], desired_joint_names=("c", "b", "a")))
    assert not swapped["error"].any()
    fewer = nm.norms(run(velocity_desired=desired[:, :2], desired_joint_names=("b", "c")))
    error = np.linalg.norm(desired[:, :2] - velocity[:, 1:], axis=1)
    np.testing.assert_allclose(fewer["error"], error, rtol=1e-12)


def test_what_a_run_does_not_have_makes_no_norm_and_nothing_joint_by_joint():
    alone, others = run(), run(velocity_desired=desired[:, :1], desired_joint_names=("tool",))
    assert nm.norms(alone).keys() == {"noise", "measured"}
    assert nm.norms(others).keys() == {"noise", "measured", "desired"}
    assert nm.by_joint(alone).keys() == {"measured_joints"}
    np.testing.assert_array_equal(nm.by_joint(alone)["measured_joints"], velocity.T)
    assert nm.by_joint(others) == {}


def test_joints_are_those_that_are_desired_as_well_as_measured():
    both = nm.by_joint(run(velocity_desired=desired[:, :2], desired_joint_names=("c", "a")))
    np.testing.assert_array_equal(both["measured_joints"], velocity[:, [0, 2]].T)
    np.testing.assert_array_equal(both["desired_joints"], desired[:, [1, 0]].T)
    np.testing.assert_array_equal(
        both["error_joints"], both["desired_joints"] - both["measured_joints"]
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
        assert np.allclose(noise.shares, noise.power.sum(axis=0) / noise.total.sum(), rtol=1e-12)


def test_standstill_is_silent(solo):
    robot, surface = solo
    q, v = motion(robot)
    noise = extended(robot, surface, q, 0 * v)
    assert not noise.power.any()
    assert (noise.level == -np.inf).all()
    assert not noise.shares.any()


def test_pressure_halves_with_twice_the_distance_and_spreads_over_a_sphere(solo):
    robot, surface = solo
    noise = extended(robot, surface, *motion(robot))
    near = noise.pressure(0.5)
    # the intensity p² / (rho c) over the sphere is the power
    assert np.allclose(near**2 / IMPEDANCE * 4 * np.pi * 0.5**2, noise.total, rtol=1e-12)
    assert np.allclose(noise.pressure(1.0), near / 2, rtol=1e-14)


@pytest.mark.parametrize(("watts", "decibels"), [(1.0, 120.0), (1e-3, 90.0), (2.0, 123.0103)])
def test_a_noise_has_the_level_of_its_total_power(watts, decibels):
    noise = Noise(watts * np.array([[0.5, 0.5], [0.25, 0.75], [0.0, 1.0]]), ("left", "right"))
    np.testing.assert_allclose(noise.level, decibels, atol=1e-4)


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


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"q_desired": np.zeros((40, 19))}, "q_desired is given and v_desired is not"),
        ({"v_desired": np.zeros((40, 12))}, r"v_desired has shape \(40, 12\), expected \(40, 18"),
        ({"v_desired": np.full((40, 18), np.nan)}, "v_desired: nan in row 0, column 0"),
        (
            {"v_desired": np.zeros((30, 18)), "q_desired": np.zeros((30, 19))},
            "v has 40 samples, v_desired 30",
        ),
        ({"q": np.zeros((40, 8))}, r"q has shape \(40, 8\), expected \(40, 19\)"),
        ({"v": np.zeros((4, 18))}, r"v has shape \(4, 18\), expected \(40, 18\)"),
        ({"q": np.zeros(19)}, r"q has shape \(19,\), expected \(19, 19\)"),
        ({"v": np.full((40, 18), np.nan)}, "v: nan in row 0, column 0"),
        ({"q": np.full((40, 19), np.inf)}, "q: inf in row 0, column 0"),
        ({"kind": "loud"}, "no kind 'loud' of noise; there are paper, A, B"),
    ],
)
def test_motions_and_kinds_that_cannot_be_are_refused(solo, options, message):
    robot, surface = solo
    q, v = motion(robot)
    with pytest.raises(UnknownKindError if "kind" in options else NoiseModelError, match=message):
        extended(robot, surface, **({"q": q, "v": v} | options))


@pytest.mark.parametrize("distance", [0.0, -1.0, np.nan, np.inf])
def test_distances_that_are_not_positive_are_refused(distance):
    with pytest.raises(NoiseModelError, match="distance is .* m, expected a positive number"):
        Noise(np.ones((1, 1)), ("link",)).pressure(distance)


EVERY = ("revolute", "continuous", "prismatic", "planar", "floating", "revolute")


@pytest.fixture(params=["0 0 1", "1 2 3"])
def every(request, tmp_path):
    """A robot that has every kind of joint, and a moving base."""
    robot = chain(tmp_path, *EVERY, axis=request.param, floating_base=True)
    return robot, Surface.of(robot)


def terms(robot, surface, q, v):
    return [surface_speed(robot, surface, q, v, kind) for kind in "ABC"]


@pytest.mark.parametrize("kind", KINDS)
def test_speed_follows_the_velocity_and_not_the_place_of_the_base(every, kind):
    robot, surface = every
    q, v = motion(robot)
    once = surface_speed(robot, surface, q, v, kind)
    assert once[:, surface.area > 0].any()
    assert not surface_speed(robot, surface, q, 0 * v, kind).any()
    twice = surface_speed(robot, surface, q, -2 * v, kind)
    assert np.allclose(twice, 2 * once, rtol=1e-12, atol=1e-15)
    elsewhere = q.copy()
    elsewhere[:, :7] = [5, -3, 1, 0.5, 0.5, 0.5, 0.5]
    assert np.array_equal(surface_speed(robot, surface, elsewhere, v, kind), once)


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
    assert np.allclose(c, np.abs(v) * [link.lever for link in surface.links], rtol=1e-12)
    mean = surface_speed(robot, surface, q, v, "mean")
    assert np.allclose(c, mean, rtol=5e-4)


def test_a_floating_base_is_carried_by_nothing(solo):
    robot, surface = solo
    q, v = motion(robot)
    a, b, c = terms(robot, surface, q, v)
    assert not a[:, 0].any()
    assert not b[:, 0].any()
    slides = v.copy()
    slides[:, 3:] = 0
    only = surface_speed(robot, surface, q, slides, "C")[:, 0]
    assert np.allclose(only, np.linalg.norm(v[:, :3], axis=1), rtol=1e-14)
    assert (c[:, 0] > only).all()


def test_mean_squares_are_the_kinetic_energy_of_bodies_with_the_surfaces_for_masses(solo):
    """2 T = sum of S <v²> for inertias of mass S, centroid r and S times the surface's own."""
    robot, surface = solo
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


def test_the_surface_of_another_robot_is_refused(solo, tmp_path):
    robot = chain(tmp_path, "revolute")
    with pytest.raises(GeometryError, match="a surface of 13 links for 'chain', which has 1"):
        extended(robot, solo[1], *motion(robot))


@pytest.mark.parametrize("kind", ["paper", "normal"])
def test_motions_are_estimated_in_chunks_as_whole(solo, kind, monkeypatch):
    robot, surface = solo
    q, v = motion(robot)
    whole = extended(robot, surface, q, v, kind, v_desired=v[::-1]).power
    monkeypatch.setattr(sys.modules["noisemodel.noise"], "CHUNK", 7)
    together = extended(robot, surface, q, v, kind, v_desired=v[::-1]).power
    assert np.allclose(together, whole, rtol=1e-9, atol=1e-12 * whole.max())


def arm_run(rattling=None, *, rate=1000.0, seconds=4.0, **changes):
    """Move a UR5 slowly; one joint may rattle at 100 Hz from 2 s to 2.5 s."""
    time = np.arange(round(rate * seconds)) / rate
    names = Robot.load("ur5").joint_names
    velocity = 0.5 * np.cos(np.outer(time, np.linspace(0.5, 1.5, 6)))
    position = np.sin(np.outer(time, np.linspace(0.5, 1.5, 6)))
    if rattling is not None:
        during = (time >= 2.0) & (time < 2.5)
        velocity[during, rattling] += 0.2 * np.sin(2 * np.pi * 100 * time[during])
    fields = {"velocity": velocity, "position": position, "joint_names": names, "robot": "ur5"}
    return Run(**({"time": time} | fields | changes))


def test_desired_velocities_without_positions_are_taken_where_the_robot_is():
    run = arm_run(seconds=0.203)  # the last bin is shorter
    once = link_noise(run)
    assert once.time[-2:] == pytest.approx([0.195, 0.2015])
    both = link_noise(arm_run(seconds=0.203, velocity_desired=2 * run.velocity))
    np.testing.assert_allclose(both.power, 5 * once.power, rtol=1e-9)
    np.testing.assert_allclose(both.vibration, once.vibration, rtol=1e-12)


def test_the_loudest_link_is_the_one_with_the_largest_peak_and_joints_that_move_it_are_named():
    found = link_noise(arm_run(rattling=3))
    peaks = found.vibration.max(axis=0)
    assert [peaks[link] for link in found.loudest] == sorted(peaks, reverse=True)
    assert "wrist_1_joint" in found.movers[found.loudest[0]]
    movers = dict(zip(found.links, found.movers, strict=True))
    assert movers["shoulder_link"] == {"shoulder_pan_joint"}
    assert movers["wrist_3_link"] == set(Robot.load("ur5").joint_names)
    assert 200 <= found.vibration[:, found.loudest[0]].argmax() < 250


def test_vibration_has_no_running_mean_of_a_tenth_of_a_second():
    velocity = np.random.default_rng(5).normal([1.0, -2.0], size=(300, 2))
    valid = np.ones(300, dtype=bool)
    valid[120] = False
    found = vibrating(velocity, valid, 1000.0)
    for start, stop in ((0, 120), (121, 300)):
        for sample in range(start, stop):
            reach = min(50, sample - start, stop - 1 - sample)
            mean = velocity[sample - reach : sample + reach + 1].mean(axis=0)
            np.testing.assert_allclose(found[sample], velocity[sample] - mean, atol=1e-12)
    assert not found[120].any()


def test_what_is_missing_is_said_in_a_sentence_each(tmp_path):
    robot = chain(tmp_path, "revolute", "revolute", shapes=[BAR, ""], floating_base=True)
    time = np.arange(200) / 1000
    pose = np.tile([0.0, 0, 0, 0, 0, 0, 1], (200, 1))
    joints = {"joint_names": ("joint2",), "velocity": np.ones((200, 1)), "position": time[:, None]}
    run = Run(time=time, robot=str(robot.path), base_pose=pose, **joints)
    said = (
        "Not in the log, assumed stationary: joint1.",
        "Links without geometry make no noise: link0, link2.",
        "The run has no base velocity: its base is assumed stationary.",
    )
    assert link_noise(run).remarks == estimate(run, "paper").remarks == said
    assert moving(run)[2] == said[::2]
    assert len(link_noise(replace(run, base_velocity=np.zeros((200, 6)))).remarks) == 2


@pytest.mark.parametrize("kind", ["normal", "paper"])
def test_joints_that_mimic_one_follow_it_unless_the_run_has_them(tmp_path, kind):
    """The last two joints of a branch follow the first one of the other, three times as fast."""
    follow = '<mimic joint="joint1" multiplier="-3" offset="0.2"/>'
    chained = chain(tmp_path, *["revolute"] * 6, follow=follow, branch=4, mimic=True)
    surface, phase = Surface.of(chained), np.outer(np.arange(100) / 100, range(1, 5))
    v = np.cos(phase)
    _, b, c = terms(chained, surface, 0.01 * np.sin(phase), v)
    speeds = np.abs(v[:, [0, 1, 2, 3, 0, 0]]) * [1, 1, 1, 1, 3, 3]
    assert np.allclose(c, speeds * [link.lever for link in surface.links], rtol=1e-12)
    assert b[:, 4:].all()
    run = as_run(chained, 0.01 * np.sin(phase), v)
    power = extended(chained, surface, run.position, v, kind).power
    found = link_noise(run, kind)
    np.testing.assert_allclose(found.power.mean(axis=0), power.mean(axis=0), rtol=1e-3)
    np.testing.assert_array_equal(estimate(run, kind).power, power)
    np.testing.assert_array_equal(moving(run)[0].joint_names, chained.joint_names)
    assert (found.remarks, found.movers[-1]) == ((), {"joint4", "joint1"})
    also = {"joint_names": (*run.joint_names, "joint5"), "position": np.hstack((v, v))[:, :5]}
    assert list(Robot.of(replace(run, velocity=0 * also["position"], **also)).mimics) == ["joint6"]


def test_a_base_is_heard_without_its_pose(tmp_path):
    robot = chain(tmp_path, "revolute", floating_base=True)
    run = as_run(robot, *motion(robot, samples=400))
    for heard in (lambda one: link_noise(one).power, lambda one: estimate(one, "normal").power):
        np.testing.assert_allclose(heard(replace(run, base_pose=None)), heard(run), rtol=1e-6)


def test_a_long_run_has_no_more_bins_than_a_short_one():
    assert len(link_noise(arm_run(rate=100.0, seconds=120.0)).time) <= 4001


def vibration(robot, samples, *, moving):
    generator = np.random.default_rng(0)
    v = generator.normal(size=(samples, robot.nv))
    q = np.tile(robot.neutral, (samples, 1))
    q[:, 7:] = generator.uniform(-1, 1, robot.nq - 7)
    if moving:
        time = np.arange(samples)[:, None] / 1000
        q[:, 7:] += 0.5 * np.sin(2 * np.pi * time + np.arange(robot.nq - 7))
    return q, v


@pytest.mark.parametrize("offset", [0.0, 0.7])
@pytest.mark.parametrize("kind", ["normal", "paper"])
def test_the_noise_of_a_floating_robot_is_the_extended_one(solo, kind, offset):
    robot, surface = solo
    q, v = vibration(robot, 400, moving=True)
    q[:, :3] = [0.3, -0.2, 0.5]
    desired = {"velocity_desired": v[:, :5:-1], "position_desired": q[:, :6:-1] + offset}
    names = robot.joint_names[::-1]
    run = as_run(robot, q, v, robot="solo12", desired_joint_names=names, **desired)
    found = link_noise(run, kind)
    desired = dict(zip(("q_desired", "v_desired"), robot.desired(run), strict=True))
    noise = extended(robot, surface, *robot.configuration(run), kind, **desired).power
    np.testing.assert_allclose(found.power.mean(axis=0), noise.mean(axis=0), rtol=5e-3)
    assert (found.power.shape, found.links) == ((40, len(surface.names)), surface.names)
    assert found.total[7] == pytest.approx(noise[70:80].sum(axis=1).mean(), rel=0.05)
    np.testing.assert_allclose(found.time, 0.005 + 0.01 * np.arange(40))


@pytest.mark.parametrize("lost", [8, 9])
@pytest.mark.parametrize("kind", ["normal", "paper"])
def test_a_bin_that_begins_in_a_gap_takes_the_pose_of_its_valid_part(solo, kind, lost):
    robot, _ = solo
    q, v = vibration(robot, 200, moving=False)
    v[:] = v[0]
    valid = np.ones(200, dtype=bool)
    valid[100 : 100 + lost] = False  # the middle of the bin from 100 to 110 is lost
    run = {"joint_names": robot.joint_names, "time": np.arange(200) / 1000, "robot": "solo12"}
    whole = Run(velocity=v[:, 6:], position=q[:, 7:], **run)
    signals = {"velocity": v[:, 6:] * valid[:, None], "position": q[:, 7:] * valid[:, None]}
    holed = Run(valid=valid, **signals, **run)
    found, expected = link_noise(holed, kind).power, link_noise(whole, kind).power
    np.testing.assert_allclose(found[10], expected[10])


@pytest.mark.parametrize("chunk", [4, 25, 1000])
def test_power_of_samples_is_averaged_in_bins_whatever_the_chunks(tmp_path, monkeypatch, chunk):
    monkeypatch.setattr(sys.modules["noisemodel.noise"], "CHUNK", chunk)
    robot = chain(tmp_path, "revolute", "prismatic")
    q, v = motion(robot, samples=95)
    valid = np.ones(95, dtype=bool)
    valid[[*range(20, 30), 33, 41, 42]] = False
    run = as_run(robot, q * valid[:, None], v * valid[:, None], valid=valid)
    surface = Surface.of(robot)
    power = extended(robot, surface, *robot.configuration(run), "paper").power * valid[:, None]
    parts = [slice(first, first + 10) for first in range(0, 95, 10)]
    expected = [power[part].sum(axis=0) / max(valid[part].sum(), 1) for part in parts]
    found = by_samples(robot, surface, run, "paper", np.array([*range(0, 95, 10), 95]))
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert not found[2].any()


def test_power_of_moments_is_that_of_each_link_with_a_surface_and_of_each_motion(tmp_path):
    robot = chain(tmp_path, "revolute", "prismatic", "revolute", shapes=[BAR, "", BAR])
    surface = Surface.of(robot)
    q, v = motion(robot, samples=5)
    motions = [("rms", v), ("normal", v), ("normal", -2 * v)]
    moments = [(kind, each[:, :, None] * each[:, None]) for kind, each in motions]
    for (kind, each), found in zip(motions, by_moments(robot, surface, q, moments), strict=True):
        np.testing.assert_allclose(found, extended(robot, surface, q, each, kind).power, rtol=1e-9)
        assert (found > 0).any(axis=0).tolist() == [True, False, True]


def test_bins_of_moments_count_their_own_samples_and_nothing_in_gaps():
    random = np.random.default_rng(0)
    velocity, valid = random.normal(size=(67, 3)), np.ones(67, dtype=bool)
    valid[[3, *range(20, 40), 60, 64]] = False  # the second bin is a gap
    parts = [slice(first, min(first + 20, 67)) for first in range(0, 67, 20)]
    known = [velocity[part][valid[part]] for part in parts]
    expected = [each.T @ each / max(len(each), 1) for each in known]
    np.testing.assert_allclose(second_moments(velocity, valid, size=20), expected, atol=1e-12)
