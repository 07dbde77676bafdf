import re

import numpy as np
import pytest
from commandline import call
from csvlogs import TIME, jittered, log, swing, write

from inspector import read_log
from inspector.errors import InspectorError, LogError


def test_irregular_stamps_are_resampled_to_the_round_rate_nearby(tmp_path):
    time = jittered() * 100 / 98.2
    imported = read_log(log(tmp_path, time))
    run, (position, velocity) = imported.run, swing(imported.run.time)
    assert run.rate == 100.0
    assert np.abs(run.position[:, 0] - position).max() < 5e-3
    assert np.abs(run.velocity[:, 0] - velocity).max() < 5e-3 * 2 * np.pi
    assert re.fullmatch(
        r"log.csv: resampled to 100 Hz \(stamps of 9\d.\d+ Hz, jitter 1.\d+ ms rms\)",
        imported.remarks[0],
    )
    assert run.meta["jitter"]["rms"] == pytest.approx(1.6e-3, rel=0.2)


@pytest.mark.parametrize(
    ("nominal", "rate"),
    [(98.0, 100.0), (104.0, 100.0), (122.0, 125.0), (29.1, 30.0), (511.0, 500.0), (70.0, 70.0)],
)
def test_a_rate_within_5_percent_of_a_round_one_becomes_that(tmp_path, nominal, rate):
    steps = np.tile([0.9, 1.0, 1.0, 1.1], 100) / nominal
    time = np.concatenate(([0.0], np.cumsum(steps)))
    assert read_log(log(tmp_path, time)).run.rate == pytest.approx(rate, rel=1e-9)
    uniform = np.arange(400) / nominal  # is kept, round or not
    assert read_log(log(tmp_path, uniform)).run.rate == pytest.approx(nominal, rel=1e-9)


def test_rounded_stamps_have_the_rate_of_all_of_them(tmp_path):
    time = np.arange(4000) / 1200
    for stamps in (np.round(time, 6), time.astype(np.float32).astype(float), time + 1.7e9):
        run = read_log(log(tmp_path, stamps)).run
        assert run.rate == pytest.approx(1200.0, rel=1e-6)
        assert run.time[-1] == pytest.approx(time[-1], abs=1e-4)


@pytest.mark.parametrize("rate", [100, 240, 600, 700, 800, 960])
def test_stamps_rounded_to_a_millisecond_are_even_unless_a_sample_is_lost(tmp_path, rate):
    time = np.arange(4000) / rate
    kept = (time < 1) | (time >= 1.2)  # a gap stays one
    moved = {"elbow.velocity": swing(time[kept])[1]}
    imported = read_log(log(tmp_path, np.round(time, 3)[kept], **moved))
    assert np.allclose(
        imported.run.velocity[kept, 0], moved["elbow.velocity"], rtol=1e-12, atol=1e-12
    )
    assert np.array_equal(imported.run.mask, kept)
    told = f"log.csv: stamps rounded to 0.001 s, taken for even ones of {rate} Hz"
    assert (told in imported.remarks) == (rate > 100)
    lost = np.delete(np.round(time, 3), [1000, 1700, 3100])
    assert told not in read_log(log(tmp_path, lost)).remarks


def test_steps_of_which_none_is_near_the_median_have_its_rate(tmp_path):
    time = np.cumsum(np.tile([0.01, 0.05], 200))[:399]  # as many short ones as long ones
    assert read_log(log(tmp_path, time - time[0])).run.rate == pytest.approx(100 / 3, rel=0.1)


@pytest.mark.parametrize("lost", [4, 5])
@pytest.mark.parametrize("start", [0, 0.7, 77])
def test_four_missing_samples_are_no_gap_and_five_are_whatever_stamps_are_rounded_to(
    tmp_path, lost, start
):
    for unit in (10**3, 10**6, 10**9):
        time = np.delete(np.round((start + TIME) * unit), slice(150, 150 + lost))
        run = read_log(log(tmp_path, time / unit if unit < 10**9 else time.astype(int))).run
        assert run.mask.all() == (lost < 5)


def test_a_declared_rate_is_the_rate(tmp_path):
    assert read_log(log(tmp_path), rate=125).run.rate == pytest.approx(125.0)
    message = "the rate of the stamps is 100 Hz; a run of 1000 Hz cannot be made"
    with pytest.raises(LogError, match=message):
        read_log(log(tmp_path), rate=1000)
    with pytest.raises(InspectorError, match="the rate is 0 Hz; expected 0.001 to 1e[+]09 Hz"):
        read_log(log(tmp_path), rate=0)


def test_a_lower_rate_says_which_band_is_lost(tmp_path):
    lost = ": nothing above 40 Hz is left"
    for stamps in (TIME, jittered()):
        (remark,) = read_log(log(tmp_path, stamps), rate=80).remarks
        assert remark.startswith("log.csv: resampled to 80 Hz")
        assert remark.endswith(f" ms rms){lost}")
    _, out, _ = call("import", log(tmp_path), "--rate", "80", "-o", tmp_path / "run.npz")
    assert lost in out
    for higher in (log(tmp_path), log(tmp_path, jittered() * 1.005)):
        assert not any("is left" in each for each in read_log(higher, rate=100).remarks)


def test_resampling_does_not_overshoot(tmp_path):
    step = np.where(TIME < 2, 0.0, 1.0)
    columns = {"time": jittered(), "a.velocity": step}
    velocity = read_log(write(tmp_path / "log.csv", columns)).run.velocity
    assert velocity.min() >= 0
    assert velocity.max() <= 1


def test_gaps_are_marked_and_nothing_is_computed_in_them(tmp_path):
    time = np.delete(jittered(), slice(100, 120))
    imported = read_log(log(tmp_path, time))
    run = imported.run
    gap = (run.time > time[99]) & (run.time < time[100])
    assert np.array_equal(run.mask, ~gap)
    assert not run.velocity[gap].any()
    assert not run.position[gap].any()
    _, velocity = swing(run.time)
    assert np.abs(run.velocity[:, 0] - velocity)[~gap].max() < 5e-3 * 2 * np.pi
    assert "log.csv: 1 gap, 0.2" in imported.remarks[1]


def test_angles_that_wrap_are_interpolated_the_short_way(tmp_path):
    time = jittered()
    wrapped = (3 * time + np.pi) % (2 * np.pi) - np.pi
    run = read_log(write(tmp_path / "log.csv", {"time": time, "a.position": wrapped})).run
    assert np.allclose(run.position[:, 0], 3 * run.time, rtol=0, atol=1e-9)
    assert np.allclose(run.velocity, 3.0, rtol=0, atol=1e-9)
