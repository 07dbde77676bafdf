"""Desired and measured motion with separate clocks."""

import numpy as np
import pytest
from csvlogs import write
from samplelogs import JOINTS, TIMES, Talk, joint_states, motion, numbers, write_bag

from inspector import read_log
from inspector.errors import LogError


def csv(path, time, velocity, suffix=""):
    columns = {f"{joint}.velocity{suffix}": velocity[:, n] for n, joint in enumerate(JOINTS)}
    return write(path, {"time": [repr(float(each)) for each in time]} | columns)


def pair(tmp_path, *, offset, drift=0.0, lag=0.0, lost=0.0, seconds=60, rate=250, desired_rate=100):
    """A measured log, and a desired one whose clock differs; they overlap from 5 s on."""
    time = np.arange(seconds * rate) / rate
    time = time[(time <= 20) | (time > 20 + lost)]
    measured = motion(time - lag)[1]
    measured += 0.02 * np.random.default_rng(1).standard_normal(measured.shape)
    meant = 5 + np.arange((seconds - 10) * desired_rate) / desired_rate
    stamps = 5 - offset + (meant - 5) / (1 + drift)
    return (
        csv(tmp_path / "measured.csv", time, measured),
        csv(tmp_path / "desired.csv", stamps, motion(meant)[1]),
    )


@pytest.mark.parametrize(("offset", "lost"), [(0.7, 0), (-0.4, 0), (1234.5, 0), (3.21, 12)])
def test_the_offset_is_estimated_and_removed_whatever_gap_there_is(tmp_path, offset, lost):
    measured, desired = pair(tmp_path, offset=offset, lost=lost)
    imported = read_log(measured, desired=desired)
    assert imported.run.meta["offset"] == {"seconds": pytest.approx(offset, abs=1e-3)}
    difference = imported.run.velocity - imported.run.velocity_desired
    assert np.sqrt(np.mean(difference**2)) < 0.03  # the measured one's noise is 0.02
    assert any(remark.startswith("desired.csv: offset ") for remark in imported.remarks)
    assert lost or not any("drift" in remark for remark in imported.remarks)
    assert imported.run.duration == pytest.approx(50, abs=0.1)
    (note,) = imported.run.meta["notes"]
    assert note.removeprefix("cut to the ").endswith(" s that both logs cover")


@pytest.mark.parametrize(("drift", "change"), [(2e-4, 0.005), (-1e-4, -0.0025)])
def test_a_drift_of_the_clocks_is_said(tmp_path, drift, change):
    measured, desired = pair(tmp_path, offset=12.0, drift=drift)
    (said,) = (each for each in read_log(measured, desired=desired).remarks if "drift" in each)
    begin, _, rest = said.partition("; the clocks drift: it is ")
    assert begin.endswith("its stamps are shifted by that")
    assert float(rest.split()[0]) == pytest.approx(change, rel=0.1)


def test_a_controllers_lag_is_reported_and_not_corrected(tmp_path):
    measured, desired = pair(tmp_path, offset=0.0, lag=0.02, drift=2e-4)
    imported = read_log(measured, desired=desired)
    assert "offset" not in imported.run.meta
    (expected,) = [each for each in imported.remarks if "a controller's lag" in each]
    assert expected.startswith("desired.csv: offset +0.025")
    assert expected.endswith("the stamps are not changed")  # no drift in what may be the motion


def test_positions_give_the_offset_where_there_are_no_velocities(tmp_path):
    time = np.arange(6000) / 100
    for name, since, shift in (("measured", time, 0.0), ("desired", time[500:5000], 77.7)):
        position = motion(since)[0]
        columns = {f"{joint}.position": position[:, n] for n, joint in enumerate(JOINTS)}
        write(tmp_path / f"{name}.csv", {"time": since - shift} | columns)
    imported = read_log(tmp_path / "measured.csv", desired=tmp_path / "desired.csv")
    assert imported.run.meta["offset"]["seconds"] == pytest.approx(77.7, abs=1e-3)


def test_a_periodic_motion_gives_no_offset(tmp_path):
    time = np.arange(6000) / 100
    swing = np.cos(2 * np.pi * time)[:, None] * np.ones(3)
    measured = csv(tmp_path / "measured.csv", time, swing)
    desired = csv(tmp_path / "desired.csv", time + 1e6, swing)
    message = (
        r"desired.csv: the stamps from 1000000(\.0)? s to .* do not overlap with .*, and"
        r" the offset cannot be estimated \(offset .*\); specify --offset SECONDS, which is added"
        r" to the desired stamps"
    )
    with pytest.raises(LogError, match=message):
        read_log(measured, desired=desired)
    imported = read_log(measured, desired=desired, offset=-1e6)
    assert np.allclose(imported.run.velocity_desired, imported.run.velocity, atol=1e-3)
    assert "desired.csv: offset -1e+06 s, as given" in imported.remarks


def test_unrelated_motions_and_standstill_give_no_offset(tmp_path):
    time = np.arange(6000) / 100
    measured = csv(tmp_path / "measured.csv", time, motion(time)[1])
    for shift in (0.005, 1e6):
        desired = csv(tmp_path / "desired.csv", time + shift, motion(time, seed=9)[1])
        if shift > 1:
            with pytest.raises(LogError, match="the offset cannot be estimated"):
                read_log(measured, desired=desired)
        else:
            remarks = read_log(measured, desired=desired).remarks
            assert any("is assumed to be the measured one's, since the" in r for r in remarks)
    desired = csv(tmp_path / "desired.csv", time + 100, np.zeros((6000, 3)))
    with pytest.raises(LogError, match="no joint moves in both; specify --offset"):
        read_log(measured, desired=desired)


def test_topics_of_two_computers_are_synchronised(tmp_path):
    talk = Talk()
    since = np.arange(4000) / 100
    times = TIMES[0] + 10_000_000 * np.arange(4000)
    away = times[100:3900] - 5_000_000_000 + 4_000_000
    topics = {
        "/joint_states": joint_states(talk, times, velocity=motion(since)[1]),
        "/joint_commands": joint_states(talk, away, velocity=motion(since[100:3900])[1]),
    }
    run = read_log(write_bag(tmp_path / "bag", talk, topics)).run
    assert run.meta["offset"]["seconds"] == pytest.approx(4.996, abs=1e-3)
    assert np.abs(run.velocity - run.velocity_desired).max() < 0.01


def test_duplicate_and_backward_stamps_are_left_out_and_counted(tmp_path):
    time = np.arange(1000) / 100
    time[[100, 101]] = time[99]  # twice the same
    time[500] = time[490]
    imported = read_log(csv(tmp_path / "log.csv", time, numbers(samples=1000) / 10))
    expected = "3 samples whose stamps are not later than all before left out, the first 0.99 s"
    assert f"log.csv: {expected} into the log" in imported.remarks
    assert np.all(np.diff(imported.run.time) > 0)


def test_two_logs_in_one_are_refused(tmp_path):
    time = np.concatenate((np.arange(500), np.arange(500))) / 100
    with pytest.raises(LogError, match="row 502: time runs backwards: 0.0 comes after 4.99"):
        read_log(csv(tmp_path / "log.csv", time, numbers(samples=1000)))
