"""Gaits are timed and placed so that feet carry the body; quadrupeds trot, and hit obstacles."""

from itertools import cycle, pairwise

import numpy as np
import pinocchio as pin
import pytest
from simulated import simulated

from noiseclassifier.scenarios import simulation
from noiseclassifier.scenarios.domains import LANDING, LIMITS, quadruped_motion, steady
from noiseclassifier.scenarios.drives import Drives
from noiseclassifier.scenarios.faults import Faults, Imperfections, no_defect
from noiseclassifier.scenarios.labels import annotate
from noiseclassifier.scenarios.motions import RATE, TICK, Trot, times
from noiseclassifier.scenarios.quadruped import (
    ACROSS,
    CHANGE,
    GAITS,
    NEAR,
    SHIFT,
    TILT,
    TOP,
    TROT,
    beats,
    footholds,
    height_of,
    loads,
    progress_of,
    scene,
    stand,
    steer,
    swings,
)
from noiseclassifier.scenarios.quadruped import plan as planned
from noiseclassifier.scenarios.robots import WIDE
from noiseclassifier.scenarios.simulation import FAULTS, SCENARIOS, Start, _trial, suited
from noiseclassifier.scenarios.world import GRAVITY, reduced_model, sensors_of

A1 = WIDE["a1"]
GO2 = WIDE["go2"]
HYQ = WIDE["hyq"]
QUADRUPEDS = tuple(robot for robot in WIDE.values() if robot.family == "quadruped")

SOFTEST = LIMITS["quadruped"]


def plan(robot=GO2, seed=1, duration=5.0, **motion):
    return planned(robot, Trot(**motion), np.random.default_rng(seed), duration)


def run(robot, motion, seed=1, duration=3.0):
    return _trial(Start(robot.name, seed, motion), no_defect, duration)


def upright(trial, most=0.2):
    _, x, y, _ = trial.motion.base_pose[:, 3:].T
    return 2 * np.hypot(x, y).max() < most


@pytest.mark.parametrize("robot", QUADRUPEDS, ids=lambda robot: robot.name)
def test_every_quadruped_has_the_mass_and_leg_of_its_model_and_stands_within_its_limits(robot):
    standing, model, foot = stand(robot), reduced_model(robot), robot.effectors[0]
    joints = standing.configuration[7:]
    assert (model.lowerPositionLimit[7:] < joints).all()
    assert (joints < model.upperPositionLimit[7:]).all()
    assert standing.height > 0.5 * (foot.radius * 0.426 / 0.022)
    assert standing.feet[:, :2].mean(axis=0) == pytest.approx([0, 0], abs=1e-9)
    if robot.name in ("go2", "solo12", "anymal"):  # which are similar to none
        return
    frame = model.frames[model.getFrameId(foot.frame)]
    thigh = model.jointPlacements[frame.parentJoint].translation
    leg = np.linalg.norm(thigh) + np.linalg.norm(frame.placement.translation)
    assert leg / foot.radius == pytest.approx(0.426 / GO2.effectors[0].radius, rel=1e-3)
    mass = standing.weight / GRAVITY
    assert mass / robot.payload == pytest.approx(16.085 / GO2.payload, rel=1e-3)


@pytest.mark.parametrize(
    ("robot", "gait"), [(A1, "walk"), pytest.param(HYQ, "trot", marks=pytest.mark.slow)]
)
def test_a_target_robot_walks_upright_and_where_it_is_planned(robot, gait):
    motion = Trot(gait=gait)
    trial = run(robot, motion)
    assert upright(trial)
    assert (*trial.events, *trial.contacts) == ()
    rng = np.random.default_rng(np.random.SeedSequence(1).spawn(1)[0])
    way_of = planned(robot, motion, rng, 3.0)
    way = trial.motion.base_pose[::10, :2] - trial.motion.base_pose[0, :2]
    assert np.abs(way - way_of.centre[:, :2]).max() < 0.12 * way_of.units.length


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "gait"),
    list(zip(QUADRUPEDS[::2], cycle(["stand", "trot", "walk", "pace"]), strict=False)),
    ids=lambda each: getattr(each, "name", each),
)
def test_every_gait_stays_upright(robot, gait):
    assert upright(run(robot, Trot(gait=gait, posing=(0.5, 0.5) if gait == "stand" else (0, 0))))


def test_the_body_of_a_walk_moves_as_its_feet_push_it():
    walk = plan(gait="walk")
    zmp = np.einsum("tf,tfa->ta", walk.load, walk.places[..., :2])
    acceleration = np.gradient(np.gradient(walk.centre[:, :2], 1e-3, axis=0), 1e-3, axis=0)
    expected = GRAVITY / walk.units.length * (walk.centre[:, :2] - zmp)
    np.testing.assert_allclose(acceleration[5:-5], expected[5:-5], atol=0.05)
    np.testing.assert_allclose(walk.push[5:-5], acceleration[5:-5] / GRAVITY, atol=0.01)


def test_a_standing_robot_lifts_no_foot_and_moves_its_body_smoothly():
    rigid = plan(gait="stand")
    assert not np.hstack(
        (rigid.tilt, np.diff(rigid.centre, axis=0, prepend=rigid.centre[:1]))
    ).any()
    still = plan(gait="stand", posing=(1.0, 1.0))
    rates = np.gradient(np.hstack((still.tilt, still.centre)), 1e-3, axis=0)
    assert 0 < np.abs(rates).max() < 1.5
    assert not still.swing.any()
    assert not np.ptp(still.places, axis=0).any()
    assert 0.02 < np.abs(still.tilt).max() <= max(TILT)
    assert 0.01 < np.ptp(still.centre, axis=0).max() / still.units.length < 2 * max(SHIFT)
    np.testing.assert_array_equal(still.tilt[[0, -1]], 0)


def test_a_pause_is_without_steps_and_a_short_run_has_none():
    stopping = plan(duration=7.0, pauses=1, pause=(0.8, 0.8))
    stepping = stopping.swing.any(axis=1)
    gaps = np.flatnonzero(np.diff(np.flatnonzero(stepping)) > 600)
    assert len(gaps) == 1
    before = np.flatnonzero(stepping)[gaps[0]] + 300
    np.testing.assert_allclose(
        np.diff(stopping.centre[before : before + 300], axis=0), 0, atol=1e-9
    )
    assert plan(duration=3.0, pauses=2).swing.any()


def test_a_robot_of_another_size_is_similar():
    large = GO2.scaled(1.15)
    one, other = stand(GO2), stand(large)
    assert other.height == pytest.approx(1.15 * one.height)
    assert other.weight == pytest.approx(one.weight)
    np.testing.assert_allclose(other.feet, 1.15 * one.feet, atol=1e-9)
    small, model = reduced_model(GO2.scaled(0.85)), reduced_model(GO2)
    turned = pin.neutral(model)
    turned[7:] = one.configuration[7:]
    inertia = [pin.crba(m, m.createData(), turned)[3:6, 3:6] for m in (small, model)]
    np.testing.assert_allclose(inertia[0], 0.85**2 * inertia[1], rtol=1e-9)


def test_motions_of_the_domain_are_wider_the_wilder():
    rng = np.random.default_rng(0)
    mild = [quadruped_motion(rng, 0.0, GO2) for _ in range(200)]
    wild = [quadruped_motion(rng, 1.0, GO2) for _ in range(200)]
    assert {motion.gait for motion in wild} == {"trot", "walk", "pace", "stand"}
    assert {motion.pauses for motion in mild} == {0}
    assert {motion.pauses for motion in wild} == {0, 1, 2}
    for name in ("period", "height"):
        narrow, wide = ([getattr(m, name)[0] for m in motions] for motions in (mild, wild))
        assert np.ptp(narrow) < 0.21 < 0.5 < np.ptp(wide)
    periods = [GO2.period * motion.period[0] for motion in wild]
    assert min(periods) < 0.35
    for motions in (mild, wild):  # controllers differ at any wildness
        landings = [motion.landing for motion in motions]
        assert LANDING[0] <= min(landings) < 0.12 < 2.0 < max(landings) <= LANDING[1]
        assert 60 < sum(motion.blind for motion in motions) < 140


def test_steps_on_soft_drives_are_quick_trots_or_walks():
    for gait, wanted, quick in (
        ("trot", "trot", 0.7),
        ("pace", "trot", 0.7),
        ("walk", "walk", 0.8),
    ):
        assert steady(Trot(gait=gait)) == Trot(gait=wanted, period=(quick, quick))
    assert steady(Trot(gait="stand")) == Trot(gait="stand")
    fast = Trot(period=(0.5, 0.6))
    assert steady(fast) == fast


class Soft(Drives):
    """The softest drives of the domain, which hold targets for as long as it allows."""

    def __init__(self, *at_rest):
        super().__init__(*at_rest)
        self._stiffness = SOFTEST.stiffness[0] * self._stiffness
        self._damping = SOFTEST.damping[0] * self._damping
        self.held, self.number = (), 0

    def torque(self, position, velocity, desired, rate, feedforward):
        if self.number % round(SOFTEST.hold * RATE) == 0:
            self.held = desired.copy(), rate.copy(), SOFTEST.feedforward * feedforward
        self.number += 1
        return super().torque(position, velocity, *self.held)


@pytest.mark.slow
def test_go2_trots_on_the_softest_drives(monkeypatch):
    monkeypatch.setattr(simulation, "Drives", Soft)
    trial = run(GO2, steady(Trot(gait="trot")))
    assert upright(trial)
    error = trial.motion.velocity - trial.motion.velocity_desired
    assert 0.5 < np.sqrt((error**2).mean()) < 4


TIME = times(6000, TICK)


@pytest.fixture
def timing():
    rng = np.random.default_rng(3)
    return beats(rng, begin=0.5, end=5.5, period=0.5, jitter=0.1)


def test_pairs_swing_in_turn_and_never_together(timing):
    assert [beat.group for beat in timing] == [0, 1] * (len(timing) // 2)
    for one, two in pairwise(timing):
        assert one.touch == two.begin < two.lift < two.touch
    assert timing[0].begin == 0.5
    assert 5.5 - 0.55 <= timing[-1].touch <= 5.5


def test_cycles_vary_by_the_given_share(timing):
    cycles = np.diff([beat.begin for beat in timing[::2]])
    assert cycles.min() >= 0.45
    assert cycles.max() <= 0.55
    assert np.ptp(cycles) > 0.02
    stands = [two.lift - one.touch for one, two in zip(timing, timing[2:], strict=False)]
    assert np.mean(stands) / cycles.mean() == pytest.approx(TROT.duty, abs=0.02)


def test_weight_goes_from_pair_to_pair_and_does_not_jump(timing):
    load = loads(TIME, timing)
    assert load.min() == 0
    np.testing.assert_array_equal(load[[0, -1]], 0.25)
    assert np.abs(np.diff(load, axis=0)).max() < 0.02
    np.testing.assert_array_equal(load[:, 0], load[:, TROT.groups.index(0, 1)])


@pytest.mark.parametrize("landing", [*LANDING, 1.0])
def test_a_foot_goes_up_and_comes_down_and_lands_at_the_wanted_speed(landing):
    share = np.linspace(0, 1, 10001)
    height = height_of(share, landing)
    slope = np.gradient(height, share)
    assert height[[0, -1]] == pytest.approx([0, 0], abs=1e-12)
    assert height.max() == pytest.approx(1, abs=1e-12)
    assert np.argmax(height) == pytest.approx(TOP * 10000, abs=1)
    assert slope[-1] == pytest.approx(-landing / (1 - TOP), rel=1e-2)
    assert (np.diff(height) * np.sign(TOP - share[:-1]) > -1e-6).all()
    assert np.abs(np.diff(slope)).max() < 0.01


def test_a_foot_is_over_its_place_before_it_may_touch():
    assert progress_of(np.array([0.0, ACROSS, 1.0])) == pytest.approx([0, 1, 1])
    assert height_of(np.array([NEAR]), LANDING[0])[0] < 0.35


@pytest.mark.slow
def test_feet_that_land_faster_are_louder():
    levels = []
    for landing in (0.1, 0.5, 2.0):
        trial = run(GO2, Trot(landing=landing))
        assert upright(trial)
        fast = np.diff(trial.motion.velocity[::10], 2, axis=0)
        levels.append(float(np.sqrt(np.mean(np.square(fast)))))
    assert levels[0] < levels[1] < levels[2]


@pytest.mark.parametrize("blind", [False, True])
def test_blind_control_trots_upright_and_no_force_sensor_changes_it(blind):
    motion = Trot(blind=blind)
    deaf = FAULTS["quadruped"]["force-jump"]
    good, wrong = (_trial(Start("go2", 1, motion), defect, 3.0) for defect in (no_defect, deaf))
    assert upright(good)
    assert wrong.events
    assert (np.abs(good.motion.velocity - wrong.motion.velocity).max() == 0) == blind
    assert ("force-jump" in suited("quadruped", motion)) != blind
    assert ("limit-cycle" in suited("quadruped", motion)) != blind


def test_feet_come_down_at_the_neutral_point(timing):
    speed, hip = 0.4, np.array([0.2, 0.1])
    way = np.column_stack((speed * TIME, np.zeros_like(TIME)))
    own = [beat for beat in timing if beat.group == 0]
    places = footholds(own, hip, way=way, yaw=np.zeros_like(TIME), stop=6.0 - TICK)
    assert places[0] == (*hip, 0.0)
    for (beat, following), place in zip(pairwise(own), places[1:-1], strict=True):
        standing = following.lift - beat.touch  # Raibert: half a stance ahead of the hip
        expected = hip[0] + speed * (beat.touch + standing / 2)
        assert place[0] == pytest.approx(expected, abs=speed * TICK)
        assert place[1] == hip[1]


def test_feet_turn_with_the_body(timing):
    yaw = 0.3 * TIME
    own = [beat for beat in timing if beat.group == 1]
    places = footholds(own, np.array([0.2, 0.1]), way=np.zeros((6000, 2)), yaw=yaw, stop=5.5)
    for x, y, direction in places:
        turned = (0.2 + 0.1j) * np.exp(1j * direction)
        assert (x, y) == pytest.approx((turned.real, turned.imag))
    assert places[-1][2] == pytest.approx(0.3 * 5.5)


@pytest.mark.parametrize("way", ["straight", "curve", "directions", "spot"])
def test_the_body_goes_from_rest_to_rest_its_way(way):
    rng = np.random.default_rng(1)
    path, yaw = steer(TIME, way, GO2, rng, bouts=[(0.5, 5.5)])
    velocity = np.gradient(path, TICK, axis=0)
    speed = np.linalg.norm(velocity, axis=1)
    ahead = velocity[:, 0] * np.cos(yaw) + velocity[:, 1] * np.sin(yaw)
    assert not speed[TIME < 0.49].any()
    assert speed[TIME > 5.51].max() < 1e-9
    assert speed.max() <= GO2.speed * 1.001
    assert np.abs(np.diff(velocity, axis=0)).max() < 2 * GO2.speed / CHANGE * 2 * TICK
    if way == "spot":
        assert speed.max() == 0
    elif way == "directions":
        assert ahead[TIME > 1].max() < 0.5 * GO2.speed
    else:
        assert ahead[(TIME > 1) & (TIME < 4)].min() > 0.3 * GO2.speed
        assert (np.ptp(yaw) > 0.2) == (way == "curve")


@pytest.mark.parametrize(
    ("name", "together"), [("trot", {(0, 3), (1, 2)}), ("pace", {(0, 2), (1, 3)})]
)
def test_two_feet_swing_at_once_in_a_trot_and_a_pace(name, together):
    assert {tuple(np.flatnonzero(now).tolist()) for now in _swing(name) if now.any()} == together


def test_a_walk_lifts_one_foot_at_a_time_in_the_lateral_sequence():
    swing = _swing("walk")
    assert swing.sum(axis=1).max() == 1
    order = [int(np.argmax(now)) for now in swing if now.any()]
    sequence = [foot for foot, after in pairwise(order) if foot != after]
    assert sequence[:8] == [2, 0, 3, 1] * 2  # rear left, front left, rear right, front right
    inside = (TIME > 1.5) & (TIME < 4.5)
    assert swing[inside].mean() == pytest.approx(1 - GAITS["walk"].duty, abs=0.02)


@pytest.mark.parametrize("name", GAITS)
def test_the_feet_on_the_ground_share_the_weight_in_every_gait(name):
    gait = GAITS[name]
    timing = _timing(gait)
    load, share = loads(TIME, timing, gait), swings(TIME, timing, gait)
    np.testing.assert_allclose(load.sum(axis=1), 1, atol=1e-12)
    assert not load[share < 1].any()


def _timing(gait):
    rng = np.random.default_rng(4)
    return beats(rng, begin=0.5, end=5.5, period=0.7, jitter=0.1, gait=gait)


def _swing(name):
    gait = GAITS[name]
    return swings(TIME, _timing(gait), gait) < 1


ANYMAL = WIDE["anymal"]
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
    assert upright(trial, most=0.05)
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


def test_an_obstacle_is_an_impact_and_the_run_is_healthy_before(trot):
    healthy, _ = trot
    case = SCENARIOS["obstacle-full"].cases["quadruped"]
    stumble = _trial(Start("go2", SEED, case.motion), case.defect, SHORT)
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
