"""Defects of a humanoid's environment: scaled to the robot, and placed by its plan."""

import numpy as np
import pytest

from noiseclassifier.scenarios.faults import Obstacles, Overhang
from noiseclassifier.scenarios.humanoid_plan import footsteps, walk
from noiseclassifier.scenarios.motions import Walk
from noiseclassifier.scenarios.robots import WIDE
from noiseclassifier.scenarios.table import SCENARIOS

HUMANOID = {
    name: each.cases["humanoid"] for name, each in SCENARIOS.items() if "humanoid" in each.cases
}

G1 = WIDE["g1"]
TALOS = WIDE["talos"]


def plan_of(robot=TALOS, seed=1, **changes):
    motion = Walk(**changes)
    return walk(robot, footsteps(robot, motion, np.random.default_rng(seed), 8.0), 8.0)


def drawn(name, robot=TALOS):
    return HUMANOID[name].defect.draw(np.random.default_rng(0), plan_of(robot))


def test_humanoids_have_all_scenarios():
    assert {n for n, each in SCENARIOS.items() if "humanoid" in each.cases} == set(SCENARIOS)


def test_faults_of_talos_have_the_sizes_of_the_paper():
    tops = [box.top for box in drawn("early-height").boxes]
    assert tops == pytest.approx([0.02] * len(tops))
    for name, axis, size in (("force-jump", 2, 400.0), ("torque-jump", 0, 30.0)):
        faults = drawn(name)
        start = faults.events[0].start + 1e-3
        (felt,) = [
            signal(np.array([start]))[0]
            for sensor, signal in faults.sensors.items()
            if np.any(signal(np.array([start])))
        ]
        assert abs(felt[axis]) == pytest.approx(size)


def test_a_smaller_robot_has_smaller_faults():
    high, low = (drawn("early-height", robot).boxes[0].top for robot in (TALOS, G1))
    assert low == pytest.approx(G1.size * high)
    for name, power in (("force-jump", 3), ("torque-jump", 4)):
        sizes = [abs(drawn(name, robot).events[0].facts["size"]) for robot in (TALOS, G1)]
        assert sizes[1] == pytest.approx(G1.size**power * sizes[0])


@pytest.mark.parametrize(
    ("side", "axis", "sign"), [("heel", 0, -1), ("toe", 0, 1), ("left", 1, 1), ("right", 1, -1)]
)
def test_an_obstacle_lies_only_under_the_named_part_of_a_sole(side, axis, sign):
    plan = plan_of()
    (box,) = drawn(f"obstacle-{side}").boxes
    (contact,) = [one for one in plan.contacts if one.approach == box.since and one.start > 0]
    patch = plan.effectors[contact.effector].patch[axis]
    near, far = sorted(
        sign * (box.centre[axis] + way * box.half[axis] - contact.place[axis]) for way in (-1, 1)
    )
    assert 0 < near < 0.9 * patch < far


def test_an_overhang_takes_away_ground_under_the_last_step_on_the_platform_alone():
    plan = plan_of(drop=0.06, height=(0.07, 0.07))
    faults = Overhang((0.4, 0.4)).draw(np.random.default_rng(0), plan)
    assert faults.ground is not None
    (event,) = faults.events
    edge, half = faults.ground[0].centre[0] + faults.ground[0].half[0], 0.105
    soles = [one.place[0] for one in plan.contacts if one.place[2] == 0]
    assert edge == pytest.approx(max(soles) + half - 0.4 * 2 * half)
    assert edge > sorted(soles)[-2] + half
    assert faults.ground[1] == plan.ground[1]
    assert 0 < event.start < event.stop < plan.duration


def test_there_is_no_overhang_on_flat_ground():
    faults = Overhang((0.4, 0.4)).draw(np.random.default_rng(0), plan_of())
    assert faults.ground is None
    assert not faults.events


def test_one_obstacle_is_never_under_the_last_step():
    plan = plan_of()
    last = max(contact.start for contact in plan.contacts)
    for seed in range(20):
        (box,) = (
            Obstacles((0.01, 0.02), (0.1, 0.1), most=1)
            .draw(np.random.default_rng(seed), plan)
            .boxes
        )
        (contact,) = [one for one in plan.contacts if one.approach == box.since and one.start > 0]
        assert contact.start < last
