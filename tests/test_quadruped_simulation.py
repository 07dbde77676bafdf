"""Quadrupeds in simulation stand, trot as planned, and have impacts on obstacles."""

import numpy as np
import pytest
from simulated import simulated

from noiseclassifier.scenarios.faults import Faults, Imperfections, no_defect
from noiseclassifier.scenarios.labels import annotate
from noiseclassifier.scenarios.motions import Trot
from noiseclassifier.scenarios.quadruped import plan as planned
from noiseclassifier.scenarios.quadruped import scene, stand
from noiseclassifier.scenarios.robots import WIDE
from noiseclassifier.scenarios.simulation import SCENARIOS, Start, _trial
from noiseclassifier.scenarios.world import reduced_model, sensors_of

QUADRUPED = {
    name: each.cases["quadruped"] for name, each in SCENARIOS.items() if "quadruped" in each.cases
}

ANYMAL = WIDE["anymal"]
GO2 = WIDE["go2"]
SOLO12 = WIDE["solo12"]

SHORT = 3.0
SEED = 2
ROBOTS = [GO2, SOLO12, ANYMAL]
FAILURE = {
    "anymal": {
        "obstacle-full": "impact",
        "multisine-60-100": "oscillations",
        "torque-jump": "highaccelerations",
    },
    "go2": {"obstacle-heel": "impact", "early-height": "impact", "limit-cycle": "oscillations"},
    # Not "decalibrated" on ANYmal: each of its steps differs from its twin's, no impact stands out.
    "solo12": {
        "decalibrated": "impact",
        "platform": "highaccelerations",
        "reference-jump": "highaccelerations",
    },
}


@pytest.fixture(scope="module")
def trot():
    """A healthy trot of Go2, and its plan."""
    rng = np.random.default_rng(np.random.SeedSequence(SEED).spawn(1)[0])
    plan = planned(GO2, Trot(), rng, SHORT)
    return _trial(Start("go2", SEED, Trot()), no_defect, SHORT), plan


@pytest.fixture(scope="module")
def stumble():
    """The same trot over an obstacle."""
    case = QUADRUPED["obstacle-full"]
    return _trial(Start("go2", SEED, case.motion), case.defect, SHORT)


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_a_trot_begins_as_it_stands_and_never_steps_beyond_its_legs(robot):
    plan = planned(robot, Trot(way="curve"), np.random.default_rng(1), 5.0)
    standing = stand(robot)
    np.testing.assert_allclose(plan.places[0], standing.feet, atol=1e-12)
    np.testing.assert_allclose(plan.centre[0], [0, 0, standing.height], atol=1e-12)
    reach = np.linalg.norm(plan.places - plan.centre[:, None], axis=2)
    assert reach.max() < 1.25 * reach[0].max()
    moving = np.linalg.norm(np.diff(plan.places, axis=0), axis=2)
    assert not moving[~(plan.swing[1:] | plan.swing[:-1])].any()


def test_the_feet_bear_the_weight(trot):
    trial, _ = trot
    imperfections = trial.imperfections
    masses = [inertia.mass for inertia in list(reduced_model(GO2).inertias)[1:]]
    weight = 9.81 * (np.dot(masses, imperfections.mass) + imperfections.payload)
    borne = trial.motion.contact.sum(axis=1).mean()  # from rest to rest: no momentum is gained
    assert borne == pytest.approx(weight, rel=5e-3)


def test_the_trot_follows_its_plan_and_the_body_stays_level(trot):
    trial, plan = trot
    way = trial.motion.base_pose[::10, :2] - trial.motion.base_pose[0, :2]
    planned = plan.centre[:, :2] - plan.centre[0, :2]
    assert planned[-1, 0] > 0.3
    assert way[-1] == pytest.approx(planned[-1], abs=0.02 + 0.02 * planned[-1, 0])
    assert np.abs(way - planned).max() < 0.03
    _, x, y, _ = trial.motion.base_pose[:, 3:].T
    assert 2 * np.hypot(x, y).max() < 0.05
    assert np.ptp(trial.motion.base_pose[:, 2]) < 0.015


def test_feet_touch_when_they_are_planned_to(trot):
    trial, plan = trot
    assert trial.events == ()
    touching = trial.motion.contact > 0
    for contact in plan.contacts:
        if contact.start > 0:
            window = slice(*(round((contact.start + late) * 1e4) for late in (0.0, 0.1)))
            assert touching[window, contact.effector].any()
    in_air = plan.load == 0
    assert touching[::10][in_air].mean() < 0.35  # the last of the swing, where it may touch


def test_an_obstacle_is_an_impact_and_the_run_is_healthy_before(trot, stumble):
    healthy, _ = trot
    first = stumble.contacts[0]
    assert first.label == "impact"
    assert first.facts["force"] > 100
    assert first.facts["effector"] in range(4)
    before = round(first.start * 1e4) - 10
    np.testing.assert_array_equal(
        stumble.motion.velocity[:before], healthy.motion.velocity[:before]
    )
    blocks, _ = annotate(
        stumble.motion.velocity, healthy.motion.velocity, stumble.contacts, rate=10000
    )
    assert {"ok", "impact"} <= {block.label for block in blocks}


def test_a_robot_that_lies_or_leans_has_fallen():
    plan = planned(GO2, Trot(), np.random.default_rng(1), SHORT)
    perfect = Imperfections.draw(np.random.default_rng(0), GO2, bodies=13)
    ready = scene(GO2, plan, Faults(), perfect)
    where = sensors_of(ready.model)
    for height, tilt, fallen in ((0.3, 0.0, False), (0.1, 0.0, True), (0.3, 0.9, True)):
        sensors = np.zeros(ready.model.nsensordata)
        sensors[where["centre.place"]] = (0, 0, height)
        sensors[where["base.turn"]] = (np.cos(tilt / 2), np.sin(tilt / 2), 0, 0)
        assert ready.fallen(sensors) == fallen


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "way"),
    [("go2", "straight"), ("solo12", "curve"), ("anymal", "directions"), ("go2", "spot")],
)
def test_a_healthy_quadruped_is_ok_all_the_time(robot, way):
    run = simulated(robot, way, 1, duration=SHORT)
    (block,) = run.blocks
    assert (block.start, block.label) == (0.0, "ok")
    assert block.stop == pytest.approx(run.meta["duration"])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "name"), [(robot, name) for robot in FAILURE for name in FAILURE[robot]]
)
def test_a_scenario_has_its_failure_on_every_quadruped(robot, name):
    run = simulated(robot, name, 1, duration=SHORT)
    assert FAILURE[robot][name] in {block.label for block in run.blocks}
