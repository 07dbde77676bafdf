"""Logs of simulators and policies, in files of a few lines that have their true layouts."""

import json

import h5py
import mujoco
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from checks import holds
from csvlogs import write
from samplelogs import EPOCH, Talk, joint_states, motion, write_bag

from inspector import read_log, read_logs
from inspector.errors import LogError
from inspector.logs.clocks import rate_of
from inspector.logs.mapping import followed
from inspector.logs.read import open_source, sources

STEPS = 400
FITS = "at which positions and velocities fit; --rate sets another"


def moved(rate, joints=7, samples=STEPS):
    """Stamps, positions and velocities of joints that move smoothly."""
    time = np.arange(samples) / rate
    return (time, *motion(time, joints))


def said(path, **options):
    """The run of a log, and what is said of it without the log's name."""
    found = read_log(path, **options)
    return found.run, [remark.removeprefix(f"{path.name}: ") for remark in found.remarks]


def hdf5(path, arrays, **attributes):
    with h5py.File(path, "w") as file:
        for name, values in arrays.items():
            file[name] = values
        for place, more in attributes.items():
            file[place.replace("_root", "/")].attrs.update(more)
    return path


def savez(path, **arrays):
    np.savez(path, **arrays)
    return path


def isaac_lab(path):
    """What Isaac Lab's recorder writes of a Franka in its cube-stacking task."""
    _, position, velocity = moved(50, 9)
    target = np.roll(position, -2, axis=0)
    target[-2:] = position[-1]
    still = np.tile([0.5, 0, 0, 1, 0, 0, 0], (STEPS, 1))
    robot = {
        "joint_position": position,
        "joint_velocity": velocity,
        "root_pose": np.tile([0, 0, 0, 1, 0, 0, 0], (STEPS, 1)),
        "root_velocity": np.zeros((STEPS, 6)),
    }
    arrays = {
        "actions": np.sin(np.arange(STEPS * 8)).reshape(STEPS, 8),
        "processed_actions": np.hstack((target[:, :7], still[:, :1])),
        "obs/actions": np.zeros((STEPS, 8)),
        "obs/joint_pos": position - position[0],
        "obs/joint_vel": velocity,
        "obs/eef_pos": np.zeros((STEPS, 3)),
        "states/rigid_object/cube_1/root_pose": still,
        "states/articulation/cabinet/joint_position": np.zeros((STEPS, 9)),
    }
    arrays |= {f"states/articulation/robot/{name}": each for name, each in robot.items()}
    arrays |= {f"initial_state/articulation/robot/{n}": each[:1] for n, each in robot.items()}
    both = {f"data/demo_{number}/{n}": each for number in (0, 1) for n, each in arrays.items()}
    hdf5(path, {name: np.float32(each) for name, each in both.items()}, data={"total": 2 * STEPS})
    return path, position, velocity, target


def test_isaac_labs_episodes_are_runs_with_their_targets(tmp_path):
    path, position, velocity, target = isaac_lab(tmp_path / "dataset.hdf5")
    runs = list(read_logs(path))
    assert [each.name for each in runs] == ["dataset-demo_0", "dataset-demo_1"]
    run, remarks = said(path, episode="demo_0")
    holds(run, rate=50.0, position=np.float32(position), velocity=np.float32(velocity))
    holds(run, desired_joint_names=tuple(f"joint_{n}" for n in range(7)), base_pose=None)
    assert np.allclose(run.position_desired, target[:, :7], atol=1e-6)
    home = "states/articulation/robot"
    assert remarks[:2] == [
        f"there are no stamps: 50 Hz, {FITS}",
        f"taken: position = {home}/joint_position, velocity = {home}/joint_velocity,"
        " position_desired = processed_actions[0:7] (position follows it)",
    ]


def robomimic(path):
    """What robomimic writes of robosuite: observations, the same one step later, and actions."""
    _, position, velocity = moved(20)
    arrays = {
        "actions": np.sin(np.arange(STEPS * 7)).reshape(STEPS, 7),
        "dones": np.zeros(STEPS, dtype=int),
        "rewards": np.zeros(STEPS),
        "states": np.zeros((STEPS, 32)),
    }
    for name in ("obs", "next_obs"):
        arrays[f"{name}/robot0_joint_pos"] = position
        arrays[f"{name}/robot0_joint_vel"] = velocity
        arrays[f"{name}/robot0_joint_pos_cos"] = np.cos(position)
        arrays[f"{name}/robot0_eef_pos"] = position[:, :3]
        arrays[f"{name}/robot0_gripper_qpos"] = position[:, :2]
    arrays = {f"data/demo_0/{name}": each for name, each in arrays.items()}
    return hdf5(path, arrays, data={"total": STEPS}), position


def test_robomimics_actions_are_not_taken_for_joint_targets(tmp_path):
    path, position = robomimic(tmp_path / "low_dim.hdf5")
    run, remarks = said(path)
    holds(run, position=position, rate=20.0, position_desired=None)
    assert remarks[:3] == [
        f"there are no stamps: 20 Hz, {FITS}",
        "taken: position = obs/robot0_joint_pos, velocity = obs/robot0_joint_vel",
        "actions not taken as desired positions: obs/robot0_joint_pos does not follow;"
        " --map position_desired=actions takes it",
    ]
    assert read_log(path, mapping=["position_desired=actions"]).run.position_desired.shape[1] == 7


SCENE = """<mujoco><option timestep="0.002" integrator="implicitfast"/>
<default><joint armature="0.2" damping="1"/><position kp="80" kv="8"/></default><worldbody>
<body pos="0 0 1">{base}<geom size="0.1"/>
<body pos="0.2 0 0"><joint name="a" axis="0 0 1"/><geom size="0.05"/>
<body pos="0.2 0 0"><joint name="b" axis="0 1 0"/><geom size="0.05"/></body></body></body>
<body name="box" pos="1 1 0"><freejoint/><geom size="0.1"/></body></worldbody>
<actuator><position joint="a"/><position joint="b"/></actuator></mujoco>"""


def simulated(base):
    """Arrays that a loop around MuJoCo collects, targets set at 50 Hz."""
    model = mujoco.MjModel.from_xml_string(SCENE.format(base=base))
    data = mujoco.MjData(model)
    log = {"time": [], "qpos": [], "qvel": [], "ctrl": [], "qfrc_actuator": []}
    for step in range(1500):
        if step % 10 == 0:
            data.ctrl[:] = [0.7 * np.sin(2 * data.time), 0.5 * np.cos(3 * data.time)]
        mujoco.mj_step(model, data)
        for name, rows in log.items():
            rows.append(np.copy(getattr(data, name)))
    return {name: np.array(rows) for name, rows in log.items()}


@pytest.mark.parametrize(("base", "first"), [("", 0), ("<freejoint/>", 7)])
def test_mujocos_arrays_are_joints_base_and_targets_without_floating_objects(tmp_path, base, first):
    log = simulated(base)
    run, remarks = said(savez(tmp_path / "log.npz", **log))
    rows = slice(round(float(run.meta["start"]) * 500) - 1, None)
    rows = slice(rows.start, rows.start + len(run.time))
    speed = 6 if first else 0
    assert run.rate == pytest.approx(500.0)
    assert np.array_equal(run.position, log["qpos"][rows, first : first + 2])
    assert np.array_equal(run.velocity, log["qvel"][rows, speed : speed + 2])
    assert np.array_equal(run.effort, log["qfrc_actuator"][rows, speed : speed + 2])
    assert (run.base_pose is not None) == bool(base)
    taken = f"position = qpos[{first}:{first + 2}], velocity = qvel[{speed}:{speed + 2}]"
    assert taken in remarks[0]
    held = "position_desired: each target is held for 10 samples (50 Hz); interpolated from target"
    assert any(remark.startswith(held) for remark in remarks)
    # The jumps of held targets would be pulses of 10 rad/s and more.
    assert np.abs(run.velocity_desired).max() < 1.6
    assert np.abs(run.velocity_desired - run.velocity).std() < 0.5


def test_mujocos_state_is_found_in_hdf5_and_in_the_columns_of_tables(tmp_path):
    log = simulated("")
    names = [
        f"{name}_{n}"
        for name, width in (("qpos", 9), ("qvel", 8), ("ctrl", 2))
        for n in range(width)
    ]
    table = np.hstack([log["time"][:, None], log["qpos"], log["qvel"], log["ctrl"]])
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header=",".join(["time", *names]))
    columns = dict(zip(["time", *names], table.T, strict=True))
    pq.write_table(pa.table(columns), tmp_path / "log.parquet")
    npz = read_log(savez(tmp_path / "log.npz", **log)).run
    del log["qfrc_actuator"]
    for path in (hdf5(tmp_path / "log.h5", log), tmp_path / "log.parquet", tmp_path / "log.csv"):
        run, remarks = said(path)
        assert run.joint_names == ("joint_0", "joint_1")
        assert np.allclose(run.position, npz.position, atol=1e-12)
        assert np.allclose(run.velocity_desired, npz.velocity_desired, atol=1e-9)
        taken = "taken: position = qpos[0:2], velocity = qvel[0:2], position_desired = ctrl"
        taken += " (position follows it)"
        assert remarks.count(taken) == 1
    mapping = ["effort.joint_0=ctrl_0", "effort.joint_1=ctrl_1"]
    mapped = read_log(path, mapping=mapping).run  # columns that are mapped are no array
    holds(mapped, velocity_desired=None, effort=log["ctrl"])


def test_wheels_that_turn_to_and_fro_are_in_the_unit_that_their_format_defines(tmp_path):
    time = np.arange(1200) / 100
    position = 15 * np.column_stack((1 - np.cos(time / 2), 0.9 - 0.9 * np.cos(time / 2)))
    velocity = 7.5 * np.column_stack((np.sin(time / 2), 0.9 * np.sin(time / 2)))
    times = EPOCH + np.round(time * 1e9).astype(int)
    states = joint_states(Talk(), times, ["l", "r"], position=position, velocity=velocity)
    arrays = savez(tmp_path / "log.npz", time=time, qpos=position, qvel=velocity)
    for path in (arrays, write_bag(tmp_path / "bag", Talk(), {"/joint_states": states})):
        with pytest.raises(LogError, match="too much for radians; .* a wheel, say --units radians"):
            read_log(path)
        assert np.array_equal(read_log(path, units="radians").run.position, position)


def test_a_single_joint_and_velocities_alone_are_read(tmp_path):
    time, position, velocity = moved(500, 1)
    path = savez(tmp_path / "one.npz", time=time, qpos=position[:, 0], qvel=velocity[:, 0])
    holds(read_log(path).run, position=position, velocity=velocity)
    alone = savez(tmp_path / "speed.npz", time=time, qvel=velocity)
    holds(read_log(alone).run, velocity=velocity)


def test_torques_are_not_taken_for_targets(tmp_path):
    _, position, velocity = moved(500)
    path = savez(tmp_path / "log.npz", qpos=position, qvel=velocity, ctrl=-20 * velocity, dt=0.002)
    run, remarks = said(path)
    assert run.velocity_desired is None
    assert remarks[0] == "there are no stamps: 500 Hz, by dt"
    assert "ctrl not taken as desired positions: qpos[0:7] does not follow" in " ".join(remarks)


def test_a_command_is_a_target_if_the_positions_follow_it():
    _, position, _ = moved(100)
    late = np.vstack((position[:1].repeat(3, axis=0), position[:-3]))
    assert followed(position, late) == 7
    assert followed(position[:, :4], late) == 4
    assert followed(position[:, :3], late) == 0  # fewer than half
    assert followed(10 * position, late) == 0
    assert followed(position + 9, late) == 0
    assert followed(np.sign(position), late) == 0
    assert followed(np.zeros((STEPS, 7)), np.zeros((STEPS, 7))) == 0  # nothing moves


def test_a_rate_that_contradicts_the_motion_is_not_believed(tmp_path):
    _, position, velocity = moved(50)
    path = savez(tmp_path / "log.npz", qpos=position, qvel=velocity, timestep=0.002)
    run, remarks = said(path)
    assert run.rate == 50.0
    expected = "there are no stamps: 50 Hz, at which positions and velocities fit (timestep says"
    assert remarks[0].startswith(expected)


def test_pybullets_joint_states_are_read_by_the_names_of_its_documentation(tmp_path):
    _, position, velocity = moved(240)
    effort = np.cos(position)
    arrays = {"jointPosition": position, "jointVelocity": velocity, "targetPositions": position}
    path = savez(tmp_path / "apart.npz", appliedJointMotorTorque=effort, **arrays)
    signals = {"position": position, "velocity": velocity, "position_desired": position}
    holds(read_log(path).run, rate=240.0, effort=effort, **signals)
    stacked = savez(tmp_path / "stacked.npz", joint_states=np.dstack((position, velocity)))
    with pytest.raises(LogError, match=r"it has joint_states \(400, 7, 2\)"):
        read_log(stacked)


def test_pybullets_tuples_are_an_error_that_says_what_to_save(tmp_path):
    states = np.array([[(0.1, 0.2, (0,) * 6, 0.3)] * 2] * 9, dtype=object)
    path = savez(tmp_path / "log.npz", states=states)
    with pytest.raises(LogError, match="'states' holds Python objects, such as None, or PyB"):
        read_log(path)


def test_minaris_episodes_have_one_state_more_than_actions(tmp_path):
    _, position, velocity = moved(25, samples=101)
    arrays = {
        "observations": np.hstack((position, velocity)),
        "actions": position[:-1],
        "rewards": np.zeros(100),
        "terminations": np.zeros(100, dtype=bool),
        "infos/qpos": position,
        "infos/qvel": velocity,
    }
    both = {f"episode_{n}/{name}": each for n in (0, 10, 2) for name, each in arrays.items()}
    path = hdf5(tmp_path / "main_data.hdf5", both)
    assert [each.name for each in read_logs(path)] == [
        f"main_data-episode_{number}" for number in (0, 2, 10)
    ]
    run, remarks = said(path, episode="episode_10")
    holds(run, rate=25.0, position=position[:-1], position_desired=position[:-1])
    assert "position_desired = actions (position follows it)" in remarks[1]


def test_d4rls_episodes_are_told_apart_by_their_ends(tmp_path):
    _, position, velocity = moved(20)
    ends = np.zeros(STEPS, dtype=bool)
    ends[[149, 399]] = True
    arrays = {
        "observations": position,
        "actions": np.zeros((STEPS, 7)),
        "terminals": np.zeros(STEPS, dtype=bool),
        "timeouts": ends,
        "infos/qpos": position,
        "infos/qvel": velocity,
    }
    for path in (hdf5(tmp_path / "pen.hdf5", arrays), savez(tmp_path / "pen.npz", **arrays)):
        first, second = read_logs(path)
        again = [open_source(source).run.velocity for source in sources([path])[0]]
        assert [*map(len, again)] == [150, 250]
        assert (first.name, second.name) == ("pen-0", "pen-1")
        assert np.array_equal(first.run.position, position[:150])
        assert np.array_equal(second.run.velocity, velocity[150:])


@pytest.mark.parametrize(
    ("name", "lengths"),
    [
        *((name, [150, 150, 100]) for name in ("done", "is_last", "episode", "episode_index")),
        ("terminated", [STEPS]),  # to the end, once it is set
    ],
)
def test_episodes_are_told_apart_in_the_same_way_in_every_format(tmp_path, name, lengths):
    number = np.arange(STEPS) // 150
    flag = number > 1 if name == "terminated" else np.append(np.diff(number) > 0, True)
    time, position, velocity = moved(20, 1)
    columns = {"time": time, "q1": position[:, 0], "dq1": velocity[:, 0]}
    columns[name] = number if name.startswith("episode") else flag
    pq.write_table(pa.table(columns), tmp_path / "a.parquet")
    paths = (savez(tmp_path / "a.npz", **columns), hdf5(tmp_path / "a.h5", columns))
    for path in (*paths, tmp_path / "a.parquet", write(tmp_path / "a.csv", columns)):
        found = [*read_logs(path)]
        assert [len(each.run.time) for each in found] == lengths
        assert np.array_equal(np.concatenate([each.run.velocity for each in found]), velocity)
        assert not any("not read" in remark for each in found for remark in each.remarks)


def test_alohas_actions_are_targets(tmp_path):
    _, position, velocity = moved(50, 14)
    arrays = {
        "action": np.roll(position, -1, axis=0),
        "observations/qpos": position,
        "observations/qvel": velocity,
        "observations/effort": np.sin(position),
    }
    arrays["action"][-1] = position[-1]
    run, remarks = said(hdf5(tmp_path / "episode_3.hdf5", arrays, _root={"sim": True}))
    holds(run, rate=50.0, position_desired=arrays["action"], effort=np.sin(position))
    assert "position_desired = action (position follows it)" in remarks[1]


def test_maniskills_trajectories_are_runs(tmp_path):
    _, position, velocity = moved(20, 9, samples=STEPS + 1)
    arrays = {
        "traj_0/obs/agent/qpos": position,
        "traj_0/obs/agent/qvel": velocity,
        "traj_0/actions": np.sin(np.arange(STEPS * 8)).reshape(STEPS, 8),
        "traj_0/env_states/articulations/panda": np.zeros((STEPS + 1, 31)),
    }
    path = hdf5(tmp_path / "trajectory.h5", arrays)
    holds(read_log(path).run, rate=20.0, velocity=velocity[:-1])


def test_observations_without_names_are_an_error_with_the_line_to_type(tmp_path):
    _, position, velocity = moved(25)
    observations = np.hstack((position, velocity))
    path = savez(tmp_path / "rollout.npz", observations=observations, actions=np.zeros((STEPS, 2)))
    with pytest.raises(LogError) as caught:
        read_log(path)
    line = "--map position=observations[0:7] --map velocity=observations[7:14]"
    assert str(caught.value) == (
        f"{path}: the file holds no known joint positions or velocities; name them, such as {line};"
        " it has observations (400, 14), actions (400, 2)"
    )
    run = read_log(path, mapping=line.replace("--map ", "").split()).run
    assert (run.rate, np.array_equal(run.velocity, velocity)) == (25.0, True)


@pytest.mark.parametrize(("rate", "frequency"), [(20, 2.5), (30, 0.3), (240, 5), (500, 40)])
def test_the_rate_is_that_at_which_velocities_are_the_steps_of_positions(rate, frequency):
    phase = 2 * np.pi * frequency * np.arange(400)[:, None] / rate
    position, velocity = np.sin(phase), 2 * np.pi * frequency * np.cos(phase)
    assert rate_of(position, velocity) == rate
    explicit = np.cumsum(velocity, axis=0) / rate  # a simulator's positions
    assert rate_of(explicit, velocity) == rate
    assert rate_of(position, np.roll(velocity, 7, axis=0)) is None
    assert rate_of(np.zeros_like(position), velocity) is None


def test_a_single_array_is_read_by_mapping(tmp_path):
    _, position, velocity = moved(100)
    np.save(tmp_path / "log.npy", np.hstack((position, velocity)))
    mapping = ["position=array[0:7]", "velocity=array[7:14]"]
    holds(read_log(tmp_path / "log.npy", mapping=mapping).run, rate=100.0, position=position)


def test_lerobots_velocities_and_efforts_are_read_where_a_set_has_them(tmp_path):
    _, position, velocity = moved(50)
    names = ("observation.state", "observation.velocity", "observation.effort", "action")
    feature = {"dtype": "float32", "shape": [7], "names": {"motors": [*"abcdefg"]}}
    info = {"fps": 50, "features": dict.fromkeys(names, feature)}
    (tmp_path / "set" / "meta").mkdir(parents=True)
    (tmp_path / "set" / "meta" / "info.json").write_text(json.dumps(info))
    columns = zip(names, (position, velocity, np.sin(position), position), strict=True)
    table = {name: list(np.float32(each)) for name, each in columns}
    (tmp_path / "set" / "data").mkdir()
    file = tmp_path / "set" / "data" / "file-000.parquet"
    pq.write_table(pa.table(table | {"episode_index": np.zeros(STEPS, dtype=int)}), file)
    run, remarks = said(tmp_path / "set")
    assert remarks[0] == (
        "taken: position = observation.state, velocity = observation.velocity,"
        " effort = observation.effort, position_desired = action"
    )
    wanted = {"velocity": velocity, "effort": np.sin(position), "position_desired": position}
    holds(run, **{name: np.float32(each) for name, each in wanted.items()})


def test_any_file_is_read_by_mapping(tmp_path):
    _, position, _ = moved(250)
    arrays = {"log/clock": np.arange(STEPS) / 250, "log/q_arm": position, "log/x": np.zeros((3, 3))}
    path = hdf5(tmp_path / "own.h5", arrays)
    mapping = ["time=log/clock", "position=log/q_arm[0:6]", "velocity.tool=log/q_arm[6]"]
    run = read_log(path, mapping=mapping, joints=[*"abcdef"]).run
    assert run.rate == 250.0
    assert np.array_equal(run.velocity[:, run.joint_names.index("tool")], position[:, 6])
