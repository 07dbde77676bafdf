import mujoco
import numpy as np
import pytest
from checks import holds, one_line
from samplelogs import JOINTS, numbers

from inspector import read_log
from inspector.errors import LogError
from noisemodel import Block, Run

POSITION, VELOCITY = numbers(), numbers(seed=1)
TIME = np.arange(400) / 100


def save(tmp_path, **arrays):
    np.savez(tmp_path / "log.npz", **arrays)
    return tmp_path / "log.npz"


def test_a_run_file_is_loaded_unchanged(tmp_path):
    blocks = (Block(0.0, 1.0, "ok"),)
    run = Run(time=TIME, velocity=VELOCITY, joint_names=JOINTS, blocks=blocks, meta={"seed": 3})
    run.save(tmp_path / "run.npz")
    imported = read_log(tmp_path / "run.npz")
    assert (imported.run.blocks, imported.run.meta) == (blocks, {"seed": 3})
    assert imported.remarks == ("a run file, unchanged",)


def test_a_run_file_whose_time_is_not_uniform_is_resampled(tmp_path):
    time = TIME + np.random.default_rng(0).uniform(-0.002, 0.002, 400)
    path = save(tmp_path, time=time, velocity=np.sin(time)[:, None], joint_names=["a"])
    run = read_log(path).run
    holds(run, rate=100.0, joint_names=("a",))
    since = run.time + float(run.meta["start"])
    assert np.allclose(run.velocity[:, 0], np.sin(since), atol=1e-4)


def test_the_unit_in_a_name_counts_for_arrays_as_for_columns(tmp_path):
    arrays = {"q_deg": np.rad2deg(POSITION), "dq_degs": np.rad2deg(VELOCITY)}
    columns = {n.replace("q", f"q{i}"): a[:, i] for n, a in arrays.items() for i in range(len(a.T))}
    for each in (arrays, columns):
        found = read_log(save(tmp_path, time=TIME, **each))
        assert np.allclose(found.run.velocity, VELOCITY)
        assert np.allclose(found.run.position, POSITION)
        assert any("converted from deg" in remark for remark in found.remarks)


FREE = """<mujoco><worldbody><body><freejoint/><geom size="0.1"/>
<body pos="0.2 0 0"><joint name="arm" axis="0 0 1"/><geom size="0.05"/></body>
</body></worldbody></mujoco>"""


def test_mujocos_state_becomes_a_base_in_body_axes_and_joints(tmp_path):
    model = mujoco.MjModel.from_xml_string(FREE)
    data = mujoco.MjData(model)
    data.qvel[:] = [0.3, -0.2, 1.0, 0.5, 1.0, -2.0, 4.0]
    qpos, qvel, local = [], [], []
    for _ in range(300):
        qpos.append(data.qpos.copy())
        qvel.append(data.qvel.copy())
        twist = np.zeros(6)  # MuJoCo's own word for it: angular, then linear
        mujoco.mj_forward(model, data)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, 1, twist, 1)
        local.append(np.concatenate((twist[3:], twist[:3])))
        mujoco.mj_step(model, data)
    time = np.arange(300) * model.opt.timestep
    run = read_log(save(tmp_path, time=time, qpos=qpos, qvel=qvel)).run
    assert np.allclose(run.base_velocity, local, atol=1e-9)
    assert np.array_equal(run.base_pose[:, :3], np.array(qpos)[:, :3])
    assert np.array_equal(run.base_pose[:, 3:], np.array(qpos)[:, [4, 5, 6, 3]])
    holds(run, position=np.array(qpos)[:, 7:], velocity=np.array(qvel)[:, 6:])


def test_isaacs_arrays_are_recognised_and_its_root_is_mapped(tmp_path):
    turn = [np.cos(0.3), np.sin(0.3), 0.0, 0.0]
    root = np.column_stack(
        (numbers(3), np.tile(turn, (400, 1)), np.tile([0, 0, 1, 0, 0, 2], (400, 1)))
    )
    path = save(tmp_path, dof_pos=POSITION, dof_vel=VELOCITY, root_state=root)
    mapping = ["base_pose.wxyz=root_state[0:7]", "base_velocity.world=root_state[7:13]"]
    run = read_log(path, mapping=mapping, rate=200).run
    assert np.array_equal(run.velocity, VELOCITY)
    up = [0.0, np.sin(0.6), np.cos(0.6)]  # the world's z, seen from a body tilted about x
    assert np.allclose(run.base_velocity, np.concatenate((up, np.multiply(2, up))))
    alone = read_log(path, mapping=mapping[:1], rate=200).run
    assert "base_velocity" in alone.meta["differentiated"]
    assert np.allclose(alone.base_velocity[:, 3:], 0.0)
    with pytest.raises(LogError, match="a velocity in world axes needs a base_pose of the same"):
        read_log(path, mapping=mapping[1:], rate=200)
    wrong = ["base_pose=root_state[1:8]"]
    with pytest.raises(LogError, match="a quaternion whose norm is not 1"):
        read_log(path, mapping=wrong, rate=200)


@pytest.mark.parametrize("scale", [1.0, 1.02])
def test_a_row_without_numbers_leaves_a_floating_base_what_it_is(tmp_path, scale):
    turn = scale * np.tile([0.6, 0.0, 0.8, 0.0], (400, 1))
    state = np.hstack((np.zeros((400, 3)), turn, POSITION))
    state[7] = np.nan
    path = save(tmp_path, time=TIME, qpos=state, qvel=np.hstack((np.zeros((400, 6)), VELOCITY)))
    if scale != 1.0:
        message = "qpos has 10 columns and qvel 9, but there is no quaternion; name the joints"
        with pytest.raises(LogError, match=message):
            read_log(path)
        return
    run = read_log(path).run
    assert np.array_equal(np.flatnonzero(~run.mask), [7])
    assert np.array_equal(run.velocity[run.mask], VELOCITY[run.mask])
    assert run.base_pose is not None


@pytest.mark.parametrize(
    "names",
    [("q", "dq", "q_d", "dq_d"), ("q", "dq", "qd", "dq_d"),
     ("positions", "velocities", "desired_positions", "target_qd")],
)  # fmt: skip
def test_arrays_are_known_by_symbols_and_words(tmp_path, names):
    signals = [numbers(seed=seed) for seed in range(4)]
    run = read_log(save(tmp_path, t=TIME, **dict(zip(names, signals, strict=True)))).run
    found = (run.position, run.velocity, run.position_desired, run.velocity_desired)
    assert all(map(np.array_equal, found, signals))


def test_a_robot_names_the_columns_of_an_array_that_fits_it(tmp_path):
    path = save(tmp_path, t=TIME, dof_vel=numbers(9))
    run = read_log(path, robot="panda").run
    assert run.joint_names[0] == "panda_joint1"
    path = save(tmp_path, t=TIME, dof_vel=numbers(12))
    message = r"'dof_vel' has 12 columns, robot 'panda' has 9; take a part of it \(--map vel"
    with pytest.raises(LogError, match=message):
        read_log(path, robot="panda")


FITS = {"dof_vel": VELOCITY, "t": TIME}


@pytest.mark.parametrize(
    ("arrays", "mapping", "message"),
    [
        ({"dof_vel": VELOCITY}, [], r"there are no stamps; give the log's rate"),
        ({"speed": VELOCITY, "t": TIME}, [], "holds no known joint positions or velocit.* speed"),
        ({"velocty": VELOCITY, "t": TIME}, [], "such as --map velocity=velocty;"),
        ({"dof_vel": VELOCITY.T, "t": TIME}, [],
         r"'dof_vel' has shape \(3, 400\); expected 400 samples, as stamps, along its first"),
        (FITS, ["position=dof_pos"], "no column 'dof_pos' to map; it"),
        (FITS, ["velocity=dof_vel[2:9]"], r"'dof_vel' has 3 columns"),
        (FITS, ["velocity.elbow=dof_vel"],
         r"'dof_vel' has 3 columns, velocity.elbow is one; name it as dof_vel\[0\]"),
        (FITS, ["base_pose=dof_vel"], "3 columns, a base_pose has 7"),
        (FITS | {"t": np.where(TIME == 1, np.nan, TIME)}, [], r"'t' holds nan \(sample 101\)"),
        (FITS | {"dof_vel": np.array([{}], dtype=object)}, [], "not an archive of plain arrays"),
    ],
)  # fmt: skip
def test_arrays_that_do_not_fit_are_errors_of_one_line(tmp_path, arrays, mapping, message):
    path = save(tmp_path, **arrays)
    with one_line(LogError, message):
        read_log(path, mapping=mapping)
