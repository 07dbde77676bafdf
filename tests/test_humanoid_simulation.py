"""Humanoids in simulation stand, carry their weight, walk, and have impacts on obstacles."""

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
from noiseclassifier.scenarios.world import real_model, reduced_model

G1 = WIDE["g1"]
TALOS = WIDE["talos"]

SEED, SHORT = 1, 4.0
HUMANOIDS = pytest.mark.parametrize("robot", [TALOS, G1], ids=lambda robot: robot.name)


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


@pytest.fixture(scope="module")
def obstacle(straight):
    return simulated("talos", "obstacle-full", SEED, duration=SHORT)


def test_a_healthy_walk_is_ok_all_the_time(straight):
    assert [(block.start, block.stop, block.label) for block in straight.blocks] == [
        (0.0, SHORT, "ok")
    ]
    assert straight.meta["events"] == []


def test_it_walks_upright_to_where_its_steps_lead(straight):
    rng = np.random.default_rng(np.random.SeedSequence(SEED).spawn(4)[0])
    steps = footsteps(TALOS, Walk(), rng, SHORT)
    place, turn = straight.base_pose[-1, :3], straight.base_pose[-1, 3:]
    start = straight.base_pose[0, :3]
    assert place[0] - start[0] == pytest.approx(steps[-1].place[0], abs=0.03)
    assert steps[-1].place[0] > 0.05
    assert place[2] == pytest.approx(start[2], abs=0.02)
    assert np.abs(turn[:3]).max() < 0.03


def test_an_obstacle_is_an_early_contact_and_an_impact(obstacle):
    (event, *_) = obstacle.meta["events"]
    assert event["label"] == "impact"
    assert event["facts"]["force"] > 300
    blocks = [block for block in obstacle.blocks if block.label == "impact"]
    assert blocks
    assert blocks[0].start == pytest.approx(event["start"], abs=0.03)


def test_runs_are_the_same_until_the_contact_with_the_obstacle(straight, obstacle):
    onset = int(obstacle.meta["events"][0]["start"] * 10_000) - 1
    np.testing.assert_array_equal(obstacle.velocity[:onset], straight.velocity[:onset])


def test_an_obstacle_changes_the_command_and_not_the_plan(straight, obstacle):
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
