"""What makes a run valid: both sides of each limit, and errors as they are printed whole."""

import re
from contextlib import nullcontext

import numpy as np
import pytest

from noisemodel import Block, RunError, checks, ondemand
from noisemodel.ondemand import OnDemand

FINEST = 2.0**-33
"""Spacing of numbers just below 2**20."""


def refused(message, error=RunError):
    """Expect an error with this whole text."""
    return pytest.raises(error, match=f"^{re.escape(message)}$")


@pytest.fixture
def cut(monkeypatch):
    """Pieces of four rows, of one column of floats."""
    monkeypatch.setattr(ondemand, "AT_ONCE", 4 * 8)


@pytest.mark.parametrize("shape", [(), (0,), (1,), (2, 1), (2, 2)])
def test_a_time_has_one_axis_and_two_samples_at_least(shape):
    with refused(f"time: shape {shape}, expected (samples,) with at least 2 samples"):
        checks.check_time(np.zeros(shape))
    checks.check_time(np.arange(2.0))


@pytest.mark.parametrize(
    ("time", "message"),
    [
        ([0.0, 0.5, np.nan, np.inf, 2.0], "time: nan in row 2"),
        ([0.0, np.inf, np.nan], "time: inf in row 1"),
        ([0.0, 0.5, 1.0, 1.0, 1.5], "time: stands still in row 3 (1 s, then 1 s)"),
        (
            [0.0, 0.5, 1.0, 0.987654321, 0.987654321],
            "time: runs backwards in row 3 (1 s, then 0.987654321 s)",
        ),
    ],
)
def test_the_first_row_of_a_time_that_is_wrong_is_named(time, message):
    with refused(message):
        checks.check_time(np.array(time))


@pytest.mark.parametrize(
    ("step", "message"),
    [
        (1e-9, ""),
        (0.9e-9, "9e-10"),
        (1e9, ""),
        (1e9 + 1, "1e+09"),
    ],
)
def test_steps_of_time_are_from_a_nanosecond_to_1e9_seconds(step, message):
    whole = f"time: the median step is {message} s, expected 1e-09 s to 1e+09 s"
    with refused(whole) if message else nullcontext():
        checks.check_time(np.array([0.0, step]))


@pytest.mark.parametrize("share", [0.9e-3, -0.9e-3, 1.1e-3, -1.1e-3])
def test_a_step_may_lie_a_thousandth_from_the_median(share):
    time = np.arange(20) / 4
    time[7:] += share / 4
    time[9:] += 2 * share / 4 * (abs(share) > 1e-3)
    text = (
        f"time: not uniform, the step to row 7 is {0.25 * (1 + share):.6g} s where the median is"
        " 0.25 s; `inspector import` resamples such logs (and float32 is too coarse)"
    )
    wrong = abs(share) > 1e-3
    with refused(text, checks.NotUniformError) if wrong else nullcontext():
        checks.check_time(time)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize(("by", "uniform"), [(4, True), (-4, True), (5, False), (-5, False)])
def test_stamps_far_from_zero_may_lie_two_of_their_own_spacings_from_the_median(
    mirrored, by, uniform
):
    """Only the outermost stamp has a spacing of 2 FINEST: the tolerance is 4 FINEST."""
    steps = np.full(9, 200.0)
    steps[4] += by
    time = 2.0**20 - FINEST * np.append(np.cumsum(steps[::-1])[::-1], 0.0)
    with nullcontext() if uniform else pytest.raises(checks.NotUniformError, match="row 5 is"):
        checks.check_time(-time[::-1] if mirrored else time)


@pytest.mark.parametrize("row", range(1, 12))
def test_an_uneven_step_is_named_in_every_piece_of_the_time(cut, row):
    time = np.arange(12.0)
    time[row:] += 0.5
    with pytest.raises(checks.NotUniformError, match=f"the step to row {row} is 1.5 s"):
        checks.check_time(time)


def test_the_median_of_steps_is_that_of_the_middle():
    assert checks.median_step(np.array([0.0, 1.0, 3.0, 6.0, 10.0])) == 2.5


@pytest.mark.parametrize("word", ["", "a\nb", "\x00"])
def test_words_are_printable_and_not_empty(word):
    checks.check_words("stages", ["a b", "ö"])
    with refused(f"stages: {word!r} is no name; it is empty or cannot be printed"):
        checks.check_words("stages", ["a", word])


def test_names_that_repeat_are_all_named(monkeypatch):
    with refused("joint_names: a, c named twice"):
        checks.check_names("joint_names", ["c", "b", "a", "c", "a", "a"])
    monkeypatch.setenv("NOISE_LIMIT_JOINTS", "3")
    checks.check_names("joint_names", ["a", "b", "c"])
    with refused("joint_names: 4 joints, the limit is 3 (--limit joints=N raises it)"):
        checks.check_names("joint_names", ["a", "b", "c", "d"])


@pytest.mark.parametrize(
    ("shape", "turned"),
    [
        ((2, 5), True),
        ((7, 5), True),
        ((2, 4), False),
        ((5, 5), False),
        ((5, 3), False),
        ((5,), False),
        ((1, 5, 1), False),
        ((2, 2, 5), False),
        ((2, 5, 2), False),
    ],
)
def test_signals_of_another_shape_are_refused_and_samples_that_come_last_are_named(shape, turned):
    hint = "; samples come first, is it transposed?" if turned else ""
    with refused(f"effort: shape {shape}, expected (5, 2){hint}"):
        checks.check_signal("effort", np.zeros(shape), (5, 2))


def test_signals_are_of_floating_point_numbers_of_any_size():
    for kind in (np.float16, np.float32, np.float64):
        checks.check_signal("effort", np.ones((5, 2), dtype=kind), (5, 2))
    for wrong in (np.int64, np.complex128):
        with refused(f"effort: holds {wrong.__name__}, expected floating-point numbers"):
            checks.check_signal("effort", np.ones((5, 2), dtype=wrong), (5, 2))


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("row", [0, 1, 4, 6, 8])
def test_a_value_that_is_not_finite_or_of_1e15_is_named_in_every_piece(cut, sign, row):
    signal = np.full((9, 2), sign * (1e15 - 1))
    checks.check_signal("effort", signal, (9, 2))
    for value, said in (
        (1e15, f"{sign * 1e15:g} in row {row}, column 1; expected numbers below 1e+15"),
        (np.inf, f"{sign * np.inf} in row {row}, column 1; mark gaps with valid = false and zeros"),
        (np.nan, f"nan in row {row}, column 1; mark gaps with valid = false and zeros"),
    ):
        wrong = signal.copy()
        wrong[row, 1] = sign * value
        wrong[row + 1 :, 0] = 2e15
        with refused(f"effort: {said}"):
            checks.check_signal("effort", wrong, (9, 2))


def test_a_signal_on_demand_is_read_for_its_check_once_and_its_shape_always(cut):
    read = []

    def rows(first, stop):
        read.append((first, stop))
        return np.zeros((stop - first, 1))

    signal = OnDemand((9, 1), np.float64, rows)
    for _ in range(2):
        checks.check_signal("effort", signal, (9, 1))
        assert read == [(0, 4), (4, 8), (8, 9)]
    with refused("effort: shape (9, 1), expected (9, 2)"):
        checks.check_signal("effort", signal, (9, 2))


def test_a_mask_is_a_boolean_for_each_sample_and_leaves_one_at_least():
    checks.check_valid(np.arange(5) == 3, 5)
    for wrong in (np.ones(5), np.ones(4, dtype=bool), np.ones((5, 1), dtype=bool)):
        text = f"valid: shape {wrong.shape} of {wrong.dtype}, expected (5,) of bool"
        with refused(text):
            checks.check_valid(wrong, 5)
    with refused("valid: false in every sample, no sample is left"):
        checks.check_valid(np.zeros(5, dtype=bool), 5)


@pytest.mark.parametrize(
    ("blocks", "message"),
    [
        ([(9.5, 13.0, "ok")], ""),
        (
            [(9.49, 11.0, "ok")],
            "block 'ok': 9.49 s to 11 s lies outside of the run, 10 s to 12 s",
        ),
        (
            [(11.0, 11.5, "ok"), (11.5, 13.01, "late")],
            "block 'late': 11.5 s to 13.01 s lies outside of the run, 10 s to 12 s",
        ),
        ([(10.0, 11.0, "ok"), (10.5, 12.0, "impact"), (12.0, 13.0, "ok")], ""),
        (
            [(10.0, 11.0, "ok"), (11.0, 12.0, "impact"), (11.49, 13.0, "last")],
            "blocks overlap: 'impact' until 12 s and 'last' from 11.49 s",
        ),
        ([(11.0, 11.0, "ok")], "block 'ok': starts at 11 s, stops at 11 s"),
        ([(11.5, 11.25, "ok")], "block 'ok': starts at 11.5 s, stops at 11.25 s"),
        ([(11.0, 12.0, "")], "block_label: '' is no name; it is empty or cannot be printed"),
    ],
)
def test_blocks_may_lie_a_step_before_a_run_two_after_it_and_overlap_by_one(blocks, message):
    time = 10.0 + np.arange(5) / 2
    with refused(message) if message else nullcontext():
        checks.check_blocks([Block(*block) for block in blocks], time)


@pytest.mark.parametrize("row", range(9))
@pytest.mark.parametrize("norm", [0.989, 1.011, 0.991, 1.009])
def test_quaternions_have_a_length_of_one_to_a_hundredth_in_every_piece(monkeypatch, row, norm):
    monkeypatch.setattr(ondemand, "AT_ONCE", 4 * 7 * 8)
    turn = np.array([0.1, -0.7, 0.5, 0.5])
    pose = np.tile([3.0, 4.0, 5.0, *turn], (9, 1))
    valid = np.ones(9, dtype=bool)
    checks.check_quaternions(pose, valid)
    pose[row, 3:] *= norm
    pose[row + 1 :, 3:] *= norm
    wrong = abs(norm - 1) > 0.01
    text = (
        f"base_pose: the quaternion in row {row} has norm {norm:.3g}, expected 1 (order x, y, z, w)"
    )
    with refused(text) if wrong else nullcontext():
        checks.check_quaternions(pose, valid)
    checks.check_quaternions(pose, np.arange(9) < row)
