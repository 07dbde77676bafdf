"""Logs of simulated runs: sensing changes what is seen, and labels follow what can be seen."""

from dataclasses import replace

import numpy as np
import pytest
import simulated

from noiseclassifier.scenarios.logs import logged, visible
from noisemodel import Block, Run

RATE = 2000.0
PLAIN = replace(simulated.PLAIN, rate=RATE)
FAULT = (2.0, 3.0)


def run_with(fault=0.0, frequency=60.0, joints=2):
    """A slow motion, and an oscillation of the first joint for a second."""
    time = np.arange(round(5 * RATE)) / RATE
    smooth = np.stack([np.sin(2 * np.pi * 0.4 * time + joint) for joint in range(joints)], axis=1)
    position = -np.cos(2 * np.pi * 0.4 * time[:, None] + np.arange(joints)) / (2 * np.pi * 0.4)
    inside = (time >= FAULT[0]) & (time < FAULT[1])
    velocity = smooth.copy()
    velocity[:, 0] += fault * inside * np.sin(2 * np.pi * frequency * time)
    events = [{"label": "oscillations", "start": FAULT[0], "stop": FAULT[1], "labelled": 1.0}]
    blocks = (Block(0.0, 1.9, "ok"), Block(*FAULT, "oscillations"), Block(3.2, 5.0, "ok"))
    return Run(
        time=time,
        joint_names=tuple("ab"[:joints]),
        velocity=velocity.astype(np.float32),
        position=position.astype(np.float32),
        velocity_desired=smooth.astype(np.float32),
        stages={"planned": smooth.astype(np.float32)},
        blocks=blocks if fault else (Block(0.0, 5.0, "ok"),),
        meta={"events": events if fault else []},
    )


TWIN = run_with()


def labelled(fault, logger, frequency=60.0):
    found = logged(run_with(fault, frequency), TWIN, logger, seed=1)
    return sum(b.stop - b.start for b in found.blocks if b.label == "oscillations")


def test_a_perfect_logger_changes_nothing():
    run = run_with(0.3)
    found = logged(run, TWIN, PLAIN, seed=1)
    np.testing.assert_allclose(found.velocity, run.velocity, atol=1e-6)
    np.testing.assert_allclose(found.velocity_desired, run.velocity_desired, atol=1e-6)
    assert found.blocks == run.blocks


@pytest.mark.parametrize("noise", [1e-4, 1e-3, 1e-2])
def test_a_louder_fault_never_loses_a_label_that_a_fainter_one_has(noise):
    times = [labelled(fault, replace(PLAIN, noise=noise)) for fault in np.geomspace(1e-5, 1, 9)]
    assert times == sorted(times)
    assert times[0] == 0.0
    assert times[-1] == pytest.approx(1.0)


@pytest.mark.parametrize(("fault", "labelled"), [(3e-4, 0.0), (0.3, 1.0)])
def test_a_fault_below_the_noise_has_no_label_and_its_event_says_so(fault, labelled):
    found = logged(run_with(fault), TWIN, replace(PLAIN, noise=0.02), seed=1)
    assert ({block.label for block in found.blocks} == {"ok"}) == (labelled == 0.0)
    assert found.meta["events"][0]["labelled"] == pytest.approx(labelled)


def test_a_fault_above_the_log_s_bandwidth_has_no_label():
    slow = replace(PLAIN, velocity="filtered", cutoff=20.0, noise=0.005)
    assert labelled(0.01, slow, frequency=300.0) == 0.0
    assert labelled(0.01, replace(PLAIN, noise=0.005), frequency=300.0) == pytest.approx(1.0)


def test_ripple_has_its_share_of_the_speed_at_its_order():
    speed, gear, share = 0.5, 100.0, 0.02
    time = np.arange(round(8 * RATE)) / RATE
    steady = np.full((len(time), 1), speed)
    run = Run(
        time=time,
        joint_names=("a",),
        velocity=steady,
        position=speed * time[:, None],
        velocity_desired=steady,
        stages={"planned": steady},
    )
    found = logged(run, run, replace(PLAIN, ripple=share, gear=gear), seed=3)
    spectrum = np.abs(np.fft.rfft(found.velocity[:, 0] - speed)) / len(time) * 2
    frequencies = np.fft.rfftfreq(len(time), 1 / RATE)
    peak = np.argmax(spectrum)
    assert frequencies[peak] == pytest.approx(gear * speed / (2 * np.pi), abs=0.2)
    assert 0.15 * share * speed < spectrum[peak] < 1.05 * share * speed


def test_differentiated_velocities_have_the_steps_of_the_encoder():
    coarse = replace(PLAIN, velocity="differentiated", bits=12, cutoff=800.0)
    error = logged(TWIN, TWIN, coarse, seed=1).velocity - TWIN.velocity
    step = 2 * np.pi / 2**12 * RATE
    assert 0.1 * step < np.sqrt(np.mean(error[10:] ** 2)) < step


def test_lower_rates_have_fewer_samples_and_blocks_within_them():
    found = logged(run_with(0.3), TWIN, replace(PLAIN, rate=125.0), seed=1)
    assert found.rate == pytest.approx(125.0)
    assert len(found.time) == 625
    assert max(block.stop for block in found.blocks) <= 5.0


def test_desired_velocities_may_be_zero_or_missing_and_held_samples_repeat():
    held = logged(TWIN, TWIN, replace(PLAIN, hold=10), seed=1).velocity
    assert np.array_equal(held[::10], held[9::10])
    assert not logged(TWIN, TWIN, replace(PLAIN, desired="zero"), seed=1).velocity_desired.any()
    assert logged(TWIN, TWIN, replace(PLAIN, desired="missing"), seed=1).velocity_desired is None


def test_visible_is_three_decibels_in_a_band():
    time = np.arange(4000) / 1000
    tone = np.sin(2 * np.pi * 50 * time)[:, None]
    assert not visible(1.3 * tone, tone, rate=1000.0).any()
    assert visible(1.5 * tone, tone, rate=1000.0).all()
    assert visible(0.01 * tone, np.sin(2 * np.pi * 200 * time)[:, None], rate=1000.0).all()
    assert not visible(0 * tone, 0 * tone, rate=1000.0).any()
