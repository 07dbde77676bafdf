import re

import numpy as np
import pytest
from chains import chain

import noisemodel as nm
from noisemodel import OutputError, RunError, UnknownJointError

OTHER, OTHERS = (f"({names}); joint_names=… names others" for names in ("c", "a, b"))
BOTH = {"velocity": np.zeros(2)}
PANDA = [f"panda_joint{number}" for number in range(1, 8)]


def whole(text):
    return pytest.raises(RunError, match=f"^{re.escape(text)}$")


def pushed(recorder, samples=300, rate=100):
    for step in range(samples):
        angle = np.array([np.sin(step / rate), np.cos(step / rate)])
        slope = np.array([np.cos(step / rate), -np.sin(step / rate)])
        recorder.push(position=angle, velocity=slope)
    return recorder


def test_pushed_samples_are_the_run_at_the_recorders_rate(tmp_path):
    recorder = nm.Recorder("panda", 250, joint_names=PANDA, meta={"seed": 3})
    values = np.random.default_rng(0).normal(size=(5, 3000, 7))
    names = ("position", "velocity", "position_desired", "velocity_desired", "effort")
    for row in range(3000):  # more than there is room for at first
        recorder.push(**{name: values[place, row] for place, name in enumerate(names)})
    assert len(recorder) == 3000
    recorder.save(tmp_path / "run.npz")
    run = nm.Run.load(tmp_path / "run.npz")
    assert run.rate == 250.0
    assert run.robot == "panda"
    assert run.joint_names == run.desired_joint_names == tuple(PANDA)
    assert run.meta == {"seed": 3}
    for place, name in enumerate(names):
        assert np.array_equal(getattr(run, name), values[place])
    with pytest.raises(OutputError, match="exists"):
        recorder.save(tmp_path / "run.npz")
    recorder.save(tmp_path / "run.npz", overwrite=True)


def test_values_by_name_are_put_in_the_recorders_order():
    recorder = nm.Recorder(None, 100, joint_names=["a", "b"], desired_joint_names=["b"])
    for _ in range(3):
        recorder.push(velocity={"b": 2.0, "a": 1.0}, velocity_desired={"b": 3.0})
    run = recorder.run()
    assert np.array_equal(run.velocity, [[1.0, 2.0]] * 3)
    assert np.array_equal(run.velocity_desired, [[3.0]] * 3)
    for wrong in ({"a": 1.0, "c": 1.0}, {"b": 1.0}, {"a": 1.0, "b": 1.0, "c": 1.0}):
        named = ", ".join(wrong)
        with whole(f"velocity: joints {named}, expected a, b; joint_names=… names others"):
            recorder.push(velocity=wrong, velocity_desired={"b": 3.0})
    with whole("velocity_desired: joints a, expected b; joint_names=… names others"):
        recorder.push(velocity={"a": 1.0, "b": 1.0}, velocity_desired={"a": 3.0})


@pytest.mark.parametrize(
    ("sample", "message"),
    [
        ({"velocity": np.zeros((1, 2))}, f"velocity: shape (1, 2), expected (2,) {OTHERS}"),
        ({"velocity": 0.3}, f"velocity: shape (), expected (2,) {OTHERS}"),
        ({"velocity": ["x", "y"]}, "velocity: ['x', 'y'], expected a number for each joint"),
        (BOTH | {"base_pose": np.zeros(6)}, "base_pose: shape (6,), expected (7,)"),
        (BOTH | {"base_velocity": np.zeros((2, 6))}, "base_velocity: shape (2, 6), expected (6,)"),
        (BOTH | {"velocity_desired": 1.0}, f"velocity_desired: shape (), expected (1,) {OTHER}"),
        ({"effort": np.zeros(2)}, "velocity: missing, and position too; the sample has effort"),
        ({}, "velocity: missing, and position too; the sample has nothing"),
        (BOTH | {"time": np.nan}, "time: nan s in sample 1, after -inf s"),
    ],
)
def test_a_wrong_sample_is_an_error_that_names_the_signal(sample, message):
    recorder = nm.Recorder(None, 100, joint_names=["a", "b"], desired_joint_names=["c"])
    with whole(message):
        recorder.push(**sample)
    assert len(recorder) == 0


def test_signals_may_not_come_and_go():
    recorder = pushed(nm.Recorder(None, 100), 5)
    with pytest.raises(RunError, match="position: missing in sample 6; push it each time or never"):
        recorder.push(velocity=[0, 0])
    with pytest.raises(RunError, match="effort: new in sample 6; push it each time or never"):
        recorder.push(velocity=[0, 0], position=[0, 0], effort=[0, 0])
    with pytest.raises(RunError, match="time: new in sample 6"):
        recorder.push(velocity=[0, 0], position=[0, 0], time=0.1)
    assert len(recorder.run().time) == 5


@pytest.mark.parametrize("now", [0.1, 0.2, np.nan, np.inf])
def test_time_has_to_rise(now):
    recorder = nm.Recorder(None, 100)
    recorder.push(velocity=[1.0], time=0.2)
    with whole(f"time: {now:g} s in sample 2, after 0.2 s"):
        recorder.push(velocity=[1.0], time=now)


def failing(path, samples):
    with nm.Recorder(None, 100, path=path) as recorder:
        pushed(recorder, samples)
        raise KeyboardInterrupt


def test_a_loop_that_is_interrupted_leaves_what_it_had(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        failing(tmp_path / "a.npz", 10)
    assert len(nm.Run.load(tmp_path / "a.npz").time) == 10
    with pytest.raises(KeyboardInterrupt):
        failing(tmp_path / "b.npz", 0)
    with pytest.raises(RunError, match="0 samples"), nm.Recorder(None, 100, path="c.npz"):
        pass
    with nm.Recorder(None, 100) as recorder:
        pushed(recorder, 10)
    for samples in (0, 1):
        with whole(f"the recorder has {samples} samples, a run needs at least 2"):
            pushed(nm.Recorder(None, 100), samples).save(tmp_path / "c.npz")
    with nm.Recorder(None, 100, path=tmp_path / "a.npz") as recorder:  # replaces what there was
        pushed(recorder, 20)
    assert sorted(each.name for each in tmp_path.iterdir()) == ["a.npz"]
    assert len(nm.Run.load(tmp_path / "a.npz").time) == 20


def test_a_robot_names_the_joints_and_joints_are_checked():
    for names in ((["elbow"], ()), (PANDA, [PANDA[0], "elbow"])):
        with pytest.raises(UnknownJointError, match="no joint 'elbow' in robot 'panda'"):
            nm.Recorder("panda", 100, joint_names=names[0], desired_joint_names=names[1])
    recorder = nm.Recorder("panda", 100, joint_names=PANDA[:2], desired_joint_names=PANDA[4:5])
    for _ in range(2):
        recorder.push(velocity=[0, 0], velocity_desired=[0])
    run = recorder.run()
    assert (run.joint_names, run.desired_joint_names) == (tuple(PANDA[:2]), (PANDA[4],))


def test_a_loaded_robot_is_named_as_it_was_loaded(tmp_path):
    for robot in (nm.Robot.load("panda"), "panda"):
        recorder = nm.Recorder(robot, 100)
        for _ in range(2):
            recorder.push(velocity=np.zeros(9))
        assert recorder.run().robot == "panda"
    own = chain(tmp_path, "continuous").path
    recorder = nm.Recorder(own, 100)
    for _ in range(2):
        recorder.push(velocity={"joint1": 1.0})
    recorder.save(tmp_path / "run.npz")
    assert nm.Run.load(tmp_path / "run.npz").robot == str(own)


STEP = 1 / 128  # a step whose multiples are exact, in [s]


def stamped(stamps, rate=128, **signals):
    """What is pushed at these stamps, in steps: signals are functions of the time in [s]."""
    recorder = nm.Recorder(None, rate)
    for stamp in stamps:
        time = stamp * STEP
        recorder.push(time=5.0009765625 + time, **{n: make(time) for n, make in signals.items()})
    return recorder.run()


SHIFT = np.array([0.0, 0.0, 0.0, 0.0, 9.0])


def ramp(time):
    return np.arange(1.0, 6.0) + np.arange(2.0, 7.0) * time


def test_samples_are_interpolated_between_stamps_and_not_in_gaps_or_at_single_samples():
    """A ramp is interpolated exactly; steps above five medians are gaps."""
    stamps = [0, 1, 2, 3, 4.5, 5, 6, 12, 13, 14, 20, 30, 31, 40, 41, 42, 43.5]
    sign = dict(zip(stamps, (1, 1, -1, 1, -1, 1, 1, -1, 1, 1, 1, 1, -1, 1, -1, -1, 1), strict=True))

    def turn(time):
        return np.array([0.6 * np.sin(40 * time), 0.8 * np.sin(40 * time), 0, np.cos(40 * time)])

    run = stamped(
        stamps,
        velocity=lambda time: ramp(time) if time != 13 * STEP else np.full(5, np.nan),
        position=lambda time: np.angle(np.exp(1j * 25.0 * ramp(time))) + SHIFT,
        base_pose=lambda time: [*ramp(time)[:3], *sign[time / STEP] * turn(time)],
    )
    assert run.joint_names == ("joint_0", "joint_1", "joint_2", "joint_3", "joint_4")
    np.testing.assert_array_equal(run.time, np.arange(44) * STEP)
    known = [*range(7), *range(12, 15), 30, 31, *range(40, 44)]
    assert np.flatnonzero(run.mask).tolist() == known
    assert run.meta["start"] == "5.0009765625"
    assert run.meta["jitter"] == pytest.approx({"rms": STEP * np.sqrt(0.75 / 12), "max": STEP / 2})
    there, gap = run.time[known], ~run.mask
    np.testing.assert_allclose(run.velocity[known], [*map(ramp, there)], rtol=1e-12)
    np.testing.assert_allclose(run.base_pose[known, :3], [ramp(t)[:3] for t in there], rtol=1e-12)
    np.testing.assert_array_equal(run.velocity[gap], 0.0)
    np.testing.assert_array_equal(run.position[gap], 0.0)
    np.testing.assert_array_equal(run.base_pose[gap], np.tile([0, 0, 0, 0, 0, 0, 1.0], (28, 1)))
    np.testing.assert_allclose(np.linalg.norm(run.base_pose[:, 3:], axis=1), 1.0, rtol=1e-12)
    for first, stop in ((0, 7), (12, 15), (30, 32), (40, 44)):
        stretch, time = slice(first, stop), run.time[first:stop]
        slopes = np.diff(run.position[stretch], axis=0) / STEP
        np.testing.assert_allclose(
            slopes, np.broadcast_to(25.0 * np.arange(2.0, 7.0), slopes.shape)
        )
        start = np.angle(np.exp(1j * 25.0 * ramp(time[0]))) + SHIFT
        np.testing.assert_allclose(run.position[first], start, rtol=1e-12)
        expected = sign[first] * np.array([turn(each) for each in time])
        np.testing.assert_allclose(run.base_pose[stretch, 3:], expected, atol=0.03)
        stamped_there = np.isin(np.arange(first, stop), [each for each in stamps if each != 13])
        np.testing.assert_allclose(
            run.base_pose[stretch, 3:][stamped_there], expected[stamped_there], atol=1e-12
        )


@pytest.mark.parametrize(("step", "missing", "most"), [(5, 0, 4), (5.25, 5, 0.25)])
def test_a_step_of_five_medians_is_no_gap_yet(step, missing, most):
    """Where it is a gap, only the other step, of 0.75 medians, deviates."""
    stamps = [*range(10), 9 + step, *range(15, 20)]
    run = stamped(stamps, velocity=ramp)
    assert (~run.mask).sum() == missing
    assert run.meta["jitter"]["max"] == most * STEP
    np.testing.assert_allclose(run.velocity[run.mask], [*map(ramp, run.time[run.mask])])


@pytest.mark.parametrize(("share", "kept"), [(0.9e-3, True), (1.1e-3, False)])
def test_stamps_are_kept_that_lie_a_thousandth_of_a_step_apart(share, kept):
    stamps = np.arange(20.0)
    stamps[7] += share
    run = stamped(stamps, velocity=ramp)
    assert ("jitter" in run.meta) != kept
    np.testing.assert_array_equal(
        run.time == np.arange(20) * STEP, (np.arange(20) != 7) | (not kept)
    )
    np.testing.assert_allclose(run.velocity, [*map(ramp, run.time)], rtol=1e-9)


@pytest.mark.parametrize("share", [-0.051, -0.049, 0.049, 0.051])
def test_stamps_that_jitter_have_the_recorders_rate_unless_theirs_is_5_percent_off(share):
    own = abs(share) > 0.05
    stamps = [*range(10), *range(11, 30)]
    rate = 128 * (1 + share)
    run = stamped(stamps, rate=rate, velocity=ramp)
    assert run.rate == pytest.approx(128 if own else rate, rel=1e-8)
    assert len(run.time) == (30 if own else int(29 * (1 + share) + 0.001) + 1)
    np.testing.assert_allclose(run.velocity[run.mask], [*map(ramp, run.time[run.mask])])


def test_a_rate_of_stamps_has_six_digits():
    recorder = nm.Recorder(None, 100)
    for step in (0, 1, 2, 3, 5, 6, 7):
        recorder.push(velocity=[1.0], time=step / 300.1234567)
    assert recorder.run().rate == 300.123


def test_a_sample_that_is_not_finite_is_a_gap_in_all_signals_and_the_base_does_not_turn_there():
    recorder = nm.Recorder(None, 0.5)
    for step in range(4):
        velocity, effort = [1.0, 2.0], [np.inf if step == 2 else 3.0, 4.0]
        recorder.push(velocity=velocity, effort=effort, base_pose=[1, 2, 3, 1, 0, 0, 0])
    run = recorder.run()
    assert run.time.tolist() == [0.0, 2.0, 4.0, 6.0]
    assert run.mask.tolist() == [True, True, False, True]
    assert run.velocity.tolist() == [[1, 2], [1, 2], [0, 0], [1, 2]]
    assert run.effort.tolist() == [[3, 4], [3, 4], [0, 0], [3, 4]]
    assert run.base_pose[1:3].tolist() == [[1, 2, 3, 1, 0, 0, 0], [0, 0, 0, 0, 0, 0, 1]]


@pytest.mark.parametrize("rate", [0.0, -1.0, 5e-324, 1e300, np.nan, np.inf])
def test_a_rate_is_one_that_a_run_may_have(rate):
    with whole(f"rate: {rate:g} Hz, expected 1e-09 Hz to 1e+09 Hz"):
        nm.Recorder(None, rate)


def test_without_names_the_first_sample_names_the_joints():
    recorder = nm.Recorder(None, 100)
    with whole("velocity: shape (), expected (joints,)"):
        recorder.push(velocity=1.0)
    for _ in range(2):
        recorder.push(time=len(recorder) / 100, velocity={"b": 1.0, "a": 2.0}, effort=[3.0, 4.0])
    with whole("velocity: shape (3,), expected (2,) (b, a); joint_names=… names others"):
        recorder.push(time=0.5, velocity=[1, 2, 3], effort=[3.0, 4.0])
    run = recorder.run()
    assert run.joint_names == run.desired_joint_names == ("b", "a")
    assert run.velocity.tolist() == [[1.0, 2.0]] * 2


def test_desired_joints_keep_their_names_and_missing_velocities_are_differentiated():
    recorder = nm.Recorder(None, 100, desired_joint_names=["b"])
    for step in range(300):
        swing = np.sin(step / 100)
        recorder.push(position=[swing, 0.0], position_desired=[swing])
    run = recorder.run()
    assert set(run.meta["differentiated"]) == {"velocity", "velocity_desired"}
    assert np.allclose(run.velocity[:, 0], np.cos(run.time), atol=1e-4)
    np.testing.assert_array_equal(run.velocity_desired[:, 0], run.velocity[:, 0])
    assert (run.joint_names, run.desired_joint_names) == (("joint_0", "joint_1"), ("b",))
