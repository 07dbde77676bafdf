"""Humanoids of the wide domains: robots, motions and faults."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import noisemodel
from noiseclassifier.scenarios.domains import LIMITS, WALKS, humanoid_motion
from noiseclassifier.scenarios.drives import Drives
from noiseclassifier.scenarios.faults import Faults, Imperfections
from noiseclassifier.scenarios.humanoid import plan, scene, standing
from noiseclassifier.scenarios.labels import unplanned
from noiseclassifier.scenarios.loop import record
from noiseclassifier.scenarios.motions import STEPS, TICK, Gesture, Stand, Stroll
from noiseclassifier.scenarios.robots import LEGS, WIDE, similar
from noiseclassifier.scenarios.world import reduced_model

G1 = WIDE["g1"]
G1_MOVING = WIDE["g1_with_hands"]
HUMANOIDS = tuple(robot for robot in WIDE.values() if robot.family == "humanoid")
ROMEO = WIDE["romeo_small"]
TALOS = WIDE["talos"]

WAVE = Gesture(way="sines", size=(1.0, 1.0), period=(0.8, 2.0))
SQUAT = Stand(sway=(0.5, 0.5), squat=(0.1, 0.1), period=(1.5, 2.5), upper=WAVE)
EACH = pytest.mark.parametrize("robot", HUMANOIDS, ids=lambda robot: robot.name)


def planned(robot, wanted, seed=1, duration=4.0):
    return plan(robot, wanted, np.random.default_rng(seed), duration)


def simulated(robot, wanted, seed=1, duration=4.0, stiffness=1.0, damping=1.0, delay=0.0):
    """A run without faults, and its plan."""
    way, joints = planned(robot, wanted, seed, duration), len(robot.drives.joints)
    rng = np.random.default_rng(seed)
    like = Imperfections.draw(rng, robot, bodies=reduced_model(robot).njoints - 1)
    like = replace(like, torque_delay=like.torque_delay + round(delay * STEPS / TICK))
    scenery = scene(robot, way, Faults(), like)
    exact = replace(like, stiffness=stiffness, damping=damping)
    drives = Drives(scenery.start[-joints:], robot.drives, np.zeros(joints), exact)
    ticks = scenery.settling + len(way.time)
    error = np.zeros((ticks * STEPS, joints))
    sensors = np.zeros((ticks, scenery.model.nsensordata))
    return way, record(scenery, drives, encoder_error=error, sensor_error=sensors)


def walks_well(robot, gait, seed=1):
    way, run = simulated(robot, Stroll(walk=WALKS[gait], stops=1, upper=WAVE), seed)
    moved = run.base_pose[-1, :2] - run.base_pose[0, :2]
    assert np.linalg.norm(moved - (way.centre[-1] - way.centre[0])[:2]) < 0.05
    assert (np.abs(run.torque) < robot.drives.torque).mean() > 0.999
    assert np.sqrt(np.square(run.velocity - run.velocity_desired).mean()) < 0.3
    assert not [event for event in unplanned(run.contact, way.contacts) if event.start < 0.3]


@EACH
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
    way, run = simulated(robot, SQUAT, duration=3.0)
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
    walks_well(robot, gait)


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
    _, run = simulated(
        G1, Stroll(walk=WALKS["walk"]), duration=3.0,
        stiffness=LIMITS["humanoid"].stiffness[0], damping=LIMITS["humanoid"].damping[1],
        delay=LIMITS["humanoid"].delay / 2,
    )  # fmt: skip
    error = np.abs(run.position - run.position_desired).max()
    assert 0.01 < error < 0.3
