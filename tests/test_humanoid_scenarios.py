"""Plans of walks follow the law of the pendulum; humanoids stand, walk, and hit obstacles."""

from dataclasses import replace

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from simulated import simulated

from noiseclassifier.scenarios.drives import Drives
from noiseclassifier.scenarios.faults import Faults, Imperfections
from noiseclassifier.scenarios.humanoid import SETTLING, footsteps, scene, walk
from noiseclassifier.scenarios.loop import record
from noiseclassifier.scenarios.motions import STEPS, TICK, Walk
from noiseclassifier.scenarios.robots import WIDE
from noiseclassifier.scenarios.world import centre_of_mass, real_model, reduced_model
from noisemodel import Block

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


SEED, SHORT = 1, 4.0


def imperfect(robot, seed=3):
    rng = np.random.default_rng(seed)
    return Imperfections.draw(rng, robot, bodies=reduced_model(robot).njoints - 1)


def stood(robot, duration=0.3):
    """A robot that does nothing but stand, and what it is like."""
    like = imperfect(robot)
    scenery = scene(robot, walk(robot, (), duration), Faults(), like)
    exact = replace(like, stiffness=1.0, damping=1.0)
    drives = Drives(scenery.start[-12:], robot.drives, np.zeros(12), exact)
    ticks = SETTLING + round(duration / TICK)
    quiet = np.zeros((ticks * STEPS, 12))
    error = np.zeros((ticks, scenery.model.nsensordata))
    return record(scenery, drives, encoder_error=quiet, sensor_error=error), like


@HUMANOIDS
def test_a_standing_robot_stands_still_and_the_ground_bears_its_weight(robot):
    motion, like = stood(robot)
    assert np.abs(motion.velocity).max() < 0.02
    assert np.ptp(motion.base_pose[:, :3], axis=0).max() < 2e-3
    real = real_model(reduced_model(robot), robot.carrier, np.zeros(3), like)
    weight = pin.computeTotalMass(real) * 9.81
    assert motion.contact.sum(axis=1).mean() == pytest.approx(weight, rel=0.01)
    assert (motion.contact.min(axis=0) > 0.3 * weight).all()


@pytest.fixture(scope="module")
def straight():
    return simulated("talos", "straight", SEED, duration=SHORT)


def test_a_healthy_walk_is_ok_upright_and_leads_to_where_its_steps_do(straight):
    assert straight.blocks == (Block(0.0, SHORT, "ok"),)
    assert straight.meta["events"] == []
    rng = np.random.default_rng(np.random.SeedSequence(SEED).spawn(4)[0])
    steps = footsteps(TALOS, Walk(), rng, SHORT)
    place, turn = straight.base_pose[-1, :3], straight.base_pose[-1, 3:]
    start = straight.base_pose[0, :3]
    assert place[0] - start[0] == pytest.approx(steps[-1].place[0], abs=0.03)
    assert steps[-1].place[0] > 0.05
    assert place[2] == pytest.approx(start[2], abs=0.02)
    assert np.abs(turn[:3]).max() < 0.03


def test_an_obstacle_is_an_early_contact_that_changes_the_command_and_not_the_plan(straight):
    obstacle = simulated("talos", "obstacle-full", SEED, duration=SHORT)
    (event, *_) = obstacle.meta["events"]
    assert event["label"] == "impact"
    assert event["facts"]["force"] > 300
    first = next(block for block in obstacle.blocks if block.label == "impact")
    assert first.start == pytest.approx(event["start"], abs=0.03)
    onset = int(event["start"] * 10_000) - 1
    np.testing.assert_array_equal(obstacle.velocity[:onset], straight.velocity[:onset])
    planned, commanded = (
        np.abs(obstacle.stages[stage] - straight.stages[stage]).max()
        for stage in ("planned", "commanded")
    )
    assert planned < 0.05  # the plan is the same, the posture that follows it is not quite
    assert commanded > 10 * planned


def test_planned_velocities_are_those_that_drives_follow_where_nothing_disturbs(straight):
    quiet = straight.time < 0.5
    planned, desired = straight.stages["planned"], straight.velocity_desired
    assert np.abs(planned[quiet] - desired[quiet]).max() < 0.02
    share = np.square(planned - desired).sum() / np.square(desired).sum()
    assert share < 0.1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "way"),
    [("g1", "straight"), ("talos", "curve"), ("g1", "directions"), ("talos", "spot")],
)
def test_humanoids_walk_every_way_without_an_event(robot, way):
    run = simulated(robot, way, 2, duration=SHORT)
    assert [block.label for block in run.blocks] == ["ok"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scenario", "failure"),
    [
        ("obstacle-heel", "impact"),
        ("obstacle-toe", "impact"),
        ("obstacle-left", "impact"),
        ("limit-cycle", "oscillations"),
    ],
)
def test_obstacles_under_any_part_of_a_sole_are_impacts_and_too_high_gains_oscillate(
    scenario, failure
):
    run = simulated("talos", scenario, 2, duration=SHORT)
    assert failure in {block.label for block in run.blocks}


@pytest.mark.slow
def test_a_partial_contact_at_the_edge_of_a_platform_is_labelled():
    run = simulated("talos", "platform", 2)
    assert {"ok", "highaccelerations"} <= {block.label for block in run.blocks}
    assert run.base_pose[-1, 2] == pytest.approx(run.base_pose[0, 2] - 0.06, abs=0.02)


def test_a_robot_that_lies_on_its_side_has_fallen():
    like = imperfect(TALOS)
    scenery = scene(TALOS, walk(TALOS, (), 0.3), Faults(), like)
    data = mujoco.MjData(scenery.model)
    data.qpos[:] = scenery.start
    mujoco.mj_forward(scenery.model, data)
    assert not scenery.fallen(data.sensordata)
    data.qpos[3:7] = (np.cos(0.5), np.sin(0.5), 0.0, 0.0)
    mujoco.mj_forward(scenery.model, data)
    assert scenery.fallen(data.sensordata)
