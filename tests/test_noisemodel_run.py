"""What makes a run valid: both sides of each limit, and errors as they are printed whole."""

import re
from contextlib import nullcontext
from dataclasses import fields

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from noisemodel import Block, Run, RunError, RunFileError, decimated, runfile
from noisemodel.run import (
    METHOD,
    NotUniformError,
    base_velocity,
    check_blocks,
    check_names,
    check_quaternions,
    check_signal,
    check_time,
    joint_velocity,
    pieces_of,
)
from noisemodel.runfile import OnDemand

TIME = np.arange(100) / 1000


def run(**changes):
    least = {"time": TIME, "velocity": np.ones((100, 2)), "joint_names": ("a", "b")}
    return Run(**(least | changes))


def test_time_and_velocity_alone_are_a_run():
    alone = run()
    assert alone.rate == 1000.0
    assert alone.duration == pytest.approx(0.1)
    assert alone.mask.all()
    assert alone.desired_joint_names == ("a", "b")
    assert np.array_equal(alone.motion, alone.velocity)


@pytest.mark.parametrize("rate", [1.0, 60.0, 333.3, 1000.0, 10_000.0, 44_100.0])
def test_the_rate_is_the_nominal_one(rate):
    for begin in (0.0, 1.7e4, 1.7e9):  # the last has a resolution of 0.24 µs
        recorded = run(time=begin + np.arange(100) / rate)
        assert recorded.rate == pytest.approx(rate, rel=1e-9)


def test_a_run_sorts_its_blocks_and_cannot_be_changed_in_place():
    late, early = Block(0.05, 0.1, "impact"), Block(0.0, 0.05, "ok")
    assert run(blocks=(late, early)).blocks == (early, late)
    with pytest.raises(AttributeError):
        run().robot = "talos"
    with pytest.raises(TypeError):
        run().meta["seed"] = 1


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"time": TIME[:1], "velocity": np.ones((1, 2))}, "with at least 2 samples"),
        ({"time": TIME[:, None]}, r"time: shape \(100, 1\), expected \(samples,\)"),
        ({"velocity": np.full((100, 2), np.nan)}, "velocity: nan in row 0, column 0; mark gaps"),
        ({"position": np.ones((100, 1))}, r"position: shape \(100, 1\), expected \(100, 2\)"),
        ({"velocity_desired": np.ones((100, 1))}, r"velocity_desired: shape \(100, 1\)"),
        ({"stages": {"planner": np.ones((9, 2))}}, r"stage_planner: shape \(9, 2\)"),
        ({"stages": {"a\nb": np.ones((100, 2))}}, r"stages: 'a\\nb' is no name"),
        ({"base_velocity": np.ones((100, 7))}, r"base_velocity: shape \(100, 7\)"),
        ({"base_pose": np.ones((100, 6))}, r"base_pose: shape \(100, 6\), expected \(100, 7\)"),
        ({"base_pose": np.ones((100, 7))}, "quaternion in row 0 has norm 2, expected 1"),
        ({"valid": np.ones(99, dtype=bool)}, r"valid: shape \(99,\) of bool, expected \(100,\)"),
        ({"valid": np.ones(100)}, r"valid: shape \(100,\) of float64"),
        ({"valid": np.zeros(100, dtype=bool)}, "valid: false in every sample"),
        ({"joint_names": ("a", "")}, "joint_names: '' is no name"),
        ({"desired_joint_names": ("c", "c")}, "desired_joint_names: c named twice"),
    ],
)
def test_signals_that_do_not_fit_are_refused(changes, message):
    with pytest.raises(RunError, match=message) as caught:
        run(**changes)
    assert "\n" not in str(caught.value)


def filled():
    """A run with every signal, a gap, and two blocks."""
    random = np.random.default_rng(0)
    names = ("position", "velocity_desired", "position_desired", "effort")
    valid = np.ones(100, dtype=bool)
    valid[40:45] = False
    signals = {name: random.standard_normal((100, 2)) * valid[:, None] for name in names}
    pose = np.tile([0.0, 0, 0, 0, 0, 0, 1], (100, 1))
    signals["velocity"] = random.standard_normal((100, 2)) * valid[:, None]
    signals["stages"] = {"motor": random.standard_normal((100, 2))}
    base = {"base_pose": pose, "base_velocity": random.standard_normal((100, 6))}
    blocks = (Block(0.0, 0.0205, "ok"), Block(0.0205, 0.08, "impact"))
    about = {"robot": "panda", "blocks": blocks, "meta": {"seed": 1}}
    return run(valid=valid, desired_joint_names=("c", "d"), **signals, **base, **about)


def same(one, other):
    """Compare two runs field by field."""
    for field in fields(Run):
        left, right = (getattr(each, field.name) for each in (one, other))
        is_table = field.name in ("stages", "meta")
        np.testing.assert_equal(*map(dict, (left, right)) if is_table else (left, right))
    return True


@pytest.mark.parametrize("stretch", [(-np.inf, np.inf), (0.0, 1.0), (-5.0, 0.0991)])
def test_a_cut_of_everything_is_the_run(stretch):
    whole = filled()
    assert same(whole.cut(*stretch), whole)


@given(
    st.tuples(*[st.floats(-0.01, 0.11)] * 4).map(sorted).filter(lambda t: t[2] - t[1] > 0.02),
    st.sampled_from((1, -1)),
    st.sampled_from((1, -1)),
)
def test_cutting_twice_is_cutting_once(times, order_of_starts, order_of_stops):
    first, later = times[:2][::order_of_starts]
    stop, earlier = times[2:][::order_of_stops]
    twice = filled().cut(first, stop).cut(later, earlier)
    assert same(twice, filled().cut(max(first, later), min(stop, earlier)))


def test_a_cut_holds_the_samples_from_its_start_to_before_its_stop():
    whole, cut = filled(), filled().cut(0.02, 0.05)
    for name in ("time", "velocity", "position", "effort", "valid", "base_pose", "base_velocity"):
        np.testing.assert_array_equal(getattr(cut, name), getattr(whole, name)[20:50])
    np.testing.assert_array_equal(cut.stages["motor"], whole.stages["motor"][20:50])
    assert (cut.robot, cut.meta, cut.joint_names) == (whole.robot, whole.meta, whole.joint_names)


def test_blocks_are_clipped_to_a_cut():
    clipped = filled().cut(0.01, 0.05).blocks
    assert clipped == (Block(0.01, 0.0205, "ok"), Block(0.0205, 0.05, "impact"))
    assert filled().cut(0.0301, 0.09).blocks == (Block(TIME[31], 0.08, "impact"),)
    assert filled().cut(0.0205, 0.05).blocks == (Block(0.0205, 0.05, "impact"),)
    assert filled().cut(0.08, 0.09).blocks == ()


@pytest.mark.parametrize(
    ("stretch", "message"),
    [
        ((0.05, 0.05), "0 samples from 0.05 s to 0.05 s, expected 2 at least; the run has 0 s"),
        ((0.05, 0.0505), "1 samples from"),
        ((7.0, 8.0), "0 samples from 7 s to 8 s, .* the run has 0 s to 0.099 s"),
        ((np.nan, np.nan), "0 samples from nan s"),
        ((0.04, 0.0445), "false in every sample"),
    ],
)
def test_an_empty_cut_is_refused(stretch, message):
    with pytest.raises(RunError, match=message):
        filled().cut(*stretch)
    assert len(filled().cut(0.05, 0.0511).time) == 2


def test_a_run_is_represented_in_one_line():
    line = "Run(panda, 2 joints, 100 samples at 1000 Hz, 0.1 s, 2 blocks)"
    assert repr(filled()) == line
    assert repr(run()) == "Run(no robot, 2 joints, 100 samples at 1000 Hz, 0.1 s, 0 blocks)"


def test_a_run_moves_by_joints_or_by_its_base():
    base = run(velocity=np.zeros((100, 0)), joint_names=(), base_velocity=np.ones((100, 6)))
    assert base.motion.shape == (100, 6)
    text = "^joint_names: there are no joints, and the base does not move$"
    with pytest.raises(RunError, match=text):
        run(velocity=np.zeros((100, 0)), joint_names=())


@pytest.mark.parametrize("samples", [1, 7, 99, 100, 101, None])
def test_the_pieces_of_a_run_are_its_motion(monkeypatch, samples):
    monkeypatch.setattr(runfile, "AT_ONCE", 8 * 8 * 30 + 5)
    whole = filled()
    found = list(pieces_of(whole, samples=samples))
    sizes = [len(piece.time) for piece in found]
    assert set(sizes[:-1]) <= {samples or 30}
    assert sizes[-1] == 100 - sum(sizes[:-1]) > 0
    for name in ("time", "velocity", "velocity_desired", "effort", "base_velocity", "mask"):
        joined = np.concatenate([getattr(piece, name) for piece in found])
        np.testing.assert_array_equal(joined, getattr(whole, name))
    for piece in found:
        assert (piece.position, piece.position_desired, piece.base_pose) == (None, None, None)
        assert (piece.rate, piece.robot, piece.meta) == (whole.rate, "panda", whole.meta)
        assert (piece.joint_names, piece.desired_joint_names) == (("a", "b"), ("c", "d"))
        assert (piece.blocks, piece.stages) == ((), {})
    (alone,) = pieces_of(run())
    assert (alone.effort, alone.base_velocity, alone.robot) == (None, None, None)


FINEST = 2.0**-33  # spacing of numbers just below 2**20


def refused(message, error=RunError):
    """Expect an error with this whole text."""
    return pytest.raises(error, match=f"^{re.escape(message)}$")


@pytest.fixture
def cut(monkeypatch):
    """Pieces of four rows, of one column of floats."""
    monkeypatch.setattr(runfile, "AT_ONCE", 4 * 8)


@pytest.mark.parametrize(
    ("time", "message"),
    [
        ([np.nan, 0.5, 1.0], "does not rise to row 1 (nan s, then 0.5 s)"),
        ([0.0, 0.5, np.nan, np.inf, 2.0], "does not rise to row 2 (0.5 s, then nan s)"),
        ([0.0, np.inf, np.inf], "does not rise to row 2 (inf s, then inf s)"),
        ([0.0, 0.5, 1.0, 1.5, np.inf], "inf s, expected seconds, 9e+09 at most"),
        ([-np.inf, 0.5, 1.0, 1.5], "inf s, expected seconds, 9e+09 at most"),
        ([0.0, 0.5, 1.0, 1.0, 1.5], "does not rise to row 3 (1 s, then 1 s)"),
        ([0.0, 1.0, 0.987654321, 0.5], "does not rise to row 2 (1 s, then 0.987654321 s)"),
    ],
)
def test_the_first_row_of_a_time_that_is_wrong_is_named(time, message):
    with refused(f"time: {message}"):
        check_time(np.array(time))


@pytest.mark.parametrize(
    ("step", "message"), [(1e-9, ""), (0.9e-9, "9e-10"), (1e9, ""), (1e9 + 1, "1e+09")]
)
def test_steps_of_time_are_from_a_nanosecond_to_1e9_seconds(step, message):
    whole = f"time: the median step is {message} s, expected 1e-09 s to 1e+09 s"
    with refused(whole) if message else nullcontext():
        check_time(np.array([0.0, step]))


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
    with refused(text, NotUniformError) if wrong else nullcontext():
        check_time(time)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize(("by", "uniform"), [(4, True), (-4, True), (5, False), (-5, False)])
def test_stamps_far_from_zero_may_lie_two_of_their_own_spacings_from_the_median(
    mirrored, by, uniform
):
    """Only the outermost stamp has a spacing of 2 FINEST: the tolerance is 4 FINEST."""
    steps = np.full(9, 200.0)
    steps[4] += by
    time = 2.0**20 - FINEST * np.append(np.cumsum(steps[::-1])[::-1], 0.0)
    with nullcontext() if uniform else pytest.raises(NotUniformError, match="row 5 is"):
        check_time(-time[::-1] if mirrored else time)


def test_names_that_repeat_are_all_named(monkeypatch):
    with refused("joint_names: a, c named twice"):
        check_names("joint_names", ["c", "b", "a", "c", "a", "a"])
    monkeypatch.setenv("NOISE_LIMIT_JOINTS", "3")
    check_names("joint_names", ["a", "b", "c"])
    with refused("joint_names: 4 joints, the limit is 3 (--limit joints=N raises it)"):
        check_names("joint_names", ["a", "b", "c", "d"])


@pytest.mark.parametrize("shape", [(2, 5), (2, 4), (5, 3), (5,), (2, 2, 5), (2, 5, 2)])
def test_signals_of_another_shape_are_refused_and_samples_that_come_last_are_named(shape):
    hint = "; samples come first, is it transposed?" if shape == (2, 5) else ""
    with refused(f"effort: shape {shape}, expected (5, 2){hint}"):
        check_signal("effort", np.zeros(shape), (5, 2))


def test_signals_are_of_floating_point_numbers_of_any_size():
    for kind in (np.float16, np.float32, np.float64):
        check_signal("effort", np.ones((5, 2), dtype=kind), (5, 2))
    for wrong in (np.int64, np.complex128):
        with refused(f"effort: holds {wrong.__name__}, expected floating-point numbers"):
            check_signal("effort", np.ones((5, 2), dtype=wrong), (5, 2))


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("row", [0, 1, 4, 6, 8])
def test_a_value_that_is_not_finite_or_of_1e15_is_named_in_every_piece(cut, sign, row):
    signal = np.full((9, 2), sign * (1e15 - 1))
    check_signal("effort", signal, (9, 2))
    for value, said in (
        (1e15, f"{sign * 1e15:g} in row {row}, column 1; expected numbers below 1e+15"),
        (np.inf, f"{sign * np.inf} in row {row}, column 1; mark gaps with valid = false and zeros"),
        (np.nan, f"nan in row {row}, column 1; mark gaps with valid = false and zeros"),
    ):
        wrong = signal.copy()
        wrong[row, 1] = sign * value
        wrong[row + 1 :, 0] = 2e15
        with refused(f"effort: {said}"):
            check_signal("effort", wrong, (9, 2))


def test_a_signal_on_demand_is_read_for_its_check_once_and_its_shape_always(cut):
    read = []

    def rows(first, stop):
        read.append((first, stop))
        return np.zeros((stop - first, 1))

    signal = OnDemand((9, 1), np.float64, rows)
    for _ in range(2):
        check_signal("effort", signal, (9, 1))
        assert read == [(0, 4), (4, 8), (8, 9)]
    with refused("effort: shape (9, 1), expected (9, 2)"):
        check_signal("effort", signal, (9, 2))


@pytest.mark.parametrize(
    ("blocks", "message"),
    [
        ([(9.5, 13.0, "ok")], ""),
        ([(9.49, 11.0, "ok")], "block 'ok': 9.49 s to 11 s lies outside of the run, 10 s to 12 s"),
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
        check_blocks([Block(*block) for block in blocks], time)


@pytest.mark.parametrize("row", range(9))
@pytest.mark.parametrize("norm", [0.989, 1.011, 0.991, 1.009])
def test_quaternions_have_a_length_of_one_to_a_hundredth_in_every_piece(monkeypatch, row, norm):
    monkeypatch.setattr(runfile, "AT_ONCE", 4 * 7 * 8)
    turn = np.array([0.1, -0.7, 0.5, 0.5])
    pose = np.tile([3.0, 4.0, 5.0, *turn], (9, 1))
    valid = np.ones(9, dtype=bool)
    check_quaternions(pose, valid)
    pose[row, 3:] *= norm
    pose[row + 1 :, 3:] *= norm
    wrong = abs(norm - 1) > 0.01
    text = (
        f"base_pose: the quaternion in row {row} has norm {norm:.3g}, expected 1 (order x, y, z, w)"
    )
    with refused(text) if wrong else nullcontext():
        check_quaternions(pose, valid)
    check_quaternions(pose, np.arange(9) < row)


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


def test_a_constant_velocity_stays_constant_to_the_edges():
    time = np.arange(10_000) / 10_000
    run = Run(time=time, velocity=np.full((10_000, 1), 2.0), joint_names=("a",))
    np.testing.assert_allclose(decimated(run, 1000.0).velocity, 2.0, atol=2e-3)


def test_all_velocities_are_decimated_and_nothing_else_is_kept():
    velocity = run_of(20.0).velocity
    signals = dict.fromkeys(("velocity_desired", "position", "effort"), velocity)
    pose = np.tile([0.0, 0, 0, 0, 0, 0, 1], (len(velocity), 1))
    signals |= {"base_velocity": np.tile(velocity, 6), "base_pose": pose}
    about = {"blocks": (Block(5.0, 6.0, "ok"),), "meta": {"seed": 1}, "robot": "panda"}
    run = run_of(20.0, stages={"planned": velocity}, **signals, **about)
    slow = decimated(run, 1000.0)
    np.testing.assert_array_equal(slow.velocity, slow.velocity_desired)
    np.testing.assert_array_equal(slow.velocity, slow.stages["planned"])
    assert slow.base_velocity.shape == (3000, 6)
    assert (slow.position, slow.effort, slow.base_pose) == (None, None, None)
    assert (slow.blocks, dict(slow.meta), slow.robot) == (run.blocks, {"seed": 1}, "panda")


@pytest.mark.parametrize(
    ("seconds", "rate"), [(3.0, 20_000.0), (3.0, 0.0), (3.0, -1000.0), (0.0019, 1000.0)]
)
def test_a_rate_is_never_raised_and_two_samples_are_left_at_least(seconds, rate):
    text = f"a run of {seconds:g} s at 10000 Hz cannot be decimated to {rate:g} Hz"
    with refused(text):
        decimated(run_of(20.0, seconds=seconds), rate)
    least = run_of(20.0, seconds=0.002)
    assert len(decimated(least, 1000.0).time) == 2
    assert decimated(least, 10_000.0) is least


@pytest.mark.parametrize("gap", [0, 7, 150, 2995, 2999])
def test_ten_samples_to_either_side_of_a_gap_are_not_valid(gap):
    valid = np.ones(30_000, dtype=bool)
    valid[10 * gap + 3] = False
    slow = decimated(run_of(20.0, valid=valid), 1000.0)
    lost = np.flatnonzero(~slow.valid)
    assert lost.tolist() == [*range(max(0, gap - 10), min(3000, gap + 11))]
    assert (slow.velocity[lost] == 0.0).all()


RATE = 1000.0
LONG = np.arange(2000) / RATE


def swing(time, frequency=5.0):
    """Position of a joint that swings, and its velocity."""
    phase = 2 * np.pi * frequency * time
    return np.sin(phase)[:, None], (2 * np.pi * frequency * np.cos(phase))[:, None]


def tumble(time):
    """Pose of a base that moves and turns at constant rates, and its body velocity."""
    twist = np.array([0.3, -0.2, 0.1, 1.0, 5.0, -2.0])
    motion = pin.Motion(twist)
    poses = [pin.SE3ToXYZQUAT(pin.exp6(motion * float(t))) for t in time]
    return np.array(poses), np.tile(twist, (len(time), 1))


def test_angles_that_wrap_give_no_spike():
    angle = np.outer(LONG, [20.0])
    wrapped = (angle + np.pi) % (2 * np.pi) - np.pi
    assert np.allclose(joint_velocity(LONG, wrapped), 20.0, rtol=0, atol=1e-8)


def test_nothing_is_differentiated_across_a_gap():
    position, velocity = swing(LONG)
    valid = (LONG < 0.5) | (LONG > 0.7)
    valid[[1990, 1992]] = False
    velocity[1991] = 0.0  # a sample alone
    position[~valid] = 0.0
    found = joint_velocity(LONG, position, valid)
    assert np.array_equal(found[~valid], np.zeros((int((~valid).sum()), 1)))
    assert np.abs(found - velocity)[valid].max() < 1e-3 * np.abs(velocity).max()


@pytest.mark.parametrize("factor", [1, -1, 1.005])
def test_a_tumbling_base_has_its_body_velocity_though_quaternions_flip_or_are_longer(factor):
    pose, twist = tumble(LONG)
    pose[700:1300, 3:] *= factor
    assert np.allclose(base_velocity(LONG, pose), twist, rtol=0, atol=1e-6)


def test_a_half_turn_between_two_samples_does_not_silence_the_rest():
    pose = np.tile([0, 0, 0, 0, 0, 0, 1.0], (20, 1))
    pose[5:, 3:] = [1.0, 0, 0, 0]
    pose[:, 0] = np.arange(20) / RATE
    linear = base_velocity(LONG[:20], pose)[:, :3]
    assert np.allclose(np.linalg.norm(linear, axis=1), 1.0, atol=1e-9)


@pytest.mark.parametrize(("hold", "near"), [(1, 1e-3), (10, 0.05)])
def test_a_run_of_positions_alone_has_velocities_and_states_their_source(tmp_path, hold, near):
    places, ends = np.arange(len(LONG)) // hold * hold, 3 * (hold - 1)
    inside = slice(ends, len(LONG) - ends)
    (position, velocity), (pose, twist) = swing(LONG), tumble(LONG)
    position, pose = position[places], pose[places]
    np.savez(
        tmp_path / "run.npz", time=LONG, position=position, position_desired=position,
        base_pose=pose,
    )  # fmt: skip
    run = Run.load(tmp_path / "run.npz")
    for found in (run.velocity, run.velocity_desired):
        assert np.abs(found - velocity)[inside].max() < near * np.abs(velocity).max()
    assert np.allclose(run.base_velocity[inside], twist[inside], rtol=0, atol=near**2)
    assert METHOD == "Savitzky-Golay, window 7, order 3"
    filled = ("velocity", "velocity_desired", "base_velocity")
    assert run.meta["differentiated"] == dict.fromkeys(filled, METHOD)
    np.savez(tmp_path / "own.npz", time=LONG, position=position, velocity=2 * velocity)
    own = Run.load(tmp_path / "own.npz")
    np.testing.assert_array_equal(own.velocity, 2 * velocity)
    assert "differentiated" not in own.meta


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"position": np.ones((3, 2))}, r"position: shape \(3, 2\), expected \(2000, 2\)"),
        (
            {"position": np.where(LONG == 0.003, np.nan, 1.0)[:, None]},
            "position: nan in row 3, column 0; mark gaps with valid = false",
        ),
        (
            {"velocity": np.ones((2000, 1)), "base_pose": np.ones((2000, 6))},
            r"base_pose: shape \(2000, 6\), expected \(2000, 7\)",
        ),
        (
            {"velocity": np.ones((2000, 1)), "base_pose": np.zeros((2000, 7))},
            "the quaternion in row 0 has norm 0, expected 1",
        ),
    ],
)
def test_positions_that_cannot_be_differentiated_are_refused(tmp_path, arrays, message):
    np.savez(tmp_path / "run.npz", time=LONG, **arrays)
    with pytest.raises(RunFileError, match=message):
        Run.load(tmp_path / "run.npz")


@pytest.mark.parametrize(("hold", "reach"), [(1, 7), (3, 22)])
@pytest.mark.parametrize("derivative", [joint_velocity, base_velocity])
def test_rows_that_are_differentiated_on_demand_are_those_of_the_whole(derivative, hold, reach):
    time, read = LONG[:60], []
    pose = tumble(time)[0][np.arange(60) // hold * hold]
    pose[30:, 3:] *= -1
    valid = np.ones(60, dtype=bool)
    valid[[7, 20, 23, 40, 41]] = False
    whole = derivative(time, pose, valid)

    def rows(first, stop):
        assert 0 <= first <= stop <= 60
        read.append((first, stop))
        return pose[first:stop]

    kept = derivative(time, OnDemand((60, 7), np.float64, rows), valid)
    assert isinstance(kept, OnDemand)
    assert (kept.shape, kept.dtype) == (whole.shape, np.float64)
    for first in range(0, 60, 3):
        for stop in (first + 1, first + 5, 60):
            found = kept[first:stop]
            np.testing.assert_allclose(found, whole[first:stop], atol=1e-9)
    assert max(stop - first for first, stop in read[-60::3]) <= 1 + 2 * reach
    without = derivative(time, OnDemand((60, 7), np.float64, rows))
    np.testing.assert_allclose(without[10:20], derivative(time, pose)[10:20], atol=1e-9)


@pytest.mark.parametrize("samples", [2, 3, 6, 7, 8])
def test_a_parabola_is_differentiated_exactly_by_seven_samples_and_inside_by_fewer(samples):
    time = np.arange(samples) / 4
    found = joint_velocity(time, 0.1 * time[:, None] ** 2)[:, 0]
    exact = slice(None) if samples >= 7 else slice(1, -1)
    np.testing.assert_allclose(found[exact], 0.2 * time[exact], atol=1e-12)
    assert (abs(found[0]) > 0.02) == (samples < 7)
