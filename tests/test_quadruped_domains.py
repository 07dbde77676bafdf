"""Quadrupeds of wide domains: robots, gaits, poses, sizes, faults, soft drives."""

from itertools import cycle

import numpy as np
import pinocchio as pin
import pytest

from noiseclassifier.scenarios import simulation
from noiseclassifier.scenarios.domains import LIMITS, quadruped_motion, steady
from noiseclassifier.scenarios.drives import Drives
from noiseclassifier.scenarios.faults import no_defect
from noiseclassifier.scenarios.motions import RATE, Trot
from noiseclassifier.scenarios.quadruped import SHIFT, TILT, stand
from noiseclassifier.scenarios.quadruped import plan as planned
from noiseclassifier.scenarios.robots import WIDE
from noiseclassifier.scenarios.simulation import Start, _trial
from noiseclassifier.scenarios.world import GRAVITY, reduced_model

A1 = WIDE["a1"]
GO2 = WIDE["go2"]
HYQ = WIDE["hyq"]
QUADRUPEDS = tuple(robot for robot in WIDE.values() if robot.family == "quadruped")

SOFTEST = LIMITS["quadruped"]


def plan(robot=GO2, seed=1, duration=5.0, **motion):
    return planned(robot, Trot(**motion), np.random.default_rng(seed), duration)


def run(robot, motion, seed=1, duration=3.0):
    return _trial(Start(robot.name, seed, motion), no_defect, duration)


def upright(trial):
    _, x, y, _ = trial.motion.base_pose[:, 3:].T
    return 2 * np.hypot(x, y).max() < 0.2


@pytest.mark.parametrize("robot", QUADRUPEDS, ids=lambda robot: robot.name)
def test_every_quadruped_has_the_mass_and_leg_of_its_model_and_stands_within_its_limits(robot):
    standing, model, foot = stand(robot), reduced_model(robot), robot.effectors[0]
    joints = standing.configuration[7:]
    assert (model.lowerPositionLimit[7:] < joints).all()
    assert (joints < model.upperPositionLimit[7:]).all()
    assert standing.height > 0.5 * (foot.radius * 0.426 / 0.022)
    assert standing.feet[:, :2].mean(axis=0) == pytest.approx([0, 0], abs=1e-9)
    if robot.name in ("go2", "solo12", "anymal"):  # which are similar to none
        return
    frame = model.frames[model.getFrameId(foot.frame)]
    thigh = model.jointPlacements[frame.parentJoint].translation
    leg = np.linalg.norm(thigh) + np.linalg.norm(frame.placement.translation)
    assert leg / foot.radius == pytest.approx(0.426 / GO2.effectors[0].radius, rel=1e-3)
    mass = standing.weight / GRAVITY
    assert mass / robot.payload == pytest.approx(16.085 / GO2.payload, rel=1e-3)


@pytest.mark.parametrize(
    ("robot", "gait"), [(A1, "walk"), pytest.param(HYQ, "trot", marks=pytest.mark.slow)]
)
def test_a_target_robot_walks_upright_and_where_it_is_planned(robot, gait):
    motion = Trot(gait=gait)
    trial = run(robot, motion)
    assert upright(trial)
    assert (*trial.events, *trial.contacts) == ()
    rng = np.random.default_rng(np.random.SeedSequence(1).spawn(1)[0])
    way_of = planned(robot, motion, rng, 3.0)
    way = trial.motion.base_pose[::10, :2] - trial.motion.base_pose[0, :2]
    assert np.abs(way - way_of.centre[:, :2]).max() < 0.12 * way_of.units.length


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "gait"),
    list(zip(QUADRUPEDS[::2], cycle(["stand", "trot", "walk", "pace"]), strict=False)),
    ids=lambda each: getattr(each, "name", each),
)
def test_every_gait_stays_upright(robot, gait):
    assert upright(run(robot, Trot(gait=gait, posing=(0.5, 0.5) if gait == "stand" else (0, 0))))


def test_the_body_of_a_walk_moves_as_its_feet_push_it():
    walk = plan(gait="walk")
    zmp = np.einsum("tf,tfa->ta", walk.load, walk.places[..., :2])
    acceleration = np.gradient(np.gradient(walk.centre[:, :2], 1e-3, axis=0), 1e-3, axis=0)
    expected = GRAVITY / walk.units.length * (walk.centre[:, :2] - zmp)
    np.testing.assert_allclose(acceleration[5:-5], expected[5:-5], atol=0.05)
    np.testing.assert_allclose(walk.push[5:-5], acceleration[5:-5] / GRAVITY, atol=0.01)


def test_a_standing_robot_lifts_no_foot_and_moves_its_body_smoothly():
    rigid = plan(gait="stand")
    assert not np.hstack(
        (rigid.tilt, np.diff(rigid.centre, axis=0, prepend=rigid.centre[:1]))
    ).any()
    still = plan(gait="stand", posing=(1.0, 1.0))
    rates = np.gradient(np.hstack((still.tilt, still.centre)), 1e-3, axis=0)
    assert 0 < np.abs(rates).max() < 1.5
    assert not still.swing.any()
    assert not np.ptp(still.places, axis=0).any()
    assert 0.02 < np.abs(still.tilt).max() <= max(TILT)
    assert 0.01 < np.ptp(still.centre, axis=0).max() / still.units.length < 2 * max(SHIFT)
    np.testing.assert_array_equal(still.tilt[[0, -1]], 0)


def test_a_pause_is_without_steps_and_a_short_run_has_none():
    stopping = plan(duration=7.0, pauses=1, pause=(0.8, 0.8))
    stepping = stopping.swing.any(axis=1)
    gaps = np.flatnonzero(np.diff(np.flatnonzero(stepping)) > 600)
    assert len(gaps) == 1
    before = np.flatnonzero(stepping)[gaps[0]] + 300
    np.testing.assert_allclose(
        np.diff(stopping.centre[before : before + 300], axis=0), 0, atol=1e-9
    )
    assert plan(duration=3.0, pauses=2).swing.any()


def test_a_robot_of_another_size_is_similar():
    large = GO2.scaled(1.15)
    one, other = stand(GO2), stand(large)
    assert other.height == pytest.approx(1.15 * one.height)
    assert other.weight == pytest.approx(one.weight)
    np.testing.assert_allclose(other.feet, 1.15 * one.feet, atol=1e-9)
    small, model = reduced_model(GO2.scaled(0.85)), reduced_model(GO2)
    turned = pin.neutral(model)
    turned[7:] = one.configuration[7:]
    inertia = [pin.crba(m, m.createData(), turned)[3:6, 3:6] for m in (small, model)]
    np.testing.assert_allclose(inertia[0], 0.85**2 * inertia[1], rtol=1e-9)


def test_motions_of_the_domain_are_wider_the_wilder():
    rng = np.random.default_rng(0)
    mild = [quadruped_motion(rng, 0.0, GO2) for _ in range(200)]
    wild = [quadruped_motion(rng, 1.0, GO2) for _ in range(200)]
    assert {motion.gait for motion in wild} == {"trot", "walk", "pace", "stand"}
    assert {motion.pauses for motion in mild} == {0}
    assert {motion.pauses for motion in wild} == {0, 1, 2}
    for name in ("period", "height"):
        narrow, wide = ([getattr(m, name)[0] for m in motions] for motions in (mild, wild))
        assert np.ptp(narrow) < 0.21 < 0.5 < np.ptp(wide)
    periods = [GO2.period * motion.period[0] for motion in wild]
    assert min(periods) < 0.35


def test_steps_on_soft_drives_are_quick_trots_or_walks():
    for gait, wanted, quick in (
        ("trot", "trot", 0.7),
        ("pace", "trot", 0.7),
        ("walk", "walk", 0.8),
    ):
        assert steady(Trot(gait=gait)) == Trot(gait=wanted, period=(quick, quick))
    assert steady(Trot(gait="stand")) == Trot(gait="stand")
    fast = Trot(period=(0.5, 0.6))
    assert steady(fast) == fast


class Soft(Drives):
    """The softest drives of the domain, which hold targets for as long as it allows."""

    def __init__(self, *at_rest):
        super().__init__(*at_rest)
        self._stiffness = SOFTEST.stiffness[0] * self._stiffness
        self._damping = SOFTEST.damping[0] * self._damping
        self.held, self.number = (), 0

    def torque(self, position, velocity, desired, rate, feedforward):
        if self.number % round(SOFTEST.hold * RATE) == 0:
            self.held = desired.copy(), rate.copy(), SOFTEST.feedforward * feedforward
        self.number += 1
        return super().torque(position, velocity, *self.held)


@pytest.mark.slow
def test_go2_trots_on_the_softest_drives(monkeypatch):
    monkeypatch.setattr(simulation, "Drives", Soft)
    trial = run(GO2, steady(Trot(gait="trot")))
    assert upright(trial)
    error = trial.motion.velocity - trial.motion.velocity_desired
    assert 0.5 < np.sqrt((error**2).mean()) < 4
