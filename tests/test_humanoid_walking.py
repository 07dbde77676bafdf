"""Plans of walks: the pendulum's law, footsteps that are reached, and feet that do not jump."""

import numpy as np
import pytest

from noiseclassifier.scenarios.humanoid import footsteps, walk
from noiseclassifier.scenarios.motions import TICK, Walk
from noiseclassifier.scenarios.robots import WIDE
from noiseclassifier.scenarios.world import centre_of_mass

G1 = WIDE["g1"]
TALOS = WIDE["talos"]

WAYS = ("straight", "curve", "directions", "spot")
DURATION = 8.0
HUMANOIDS = pytest.mark.parametrize("robot", [TALOS, G1], ids=lambda robot: robot.name)


def steps_of(way="straight", seed=1, robot=TALOS, **changes):
    rng = np.random.default_rng(seed)
    return footsteps(robot, Walk(way=way, **changes), rng, DURATION)


def plan_of(way="straight", seed=1, robot=TALOS, **changes):
    return walk(robot, steps_of(way, seed, robot, **changes), DURATION)


@pytest.mark.parametrize("way", WAYS)
def test_the_centre_of_mass_moves_as_a_pendulum_over_its_zero_moment_point(way):
    plan = plan_of(way)
    x = plan.centre[:, :2]
    acceleration = (x[2:] - 2 * x[1:-1] + x[:-2]) / TICK**2
    zmp = x[1:-1] - acceleration / plan.rate**2
    np.testing.assert_allclose(zmp, plan.zmp[1:-1], rtol=0, atol=1e-7)


def test_the_centre_of_mass_starts_to_move_before_the_zero_moment_point_jumps():
    zmp = np.repeat([[0.0, 0.0], [0.1, 0.0]], 1000, axis=0)
    x = centre_of_mass(zmp, 3.0)[:, 0]
    time = (np.arange(2000) - 999.5) * TICK
    # By hand: half of the way at the jump, exponential on both sides.
    expected = np.where(time < 0, 0.05 * np.exp(3 * time), 0.1 - 0.05 * np.exp(-3 * time))
    np.testing.assert_allclose(x, expected, atol=0.003)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("seed", range(3))
def test_feet_land_where_and_when_they_are_to(way, seed):
    steps, plan = steps_of(way, seed), plan_of(way, seed)
    for step in steps:
        tick = int(np.ceil(step.stop / TICK))
        np.testing.assert_allclose(plan.places[tick, step.foot], step.place, atol=1e-9)
        assert plan.yaws[tick, step.foot] == pytest.approx(step.yaw)
        flight = plan.places[int(step.start / TICK) : tick, step.foot, 2]
        assert flight.max() == pytest.approx(step.height, abs=1e-4)


@pytest.mark.parametrize("way", WAYS)
def test_feet_start_and_land_softly(way):
    plan = plan_of(way)
    velocity = np.diff(plan.places, axis=0) / TICK
    assert np.abs(velocity).max() < 2.0
    assert np.abs(np.diff(velocity, axis=0)).max() / TICK < 30


@pytest.mark.parametrize("way", WAYS)
def test_the_foot_in_the_air_bears_no_weight_and_the_other_one_all(way):
    plan = plan_of(way)
    assert (plan.left[plan.swinging == 0] == 0).all()
    assert (plan.left[plan.swinging == 1] == 1).all()
    assert ((plan.left >= 0) & (plan.left <= 1)).all()
    for foot in (0, 1):
        other = plan.swinging == 1 - foot
        beside = plan.zmp[other] - plan.places[other, foot, :2]
        np.testing.assert_allclose(np.linalg.norm(beside, axis=1), 0.005, atol=1e-6)


@HUMANOIDS
@pytest.mark.parametrize("way", WAYS)
def test_a_walk_fills_its_time_and_ends_standing(way, robot):
    for seed in range(5):
        steps, plan = steps_of(way, seed, robot), plan_of(way, seed, robot)
        assert DURATION - 2.5 < steps[-1].stop < DURATION - 0.8
        between = plan.places[-1].mean(axis=0)[:2]
        np.testing.assert_allclose(plan.zmp[-1], between, atol=1e-6)
        apart = np.linalg.norm(plan.places[-1, 0] - plan.places[-1, 1])
        assert 2 * robot.apart - 1e-9 <= apart < 2 * robot.apart + 0.1


def test_soles_never_stand_on_one_another():
    for way in WAYS:
        for seed in range(10):
            plan = plan_of(way, seed)
            apart = plan.places[:, 0, :2] - plan.places[:, 1, :2]
            across = -np.sin(plan.heading) * apart[:, 0] + np.cos(plan.heading) * apart[:, 1]
            assert across.min() > 2 * TALOS.effectors[0].patch[1]


def test_seeds_walk_differently():
    assert len({steps_of(seed=seed) for seed in range(10)}) == 10
    assert {steps_of("directions", seed)[-1].place[0] > 0.2 for seed in range(9)} == {False}
    assert {steps_of("curve", seed)[-1].yaw > 0 for seed in range(9)} == {True, False}


@HUMANOIDS
def test_a_platform_is_left_over_its_edge(robot):
    for seed in range(10):
        plan = plan_of(seed=seed, robot=robot, drop=0.06, height=(0.07, 0.07))
        platform, floor = plan.ground
        assert (platform.top, floor.top) == pytest.approx((0.0, -0.06))
        edge, half = platform.centre[0] + platform.half[0], robot.effectors[0].patch[0]
        heel, toe = plan.places[:, :, 0] - half, plan.places[:, :, 0] + half
        below = plan.places[:, :, 2] < -1e-3
        assert (heel[below] > edge).all()
        resting = (np.abs(plan.places[:, :, 2]) < 1e-9) & (heel < edge)
        assert (toe[resting] < edge).all()


def test_contacts_state_when_feet_stand_and_when_they_are_highest():
    plan = plan_of()
    standing = [contact for contact in plan.contacts if contact.start <= 0]
    assert sorted(contact.effector for contact in standing) == [0, 1]
    for contact in plan.contacts:
        assert contact.start < contact.lift <= contact.stop
        if contact.start > 0:
            height = plan.places[round(contact.approach / TICK), contact.effector, 2]
            assert height == pytest.approx(0.05, abs=1e-3)
            assert plan.places[round(contact.start / TICK), contact.effector, 2] < 0.006
