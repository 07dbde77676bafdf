import numpy as np
import pytest

import noisemodel as nm
from noisemodel import OutputError, RunError, UnknownJointError

PANDA = [f"panda_joint{number}" for number in range(1, 8)]


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


def test_a_pushed_array_may_change_afterwards():
    recorder, state = nm.Recorder(None, 100), np.zeros(2)
    for step in range(5):
        state += step
        recorder.push(velocity=state)
    assert np.array_equal(recorder.run().velocity[:, 0], [0, 1, 3, 6, 10])
    assert recorder.run().joint_names == ("joint1", "joint2")


def test_values_by_name_are_put_in_the_recorders_order():
    recorder = nm.Recorder(None, 100, joint_names=["a", "b"], desired_joint_names=["b"])
    for _ in range(3):
        recorder.push(velocity={"b": 2.0, "a": 1.0}, velocity_desired={"b": 3.0})
    run = recorder.run()
    assert np.array_equal(run.velocity, [[1.0, 2.0]] * 3)
    assert np.array_equal(run.velocity_desired, [[3.0]] * 3)
    with pytest.raises(RunError, match=r"velocity: no joint 'c'; expected a, b"):
        recorder.push(velocity={"a": 1.0, "c": 1.0}, velocity_desired={"b": 3.0})
    with pytest.raises(RunError, match=r"velocity: missing for a; joint_names=… names fewer"):
        recorder.push(velocity={"b": 1.0}, velocity_desired={"b": 3.0})


def test_missing_velocities_are_differentiated_from_positions():
    recorder = nm.Recorder(None, 100)
    for step in range(300):
        recorder.push(position=[np.sin(step / 100)], position_desired=[np.sin(step / 100)])
    run = recorder.run()
    assert set(run.meta["differentiated"]) == {"velocity", "velocity_desired"}
    assert np.allclose(run.velocity[:, 0], np.cos(run.time), atol=1e-4)


@pytest.mark.parametrize(
    ("sample", "message"),
    [
        ({"velocity": np.zeros(9)}, r"velocity: shape \(9,\), expected \(2,\) \(a, b\); joint_na"),
        ({"velocity": np.zeros((1, 2))}, r"velocity: shape \(1, 2\), expected \(2,\) \(a, b\)$"),
        ({"velocity": 0.3}, r"velocity: shape \(\), expected \(2,\)"),
        ({"velocity": ["x", "y"]}, r"velocity: \['x', 'y'\], expected a number for each joint"),
        (
            {"velocity": np.zeros(2), "base_pose": np.zeros(6)},
            r"base_pose: shape \(6,\), expected \(7,\)",
        ),
        (
            {"velocity": np.zeros(2), "base_velocity": np.zeros(7)},
            r"base_velocity: shape \(7,\), expected \(6,\)",
        ),
        ({"effort": np.zeros(2)}, "velocity: missing, and position too; the sample has effort"),
        ({}, "velocity: missing, and position too; the sample has nothing"),
        ({"velocity": np.zeros(2), "time": np.nan}, "time: nan in sample 1"),
    ],
)
def test_a_wrong_sample_is_an_error_that_names_the_signal(sample, message):
    recorder = nm.Recorder(None, 100, joint_names=["a", "b"])
    with pytest.raises(RunError, match=message):
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


def test_time_has_to_rise():
    recorder = nm.Recorder(None, 100)
    recorder.push(velocity=[1.0], time=0.2)
    with pytest.raises(RunError, match=r"time: runs backwards in sample 2 \(0.2 s, then 0.1 s\)"):
        recorder.push(velocity=[1.0], time=0.1)
    with pytest.raises(RunError, match=r"time: stands still in sample 2"):
        recorder.push(velocity=[1.0], time=0.2)


@pytest.mark.parametrize(("samples", "message"), [(0, "no samples"), (1, "1 sample")])
def test_too_few_samples_are_no_run(tmp_path, samples, message):
    recorder = pushed(nm.Recorder(None, 100), samples)
    with pytest.raises(RunError, match=f"the recorder has {message}, a run needs at least 2"):
        recorder.save(tmp_path / "run.npz")
    assert not (tmp_path / "run.npz").exists()


def test_stamps_that_jitter_are_resampled_and_holes_are_gaps():
    recorder, random = nm.Recorder(None, 100), np.random.default_rng(0)
    for step in range(1000):
        if not 400 <= step < 450:
            time = 50 + step / 100 + random.uniform(-0.002, 0.002)
            recorder.push(velocity=[np.sin(3 * time)], time=time)
    run = recorder.run()
    assert run.rate == 100.0
    assert run.mask[0]
    since = run.time + float(run.meta["start"])
    assert np.allclose(run.velocity[run.mask, 0], np.sin(3 * since[run.mask]), atol=1e-3)
    assert 48 <= (~run.mask).sum() <= 52
    assert 0.001 < run.meta["jitter"]["rms"] < 0.003


def test_angles_that_jump_by_a_turn_are_resampled_without_the_jump():
    recorder, random = nm.Recorder(None, 100), np.random.default_rng(0)
    for step in range(500):
        time = step / 100 + random.uniform(-0.002, 0.002)
        angle = np.angle(np.exp(3j * time))  # between -pi and pi
        recorder.push(position=[angle, 0.1 * time], velocity=[3.0, 0.1], time=time)
    run = recorder.run()
    since = run.time + float(run.meta["start"])
    assert np.allclose(run.position[run.mask], np.outer(since, [3.0, 0.1])[run.mask], atol=1e-6)


def test_uniform_stamps_count_for_more_than_the_rate():
    recorder = nm.Recorder(None, 1000)
    for step in range(100):
        recorder.push(velocity=[float(step)], time=step / 125)
    assert recorder.run().rate == 125.0


def test_a_sample_that_is_not_finite_is_a_gap():
    recorder = nm.Recorder(None, 100)
    for step in range(100):
        pose = [0, 0, 1, 0, 0, 0, 1]
        recorder.push(velocity=[np.nan if step == 40 else 1.0], base_pose=pose)
    run = recorder.run()
    assert np.flatnonzero(~run.mask).tolist() == [40]
    assert run.velocity[40, 0] == 0.0
    silent = nm.Recorder(None, 100)
    for _ in range(3):
        silent.push(velocity=[np.nan])
    with pytest.raises(RunError, match="every sample of the recorder has a value that is not fin"):
        silent.run()


def test_a_turning_base_is_interpolated_on_the_sphere():
    recorder, random = nm.Recorder(None, 100), np.random.default_rng(1)
    for step in range(300):
        time = step / 100 + random.uniform(-0.002, 0.002)
        sign = random.choice([-1, 1])  # q and -q are one rotation
        turn = sign * np.array([0, 0, np.sin(time), np.cos(time)])
        recorder.push(velocity=[0.0], base_pose=[0, 0, 1, *turn], time=time)
    run = recorder.run()
    angle = run.time + float(run.meta["start"])
    assert np.allclose(np.abs(run.base_pose[:, 5]), np.abs(np.sin(angle)), atol=1e-4)
    assert np.allclose(run.base_velocity[5:-5, 5], 2.0, atol=0.05)


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
    with pytest.raises(RunError, match="no samples"), nm.Recorder(None, 100, path="c.npz"):
        pass
    with nm.Recorder(None, 100) as recorder:
        pushed(recorder, 10)


def test_a_robot_names_the_joints_and_joints_are_checked():
    recorder = nm.Recorder("panda", 100)
    message = r"velocity: shape \(7,\), expected \(9,\) \(panda_joint1, .*\); joint_names=… names"
    with pytest.raises(RunError, match=message):
        recorder.push(velocity=np.zeros(7))
    with pytest.raises(UnknownJointError, match="no joint 'elbow' in robot 'panda'"):
        nm.Recorder("panda", 100, joint_names=["elbow"])
    with pytest.raises(RunError, match="rate: 0 Hz, expected a number above 0"):
        nm.Recorder(None, 0)


def test_a_loaded_robot_is_named_as_it_was_loaded(tmp_path):
    for robot in (nm.Robot.load("panda"), "panda"):
        recorder = nm.Recorder(robot, 100)
        for _ in range(2):
            recorder.push(velocity=np.zeros(9))
        assert recorder.run().robot == "panda"
    own = tmp_path / "own.urdf"
    own.write_text(
        '<robot name="own"><link name="a"/><link name="b"/><joint name="j" type="continuous">'
        '<parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint></robot>'
    )
    recorder = nm.Recorder(own, 100)
    for _ in range(2):
        recorder.push(velocity={"j": 1.0})
    recorder.save(tmp_path / "run.npz")
    assert nm.Run.load(tmp_path / "run.npz").robot == str(own)
