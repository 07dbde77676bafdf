"""Arms move in the air within their limits, and forces from outside act where and when they say."""

from dataclasses import replace
from functools import lru_cache
from itertools import cycle

import numpy as np
import pytest

from noiseclassifier.scenarios.arm import plan
from noiseclassifier.scenarios.arm_reaching import KINDS, ReachPlan
from noiseclassifier.scenarios.domains import arm_motion
from noiseclassifier.scenarios.errors import ScenarioError
from noiseclassifier.scenarios.faults import (
    ON_DRIVES,
    SLOW,
    Collisions,
    Defect,
    Faults,
    JointStops,
    NoDefect,
    Obstacles,
    Pushes,
)
from noiseclassifier.scenarios.labels import deviation
from noiseclassifier.scenarios.motions import (
    TICK,
    Collision,
    JointStop,
    Payload,
    Picks,
    Push,
    Reach,
)
from noiseclassifier.scenarios.robots import WIDE, Arm
from noiseclassifier.scenarios.simulation import Start, Trial, _trial
from noiseclassifier.scenarios.table import FAULTS, suited
from noiseclassifier.scenarios.world import reduced_model

OWN = {n: each for n, each in FAULTS["arm"].items() if n not in ON_DRIVES}

ARMS = tuple(robot for robot in WIDE.values() if robot.family == "arm")
PANDA = WIDE["panda"]
SO101 = WIDE["so101"]

RNG = np.random.default_rng
BY_NAME = {arm.name: arm for arm in ARMS}


class Given:
    """A defect with given faults."""

    def __init__(self, faults: Faults) -> None:
        self.faults = faults

    def draw(self, rng: np.random.Generator, plan: object) -> Faults:
        return self.faults


def reach(arm: Arm = PANDA, seed: int = 1, duration: float = 4.0, **settings) -> ReachPlan:
    return plan(arm, Reach(**settings), RNG(seed), duration)


@lru_cache
def trial(arm: str, motion: Picks | Reach, defect: Defect = NoDefect()) -> Trial:  # noqa: B008
    return _trial(Start(arm, 1, motion), defect, 2.0)


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


def test_a_trapezoid_jumps_from_no_acceleration_to_a_constant_one():
    acceleration = np.diff(reach(kind="trapezoid").joints[:, :], 2, axis=0) / TICK**2
    fastest = np.abs(acceleration).max(axis=1)
    assert np.mean(fastest < 1e-6) > 0.3  # constant speed, or at rest
    changes = np.flatnonzero(np.abs(np.diff(fastest)) > 0.05)
    assert 4 <= len(changes) < 60


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


def test_an_unknown_kind_of_motion_is_refused():
    with pytest.raises(ScenarioError, match=r"kind 'dance' is unknown; there are minimum"):
        reach(kind="dance")


def test_an_arm_without_a_table_cannot_pick():
    with pytest.raises(ScenarioError, match=r"so101 has no table to pick from"):
        plan(SO101, Picks(), RNG(0), 3.0)


def follows(one: Trial, arm: Arm) -> None:
    """Check that joints follow their references, and drives are not saturated for long."""
    motion = one.motion
    assert np.abs(motion.position_desired - motion.position).max() < 0.05
    assert np.sqrt(np.mean((motion.velocity_desired - motion.velocity) ** 2)) < 0.1
    assert np.mean(np.abs(motion.torque) >= 0.999 * np.array(arm.drives.torque)) < 0.01
    assert np.abs(motion.velocity).max() > 0.05


@pytest.mark.parametrize("arm", [SO101, BY_NAME["baxter"]], ids=lambda arm: arm.name)
def test_an_arm_follows_what_is_planned(arm):
    follows(trial(arm.name, Reach(kind="spline")), arm)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arm", "kind"),
    [*zip(ARMS, cycle(KINDS), strict=False), (PANDA, "picks"), (BY_NAME["ur3"], "picks")],
    ids=lambda each: getattr(each, "name", each),
)
def test_every_arm_and_every_motion_are_followed(arm, kind):
    follows(trial(arm.name, Picks() if kind == "picks" else Reach(kind=kind)), arm)


@pytest.mark.parametrize("arm", ARMS[-4:], ids=lambda arm: arm.name)
def test_gains_suit_the_inertia_that_joints_move(arm):
    import pinocchio as pin

    model, drives = reduced_model(arm), arm.drives
    inertia = np.diag(pin.crba(model, model.createData(), np.array(arm.rest)))
    moved = inertia + drives.armature
    frequency = np.sqrt(np.array(drives.stiffness) / moved) / (2 * np.pi)
    np.testing.assert_allclose(frequency, 8.0, rtol=0.1)


def test_a_held_payload_loads_the_arm_with_its_weight():
    still = Reach(speed=(0.001, 0.001), spread=0.001)
    held = Payload(frame=PANDA.tool.frame, start=0.2, stop=1.2, mass=1.5)
    bare = trial("panda", still).motion.torque
    loaded = trial("panda", still, Given(Faults(loads=(held,)))).motion.torque
    before, during, after = (slice(a, b) for a, b in ((0, 2000), (9000, 12000), (17000, 20000)))
    np.testing.assert_array_equal(loaded[before], bare[before])
    import pinocchio as pin

    model = reduced_model(PANDA)
    jacobian = pin.computeFrameJacobian(
        model,
        model.createData(),
        np.array(PANDA.rest),
        model.getFrameId(PANDA.tool.frame),
        pin.LOCAL_WORLD_ALIGNED,
    )
    expected = jacobian[2] * 1.5 * 9.81  # the tool points down: its tip is below the frame
    friction = 2 * 1.5 * np.array(PANDA.drives.friction)
    assert (np.abs((loaded - bare)[during].mean(axis=0) - expected) < friction + 0.02).all()
    assert (np.abs((loaded - bare)[after].mean(axis=0)) < friction).all()


@pytest.mark.parametrize("stiffness", [1e3, 1e5])
def test_a_collision_starts_when_it_says_and_is_no_stronger_than_its_limit(stiffness):
    motion = Reach(speed=(1.0, 1.0))
    obstacle = Collision(
        frame=PANDA.tool.frame, start=0.5, hold=0.3, stiffness=stiffness, limit=50.0
    )
    healthy, hit = (
        trial("panda", motion, defect) for defect in (NoDefect(), Given(Faults(loads=(obstacle,))))
    )
    (event,) = hit.events
    assert event.label == "impact"
    assert 0.5 <= event.start < 0.55
    assert 0 < event.facts["force"] <= 50.0
    onset = round(event.start * 10_000)
    velocity, twin = hit.motion.velocity, healthy.motion.velocity
    np.testing.assert_array_equal(velocity[:onset], twin[:onset])
    loudness = np.linalg.norm(deviation(velocity, twin, rate=10_000), axis=1)
    assert loudness[onset : onset + 1700].max() > 0.02
    assert loudness[onset + 1700 :].max() < loudness[onset : onset + 1700].max()


def test_a_hard_collision_is_louder_than_a_soft_one():
    motion = Reach(speed=(1.0, 1.0))
    soft, hard = (
        Collision(frame=PANDA.tool.frame, start=0.5, hold=0.3, stiffness=k, limit=50.0)
        for k in (1e3, 1e5)
    )
    forces = [
        trial("panda", motion, Given(Faults(loads=(load,)))).events[0].facts["force"]
        for load in (soft, hard)
    ]
    assert forces[1] > 2 * forces[0]


def test_an_end_stop_holds_its_joint():
    motion = Reach(speed=(0.8, 0.8))
    joints = plan(PANDA, motion, RNG(np.random.SeedSequence(1).spawn(4)[0]), 2.0).joints
    (free,) = (trial("panda", motion),)
    joint = int(np.ptp(free.motion.position, axis=0).argmax())
    way = free.motion.position[:, joint] - joints[0, joint]
    side = 1 if way.max() > -way.min() else -1
    angle = float(joints[0, joint] + 0.5 * side * np.abs(way).max())
    stop = JointStop(joint=joint, angle=angle, side=side, stiffness=2e4)
    held = trial("panda", motion, Given(Faults(loads=(stop,))))
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
        drawn = plan(PANDA, one, RNG(0), 3.0)
        faults = OWN[name].draw(RNG(1), drawn)
        assert all(0 <= event.start < event.stop for event in faults.events)
        acts = bool(faults.events or faults.loads or faults.boxes)
        assert acts == (name in suited("arm", one))


def test_a_collision_is_drawn_while_the_tool_moves():
    one = reach(duration=6.0)
    speed = np.linalg.norm(np.gradient(one.position, TICK, axis=0), axis=1)
    for seed in range(10):
        for load in Collisions().draw(RNG(seed), one).loads:
            assert speed[round(load.start / TICK)] > 0.05


def test_pushes_are_drawn_while_the_tool_stands_or_is_slow():
    for seed in range(10):
        one = reach(seed=seed, duration=6.0, stand=3.0)
        speed = np.linalg.norm(np.gradient(one.position, TICK, axis=0), axis=1)
        faults = Pushes().draw(RNG(seed), one)
        for load in faults.loads:
            now = slice(round(load.start / TICK), round(load.stop / TICK))
            assert speed[now].max() <= SLOW
            assert 3.0 <= np.linalg.norm(load.force) <= 40.0
            assert 0.6 <= load.start < load.start + load.rise + load.fall <= load.stop <= 5.4
        assert [(event.start, event.stop) for event in faults.events] == [
            (load.start, load.stop) for load in faults.loads
        ]


def test_a_push_begins_and_ends_when_it_says():
    still = Reach(speed=(0.001, 0.001), spread=0.001)
    push = Push(along=1.0, start=0.4, stop=1.2, rise=0.2, fall=0.3, force=(0.0, 20.0, 0.0))
    bare = trial("panda", still).motion.torque
    held = trial("panda", still, Given(Faults(loads=(push,)))).motion.torque
    first, last = round(push.start * 10_000), round(push.stop * 10_000)
    np.testing.assert_array_equal(held[:first], bare[:first])
    change = np.abs(held - bare).max(axis=1)
    assert change[first + 2000 : last - 3000].min() > 3.0
    assert change[-3000:].max() < 2 * 1.5 * max(PANDA.drives.friction)


def test_an_arm_stands_for_as_long_as_it_says():
    one = reach(stand=2.0, duration=4.0)
    moves = np.flatnonzero(np.abs(one.joints - one.joints[0]).max(axis=1) > 1e-9)
    assert moves[0] * TICK == pytest.approx(2.0, abs=0.05)
    drawn = [arm_motion(RNG(seed), 0.5) for seed in range(300)]
    stands = [one.stand > 1.0 for one in drawn if isinstance(one, Reach)]
    assert np.mean(stands) == pytest.approx(0.3, abs=0.08)


def test_nothing_is_drawn_for_an_arm_that_stands():
    still = reach(speed=(0.001, 0.001), spread=0.001)
    for defect in (Collisions(), JointStops(), Obstacles((0.01, 0.02), (0.05, 0.05))):
        faults = defect.draw(RNG(0), still)
        assert (faults.loads, faults.boxes, faults.events) == ((), (), ())


def test_wild_motions_are_faster_than_mild_ones_and_one_third_are_picks():
    drawn = {
        wildness: [arm_motion(RNG(seed), wildness) for seed in range(300)] for wildness in (0, 1)
    }
    tops = [
        max(one.speed[1] for one in drawn[wildness] if isinstance(one, Reach))
        for wildness in (0, 1)
    ]
    assert tops[0] <= 0.5 < 2.0 < tops[1] <= 2.5
    assert not any(one.stops for one in drawn[0] if isinstance(one, Reach))
    assert np.mean([isinstance(one, Picks) for one in drawn[1]]) == pytest.approx(0.35, abs=0.08)
    assert {one.kind for one in drawn[1] if isinstance(one, Reach)} == set(KINDS)
    assert not any(isinstance(arm_motion(RNG(seed), 1.0, SO101), Picks) for seed in range(30))


def test_a_scaled_arm_has_all_lengths_scaled():
    large = PANDA.scaled(1.1)
    assert large.tool.length == pytest.approx(1.1 * PANDA.tool.length)
    assert large.table == pytest.approx(1.1 * PANDA.table)
    assert large.reach[0][1] == pytest.approx(1.1 * PANDA.reach[0][1])
    assert large.length_scale == 1.1
    assert replace(PANDA.scaled(1.0), reach=PANDA.reach) == PANDA
