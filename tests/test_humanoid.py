"""Plans of walks follow the law of the pendulum; humanoids stand, walk, hit obstacles, and wave."""

from dataclasses import replace

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from simulated import simulated

import noisemodel
from noiseclassifier.scenarios.domains import LIMITS, WALKS, humanoid_motion
from noiseclassifier.scenarios.drives import Drives
from noiseclassifier.scenarios.faults import Faults, Imperfections
from noiseclassifier.scenarios.humanoid import footsteps, plan, scene, standing, walk
from noiseclassifier.scenarios.labels import unplanned
from noiseclassifier.scenarios.loop import record
from noiseclassifier.scenarios.motions import STEPS, TICK, Gesture, Stand, Stroll, Walk
from noiseclassifier.scenarios.robots import LEGS, WIDE, similar
from noiseclassifier.scenarios.world import centre_of_mass, real_model, reduced_model
from noisemodel import Block

G1 = WIDE["g1"]
G1_MOVING = WIDE["g1_with_hands"]
HUMANOIDS = tuple(robot for robot in WIDE.values() if robot.family == "humanoid")
ROMEO = WIDE["romeo_small"]
TALOS = WIDE["talos"]

WAVE = Gesture(way="sines", size=(1.0, 1.0), period=(0.8, 2.0))
SQUAT = Stand(sway=(0.5, 0.5), squat=(0.1, 0.1), period=(1.5, 2.5), upper=WAVE)


def planned(robot, wanted, seed=1, duration=4.0):
    return plan(robot, wanted, np.random.default_rng(seed), duration)


def imperfect(robot, seed=3):
    rng = np.random.default_rng(seed)
    return Imperfections.draw(rng, robot, bodies=reduced_model(robot).njoints - 1)


def exact(robot, way, like, stiffness=1.0, damping=1.0):
    """A run without faults and errors of sensors, on drives with these gains."""
    scenery, joints = scene(robot, way, Faults(), like), len(robot.drives.joints)
    gains = replace(like, stiffness=stiffness, damping=damping)
    drives = Drives(scenery.start[-joints:], robot.drives, np.zeros(joints), gains)
    ticks = scenery.settling + len(way.time)
    error = np.zeros((ticks * STEPS, joints))
    sensors = np.zeros((ticks, scenery.model.nsensordata))
    return record(scenery, drives, encoder_error=error, sensor_error=sensors)


def recorded(robot, wanted, seed=1, duration=4.0, delay=0.0, **gains):
    """A run without faults, and its plan."""
    way, like = planned(robot, wanted, seed, duration), imperfect(robot, seed)
    like = replace(like, torque_delay=like.torque_delay + round(delay * STEPS / TICK))
    return way, exact(robot, way, like, **gains)


@pytest.mark.parametrize("robot", HUMANOIDS, ids=lambda robot: robot.name)
def test_its_data_are_those_of_its_description(robot):
    model = reduced_model(robot)
    whole = noisemodel.Robot.load(robot.name).model
    body = standing(robot, model, planned(robot, Stand()))
    data = model.createData()
    centre = pin.centerOfMass(model, data, body.configuration)
    np.testing.assert_allclose(centre, (0.0, 0.0, robot.centre), atol=1e-6)
    limits = list(zip(whole.lowerPositionLimit, whole.upperPositionLimit, strict=True))
    for index, joint in enumerate(robot.drives.joints):
        low, high = limits[whole.joints[whole.getJointId(joint)].idx_q]
        angle = body.configuration[7 + index]
        reach = (*(0.0,) * LEGS, *robot.reach)[index]
        if robot.name != "simple_humanoid":  # its limits are those of other joints
            assert low - 0.05 <= angle - reach, joint
            assert angle + reach <= high + 0.05, joint


@pytest.mark.slow
@pytest.mark.parametrize("robot", [G1_MOVING, ROMEO], ids=lambda robot: robot.name)
def test_it_stands_sways_squats_and_waves(robot):
    way, run = recorded(robot, SQUAT, duration=3.0)
    assert np.ptp(way.centre[:, 2]) > 0.03 * robot.centre
    deep = run.base_pose[::STEPS, 2] - run.base_pose[0, 2]
    np.testing.assert_allclose(deep, way.centre[:, 2] - way.centre[0, 2], atol=0.05 * robot.centre)
    assert (run.contact > 0).all()
    upper = run.position[::STEPS, LEGS:]
    assert np.ptp(upper, axis=0).min() > 0.2
    np.testing.assert_allclose(upper[50:], way.upper[50:], atol=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "gait"),
    list(zip(HUMANOIDS, WALKS, strict=True))[::2],
    ids=lambda each: getattr(each, "name", each),
)
def test_robots_walk_in_their_gaits(robot, gait):
    way, run = recorded(robot, Stroll(walk=WALKS[gait], stops=1, upper=WAVE))
    moved = run.base_pose[-1, :2] - run.base_pose[0, :2]
    assert np.linalg.norm(moved - (way.centre[-1] - way.centre[0])[:2]) < 0.05
    assert (np.abs(run.torque) < robot.drives.torque).mean() > 0.999
    assert np.sqrt(np.square(run.velocity - run.velocity_desired).mean()) < 0.3
    assert not [event for event in unplanned(run.contact, way.contacts) if event.start < 0.3]


def test_the_weight_is_between_both_feet_at_a_stop():
    walk = WALKS["brisk"]
    straight = planned(TALOS, Stroll(walk=walk), duration=9.0)
    stopping = planned(TALOS, Stroll(walk=walk, stops=1, pause=(2.0, 2.0)), duration=9.0)

    def centred(way):
        inside = slice(2000, 7000)
        return ((abs(way.left - 0.5) < 0.05) & (way.swinging < 0))[inside].sum() * TICK

    assert centred(straight) < 0.5
    assert centred(stopping) > 1.0


@pytest.mark.parametrize("seed", range(3))
def test_upper_bodies_start_at_rest_and_stay_within_their_reach(seed):
    for way in ("still", "sines", "reaches"):
        upper = planned(G1_MOVING, Stand(upper=replace(WAVE, way=way)), seed).upper
        np.testing.assert_allclose(upper[0], G1_MOVING.rest[LEGS:], atol=1e-12)
        assert np.abs(np.diff(upper[:3], axis=0)).max() < 1e-5
        assert (np.abs(upper - G1_MOVING.rest[LEGS:]) <= np.add(G1_MOVING.reach, 1e-9)).all()
        assert np.ptp(upper) > 0 or way == "still"


def test_the_centre_of_mass_stays_where_it_is_while_only_arms_move():
    way, model = planned(G1_MOVING, Stand(upper=WAVE)), reduced_model(G1_MOVING)
    body, data = standing(G1_MOVING, model, way), model.createData()
    level = np.eye(3)
    for tick in range(0, 2000, 5):
        q = body.follow(
            way.places[tick], [level, level], way.centre[tick], level, upper=way.upper[tick]
        )
        np.testing.assert_allclose(q[7 + LEGS :], way.upper[tick], atol=1e-12)
        centre = pin.centerOfMass(model, data, q)
        np.testing.assert_allclose(centre, way.centre[tick], atol=1e-3)


def test_a_pendulum_of_a_quarter_of_the_height_steps_twice_as_fast():
    small = similar(TALOS, 1 / 64, TALOS.centre / 4)
    assert small["pace"] == pytest.approx(0.5)
    assert small["drives"]["stiffness"][0] == pytest.approx(TALOS.drives.stiffness[0] / 256)
    same = similar(TALOS, 1.0, TALOS.centre)["drives"]
    assert same == {name: getattr(TALOS.drives, name) for name in same}


def test_motions_of_a_seed_are_equal_and_both_kinds_are_drawn():
    drawn = [humanoid_motion(np.random.default_rng(seed), 1.0, G1) for seed in range(40)]
    assert drawn == [humanoid_motion(np.random.default_rng(seed), 1.0, G1) for seed in range(40)]
    assert {type(one) for one in drawn} == {Stand, Stroll}
    gaits = {one.walk.single for one in drawn if isinstance(one, Stroll)}
    assert len(gaits) == len(WALKS)


def test_lengths_are_scaled_and_nothing_else():
    small = G1.scaled(0.9)
    assert small.length_scale == pytest.approx(0.9)
    assert small.centre == pytest.approx(0.9 * G1.centre)
    assert small.effectors[0].point == pytest.approx(np.multiply(0.9, G1.effectors[0].point))
    assert small.stride == pytest.approx((0.9 * 0.24, 0.9 * 0.06))
    assert small.drives == G1.drives
    again = small.scaled(1 / 0.9)
    assert again.apart == pytest.approx(G1.apart)


@pytest.mark.slow
def test_a_soft_and_late_robot_walks_on():
    _, run = recorded(
        G1, Stroll(walk=WALKS["walk"]), duration=3.0,
        stiffness=LIMITS["humanoid"].stiffness[0], damping=LIMITS["humanoid"].damping[1],
        delay=LIMITS["humanoid"].delay / 2,
    )  # fmt: skip
    error = np.abs(run.position - run.position_desired).max()
    assert 0.01 < error < 0.3


WAYS = ("straight", "curve", "directions", "spot")
DURATION = 8.0
BOTH = pytest.mark.parametrize("robot", [TALOS, G1], ids=lambda robot: robot.name)


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


@BOTH
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


@BOTH
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


@BOTH
def test_a_standing_robot_stands_still_and_the_ground_bears_its_weight(robot):
    like = imperfect(robot)
    motion = exact(robot, walk(robot, (), 0.3), like)
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
    run = simulated("talos", "platform", 2, duration=5.0)
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
