from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from noisemodel import Block, Run, RunError, ondemand
from noisemodel.ondemand import OnDemand
from noisemodel.run import part, pieces_of

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
    recorded = run(time=1.7e4 + np.arange(100) / rate)
    assert recorded.rate == pytest.approx(rate, rel=1e-6)
    assert run(time=np.arange(100) / rate).rate == pytest.approx(rate, rel=1e-9)


def test_stamps_of_a_day_in_unix_time_are_uniform():
    """Their own spacing is 2.4e-7 s, which is coarser than a thousandth of 0.1 ms."""
    assert run(time=1.8e9 + np.arange(100) / 10_000).rate == pytest.approx(10_000, rel=3e-3)


def test_blocks_are_sorted():
    late, early = Block(0.05, 0.1, "impact"), Block(0.0, 0.05, "ok")
    assert run(blocks=(late, early)).blocks == (early, late)


def test_a_run_cannot_be_changed_in_place():
    with pytest.raises(AttributeError):
        run().robot = "talos"
    with pytest.raises(TypeError):
        run().meta["seed"] = 1
    assert replace(run(), robot="talos").robot == "talos"


def spoilt(value, row=3, column=1):
    velocity = np.ones((100, 2))
    velocity[row, column] = value
    return velocity


def shifted(row, by):
    time = TIME.copy()
    time[row:] += by
    return time


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"time": TIME[:1], "velocity": np.ones((1, 2))}, "with at least 2 samples"),
        ({"time": TIME[:, None]}, r"time: shape \(100, 1\), expected \(samples,\)"),
        ({"time": shifted(7, np.nan)}, "time: nan in row 7"),
        ({"time": shifted(7, np.inf)}, "time: inf in row 7"),
        ({"time": shifted(7, -0.001)}, r"stands still in row 7 \(0.006 s, then 0.006 s\)"),
        ({"time": shifted(7, -0.002)}, r"runs backwards in row 7 \(0.006 s, then 0.005 s\)"),
        ({"time": shifted(7, 0.001)}, "not uniform, the step to row 7 is 0.002 s where the median"),
        ({"time": TIME.astype(np.float32) + np.float32(1e3)}, "float32 is too coarse"),
        ({"velocity": np.ones((100, 3))}, r"velocity: shape \(100, 3\), expected \(100, 2\)"),
        ({"velocity": np.ones((99, 2))}, r"velocity: shape \(99, 2\), expected \(100, 2\)"),
        ({"velocity": np.ones(100)}, r"velocity: shape \(100,\), expected \(100, 2\)"),
        ({"velocity": np.ones((100, 2), dtype=object)}, "velocity: holds object, expected float"),
        ({"velocity": spoilt(np.nan)}, "velocity: nan in row 3, column 1; mark gaps with valid"),
        ({"velocity": spoilt(-np.inf)}, "velocity: -inf in row 3, column 1"),
        ({"position": np.ones((100, 1))}, r"position: shape \(100, 1\), expected \(100, 2\)"),
        ({"effort": spoilt(np.nan)}, "effort: nan in row 3, column 1"),
        ({"velocity_desired": np.ones((100, 1))}, r"velocity_desired: shape \(100, 1\)"),
        ({"stages": {"planner": np.ones((9, 2))}}, r"stage_planner: shape \(9, 2\)"),
        ({"stages": {"a\nb": np.ones((100, 2))}}, r"stages: 'a\\nb' is no name"),
        ({"base_velocity": np.ones((100, 7))}, r"base_velocity: shape \(100, 7\)"),
        ({"base_pose": np.ones((100, 6))}, r"base_pose: shape \(100, 6\), expected \(100, 7\)"),
        ({"base_pose": np.ones((100, 7))}, "quaternion in row 0 has norm 2, expected 1"),
        ({"valid": np.ones(99, dtype=bool)}, r"valid: shape \(99,\) of bool, expected \(100,\)"),
        ({"valid": np.ones(100)}, r"valid: shape \(100,\) of float64"),
        ({"valid": np.zeros(100, dtype=bool)}, "valid: false in every sample"),
        ({"joint_names": ("a", "a")}, "joint_names: a named twice"),
        ({"joint_names": ("a", "")}, "joint_names: '' is no name"),
        ({"desired_joint_names": ("c", "c")}, "desired_joint_names: c named twice"),
    ],
)
def test_signals_that_do_not_fit_are_refused(changes, message):
    with pytest.raises(RunError, match=message) as caught:
        run(**changes)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("blocks", "message"),
    [
        ([(0.05, 0.02, "ok")], "block 'ok': starts at 0.05 s, stops at 0.02 s"),
        ([(0.05, 0.05, "ok")], "block 'ok': starts at 0.05 s, stops at 0.05 s"),
        ([(np.nan, 0.05, "ok")], "block 'ok': starts at nan s"),
        ([(0.05, 0.2, "ok")], "0.05 s to 0.2 s lies outside of the run, 0 s to 0.099 s"),
        ([(-1.0, 0.05, "ok")], "-1 s to 0.05 s lies outside of the run"),
        ([(0.0, 0.05, "ok"), (0.04, 0.06, "impact")], "'ok' until 0.05 s and 'impact' from 0.04 s"),
        ([(0.0, 0.05, "")], "block_label: '' is no name"),
    ],
)
def test_blocks_that_do_not_fit_are_refused(blocks, message):
    with pytest.raises(RunError, match=message):
        run(blocks=tuple(Block(*block) for block in blocks))


def test_only_signals_whose_axes_are_exchanged_are_said_to_be_transposed():
    for shape, hint in (((2, 100), True), ((2, 99), False), ((100, 3), False), ((100,), False)):
        with pytest.raises(RunError) as caught:
            run(velocity=np.ones(shape))
        assert str(caught.value).endswith("; samples come first, is it transposed?") == hint


def test_blocks_may_touch_and_reach_the_end_of_the_last_sample_and_no_further():
    with pytest.raises(RunError, match="block 'ok'"):
        run(blocks=(Block(0.0, 0.102, "ok"),))
    assert len(run(blocks=(Block(0.0, 0.05, "ok"), Block(0.05, 0.1, "impact"))).blocks) == 2


def test_quaternions_in_gaps_are_not_checked():
    pose = np.tile([0, 0, 0, 0, 0, 0, 1.0], (100, 1))
    pose[50] = 0.0
    assert run(base_pose=pose, valid=np.arange(100) != 50).base_pose is not None


def filled():
    """A run with every signal, a gap, and two blocks."""
    random = np.random.default_rng(0)
    names = ("position", "velocity_desired", "position_desired", "effort")
    valid = np.ones(100, dtype=bool)
    valid[40:45] = False
    signals = {name: random.standard_normal((100, 2)) * valid[:, None] for name in names}
    pose = np.zeros((100, 7))
    pose[:, 6] = 1.0
    return run(
        velocity=random.standard_normal((100, 2)) * valid[:, None],
        stages={"motor": random.standard_normal((100, 2))},
        valid=valid,
        base_pose=pose,
        base_velocity=random.standard_normal((100, 6)),
        desired_joint_names=("c", "d"),
        robot="panda",
        blocks=(Block(0.0, 0.0205, "ok"), Block(0.0205, 0.08, "impact")),
        meta={"seed": 1},
        **signals,
    )


def same(one, other):
    """Compare two runs field by field."""
    for field in fields(Run):
        left, right = getattr(one, field.name), getattr(other, field.name)
        if isinstance(left, np.ndarray):
            np.testing.assert_array_equal(left, right)
        elif field.name == "stages":
            assert set(left) == set(right)
            for name in left:
                np.testing.assert_array_equal(left[name], right[name])
        else:
            assert left == right
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
    assert cut.time[0] == whole.time[20]
    assert cut.time[-1] == whole.time[49]
    for name in ("velocity", "position", "effort", "valid", "base_pose", "base_velocity"):
        np.testing.assert_array_equal(getattr(cut, name), getattr(whole, name)[20:50])
    np.testing.assert_array_equal(cut.stages["motor"], whole.stages["motor"][20:50])
    assert (cut.robot, cut.meta, cut.joint_names) == (whole.robot, whole.meta, whole.joint_names)


def test_the_halves_of_a_run_are_the_run():
    whole = filled()
    halves = whole.cut(-np.inf, 0.033), whole.cut(0.033, np.inf)
    for name in ("time", "velocity", "velocity_desired", "valid"):
        joined = np.concatenate([getattr(half, name) for half in halves])
        np.testing.assert_array_equal(joined, getattr(whole, name))


def test_blocks_are_clipped_to_a_cut():
    assert filled().cut(0.01, 0.05).blocks == (
        Block(0.01, 0.0205, "ok"),
        Block(0.0205, 0.05, "impact"),
    )
    assert filled().cut(0.0301, 0.09).blocks == (Block(TIME[31], 0.08, "impact"),)
    assert filled().cut(0.0205, 0.05).blocks == (Block(0.0205, 0.05, "impact"),)
    assert filled().cut(0.08, 0.09).blocks == ()


@pytest.mark.parametrize(
    ("stretch", "message"),
    [
        (
            (0.05, 0.05),
            "0 samples from 0.05 s to 0.05 s, expected 2 at least; the run has 0 s to 0",
        ),
        ((0.05, 0.01), "0 samples from 0.05 s to 0.01 s"),
        ((0.05, 0.0505), "1 samples from"),
        ((7.0, 8.0), "0 samples from 7 s to 8 s, .* the run has 0 s to 0.099 s"),
        ((np.nan, np.nan), "0 samples from nan s"),
        ((0.04, 0.0445), "false in every sample"),
    ],
)
def test_an_empty_cut_is_refused(stretch, message):
    with pytest.raises(RunError, match=message):
        filled().cut(*stretch)


def test_a_part_has_no_blocks_and_the_changes_that_are_given():
    whole = filled()
    found = part(whole, 10, 30, effort=None)
    assert (found.blocks, found.effort) == ((), None)
    np.testing.assert_array_equal(found.position, whole.position[10:30])


def test_a_run_is_represented_in_one_line():
    line = "Run(panda, 2 joints, 100 samples at 1000 Hz, 0.1 s, 2 blocks)"
    assert repr(filled()) == line
    assert repr(run()) == "Run(no robot, 2 joints, 100 samples at 1000 Hz, 0.1 s, 0 blocks)"


def test_a_cut_that_ends_before_it_begins_has_no_samples():
    text = "0 samples from 0.05 s to 0.01 s, expected 2 at least; the run has 0 s to 0.099 s"
    with pytest.raises(RunError, match=f"^{text}$"):
        filled().cut(0.05, 0.01)
    assert len(filled().cut(0.05, 0.0511).time) == 2


def test_a_run_moves_by_joints_or_by_its_base():
    base = run(velocity=np.zeros((100, 0)), joint_names=(), base_velocity=np.ones((100, 6)))
    assert base.motion.shape == (100, 6)
    text = "^joint_names: there are no joints, and the base does not move$"
    with pytest.raises(RunError, match=text):
        run(velocity=np.zeros((100, 0)), joint_names=())


def test_the_motion_of_a_floating_base_comes_before_that_of_the_joints():
    base, joints = np.random.default_rng(0).normal(size=(2, 100, 6))
    whole = run(velocity=joints[:, :2], base_velocity=base)
    np.testing.assert_array_equal(whole.motion, np.hstack((base, joints[:, :2])))

    def on_demand(array):
        return OnDemand(array.shape, array.dtype, lambda first, stop: array[first:stop])

    for changes in (
        {"velocity": on_demand(whole.velocity)},
        {"base_velocity": on_demand(base.astype(np.float32))},
        {"velocity": on_demand(whole.velocity), "base_velocity": on_demand(base)},
    ):
        kept = replace(whole, **changes).motion
        assert isinstance(kept, OnDemand)
        assert (kept.shape, kept.dtype) == ((100, 8), np.float64)
        np.testing.assert_allclose(kept[7:13], whole.motion[7:13], rtol=1e-6)


@pytest.mark.parametrize("samples", [1, 7, 99, 100, 101, None])
def test_the_pieces_of_a_run_are_its_motion(monkeypatch, samples):
    monkeypatch.setattr(ondemand, "AT_ONCE", 8 * 8 * 30 + 5)
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
