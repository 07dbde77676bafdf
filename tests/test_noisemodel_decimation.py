from dataclasses import replace

import numpy as np
import pytest

from noisemodel import Block, Run, RunError, decimated, ondemand
from noisemodel.ondemand import OnDemand


def run_of(hertz, *, rate=10_000, seconds=3.0, **fields):
    time = 5.0 + np.arange(round(rate * seconds)) / rate
    velocity = np.sin(2 * np.pi * hertz * (time - 5.0))[:, None]
    return Run(time=time, velocity=velocity, joint_names=("elbow",), **fields)


@pytest.mark.parametrize("rate", [5000.0, 1000.0, 2500.0, 300.0])
def test_a_slow_motion_is_unchanged(rate):
    slow = decimated(run_of(20.0), rate)
    assert slow.rate == pytest.approx(rate)
    inner = slice(20, -20)
    expected = np.sin(2 * np.pi * 20.0 * (slow.time - 5.0))
    np.testing.assert_allclose(slow.velocity[inner, 0], expected[inner], atol=3e-3)
    assert slow.time[0] == 5.0


def test_frequencies_above_the_lower_nyquist_frequency_are_removed_not_folded():
    slow = decimated(run_of(900.0), 1000.0)
    assert np.abs(slow.velocity[20:-20]).max() < 1e-2


def test_the_noise_of_a_decimated_run_is_not_the_decimated_noise():
    # |sin| of 900 Hz has power at 0 Hz; a slower logger's velocities would have none.
    noise = np.abs(run_of(900.0).velocity).mean()
    assert noise > 0.6
    assert np.abs(decimated(run_of(900.0), 1000.0).velocity[20:-20]).mean() < 1e-2


def test_a_constant_velocity_stays_constant_to_the_edges():
    time = np.arange(10_000) / 10_000
    run = Run(time=time, velocity=np.full((10_000, 1), 2.0), joint_names=("a",))
    np.testing.assert_allclose(decimated(run, 1000.0).velocity, 2.0, atol=2e-3)


def test_all_velocities_are_decimated_and_nothing_else_is_kept():
    run = run_of(20.0)
    run = run_of(
        20.0,
        velocity_desired=run.velocity,
        stages={"planned": run.velocity},
        position=run.velocity,
        effort=run.velocity,
        base_velocity=np.tile(run.velocity, 6),
        base_pose=np.tile([0.0, 0, 0, 0, 0, 0, 1], (len(run.time), 1)),
        blocks=(Block(5.0, 6.0, "ok"),),
        meta={"seed": 1},
        robot="panda",
    )
    slow = decimated(run, 1000.0)
    np.testing.assert_array_equal(slow.velocity, slow.velocity_desired)
    np.testing.assert_array_equal(slow.velocity, slow.stages["planned"])
    assert slow.base_velocity.shape == (3000, 6)
    assert (slow.position, slow.effort, slow.base_pose) == (None, None, None)
    assert (slow.blocks, dict(slow.meta), slow.robot) == (run.blocks, {"seed": 1}, "panda")


def test_what_a_gap_reaches_into_is_not_valid():
    valid = np.ones(30_000, dtype=bool)
    valid[15_000:15_100] = False
    slow = decimated(run_of(20.0, valid=valid), 1000.0)
    assert not slow.valid[1490:1520].any()
    assert slow.valid[:1490].all()
    assert slow.valid[1520:].all()
    assert (slow.velocity[~slow.valid] == 0).all()


def test_the_same_rate_changes_nothing():
    run = run_of(20.0)
    assert decimated(run, 10_000.0) is run


def test_a_rate_is_never_raised():
    with pytest.raises(RunError, match="a run of 1000 Hz cannot be decimated to 2000 Hz"):
        decimated(run_of(20.0, rate=1000), 2000.0)


def test_too_little_motion_is_refused():
    with pytest.raises(RunError, match="0.001 s of motion are too short for 1000 Hz"):
        decimated(run_of(20.0, seconds=0.001), 1000.0)


@pytest.mark.parametrize("rate", [0.0, -1000.0])
def test_a_lower_rate_is_above_zero(rate):
    with pytest.raises(RunError, match=f"^a run of 10000 Hz cannot be decimated to {rate:g} Hz$"):
        decimated(run_of(20.0), rate)


def test_two_samples_are_left_at_least():
    assert len(decimated(run_of(20.0, seconds=0.002), 1000.0).time) == 2
    with pytest.raises(RunError, match=r"^0.0019 s of motion are too short for 1000 Hz$"):
        decimated(run_of(20.0, seconds=0.0019), 1000.0)


@pytest.mark.parametrize("gap", [0, 7, 150, 2995, 2999])
def test_ten_samples_to_either_side_of_a_gap_are_not_valid(gap):
    valid = np.ones(30_000, dtype=bool)
    valid[10 * gap + 3] = False
    slow = decimated(run_of(20.0, valid=valid), 1000.0)
    lost = np.flatnonzero(~slow.valid)
    assert lost.tolist() == [*range(max(0, gap - 10), min(3000, gap + 11))]
    assert (slow.velocity[lost] == 0.0).all()


@pytest.mark.parametrize(("up", "down"), [(1, 3), (2, 5), (1, 25), (4, 5)])
def test_rows_that_are_decimated_on_demand_are_those_of_the_whole(monkeypatch, up, down):
    monkeypatch.setattr(ondemand, "AT_ONCE", 8 * 20)
    run = run_of(90.0, rate=1000, seconds=0.503, valid=np.arange(503) != 300)
    shifted = replace(run, velocity=run.velocity + 3.0 + np.linspace(0.0, 5.0, 503)[:, None])
    there = OnDemand((503, 1), np.float64, lambda first, stop: shifted.velocity[first:stop])
    whole = decimated(shifted, 1000.0 * up / down)
    kept = decimated(replace(shifted, velocity=there), 1000.0 * up / down)
    assert isinstance(kept.velocity, OnDemand)
    samples = 503 * up // down
    assert kept.velocity.shape == whole.velocity.shape == (samples, 1)
    for first in (0, 1, 2, 3, 7, samples // 2, samples - 5, samples - 1):
        for stop in (first, first + 1, first + 4, samples):
            found = kept.velocity[first:stop]
            np.testing.assert_allclose(found, whole.velocity[first:stop], atol=1e-12)
    np.testing.assert_array_equal(kept.valid, whole.valid)
