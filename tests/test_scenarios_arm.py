"""Arms pick and move in the air within their limits, and forces act where and when they say."""

from functools import lru_cache
from itertools import cycle

import numpy as np
import pinocchio as pin
import pytest

from noiseclassifier.scenarios.arm import KINDS, ReachPlan, Tool, plan
from noiseclassifier.scenarios.domains import arm_motion
from noiseclassifier.scenarios.faults import SLOW, Defect, Faults, no_defect
from noiseclassifier.scenarios.labels import deviation
from noiseclassifier.scenarios.motions import TICK, Collision, JointStop, Payload, Picks, Reach
from noiseclassifier.scenarios.robots import WIDE, Arm
from noiseclassifier.scenarios.simulation import FAULTS, ON_DRIVES, Start, Trial, _trial, suited
from noiseclassifier.scenarios.world import reduced_model

OWN = {n: each for n, each in FAULTS["arm"].items() if n not in ON_DRIVES}
WAYS = ("straight", "curve", "directions", "spot")

ARMS = tuple(robot for robot in WIDE.values() if robot.family == "arm")
PANDA = WIDE["panda"]
SO101 = WIDE["so101"]

RNG = np.random.default_rng


def given(*loads) -> Defect:
    """A defect with given loads."""
    return lambda rng, plan: Faults(loads=loads)


def pick(seed: int, duration: float, way: str = "straight"):
    return plan(PANDA, Picks(way=way), RNG(seed), duration)


def reach(arm: Arm = PANDA, seed: int = 1, duration: float = 4.0, **settings) -> ReachPlan:
    return plan(arm, Reach(**settings), RNG(seed), duration)


@lru_cache
def trial(arm: str, motion: Picks | Reach, defect: Defect = no_defect) -> Trial:
    return _trial(Start(arm, 1, motion), defect, 2.0)


@lru_cache
def planned(motion: Picks | Reach):
    return plan(PANDA, motion, RNG(0), 3.0)


@pytest.mark.parametrize("way", WAYS)
def test_picks_never_jump(way):
    for seed in range(5):
        one = pick(seed, 8.0, way)
        speed = np.linalg.norm(np.diff(one.places[:, 0], axis=0), axis=1) / TICK
        assert speed.max() < 1.5
        assert np.abs(np.diff(speed)).max() / TICK < 16.0
        assert np.abs(np.diff(one.yaw)).max() / TICK < 2.5


def test_picks_stay_in_reach_and_above_the_table_and_press_where_a_contact_is_planned():
    for seed in range(5):
        one = pick(seed, 8.0)
        x, y, z = one.places[2000:, 0].T
        (x0, x1), (y0, y1) = PANDA.reach
        assert (z > 0.1).all()
        assert ((x >= x0) & (x <= x1) & (y >= y0) & (y <= y1)).all()
        planned = np.zeros(len(one.time), dtype=bool)
        for contact in one.contacts:
            planned |= (one.time > contact.start - TICK / 2) & (one.time < contact.lift - TICK)
        assert np.mean(planned != np.isfinite(one.force)) < 1e-3
        assert np.nanmax(one.force) >= 15


def test_short_picks_are_the_beginning_of_long_ones_and_press_for_half_a_second():
    short, long = pick(2, 3.0), pick(2, 9.0)
    np.testing.assert_array_equal(short.places, long.places[: len(short.time)])
    assert short.contacts == long.contacts[: len(short.contacts)]
    assert all(pick(seed, 3.0).contacts[0].start <= 2.5 for seed in range(50))


def test_on_the_spot_all_contacts_are_at_one_place_and_in_all_directions_there_are_none():
    places = {way: {c.place for c in pick(4, 12.0, way).contacts} for way in WAYS}
    assert (len(places["spot"]), len(places["directions"])) == (1, 0)
    assert len(places["straight"]) > 1


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("arm", [PANDA, SO101], ids=lambda arm: arm.name)
def test_a_plan_stays_within_limits_and_speed(arm, kind):
    model = reduced_model(arm)
    for seed in range(3):
        joints = reach(arm, seed, kind=kind, speed=(0.2, 1.0), spread=1.2).joints
        count = joints.shape[1]
        assert (joints > model.lowerPositionLimit[:count]).all()
        assert (joints < model.upperPositionLimit[:count]).all()
        assert np.abs(np.diff(joints, axis=0)).max() / TICK < 1.06
        assert np.ptp(joints, axis=0).max() > 0.02


@pytest.mark.parametrize("kind", sorted(set(KINDS) - {"teleoperation", "trapezoid"}))
def test_a_smooth_plan_has_no_jump_of_its_velocity(kind):
    joints = reach(kind=kind, acceleration=8.0).joints
    assert np.abs(np.diff(joints, 2, axis=0)).max() / TICK**2 < 12.0


def test_a_short_plan_is_the_beginning_of_a_long_one():
    settings = {"stops": 0.5, "payload": (1.0, 2.0)}
    short, long = reach(duration=3.0, **settings), reach(duration=6.0, **settings)
    np.testing.assert_allclose(short.joints[:-200], long.joints[: len(short.joints) - 200])
    assert short.stops == long.stops[: len(short.stops)]


def test_an_emergency_stop_brakes_within_a_fifth_of_a_second():
    one = reach(kind="sines", stops=2.0, duration=8.0)
    speed = np.abs(np.gradient(one.joints, TICK, axis=0)).max(axis=1)
    assert one.stops
    for stop in one.stops:
        halted = speed[round((stop + 0.21) / TICK) : round((stop + 0.45) / TICK)]
        assert halted.max(initial=0.0) < 1e-3


@pytest.mark.parametrize(
    ("arm", "kind"),
    [
        (SO101, "spline"),
        *(
            pytest.param(*each, marks=pytest.mark.slow)
            for each in (*zip(ARMS[::2], cycle(KINDS)), (PANDA, "picks"))
        ),
    ],
    ids=lambda each: getattr(each, "name", each),
)
def test_every_kind_of_motion_is_followed(arm, kind):
    """Joints are where their references are, and drives are not saturated for long."""
    motion = trial(arm.name, Picks() if kind == "picks" else Reach(kind=kind)).motion
    assert np.abs(motion.position_desired - motion.position).max() < 0.05
    assert np.sqrt(np.mean((motion.velocity_desired - motion.velocity) ** 2)) < 0.1
    assert np.mean(np.abs(motion.torque) >= 0.999 * np.array(arm.drives.torque)) < 0.01
    assert np.abs(motion.velocity).max() > 0.05


def test_gains_suit_the_inertia_that_joints_move():
    arm = ARMS[-1]
    model, drives = reduced_model(arm), arm.drives
    inertia = np.diag(pin.crba(model, model.createData(), np.array(arm.rest)))
    frequency = np.sqrt(drives.stiffness / (inertia + drives.armature)) / (2 * np.pi)
    np.testing.assert_allclose(frequency, 8.0, rtol=0.1)


def test_a_held_payload_loads_the_arm_with_its_weight():
    still = Reach(speed=(0.001, 0.001), spread=0.001)
    held = Payload(frame=PANDA.tool.frame, start=0.2, stop=1.2, mass=1.5)
    bare = trial("panda", still).motion.torque
    loaded = trial("panda", still, given(held)).motion.torque
    before, during, after = (slice(a, b) for a, b in ((0, 2000), (9000, 12000), (17000, 20000)))
    np.testing.assert_array_equal(loaded[before], bare[before])
    *_, jacobian = Tool(PANDA).jacobian(np.array(PANDA.rest))
    expected = jacobian[2] * 1.5 * 9.81
    friction = 2 * 1.5 * np.array(PANDA.drives.friction)
    assert (np.abs((loaded - bare)[during].mean(axis=0) - expected) < friction + 0.02).all()
    assert (np.abs((loaded - bare)[after].mean(axis=0)) < friction).all()


def test_a_collision_starts_when_it_says_is_within_its_limit_and_louder_if_hard():
    motion = Reach(speed=(1.0, 1.0))
    soft, hard = (
        Collision(frame=PANDA.tool.frame, start=0.5, hold=0.3, stiffness=k, limit=50.0)
        for k in (1e3, 1e5)
    )
    healthy, touched, hit = (
        trial("panda", motion, defect) for defect in (no_defect, given(soft), given(hard))
    )
    (event,) = hit.events
    assert event.label == "impact"
    assert 0.5 <= event.start < 0.55
    assert 2 * touched.events[0].facts["force"] < event.facts["force"] <= 50.0
    onset = round(event.start * 10_000)
    velocity, twin = hit.motion.velocity, healthy.motion.velocity
    np.testing.assert_array_equal(velocity[:onset], twin[:onset])
    loudness = np.linalg.norm(deviation(velocity, twin, rate=10_000), axis=1)
    assert loudness[onset : onset + 1700].max() > 0.02
    assert loudness[onset + 1700 :].max() < loudness[onset : onset + 1700].max()


def test_an_end_stop_holds_its_joint():
    motion = Reach(speed=(0.8, 0.8))
    joints = plan(PANDA, motion, RNG(np.random.SeedSequence(1).spawn(4)[0]), 2.0).joints
    free = trial("panda", motion)
    joint = int(np.ptp(free.motion.position, axis=0).argmax())
    way = free.motion.position[:, joint] - joints[0, joint]
    side = 1 if way.max() > -way.min() else -1
    angle = float(joints[0, joint] + 0.5 * side * np.abs(way).max())
    stop = JointStop(joint=joint, angle=angle, side=side, stiffness=2e4)
    held = trial("panda", motion, given(stop))
    assert (side * (held.motion.position[:, joint] - angle)).max() < 0.01
    event = held.events[0]
    assert (event.label, event.cause) == ("impact", "end stop of a joint")
    for later in held.events[1:]:
        assert later.label in ("impact", "highaccelerations")
        assert later.start > event.start
    onset = round(event.start * 10_000)
    np.testing.assert_array_equal(held.motion.velocity[:onset], free.motion.velocity[:onset])


@pytest.mark.parametrize("name", OWN)
def test_every_fault_suits_every_motion(name):
    for one in (Picks(), Picks(way="directions"), *(Reach(kind=kind) for kind in KINDS)):
        found = OWN[name](RNG(1), planned(one))
        assert all(0 <= event.start < event.stop for event in found.events)
        acts = bool(found.events or found.loads or found.boxes)
        assert acts == (name in suited("arm", one))


def test_collisions_are_drawn_while_the_tool_moves_and_pushes_while_it_stands_or_is_slow():
    for seed in range(10):
        one = reach(seed=seed, duration=6.0, stand=3.0)
        speed = np.linalg.norm(np.gradient(one.places[:, 0], TICK, axis=0), axis=1)
        for load in OWN["collision-hard"](RNG(seed), one).loads:
            assert speed[round(load.start / TICK)] > 0.05
        found = OWN["push"](RNG(seed), one)
        for load in found.loads:
            now = slice(round(load.start / TICK), round(load.stop / TICK))
            assert speed[now].max() <= SLOW
            assert 3.0 <= np.linalg.norm(load.force) <= 40.0
            assert 0.6 <= load.start < load.start + load.rise + load.fall <= load.stop <= 5.4
        assert [(event.start, event.stop) for event in found.events] == [
            (load.start, load.stop) for load in found.loads
        ]


def test_an_arm_stands_for_as_long_as_it_says():
    one = reach(stand=2.0, duration=4.0)
    moves = np.flatnonzero(np.abs(one.joints - one.joints[0]).max(axis=1) > 1e-9)
    assert moves[0] * TICK == pytest.approx(2.0, abs=0.05)


def test_wild_motions_are_faster_than_mild_ones_one_third_are_picks_and_some_stand():
    drawn = [[arm_motion(RNG(seed), wild, PANDA) for seed in range(300)] for wild in (0, 1)]
    mild, wild = ([one for one in each if isinstance(one, Reach)] for each in drawn)
    tops = [max(one.speed[1] for one in each) for each in (mild, wild)]
    assert tops[0] <= 0.5 < 2.0 < tops[1] <= 2.5
    assert not any(one.stops for one in mild)
    assert 1 - len(wild) / 300 == pytest.approx(0.35, abs=0.08)
    assert np.mean([one.stand > 1.0 for one in wild]) == pytest.approx(0.3, abs=0.08)
    assert {one.kind for one in wild} == set(KINDS)
    assert not any(isinstance(arm_motion(RNG(seed), 1.0, SO101), Picks) for seed in range(30))
