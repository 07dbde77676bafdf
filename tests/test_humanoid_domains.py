"""Humanoids of the wide domains: robots, motions and faults."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import noisemodel
from noiseclassifier.scenarios.clock import STEPS, TICK
from noiseclassifier.scenarios.contacts import unplanned
from noiseclassifier.scenarios.drives import Drives
from noiseclassifier.scenarios.faults import Faults
from noiseclassifier.scenarios.humanoid.domains import DEFECTS, GAITS, LIMITS, motion, scaled
from noiseclassifier.scenarios.humanoid.footsteps import stopping
from noiseclassifier.scenarios.humanoid.motions import Gesture, Stand, Stroll
from noiseclassifier.scenarios.humanoid.robots import (
    G1,
    G1_MOVING,
    HUMANOIDS,
    LEGS,
    ROMEO,
    TALOS,
    TALOS_MASS,
    similar,
)
from noiseclassifier.scenarios.humanoid.scene import bodies, plan, scene, standing
from noiseclassifier.scenarios.imperfections import Imperfections
from noiseclassifier.scenarios.loop import record
from noiseclassifier.scenarios.reduced import reduced_model

WAVE = Gesture(way="sines", size=(1.0, 1.0), period=(0.8, 2.0))
SQUAT = Stand(sway=(0.5, 0.5), squat=(0.1, 0.1), period=(1.5, 2.5), upper=WAVE)
EACH = pytest.mark.parametrize("robot", HUMANOIDS, ids=lambda robot: robot.name)


def planned(robot, wanted, seed=1, duration=4.0):
    return plan(robot, wanted, np.random.default_rng(seed), duration)


def simulated(robot, wanted, seed=1, duration=4.0, stiffness=1.0, damping=1.0, delay=0.0):
    """A run without faults, and its plan."""
    way, joints = planned(robot, wanted, seed, duration), len(robot.drives.joints)
    rng = np.random.default_rng(seed)
    like = Imperfections.draw(
        rng, joints, bodies=bodies(robot), payload=robot.payload, force=robot.force_noise
    )
    like = replace(like, torque_delay=like.torque_delay + round(delay * STEPS / TICK))
    scenery = scene(robot, way, Faults(), like)
    drives = Drives(
        scenery.start[-joints:],
        stiffness=stiffness * np.array(robot.drives.stiffness),
        damping=damping * np.array(robot.drives.damping),
        limit=np.array(robot.drives.torque),
        offset=np.zeros(joints),
        imperfections=like,
        step=TICK / STEPS,
    )
    ticks = scenery.settling + len(way.time)
    error = np.zeros((ticks * STEPS, joints))
    sensors = np.zeros((ticks, scenery.model.nsensordata))
    return way, record(scenery, drives, encoder_error=error, sensor_error=sensors)


def walks_well(robot, gait, seed=1):
    way, run = simulated(robot, Stroll(walk=GAITS[gait], stops=1, upper=WAVE), seed)
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
def test_it_walks_while_its_arms_move():
    walks_well(G1_MOVING, "walk")


@pytest.mark.slow
@EACH
@pytest.mark.parametrize("gait", GAITS)
def test_every_robot_walks_in_every_gait(robot, gait):
    walks_well(robot, gait)


@pytest.mark.slow
@EACH
def test_every_robot_stands_sways_and_waves(robot):
    _, run = simulated(robot, SQUAT)
    assert (run.contact > 0).all()


def test_gaits_differ_in_their_time_on_both_feet():
    def share(name):
        rng = np.random.default_rng(0)
        steps = [
            step for _ in range(20) for step in stopping(TALOS, Stroll(walk=GAITS[name]), rng, 8.0)
        ]
        return np.mean([(step.start - step.shift) / (step.stop - step.shift) for step in steps])

    assert share("brisk") < share("walk") - 0.01 < share("slow") - 0.15
    assert share("shuffle") > share("brisk") + 0.05


def test_the_weight_is_between_both_feet_at_a_stop():
    walk = GAITS["brisk"]
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


def test_a_robot_of_the_size_of_talos_has_its_drives_and_gains():
    like = {
        name: getattr(TALOS, name) for name in ("effectors", "rest", "apart", "carrier", "held")
    }
    assert similar("talos", TALOS_MASS, TALOS.drives.joints, TALOS.centre, **like) == TALOS


def test_a_pendulum_of_a_quarter_of_the_height_steps_twice_as_fast():
    like = {name: getattr(TALOS, name) for name in ("effectors", "rest", "apart", "carrier")}
    small = similar("talos", TALOS_MASS / 64, TALOS.drives.joints, TALOS.centre / 4, **like)
    assert small.pace == pytest.approx(0.5)
    assert small.drives.stiffness[0] == pytest.approx(TALOS.drives.stiffness[0] / 256)


@pytest.mark.parametrize("wildness", [0.0, 0.5, 1.0])
def test_every_defect_is_drawn_for_every_motion(wildness):
    for seed in range(12):
        rng = np.random.default_rng(seed)
        way = planned(HUMANOIDS[seed % len(HUMANOIDS)], motion(rng, wildness), seed)
        for name, defect in DEFECTS.items():
            faults = defect.draw(rng, way)
            if "obstacle" in name or name == "edge":
                assert not faults.boxes or len(way.contacts) > 2
            assert all(event.start < event.stop for event in faults.events)


def test_motions_of_a_seed_are_equal_and_both_kinds_are_drawn():
    drawn = [motion(np.random.default_rng(seed), 1.0) for seed in range(40)]
    assert drawn == [motion(np.random.default_rng(seed), 1.0) for seed in range(40)]
    assert {type(one) for one in drawn} == {Stand, Stroll}
    gaits = {one.walk.single for one in drawn if isinstance(one, Stroll)}
    assert len(gaits) == len(GAITS)


def test_lengths_are_scaled_and_nothing_else():
    small = scaled(G1, 0.9)
    assert small.length_scale == pytest.approx(0.9)
    assert small.centre == pytest.approx(0.9 * G1.centre)
    assert small.effectors[0].point == pytest.approx(np.multiply(0.9, G1.effectors[0].point))
    assert small.stride == pytest.approx((0.9 * 0.24, 0.9 * 0.06, 0.15))
    assert small.drives == G1.drives
    again = scaled(small, 1 / 0.9)
    assert again.apart == pytest.approx(G1.apart)


def test_a_soft_and_late_robot_walks_on():
    _, run = simulated(
        G1, Stroll(walk=GAITS["walk"]), duration=3.0,
        stiffness=LIMITS.stiffness[0], damping=LIMITS.damping[1], delay=LIMITS.delay / 2,
    )  # fmt: skip
    error = np.abs(run.position - run.position_desired).max()
    assert 0.01 < error < 0.3
