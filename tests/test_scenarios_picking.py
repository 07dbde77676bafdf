"""Plans are smooth, stay in reach and press only where a contact is planned."""

import numpy as np
import pytest

from scenarios.clock import TICK
from scenarios.picking import Plan, minimum_jerk, pick

START = np.array([0.46, 0.0, 0.43])
REACH = ((0.4, 0.58), (-0.2, 0.2))


def plan(seed: int, duration: float) -> Plan:
    rng = np.random.default_rng(seed)
    return pick(rng, start=START, table=0.1, reach=REACH, duration=duration)


def test_a_movement_starts_and_ends_at_rest():
    share = minimum_jerk(np.linspace(0, 1, 1001))
    assert share[0] == 0
    assert share[-1] == pytest.approx(1)
    assert np.diff(share)[[0, -1]] == pytest.approx(0, abs=1e-7)


@pytest.mark.parametrize("seed", range(5))
def test_a_plan_never_jumps(seed):
    one = plan(seed, 8.0)
    speed = np.linalg.norm(np.diff(one.position, axis=0), axis=1) / TICK
    assert speed.max() < 1.2
    assert np.abs(np.diff(speed)).max() / TICK < 12.0
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
    for touch in one.touches:
        planned |= (one.time > touch.start - TICK / 2) & (one.time < touch.lift - TICK)
    assert np.mean(planned != np.isfinite(one.force)) < 1e-3
    assert np.nanmax(one.force) >= 15


def test_a_short_plan_is_the_beginning_of_a_long_one():
    short, long = plan(2, 3.0), plan(2, 9.0)
    np.testing.assert_array_equal(short.position, long.position[: len(short.time)])
    assert short.touches == long.touches[: len(short.touches)]


def test_the_shortest_run_has_half_a_second_of_pressing():
    assert all(plan(seed, 3.0).touches[0].start <= 2.5 for seed in range(200))


def test_a_plan_that_begins_later_rests_before():
    one = plan(3, 3.0)
    later = one.after(100)
    assert later.duration == pytest.approx(one.duration + 0.1)
    np.testing.assert_array_equal(later.position[:101], np.tile(one.position[0], (101, 1)))
    assert later.touches[0].start == pytest.approx(one.touches[0].start + 0.1)
