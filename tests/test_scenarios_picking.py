"""Plans are smooth, stay in reach and press only where a contact is planned."""

import numpy as np
import pytest

from noiseclassifier.scenarios.arm import Plan, pick
from noiseclassifier.scenarios.motions import TICK, Picks, Rod, bump, minimum_jerk

START = np.array([0.46, 0.0, 0.43])
REACH = ((0.4, 0.58), (-0.2, 0.2))


TOOL = Rod("hand", length=0.08, radius=0.01)
WAYS = ("straight", "curve", "directions", "spot")


def plan(seed: int, duration: float, way: str = "straight") -> Plan:
    rng = np.random.default_rng(seed)
    return pick(
        Picks(way=way), rng, start=START, tool=TOOL, table=0.1, reach=REACH, duration=duration
    )


def test_a_movement_starts_and_ends_at_rest():
    share = minimum_jerk(np.linspace(0, 1, 1001))
    assert share[0] == 0
    assert share[-1] == pytest.approx(1)
    assert np.diff(share)[[0, -1]] == pytest.approx(0, abs=1e-7)


def test_a_bend_leaves_the_path_and_returns():
    path = bump(np.linspace(0, 1, 1001))
    assert path[[0, 500, -1]] == pytest.approx([0, 1, 0])
    assert np.diff(path)[[0, -1]] == pytest.approx(0, abs=2e-5)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("seed", range(5))
def test_a_plan_never_jumps(seed, way):
    one = plan(seed, 8.0, way)
    speed = np.linalg.norm(np.diff(one.position, axis=0), axis=1) / TICK
    assert speed.max() < 1.5
    assert np.abs(np.diff(speed)).max() / TICK < 16.0
    assert np.abs(np.diff(one.yaw)).max() / TICK < 2.5


@pytest.mark.parametrize("seed", range(5))
def test_a_plan_stays_in_reach_and_above_the_table(seed):
    x, y, z = plan(seed, 8.0).position[2000:].T
    assert (z > 0.1).all()
    assert ((x >= REACH[0][0]) & (x <= REACH[0][1])).all()
    assert ((y >= REACH[1][0]) & (y <= REACH[1][1])).all()


def test_force_is_controlled_exactly_while_a_touch_is_planned():
    one = plan(1, 7.0)
    planned = np.zeros(len(one.time), dtype=bool)
    for contact in one.contacts:
        planned |= (one.time > contact.start - TICK / 2) & (one.time < contact.lift - TICK)
    assert np.mean(planned != np.isfinite(one.force)) < 1e-3
    assert np.nanmax(one.force) >= 15


def test_a_short_plan_is_the_beginning_of_a_long_one():
    short, long = plan(2, 3.0), plan(2, 9.0)
    np.testing.assert_array_equal(short.position, long.position[: len(short.time)])
    assert short.contacts == long.contacts[: len(short.contacts)]


def test_the_shortest_run_has_half_a_second_of_pressing():
    assert all(plan(seed, 3.0).contacts[0].start <= 2.5 for seed in range(200))


def test_a_plan_that_begins_later_rests_before():
    one = plan(3, 3.0)
    later = one.after(100)
    assert later.duration == pytest.approx(one.duration + 0.1)
    np.testing.assert_array_equal(later.position[:101], np.tile(one.position[0], (101, 1)))
    assert later.contacts[0].start == pytest.approx(one.contacts[0].start + 0.1)


def test_on_the_spot_all_contacts_are_at_one_place_and_in_all_directions_there_are_none():
    assert len({contact.place for contact in plan(4, 12.0, "spot").contacts}) == 1
    assert len({contact.place for contact in plan(4, 12.0).contacts}) > 1
    assert plan(4, 12.0, "directions").contacts == ()
