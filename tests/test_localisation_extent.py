import numpy as np
import pytest

from inspector.localisation import extent
from noisemodel import Run

START, STOP = 2.0, 3.2
FRAME, HOP = 0.4, 0.1
ON, OFF = 2.31, 2.98
RATES = [100.0, 1000.0, 10_000.0]


def moving(rate, seconds=5.0, noise=1e-3):
    """Time, and three joints that swing slowly with the noise of their sensors."""
    time = np.arange(round(seconds * rate)) / rate
    sensors = noise * np.random.default_rng(3).standard_normal((len(time), 3))
    return time, np.cos(np.outer(time, [2.0, 3.0, 4.0])) + sensors


def run_of(time, velocity, **fields):
    names = tuple(f"joint{number}" for number in range(velocity.shape[1]))
    return Run(time=time, velocity=velocity, joint_names=names, **fields)


def tone(rate, frequency=80.0, *, on=ON, off=OFF, amplitude=0.1, **fields):
    time, velocity = moving(rate)
    desired = velocity.copy()
    during = (time >= on) & (time < off)
    velocity[during, 1] += amplitude * np.sin(2 * np.pi * frequency * time[during])
    if fields.pop("desired", False):
        fields["velocity_desired"] = desired
    return run_of(time, velocity, **fields)


def blow(rate, at, *, decay=0.03):
    time, velocity = moving(rate)
    since = np.maximum(time - at, 0.0)
    ringing = np.exp(-since / decay) * np.sin(2 * np.pi * 45 * since + 1.0)
    velocity[:, 2] += np.where(time >= at, ringing, 0.0)
    return run_of(time, velocity)


@pytest.mark.parametrize("desired", [True, False])
@pytest.mark.parametrize("frequency", [30.0, 80.0, 300.0])
@pytest.mark.parametrize("on", [2.24, 2.31, 2.38])
def test_a_tone_lasts_from_when_it_is_switched_on_until_it_is_switched_off(on, frequency, desired):
    found = extent(tone(1000.0, frequency, on=on, desired=desired), START, STOP)
    assert found == pytest.approx((on, OFF), abs=0.02)


@pytest.mark.parametrize(("rate", "within"), [(100.0, 0.03), (333.0, 0.02), (10_000.0, 0.02)])
def test_a_tone_is_found_at_any_rate(rate, within):
    assert extent(tone(rate, 30.0), START, STOP) == pytest.approx((ON, OFF), abs=within)


@pytest.mark.parametrize("rate", [1000.0, 10_000.0])
@pytest.mark.parametrize("at", [2.26, 2.3, 2.37])
def test_a_blow_sets_in_when_it_hits(rate, at):
    onset, end = extent(blow(rate, at), START, 2.6)
    assert onset == pytest.approx(at, abs=0.01)
    assert at < end <= 2.6


def test_scale_when_a_run_begins_and_other_desired_joints_do_not_matter():
    run = tone(1000.0, desired=True)
    louder = run_of(run.time, 1e3 * run.velocity, velocity_desired=1e3 * run.velocity_desired)
    assert extent(louder, START, STOP) == extent(run, START, STOP)
    run = tone(1000.0)
    later = extent(run_of(run.time + 100.0, run.velocity), START + 100.0, STOP + 100.0)
    assert np.subtract(later, 100.0) == pytest.approx(extent(run, START, STOP), abs=1e-9)
    gripper = {"velocity_desired": run.velocity[:, :1], "desired_joint_names": ("gripper",)}
    gripping = run_of(run.time, run.velocity, **gripper)
    assert extent(gripping, START, STOP) == extent(run, START, STOP)


def test_a_reversed_run_ends_when_it_began_to_fail():
    run = tone(1000.0, 50.0, on=2.3, off=2.9)
    found = extent(run_of(run.time, run.velocity[::-1]), 5.0 - STOP, 5.0 - START)
    assert found == pytest.approx((5.0 - 2.9, 5.0 - 2.3), abs=0.02)


def test_a_base_that_shakes_alone_is_found():
    time, velocity = moving(1000.0)
    base = np.zeros((len(time), 6))
    during = (time >= ON) & (time < OFF)
    base[during, 2] = 0.1 * np.sin(2 * np.pi * 40 * time[during])
    pose = np.tile([0, 0, 0, 0, 0, 0, 1.0], (len(time), 1))
    found = extent(run_of(time, velocity, base_velocity=base, base_pose=pose), START, STOP)
    assert found == pytest.approx((ON, OFF), abs=0.02)


def test_a_gap_is_neither_an_onset_nor_an_end():
    run = tone(1000.0)
    valid = np.ones(len(run.time), dtype=bool)
    valid[1900:1960] = valid[2500:2520] = valid[3100:3150] = False
    gaps = run_of(run.time, np.where(valid[:, None], run.velocity, 0.0), valid=valid)
    assert extent(gaps, START, STOP) == pytest.approx((ON, OFF), abs=0.02)


def test_where_nothing_stands_out_the_onset_lies_in_the_last_hop_of_the_first_frame():
    time, velocity = moving(1000.0)
    onset, end = extent(run_of(time, velocity), START, STOP)
    assert START + FRAME - HOP - 0.05 <= onset <= START + FRAME
    assert STOP - 0.3 <= end <= STOP - 0.1
    still = run_of(time, np.zeros_like(velocity))
    assert extent(still, START, STOP) == pytest.approx((2.31, 3.0))


def test_what_fails_from_the_first_sample_to_the_last_lasts_as_long_as_the_run():
    run = tone(1000.0, on=0.0, off=9.0)
    assert extent(run, 0.0, 5.0) == pytest.approx((0.0, 5.0), abs=0.05)
    onset, _ = extent(tone(1000.0, on=0.1, off=2.0), 0.0, 2.2)  # within the first frame
    assert onset == pytest.approx(0.1, abs=0.02)


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize(
    ("start", "stop"),
    [(0.0, 0.4), (4.6, 5.0), (2.0, 2.4), (2.0, 2.5), (4.7, 5.1), (-0.1, 0.3), (1.0, 1.02)],
)
def test_the_extent_is_within_frames_and_run_and_is_not_empty(rate, start, stop):
    onset, end = extent(tone(rate, 30.0), start, stop)
    assert max(start, 0.0) <= onset <= start + FRAME
    assert onset < end <= min(stop, 5.0) + 1e-9


@pytest.mark.parametrize("rate", RATES)
def test_frames_of_another_length_are_taken_into_account(rate):
    run = tone(rate, 30.0, on=2.7, off=4.0)
    assert extent(run, 2.0, 4.5, frame=0.8, hop=0.2) == pytest.approx((2.7, 4.0), abs=0.03)


@pytest.mark.parametrize("stop", [0.4, 0.4 + 1 / 3, 0.7, 4.9999999, 5.0])
def test_a_finding_of_a_sample_at_the_end_of_a_run_has_an_onset_and_an_end(stop):
    run = tone(1000.0)
    for start in (stop - 1e-3, stop - 1e-3 - 1e-17, stop):
        onset, end = extent(run, start, stop)
        assert start - 2e-3 <= onset < end <= stop + 2e-3
