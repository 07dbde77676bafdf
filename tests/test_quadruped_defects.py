"""Defects of quadrupeds: they grow with the robot, and the ground ends where it is planned."""

import numpy as np
import pytest

from noiseclassifier.scenarios.faults import Obstacles, Scaled, SensorJumps, StepDown
from noiseclassifier.scenarios.motions import Trot
from noiseclassifier.scenarios.quadruped import plan as planned
from noiseclassifier.scenarios.robots import WIDE
from noiseclassifier.scenarios.table import SCENARIOS

QUADRUPED = {
    name: each.cases["quadruped"] for name, each in SCENARIOS.items() if "quadruped" in each.cases
}

ANYMAL = WIDE["anymal"]
GO2 = WIDE["go2"]
SOLO12 = WIDE["solo12"]


def plan(robot=GO2, seed=2, **motion):
    return planned(robot, Trot(**motion), np.random.default_rng(seed), 5.0)


def test_quadrupeds_have_every_scenario_of_the_table():
    assert set(SCENARIOS) == {n for n, each in SCENARIOS.items() if "quadruped" in each.cases}


@pytest.mark.parametrize("robot", [GO2, SOLO12, ANYMAL])
def test_obstacles_are_lower_than_the_feet_are_lifted(robot):
    faults = QUADRUPED["obstacle-full"].defect.draw(np.random.default_rng(1), plan(robot))
    tops = [box.top for box in faults.boxes]
    assert len(tops) == 2
    assert robot.height * 0.3 < min(tops) <= max(tops) < robot.height * 0.8


def test_lengths_and_forces_grow_with_the_robot():
    boxes = Scaled(
        Obstacles((0.1, 0.1), (0.2, 0.2), most=1), {"height": "length", "half": "length"}
    )
    jumps = Scaled(SensorJumps((2.0, 2.0)), {"size": "force"})
    for robot in (GO2, SOLO12, ANYMAL):
        trot = plan(robot)
        rng = np.random.default_rng(0)
        (box,) = boxes.draw(rng, trot).boxes
        assert 2 * np.array(box.half) == pytest.approx(np.array([0.4, 0.4, 0.1]) * trot.size)
        assert jumps.draw(rng, trot).events[0].facts["size"] == pytest.approx(2 * trot.weight)
    assert plan(SOLO12).weight < plan(GO2).weight < plan(ANYMAL).weight


def test_a_foot_finds_ground_before_the_edge_and_none_after():
    trot = plan()
    faults = StepDown((0.03, 0.03)).draw(np.random.default_rng(4), trot)
    assert faults.ground is not None
    edge = faults.facts["edge"]

    def top(x):
        return max(box.top for box in faults.ground if abs(x - box.centre[0]) <= box.half[0] + 1e-9)

    places = np.array([contact.place[0] for contact in trot.contacts])
    assert np.abs(places - edge).min() > 0.005
    for place in places:
        assert top(place) == pytest.approx(0 if place < edge else -0.03)


def test_each_foot_steps_down_once_where_it_first_passes_the_edge():
    trot = plan()
    faults = StepDown((0.03, 0.03)).draw(np.random.default_rng(4), trot)
    assert sorted(event.facts["effector"] for event in faults.events) == [0, 1, 2, 3]
    starts = [event.start for event in faults.events]
    assert starts == sorted(starts)
    assert starts[0] >= 0.3 * trot.duration
    for event in faults.events:
        own = [one for one in trot.contacts if one.effector == event.facts["effector"]]
        before = [one.place[0] for one in own if one.start < event.start]
        assert max(before) < faults.facts["edge"]
