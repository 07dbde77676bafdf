"""Robots as their URDFs state them, how they move, and URDFs that state no robot."""

import dataclasses
import os
import re
from importlib.metadata import PackageNotFoundError
from math import inf

import numpy as np
import pinocchio as pin
import pytest
from chains import chain
from checks import one_line

from noisemodel import (
    ROBOTS,
    NoiseModelError,
    Robot,
    RobotError,
    Run,
    RunError,
    UnknownJointError,
    UnknownRobotError,
    link_twists,
)
from noisemodel.robot import Limits, joint_limits, package_roots
from noisemodel.surface import link_names
from noisemodel.urdf import Mimic, checked, mimics

ARM = """
<robot name="arm">
  <link name="l0"/><link name="l1"/><link name="l2"/><link name="l3"/>
  <joint name="shoulder" type="continuous">
    <parent link="l0"/><child link="l1"/><axis xyz="0 0 1"/></joint>
  <joint name="elbow" type="revolute">
    <parent link="l1"/><child link="l2"/><origin xyz="0.5 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="finger" type="prismatic">
    <parent link="l2"/><child link="l3"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="1" effort="1" velocity="1"/>{follows}</joint>
</robot>"""


def arm(tmp_path, follows="", **options):
    path = tmp_path / "arm.urdf"
    path.write_text(ARM.format(follows=follows))
    return Robot.load(path, **options)


def run(joint_names, position, velocity, **signals):
    time = np.arange(len(position)) / 1000
    return Run(time=time, position=position, velocity=velocity, joint_names=joint_names, **signals)


def test_every_listed_robot_loads():
    assert len(ROBOTS) == 69
    for name, listed in ROBOTS.items():
        if name != "ur3_empty":
            robot = Robot.load(name)
            assert robot.floating_base == listed.floating_base, name
            assert len(robot.joints) == robot.model.njoints - 1, name
            assert (robot.nq, robot.nv) == (robot.model.nq, robot.model.nv), name


def test_a_urdf_of_ones_own_has_a_fixed_base_unless_requested(tmp_path):
    robot = arm(tmp_path)
    assert robot.name == "arm"
    assert robot.joint_names == ("shoulder", "elbow", "finger")
    assert (robot.nq, robot.nv) == (4, 3)
    assert arm(tmp_path, floating_base=True).nq == 11
    (tmp_path / "root.urdf").write_text(ARM.format(follows="").replace("elbow", "root_joint"))
    robot = Robot.load(tmp_path / "root.urdf", floating_base=True)
    assert robot.joint_names == ("shoulder", "root_joint", "finger")
    assert link_names(robot) == ("l0", "l1", "l2", "l3")  # the base's joint has another name


def test_neutral_is_pinocchios_for_every_kind_of_joint(tmp_path):
    kinds = ("revolute", "planar", "continuous", "floating", "prismatic", "planar", "revolute")
    robot = chain(tmp_path, *kinds, floating_base=True)
    assert np.array_equal(robot.neutral, pin.neutral(robot.model))


def test_of_a_file_that_is_too_large_no_package_is_looked_up(tmp_path, monkeypatch):
    path = tmp_path / "parts" / "urdf" / "arm.urdf"
    path.parent.mkdir(parents=True)
    path.write_text('<robot><mesh filename="package://parts/a.stl"/></robot>')
    size = path.stat().st_size
    for most, root in ((size - 1, path.parent), (size + 1, path.parent.parent)):
        monkeypatch.setattr("noisemodel.robot.MAX_BYTES", most)
        assert package_roots(path) == (root,)
    monkeypatch.setattr("noisemodel.robot.MAX_BYTES", size)
    assert package_roots(path) == (path.parent.parent,)


def test_a_configuration_is_ordered_by_joint_name(tmp_path):
    robot = arm(tmp_path)
    given = run(("finger", "shoulder", "elbow"), np.array([[0.1, 2.0, 3.0]] * 2), np.eye(3)[:2])
    q, v = robot.configuration(given)
    assert np.allclose(q, [[np.cos(2), np.sin(2), 3.0, 0.1]] * 2, rtol=1e-15)
    assert np.array_equal(v, [[0, 0, 1], [1, 0, 0]])


def test_the_base_has_the_pose_of_the_run_and_rests_in_gaps(tmp_path):
    robot = arm(tmp_path, floating_base=True)
    pose = np.array([[1, 2, 3, 0, 0, 1, 0], [0, 0, 0, 0, 0, 0, 0]], dtype=float)
    q, v = robot.configuration(
        run(
            ("elbow",),
            np.zeros((2, 1)),
            np.zeros((2, 1)),
            base_pose=pose,
            base_velocity=np.array([[1, 2, 3, 4, 5, 6], [0] * 6], dtype=float),
            valid=np.array([True, False]),
        )
    )
    assert np.array_equal(q[:, :7], [pose[0], [0, 0, 0, 0, 0, 0, 1]])
    assert np.array_equal(v[0, :6], [1, 2, 3, 4, 5, 6])


def test_mimic_joints_follow_and_take_no_place(tmp_path):
    follows = '<mimic joint="elbow" multiplier="0.1" offset="0.2"/>'
    robot = arm(tmp_path, follows, mimic=True)
    assert robot.joint_names == ("shoulder", "elbow")
    assert (robot.nq, robot.nv) == (3, 2)
    q, v = robot.configuration(
        run(("finger", "elbow"), np.array([[9.0, 1.0]] * 2), np.array([[9.0, 2.0]] * 2))
    )
    assert np.array_equal(q, [[1, 0, 1]] * 2)
    assert np.array_equal(v, [[0, 2]] * 2)


def test_a_chain_of_followers_ends_at_the_joint_that_moves_by_itself(tmp_path):
    text = "".join(f'<link name="l{n}"/>' for n in range(4))
    for n, follows in enumerate(
        ('"j1" multiplier="2" offset="0.3"', '"j2" multiplier="-3" offset="0.5"', None)
    ):
        mimic = f"<mimic joint={follows}/>" if follows else ""
        joint = JOINT.replace("elbow", f"j{n}").replace("base", f"l{n}").replace("tip", f"l{n + 1}")
        text += joint.replace("<axis", f"{mimic}<axis")
    path = tmp_path / "chain.urdf"
    path.write_text(f'<robot name="r">{text}</robot>')
    first, second, leader = Robot.load(path, mimic=True).joints
    assert [(each.first_q, each.first_v) for each in (first, second, leader)] == [(0, 0)] * 3
    assert (second.multiplier, second.offset) == (-3.0, 0.5)
    assert (first.multiplier, first.offset) == (-6.0, 2 * 0.5 + 0.3)
    assert (leader.multiplier, leader.offset) == (1.0, 0.0)


@pytest.mark.parametrize(
    ("follows", "message"),
    [
        ('<mimic joint="knee"/>', "joint 'finger' mimics 'knee', which is missing"),
        ('<mimic joint="shoulder"/>', "'finger' mimics 'shoulder'; continuous joints cannot"),
    ],
)
def test_a_mimic_joint_that_cannot_follow_is_named(tmp_path, follows, message):
    assert arm(tmp_path, follows).nv == 3
    with pytest.raises(RobotError, match=message):
        arm(tmp_path, follows, mimic=True)


def test_a_joint_that_the_robot_lacks_is_named_with_those_that_it_has(tmp_path):
    knee = run(("knee",), np.zeros((2, 1)), np.zeros((2, 1)))
    message = "no joint 'knee' in robot 'arm'; it has shoulder, elbow, finger"
    with pytest.raises(UnknownJointError, match=message) as caught:
        arm(tmp_path).configuration(knee)
    assert (caught.value.joint, caught.value.known) == ("knee", ("shoulder", "elbow", "finger"))


def test_a_run_without_positions_cannot_move_a_robot(tmp_path):
    blind = Run(time=np.arange(2) / 1000, velocity=np.zeros((2, 1)), joint_names=("elbow",))
    with pytest.raises(RunError, match="the run has no 'position'; 'arm' cannot be moved without"):
        arm(tmp_path).configuration(blind)


def test_a_robot_that_is_not_there_is_named(tmp_path):
    with pytest.raises(UnknownRobotError, match=r"no robot 'tallos'.*did you mean 'talos'\?"):
        Robot.load("tallos")
    with pytest.raises(RobotError, match=r"gone.urdf: there is no such URDF file"):
        Robot.load(tmp_path / "gone.urdf")
    with pytest.raises(RobotError, match=r"ur3.urdf: the URDF is empty or unexpanded"):
        Robot.load("ur3_empty")


def test_reading_a_robot_leaves_standard_error_as_it_was(capfd):
    Robot.load("panda")
    os.write(2, b"still here")
    assert capfd.readouterr().err == "still here"


def test_a_missing_example_robot_data_is_an_error_with_what_to_install(monkeypatch):
    def gone(name):
        raise PackageNotFoundError(name)

    monkeypatch.setattr("importlib.metadata.distribution", gone)
    with pytest.raises(RobotError, match="pip install example-robot-data"):
        Robot.load("talos")


def test_the_desired_motion_is_ordered_like_the_measured_one():
    values = np.array([[2.0, 1.0]] * 3)
    wanted = {"velocity_desired": 10 * values[:, :1], "desired_joint_names": ("panda_joint2",)}
    given = run(("panda_joint2", "panda_joint1"), values, values, **wanted)
    robot = Robot.load("panda")
    q, v = robot.desired(given)
    assert v[0].tolist() == [0.0, 20.0, *[0.0] * 7]
    assert q[0, :2].tolist() == [1.0, 2.0]  # no desired positions: where they were measured
    q, _ = robot.desired(dataclasses.replace(given, position_desired=7 * values[:, :1]))
    assert q[0, :2].tolist() == [1.0, 14.0]  # only one is: the other is where it was measured
    assert robot.desired(dataclasses.replace(given, velocity_desired=None)) is None


SAMPLES = 50


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
    robot, rate = chain(tmp_path, "revolute", "revolute"), 3.0
    tip = link_twists(robot, np.zeros((1, 2)), np.array([[rate, 0.0]]))[0, 2]
    radius = np.hypot(0.1, 0.2)  # of the second joint about the axis of the first
    speeds = np.linalg.norm(tip.reshape(2, 3), axis=1)
    np.testing.assert_allclose(speeds, [radius * rate, rate], rtol=1e-14)


def test_a_run_is_the_same_in_one_piece_in_many_and_in_single_precision(monkeypatch):
    robot = Robot.load("panda")
    q, v = (state.astype(np.float32) for state in states(robot.model))
    whole = link_twists(robot, q.astype(np.float64), v.astype(np.float64))
    assert np.array_equal(link_twists(robot, q, v), whole)
    monkeypatch.setattr("noisemodel.robot.CHUNK", 7)
    assert np.allclose(link_twists(robot, q, v), whole, rtol=0, atol=1e-15)
    assert link_twists(robot, np.empty((0, 9)), np.empty((0, 9))).shape == (0, 10, 6)


@pytest.mark.parametrize("axis", ["0 1 0", "1 -1 0", "-1 0 0", "1 2 3"])
@pytest.mark.parametrize("floating_base", [False, True])
def test_joints_of_every_kind_are_those_of_pinocchio(tmp_path, floating_base, axis):
    kinds = ("revolute", "planar", "continuous", "floating", "continuous", "prismatic", "revolute")
    robot = chain(tmp_path, *kinds, axis=axis, floating_base=floating_base)
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


@pytest.mark.parametrize(("name", "q", "v"), [("q", (5, 8), (5, 9)), ("v", (5, 9), (4, 9))])
def test_states_of_another_shape_are_refused(name, q, v):
    given = q if name == "q" else v
    with pytest.raises(
        NoiseModelError, match=re.escape(f"{name} has shape {given}, expected (5, 9")
    ):
        link_twists(Robot.load("panda"), np.zeros(q), np.zeros(v))


def limits(folder, attributes, kind="revolute"):
    """The limits of a joint of this kind with these attributes of its <limit>."""
    text = GOOD.replace('lower="-1" upper="1" effort="1" velocity="1"', attributes)
    (folder / "arm.urdf").write_text(text.replace("revolute", kind))
    return joint_limits(folder / "arm.urdf")["elbow"]


def test_the_limits_of_a_panda_are_those_of_its_data_sheet():
    found = joint_limits("panda")
    assert found["panda_joint1"] == Limits(-2.8973, 2.8973, 2.175, turns=True)
    assert found["panda_joint4"] == Limits(-3.0718, -0.0698, 2.175, turns=True)
    assert found["panda_joint7"] == Limits(-2.8973, 2.8973, 2.61, turns=True)
    assert found["panda_finger_joint1"] == Limits(0.0, 0.04, 0.2, turns=False)


@pytest.mark.parametrize(
    ("attributes", "expected"),
    [
        ("lower='-1' upper='2' velocity='3'", (-1.0, 2.0, 3.0)),
        ("upper='2' velocity='3'", (0.0, 2.0, 3.0)),  # of the URDF's specification: 0 by default
        ("lower='-2' velocity='0.5'", (-2.0, 0.0, 0.5)),
        ("lower='1' upper='1' velocity='0'", (-inf, inf, inf)),
        ("lower='-1' upper='2e6' velocity='-1'", (-inf, inf, inf)),
        ("lower='-1' upper='1' velocity='1e6'", (-1.0, 1.0, inf)),
        ("lower='-1' upper='1' velocity='fast'", (-1.0, 1.0, inf)),
    ],
)
def test_limits_are_as_they_are_written_and_none_if_empty_without_end_or_too_fast(
    tmp_path, attributes, expected
):
    assert limits(tmp_path, attributes) == Limits(*expected, turns=True)
    for_ever = limits(tmp_path, attributes, kind="continuous")
    assert for_ever == Limits(-inf, inf, expected[2], turns=True)


LINKS = '<link name="base"/><link name="tip"/>'
JOINT = """
<joint name="elbow" type="revolute">
  <parent link="base"/><child link="tip"/><origin xyz="0 0 1" rpy="0 0 0"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/>
</joint>"""
GOOD = f'<robot name="arm">{LINKS}{JOINT}</robot>'
LATIN = '<?xml version="1.0" encoding="ISO-8859-1"?>'
XACRO = 'xmlns:xacro="http://ros.org/wiki/xacro"'


def welds(joints):
    """A chain of so many joints."""
    links = "".join(f'<link name="l{number}"/>' for number in range(joints + 1))
    return f'<robot name="chain">{links}' + "".join(
        f'<joint name="j{number}" type="fixed">'
        f'<parent link="l{number}"/><child link="l{number + 1}"/></joint>'
        for number in range(joints)
    ) + "</robot>"  # fmt: skip


def test_a_urdf_gives_its_name_and_mimic_joints(tmp_path):
    path = tmp_path / "arm.urdf"
    wrist = '<mimic joint="wrist" multiplier="-2" offset="0.5"/><axis'
    path.write_text(GOOD.replace("<axis", wrist))
    assert checked(path).get("name") == "arm"
    assert mimics(path, checked(path)) == {"elbow": Mimic("wrist", multiplier=-2.0, offset=0.5)}
    path.write_text(GOOD.replace("<axis", f'<xacro:property {XACRO}/><mimic joint="wrist"/><axis'))
    assert mimics(path, checked(path)) == {"elbow": Mimic("wrist", multiplier=1.0, offset=0.0)}


def test_welds_may_have_an_axis_of_length_0(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(GOOD.replace('"revolute"', '"fixed"').replace('xyz="0 0 1"/>', 'xyz="0 0 0"/>'))
    assert Robot.load(path).joint_names == ()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (" \n", "the URDF is empty"),
        (GOOD[:200], "not XML"),
        ("<sdf><model/></sdf>", "not a URDF, its root is <sdf>, expected <robot>"),
        ('<robot name="arm"/>', "its <robot> has no name or no link"),
        (GOOD.replace('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>'), "'elbow' has length 0"),
        (GOOD.replace('<axis xyz="0 0 1"/>', "<axis/>"), "'elbow' has length 0"),
        *(
            (
                GOOD.replace('xyz="0 0 1" rpy', f'xyz="{numbers}" rpy'),
                f"xyz of <origin> is '{numbers}', expected 3 finite numbers",
            )
            for numbers in ("0 nan 1", "0 inf 1", "0 1", "a b c", "")
        ),
        (GOOD.replace('"revolute"', '"screw"'), r"Joint \[elbow\] has no known type \[screw\]"),
        (GOOD.replace('"tip"/><origin', '"toe"/><origin'), r"child link \[toe\] of joint"),
        (GOOD.replace(JOINT, JOINT * 2), "joint 'elbow' is not unique"),
        (GOOD.replace(JOINT, ""), "Two root links found"),
        (LATIN + GOOD.replace("elbow", "\udce9lbow"), r"the URDF is not in UTF-8 \(invalid"),
        (GOOD.replace(JOINT, f"{JOINT}<xacro:leg {XACRO}/>"), "<xacro:leg> is not expanded; run"),
    ],
)
def test_a_bad_urdf_is_one_line_that_names_the_file_and_the_problem(tmp_path, capfd, text, message):
    path = tmp_path / "arm.urdf"
    path.write_text(text, errors="surrogateescape")
    with one_line(RobotError, message, path):
        Robot.load(path)
    assert capfd.readouterr().err == ""  # Pinocchio's parser writes there by itself


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("</robot>", "<a ixx='1 2'/></robot>", "ixx of <a> is '1 2', expected 1 f"),
        ("</robot>", "<mass/></robot>", "value of <mass> is '', expected 1 f"),
        ("</robot>", "<mass value='1 2'/></robot>", "value of <mass> is '1 2', expected 1 f"),
        ('<child link="l3"', '<child link="l1"', "'l1' go round in a circle"),
    ],
)
def test_numbers_and_trees_that_pinocchio_takes_though_they_are_wrong(tmp_path, old, new, message):
    path = tmp_path / "arm.urdf"
    path.write_text(welds(3).replace(old, new))
    with pytest.raises(RobotError, match=message):
        checked(path)


def test_the_limit_of_joints_is_how_many_there_may_be(tmp_path, monkeypatch):
    monkeypatch.setenv("NOISE_LIMIT_JOINTS", "3")
    path = tmp_path / "arm.urdf"
    path.write_text(welds(3))
    assert checked(path).get("name") == "chain"
    path.write_text(welds(4))
    with pytest.raises(RobotError, match="4 joints; the limit is 3 .--limit joints=N raises it"):
        checked(path)
