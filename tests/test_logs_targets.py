"""Positions that are held from sample to sample, in logs and in run files."""

from dataclasses import replace

import numpy as np
import pytest
from samplelogs import motion

from inspector import read_log
from noisemodel import Recorder, Run
from noisemodel.hold import updates

RATE, SAMPLES = 500, 4000
TIME = np.arange(SAMPLES) / RATE
POSITION, VELOCITY = motion(TIME, 4)
NOISE = np.random.default_rng(0).uniform(-1, 1, SAMPLES)
HELD = "position_desired: each target is held for "


def read(tmp_path, desired, **more):
    """The run of a log with desired positions, and whether it says that these were held."""
    arrays = {"time": TIME, "q": POSITION, "dq": VELOCITY, "q_des": desired} | more
    np.savez(tmp_path / "log.npz", **arrays)
    found = read_log(tmp_path / "log.npz")
    return found.run, [remark for remark in found.remarks if remark.startswith(HELD)]


def held(every, start=0):
    """What a policy sets every so many samples, a whole number or not."""
    ticks = np.floor((np.arange(SAMPLES) - start) / every)
    return POSITION[np.round(ticks * every + start).astype(int).clip(min=0)]


@pytest.mark.parametrize(
    ("every", "start", "said"),
    [
        (10, 0, "10 samples (50 Hz); {}: nothing above 25 Hz is left"),
        (7, 3, "7 samples (71.43 Hz); {}: nothing above 35.71 Hz is left"),
        (25, 0, "25 samples (20 Hz); {}: nothing above 10 Hz is left"),
    ],
)
def test_held_targets_are_interpolated_from_target_to_target(tmp_path, every, start, said):
    run, remarks = read(tmp_path, held(every, start))
    assert remarks == [HELD + said.format("interpolated from target to target")]
    inside = slice(2 * every, -3 * every)
    truth = VELOCITY[inside]
    error = run.velocity_desired[inside] - truth
    assert np.abs(error).max() < 0.05 * np.abs(truth).max()
    pulses = np.gradient(held(every, start), 1 / RATE, axis=0)
    assert np.abs(pulses).max() > 3 * np.abs(run.velocity_desired).max()
    assert np.array_equal(run.velocity, VELOCITY)
    replace(run, velocity_desired=None, meta={}).save(tmp_path / "run.npz")
    assert np.array_equal(Run.load(tmp_path / "run.npz").velocity_desired, run.velocity_desired)


def test_a_policys_rate_need_not_divide_the_logs(tmp_path):
    run, remarks = read(tmp_path, motion(np.floor(TIME * 60) / 60, 4)[0])
    assert remarks[0].startswith(f"{HELD}8.33 samples (60")
    error = run.velocity_desired[50:-50] - VELOCITY[50 : len(run.time) - 50]
    assert np.sqrt(np.mean(error**2)) < 0.02 * VELOCITY.std()


def test_a_target_that_rests_stays_at_rest(tmp_path):
    desired = held(10)
    desired[:1005] = desired[1005]
    desired[2000:3000] = desired[1999]
    run, remarks = read(tmp_path, desired)
    assert remarks
    assert np.abs(run.velocity_desired[20:980]).max() < 1e-9
    assert np.abs(run.velocity_desired[2030:2960]).max() < 1e-9
    assert np.abs(run.position_desired - desired[: len(run.time)])[2030:2960].max() < 1e-9


@pytest.mark.parametrize(
    ("desired", "more"),
    # The second has the steps of an encoder.
    [(POSITION, {}), (np.round(POSITION, 3), {}), (held(10), {"dq_des": VELOCITY})],
)
def test_targets_of_every_sample_or_with_velocities_are_not_interpolated(tmp_path, desired, more):
    run, remarks = read(tmp_path, desired, **more)
    assert not remarks
    assert np.array_equal(run.position_desired, desired)


@pytest.mark.parametrize("jitter", [0.0, 2e-4])
def test_the_targets_of_a_recorder_are_held_too_and_so_are_measured_positions(jitter):
    recorder, stamps = Recorder(None, RATE), TIME + 1 + jitter * NOISE
    held = (motion(np.floor(stamps * rate) / rate, 4)[0] for rate in (100, 50))
    for time, there, wanted in zip(stamps, *held, strict=True):
        recorder.push(time=time, position=there, position_desired=wanted)
    run = recorder.run()
    for found in (run.velocity, run.velocity_desired):
        error = (found - motion(run.time + stamps[0], 4)[1])[50:-50]
        assert np.sqrt(np.mean(error**2)) < 0.02 * VELOCITY.std()


def test_updates_are_where_values_are_set_before_the_first_sample_too():
    values = np.repeat([0.0, 0.0, *np.cumsum(np.arange(1.0, 20.0))], 5)[2:, None]
    hold, places = updates(values)
    assert hold == 5.0
    assert places.tolist() == list(range(-2, len(values), 5))
    assert updates(np.zeros((100, 1)))[0] == 1.0
