import json
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from noisemodel import NoiseModelError, Robot, link_twists

GOLDEN = Path(__file__).parents[2] / "shared" / "golden" / "surface"
SAMPLES = 50


def read(tmp_path, joints, **options):
    """A chain of joints, each (type, axis, xyz, rpy), as a robot."""
    text = '<robot name="chain"><link name="link0"/>'
    for number, (kind, axis, xyz, rpy) in enumerate(joints, start=1):
        text += f"""
          <link name="link{number}"/>
          <joint name="joint{number}" type="{kind}">
            <parent link="link{number - 1}"/><child link="link{number}"/>
            <origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>
            <limit lower="-9" upper="9" effort="1" velocity="1"/>
          </joint>"""
    path = tmp_path / "chain.urdf"
    path.write_text(text + "</robot>")
    return Robot.load(path, **options)


def states(model):
    """Configurations far from neutral and velocities."""
    random = np.random.default_rng(1)
    neutral = pin.neutral(model)
    steps = 3 * random.standard_normal((SAMPLES, model.nv))
    q = np.array([pin.integrate(model, neutral, step) for step in steps])
    return q.reshape(SAMPLES, model.nq), random.standard_normal((SAMPLES, model.nv))


def by_pinocchio(model, q, v):
    """What `link_twists` has to give, state by state."""
    data = model.createData()
    twists = np.empty((len(q), model.njoints, 6))
    for sample in range(len(q)):
        pin.forwardKinematics(model, data, q[sample], v[sample])
        twists[sample] = [motion.vector for motion in data.v]
    return twists


def test_spinning_link_moves_its_tip_at_radius_times_rate(tmp_path):
    radius, rate = 0.7, 3.0
    robot = read(
        tmp_path,
        [("revolute", "0 0 1", "0 0 0", "0 0 0"), ("revolute", "0 0 1", f"{radius} 0 0", "0 0 0")],
    )
    tip = link_twists(robot, np.zeros((1, 2)), np.array([[rate, 0.0]]))[0, 2]
    assert np.allclose(tip, [0, radius * rate, 0, 0, 0, rate], rtol=0, atol=1e-15)


def test_sliding_link_moves_along_its_axis(tmp_path):
    robot = read(tmp_path, [("prismatic", "0 3 4", "1 2 3", "0 0 0")])
    twist = link_twists(robot, np.array([[0.5]]), np.array([[2.0]]))[0, 1]
    assert np.allclose(twist, [0, 1.2, 1.6, 0, 0, 0], rtol=0, atol=1e-15)


def test_tip_of_a_turning_slider_moves_faster_the_further_it_is_out(tmp_path):
    robot = read(
        tmp_path,
        [("revolute", "0 0 1", "0 0 0", "0 0 0"), ("prismatic", "1 0 0", "0 0 0", "0 0 0")],
    )
    out = np.array([[0.3, 0.1], [0.3, 0.2]])
    twists = link_twists(robot, out, np.array([[2.0, 0.0], [2.0, 0.0]]))
    assert np.allclose(np.linalg.norm(twists[:, 2, :3], axis=1), [0.2, 0.4], rtol=1e-14)


def test_standstill_has_no_twist():
    robot = Robot.load("talos")
    q, v = states(robot.model)
    assert not link_twists(robot, q, 0 * v).any()


def test_pose_of_the_base_changes_no_twist():
    robot = Robot.load("solo12")
    q, v = states(robot.model)
    elsewhere = q.copy()
    elsewhere[:, :7] = [5, -3, 1, 0.5, 0.5, 0.5, 0.5]
    assert np.array_equal(link_twists(robot, q, v), link_twists(robot, elsewhere, v))


def test_twists_are_linear_in_the_velocities():
    robot = Robot.load("talos")
    q, v = states(robot.model)
    other = v[::-1]
    sum_of_twists = 2 * link_twists(robot, q, v) - 3 * link_twists(robot, q, other)
    assert np.allclose(link_twists(robot, q, 2 * v - 3 * other), sum_of_twists, rtol=0, atol=1e-12)


def test_a_run_is_the_same_in_one_piece_and_in_many(monkeypatch):
    robot = Robot.load("panda")
    q, v = states(robot.model)
    whole = link_twists(robot, q, v)
    monkeypatch.setattr("noisemodel.robot.CHUNK", 7)
    assert np.allclose(link_twists(robot, q, v), whole, rtol=0, atol=1e-15)


def test_single_precision_is_computed_in_double():
    robot = Robot.load("panda")
    q, v = (state.astype(np.float32) for state in states(robot.model))
    exact = link_twists(robot, q.astype(np.float64), v.astype(np.float64))
    assert np.array_equal(link_twists(robot, q, v), exact)


def test_no_samples_have_no_twists():
    robot = Robot.load("panda")
    assert link_twists(robot, np.empty((0, 9)), np.empty((0, 9))).shape == (0, 10, 6)


@pytest.mark.parametrize("name", ["talos", "kinova", "pr2", "tiago", "romeo", "hyq", "iris"])
def test_twists_are_those_of_pinocchio(name):
    """kinova and tiago have continuous joints, tiago and pr2 prismatic ones."""
    robot = Robot.load(name)
    q, v = states(robot.model)
    assert np.allclose(
        link_twists(robot, q, v), by_pinocchio(robot.model, q, v), rtol=0, atol=1e-12
    )


@pytest.mark.parametrize("floating_base", [False, True])
def test_planar_and_inner_floating_joints_are_those_of_pinocchio(tmp_path, floating_base):
    robot = read(
        tmp_path,
        [
            ("revolute", "1 2 3", "0.1 0.2 0.3", "0.4 0.5 0.6"),
            ("planar", "0 0 1", "0.3 0 0.1", "0 0.7 0"),
            ("continuous", "0 1 0", "0.2 0 0", "0.1 0 0"),
            ("floating", "1 0 0", "0 0.3 0", "0 0 0.2"),
            ("continuous", "1 -1 0", "0.1 0 0.1", "0.2 0.3 0"),
            ("prismatic", "0 1 0", "0 0 0.1", "0 0 1"),
            ("prismatic", "1 1 0", "0 0.2 0.1", "0 1 0"),
            ("revolute", "-1 0 0", "0.1 0 0", "0 0 0"),
        ],
        floating_base=floating_base,
    )
    assert {joint.kind for joint in robot.joints} == {
        "revolute",
        "planar",
        "continuous",
        "floating",
        "prismatic",
    }
    q, v = states(robot.model)
    assert np.allclose(
        link_twists(robot, q, v), by_pinocchio(robot.model, q, v), rtol=0, atol=1e-12
    )


@pytest.mark.parametrize("name", ["panda", "baxter", "pr2", "tiago_pro"])
def test_mimic_joints_move_as_pinocchio_moves_them(name):
    robot = Robot.load(name, mimic=True)
    root = (pin.JointModelFreeFlyer(),) if robot.floating_base else ()
    model = pin.buildModelFromUrdf(str(robot.path), *root, mimic=True)
    assert robot.mimics
    assert (robot.nq, robot.nv) == (model.nq, model.nv)
    assert [joint.name for joint in robot.joints] == list(model.names)[1:]
    q, v = states(model)
    assert np.allclose(link_twists(robot, q, v), by_pinocchio(model, q, v), rtol=0, atol=1e-12)


@pytest.mark.skipif(not GOLDEN.is_dir(), reason="golden/surface is not beside this checkout")
@pytest.mark.parametrize(
    "case",
    ["panda_visual", "solo12_visual", "double_pendulum_simple_visual", "panda_collision_mimic"],
)
def test_twists_are_the_golden_ones(case):
    facts = json.loads((GOLDEN / "index.json").read_text())[case]
    golden = np.load(GOLDEN / f"{case}.npz", allow_pickle=False)
    urdf = Robot.load("panda").package_roots[-1] / facts["urdf"]
    robot = Robot.load(urdf, floating_base=facts["free_flyer"], mimic=facts["mimic"])
    twists = link_twists(robot, golden["q"], golden["v"])
    assert np.allclose(twists, golden["twist"], rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("q", "v", "message"),
    [
        ((5, 8), (5, 9), r"q has shape \(5, 8\), expected \(5, 9\)"),
        ((5, 9), (4, 9), r"v has shape \(4, 9\), expected \(5, 9\)"),
        ((9,), (9,), r"q has shape \(9,\), expected \(9, 9\)"),
    ],
)
def test_states_of_another_shape_are_refused(q, v, message):
    with pytest.raises(NoiseModelError, match=message):
        link_twists(Robot.load("panda"), np.zeros(q), np.zeros(v))
