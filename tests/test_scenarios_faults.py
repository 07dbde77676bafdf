"""Faults keep to their settings, grow with the robot, and are recorded."""

import numpy as np
import pytest

from noiseclassifier.scenarios import SCENARIOS, faults
from noiseclassifier.scenarios.arm import plan as arm_plan
from noiseclassifier.scenarios.domains import MOTIONS
from noiseclassifier.scenarios.humanoid import plan as humanoid_plan
from noiseclassifier.scenarios.motions import Picks, Trot, Walk
from noiseclassifier.scenarios.quadruped import plan as quadruped_plan
from noiseclassifier.scenarios.robots import WIDE
from noiseclassifier.scenarios.simulation import FAULTS

TIME = np.arange(70_000) * 1e-4
TALOS, G1, GO2, SOLO12, ANYMAL = (WIDE[name] for name in ("talos", "g1", "go2", "solo12", "anymal"))
PICKS = arm_plan(WIDE["panda"], Picks(), np.random.default_rng(0), 7.0)


def walk(robot=TALOS, seed=1, **motion):
    return humanoid_plan(robot, Walk(**motion), np.random.default_rng(seed), 8.0)


def trot(robot=GO2, **motion):
    return quadruped_plan(robot, Trot(**motion), np.random.default_rng(2), 5.0)


def drawn(name, plan, seed=0):
    family = {TALOS.effectors: "humanoid", G1.effectors: "humanoid", PICKS.effectors: "arm"}
    case = SCENARIOS[name].cases[family.get(plan.effectors, "quadruped")]
    return case.defect(np.random.default_rng(seed), plan)


def draw(kind, plan=PICKS, seed=1, **settings):
    return kind(np.random.default_rng(seed), plan, **settings)


@pytest.mark.parametrize("family", ["arm", "humanoid", "quadruped"])
def test_the_same_seed_draws_the_same_faults_with_labels_of_its_scenario(family):
    plan = {"arm": PICKS, "humanoid": walk(), "quadruped": trot()}[family]
    for scenario in SCENARIOS.values():
        if family not in scenario.cases:
            continue
        defect = scenario.cases[family].defect
        one, two = (defect(np.random.default_rng(4), plan) for _ in range(2))
        assert (one.events, one.facts, one.boxes) == (two.events, two.facts, two.boxes)
        assert {event.label for event in one.events} <= set(scenario.labels)
        assert all(event.start < event.stop for event in one.events)
        for signal, time in (("shift", plan.time), ("overlay", TIME[::100]), ("gain", plan.time)):
            first, second = getattr(one, signal), getattr(two, signal)
            assert (first is None) == (second is None)
            if first is not None:
                np.testing.assert_array_equal(first(time), second(time))


def test_obstacles_lie_on_the_table_where_the_tool_comes_down():
    found = draw(faults.obstacles, height=(0.014, 0.025), half=(0.05, 0.05), share=0.7)
    places = [contact.place[:2] for contact in PICKS.contacts]
    assert found.boxes
    for box in found.boxes:
        assert box.centre[2] - box.half[2] == pytest.approx(0.1)
        assert 0.114 <= box.top <= 0.125
        assert box.centre[:2] in places


def test_of_some_obstacles_only_so_many_are_drawn_and_they_are_offset_along_the_effector():
    settings = {"height": (0.02, 0.02), "half": (0.01, 0.01), "offset": (3.0, -1.0), "most": 1}
    for seed in range(20):
        (box,) = draw(faults.obstacles, seed=seed, **settings).boxes
        offsets = [np.subtract(box.centre[:2], contact.place[:2]) for contact in PICKS.contacts]
        assert any(np.allclose(each, [0.03, -0.01]) for each in offsets[:-1])  # never the last


def test_ground_that_gives_way_is_as_high_as_before_until_it_does():
    settings = {"depth": (0.01, 0.01), "half": (0.05, 0.05), "after": (0.3, 0.5)}
    found = draw(faults.giving_way, **settings)
    assert [box.top for box in found.ground] == pytest.approx([0.09])
    for box, contact in zip(found.boxes, PICKS.contacts, strict=True):
        assert box.top == pytest.approx(0.1)
        assert contact.start + 0.3 <= box.until <= contact.start + 0.5


def test_jumps_of_the_reference_return():
    settings = {"every": 1.4, "distance": (0.001, 0.004), "speed": (0.1, 2.0)}
    found = draw(faults.reference_jumps, seed=2, **settings)
    shift = found.shift(PICKS.time)[:, 0]
    way = np.linalg.norm(shift, axis=1)
    assert not way[: int(found.events[0].start * 1e3)].any()
    assert 0.001 <= way.max() <= 0.004
    assert way[int((found.events[1].stop + 0.01) * 1e3)] == pytest.approx(0, abs=1e-12)
    steps = np.linalg.norm(np.diff(shift, axis=0), axis=1)
    assert steps.max() <= 2.0 * 1e-3 + 1e-9  # never faster than the settings


def test_the_force_signal_jumps_only_while_the_tool_presses():
    found = draw(faults.sensor_jumps, seed=3, size=(80.0, 160.0))
    signal = found.sensors["panda_hand.touch"](PICKS.time)[:, 0]
    assert np.abs(signal[signal != 0]).min() >= 80
    for time in PICKS.time[signal != 0].tolist():
        assert any(contact.start < time < contact.lift for contact in PICKS.contacts)


def test_a_gain_and_an_encoder_are_off_by_what_was_drawn():
    gain = draw(faults.force_gain, factor=(6.0, 7.0))
    assert 6 <= gain.gain(PICKS.time)[0] == gain.facts["factor"] <= 7
    assert len(gain.events) == len(PICKS.contacts)
    later = draw(faults.force_gain, factor=(6.0, 7.0), start=(0.5, 0.5), contacts=False)
    gains = later.gain(PICKS.time)
    assert (gains[: len(gains) // 2] == 1).all()
    assert (gains[len(gains) // 2 :] > 6).all()
    encoder = draw(faults.decalibration, joints=(2,), angle=(0.1, 0.2))
    assert 0.1 <= encoder.offsets(7)[2] <= 0.2
    assert np.count_nonzero(encoder.offsets(7)) == 1


def test_a_multisine_has_one_line_per_hertz_of_its_band_and_its_rate_is_its_slope():
    settings = {"bands": ((40, 50),), "amplitude": (1e-3, 1e-3)}
    times = {"start": (0.0, 0.0), "stop": (1.0, 1.0)}
    wave, rate = draw(faults.multisine, **settings, **times).overlay(TIME)[:, 0].T
    inside = slice(10_000, 60_000)
    spectrum = np.abs(np.fft.rfft(wave[inside]))[::5]  # 5 s: every fifth bin is a whole hertz
    assert set(np.flatnonzero(spectrum > 0.1 * spectrum.max())) == set(range(40, 51))
    assert np.sqrt(2 * np.mean(wave[inside] ** 2)) == pytest.approx(1e-3, rel=1e-6)
    slope = np.gradient(wave, 1e-4)[inside]
    np.testing.assert_allclose(slope, rate[inside], atol=1e-3 * np.abs(rate).max())
    assert abs(wave[[0, -1]]).max() < 1e-6


def test_faults_of_talos_have_the_sizes_of_the_paper_and_a_smaller_robot_has_smaller_ones():
    high, low = (drawn("early-height", walk(robot)).boxes for robot in (TALOS, G1))
    assert [box.top for box in high] == pytest.approx([0.02] * len(high))
    assert low[0].top == pytest.approx(G1.size * 0.02)
    for name, axis, size, power in (("force-jump", 2, 400.0, 3), ("torque-jump", 0, 30.0, 4)):
        found = drawn(name, walk())
        now = np.array([found.events[0].start + 1e-3])
        values = [signal(now)[0] for signal in found.sensors.values()]
        (changed,) = [value for value in values if np.any(value)]
        assert abs(changed[axis]) == pytest.approx(size)
        small = drawn(name, walk(G1)).events[0].facts["size"]
        assert abs(small) == pytest.approx(G1.size**power * size)


@pytest.mark.parametrize(
    ("side", "axis", "sign"), [("heel", 0, -1), ("toe", 0, 1), ("left", 1, 1), ("right", 1, -1)]
)
def test_an_obstacle_lies_only_under_the_named_part_of_a_sole(side, axis, sign):
    plan = walk()
    (box,) = drawn(f"obstacle-{side}", plan).boxes
    (contact,) = [one for one in plan.contacts if one.approach == box.since and one.start > 0]
    patch = plan.effectors[contact.effector].patch[axis]
    near, far = sorted(
        sign * (box.centre[axis] + way * box.half[axis] - contact.place[axis]) for way in (-1, 1)
    )
    assert 0 < near < 0.9 * patch < far


def test_an_overhang_takes_away_ground_under_the_last_step_on_the_platform_alone():
    plan = walk(drop=0.06, height=(0.07, 0.07))
    found = draw(faults.overhang, plan, share=(0.4, 0.4))
    (event,) = found.events
    edge, half = found.ground[0].centre[0] + found.ground[0].half[0], 0.105
    soles = [one.place[0] for one in plan.contacts if one.place[2] == 0]
    assert edge == pytest.approx(max(soles) + half - 0.4 * 2 * half)
    assert edge > sorted(soles)[-2] + half
    assert found.ground[1] == plan.ground[1]
    assert 0 < event.start < event.stop < plan.duration
    flat = draw(faults.overhang, walk(), share=(0.4, 0.4))
    assert (flat.ground, flat.events) == (None, ())


@pytest.mark.parametrize("robot", [GO2, SOLO12, ANYMAL], ids=lambda robot: robot.name)
def test_obstacles_and_forces_of_a_quadruped_are_in_its_own_units(robot):
    plan = trot(robot)
    boxes = drawn("obstacle-full", plan).boxes
    assert len(boxes) == 2
    for box in boxes:
        assert robot.height * 0.3 < box.top < robot.height * 0.8  # lower than feet are lifted
        assert box.half[0] == pytest.approx(0.2 * plan.units.length)
    for event in drawn("force-jump", plan).events:
        assert 2.0 * plan.units.force <= abs(event.facts["size"]) <= 3.5 * plan.units.force


def test_ground_ends_at_an_edge_where_each_foot_steps_down_once():
    plan = trot()
    found = draw(faults.step_down, plan, seed=4, depth=(0.03, 0.03))
    edge = found.facts["edge"]
    places = np.array([contact.place[0] for contact in plan.contacts])
    assert np.abs(places - edge).min() > 0.005
    for place in places:
        tops = [box.top for box in found.ground if abs(place - box.centre[0]) <= box.half[0] + 1e-9]
        assert max(tops) == pytest.approx(0 if place < edge else -0.03)
    assert sorted(event.facts["effector"] for event in found.events) == [0, 1, 2, 3]
    assert found.events[0].start >= 0.3 * plan.duration
    for event in found.events:
        own = [one for one in plan.contacts if one.effector == event.facts["effector"]]
        assert max(one.place[0] for one in own if one.start < event.start) < edge


def test_faults_of_steps_are_not_drawn_where_a_quadruped_stands_or_stays():
    own = FAULTS["quadruped"]
    standing, on_the_spot = trot(gait="stand"), trot(way="spot")
    for name in ("obstacle-full", "platform", "force-jump"):
        found = draw(own[name], standing)
        assert (found.boxes, found.ground, found.events) == ((), None, ())
    assert draw(own["platform"], on_the_spot).ground is None
    assert draw(own["platform"], trot()).ground is not None


@pytest.mark.parametrize("family", ["humanoid", "quadruped"])
def test_every_fault_of_wide_domains_is_drawn_for_every_motion(family):
    robots = [robot for robot in WIDE.values() if robot.family == family]
    plan_of = {"humanoid": humanoid_plan, "quadruped": quadruped_plan}[family]
    for seed in range(12):
        rng, robot = np.random.default_rng(seed), robots[seed % len(robots)]
        plan = plan_of(robot, MOTIONS[family](rng, seed / 11, robot), rng, 3.0)
        for name, defect in FAULTS[family].items():
            found = defect(rng, plan)
            assert all(event.start < event.stop for event in found.events), name
            if family == "quadruped":
                assert all(box.top <= 0.65 * np.ptp(plan.places[..., 2]) for box in found.boxes)
            elif "obstacle" in name or name == "edge":
                assert not found.boxes or len(plan.contacts) > 2
