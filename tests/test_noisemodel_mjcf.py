import contextlib
import io
import json
import os
import re
import subprocess
import sys
from dataclasses import replace

import mujoco
import numpy as np
import pinocchio
import pytest
from checks import one_line
from test_noisemodel_meshes import stl

import noisemodel as nm
from noisemodel import MeshError, Robot, RobotError, Run, UnknownRobotError, mjcf
from noisemodel.compare import excitation
from noisemodel.noise import link_noise
from noisemodel.robot import limits_of
from noisemodel.surface import Surface, link_names, triangles
from noisemodel.urdf import Mimic, capsule

BALL = '<geom type="sphere" size="0.1"/>'
ARM = f"""<mujoco model="arm">
  <compiler angle="degree" eulerseq="zyx"/>
  <default><default class="slider"><joint type="slide" axis="0 1 0"/></default></default>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body name="foot" pos="0 0 0.3" euler="30 0 20">{BALL}
      <body name="upper" pos="0.1 0.2 0.3" quat="0.8 0.2 0.1 0.5">
        <joint name="lift" class="slider" ref="0.2"/>
        <joint name="turn" axis="1 2 3" pos="0.05 0 0.1" ref="40" range="-90 100"/>{BALL}
        <body pos="0 0.4 0">{BALL}
          <joint axis="0 0 -1" pos="0 0 0.2"/>
          <body name="tip" pos="0.3 0 0"><joint name="wrist" axis="1 0 0"/>{BALL}</body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>"""
LEGS = f"""<mujoco><worldbody><body name="trunk" pos="0 0 1"><freejoint/>{BALL}
  <body name="left" pos="0 0.1 0"><joint name="hip" axis="0 1 0" range="-60 60"/>{BALL}
    <body name="shin" pos="0 0 -0.3"><joint name="knee" axis="0 1 0" pos="0 0 0.05"/>{BALL}</body>
  </body></body></worldbody></mujoco>"""


@pytest.fixture(autouse=True)
def here(request, monkeypatch):
    """Compile in this process, which need not import what it compiles with."""

    def run(command, cwd, **_):
        said = io.StringIO()
        with contextlib.chdir(cwd), contextlib.redirect_stdout(said):
            try:
                mjcf.compile_here(json.loads(re.search(r"\[.*\]", command[-1])[0]))
                status = 0
            except SystemExit as end:
                status = end.code
        return subprocess.CompletedProcess(command, status, said.getvalue().encode())

    if "apart" not in request.fixturenames:
        monkeypatch.setattr("resource.setrlimit", lambda *_: None)
        monkeypatch.setattr(subprocess, "run", run)


def written(folder, text, name="robot.xml"):
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def one_body(geom, *, head="", joint='<joint name="turn" axis="0 0 1"/>'):
    return (
        f'<mujoco>{head}<worldbody><body name="b" pos="0 0 1">{joint}{geom}</body></worldbody>'
        "</mujoco>"
    )


def state_in_mujoco(model, seed=0):
    """A random state, and what it is in Pinocchio's order: q and v of all joints but free ones."""
    data, random = mujoco.MjData(model), np.random.default_rng(seed)
    mujoco.mj_integratePos(model, data.qpos, random.normal(size=model.nv), 1.0)
    data.qvel[:] = random.normal(size=model.nv)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_comVel(model, data)
    q, v = data.qpos.copy(), data.qvel.copy()
    if model.njnt and model.jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE:
        q[3:7] = data.qpos[[4, 5, 6, 3]]
        v[:3] = data.xmat[1].reshape(3, 3).T @ v[:3]  # MuJoCo has it in the world's axes
    return data, q, v


@pytest.mark.parametrize("text", [ARM, LEGS])
def test_bodies_move_as_in_mujoco(tmp_path, apart, text):
    path = written(tmp_path, text)
    robot, model = Robot.load(path), mujoco.MjModel.from_xml_path(str(path))
    data, q, v = state_in_mujoco(model)
    assert (robot.nq, robot.nv) == (model.nq, model.nv)
    twists = nm.link_twists(robot, q[None], v[None])[0]
    frames = robot.model.createData()
    pinocchio.framesForwardKinematics(robot.model, frames, q)
    for body in range(1, model.nbody):
        index = robot.model.getFrameId(model.body(body).name or f"body{body}")
        frame, pose = robot.model.frames[index], frames.oMf[index]
        np.testing.assert_allclose(pose.translation, data.xpos[body], atol=1e-12)
        np.testing.assert_allclose(pose.rotation, data.xmat[body].reshape(3, 3), atol=1e-12)
        expected = np.zeros(6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, body, expected, 1)
        twist = frame.placement.inverse() * pinocchio.Motion(twists[frame.parentJoint])
        np.testing.assert_allclose(twist.vector, np.roll(expected, 3), atol=1e-12)


def test_joints_without_a_name_are_named_after_their_body_and_numbered(tmp_path):
    joints = '<joint axis="0 0 1"/><joint axis="1 0 0"/>'
    text = LEGS.replace('<joint name="hip"', f'{joints}<joint name="hip"')
    robot = Robot.load(written(tmp_path, text))
    assert robot.joint_names == ("leftJoint_0", "leftJoint_1", "hip", "knee")
    assert robot.joints[0].name == "trunk_free"
    robot = Robot.load(written(tmp_path, ARM))
    assert robot.joint_names == ("lift", "turn", "body3Joint_0", "wrist")
    links = ["foot", "upper", "body3", "tip"]
    assert [shape.link for shape in robot.mjcf.visual] == links  # no plane, nothing of the world
    assert link_names(robot) == ("upper:lift", "upper", "body3", "tip")


@pytest.mark.parametrize("name", ["body3", "upper:lift", "body3Joint_0"])
def test_names_that_stand_for_none_are_those_of_no_other(tmp_path, name):
    """Renaming the last body and its joint changes nothing but their names."""
    one = Robot.load(written(tmp_path, ARM))
    other = Robot.load(written(tmp_path, re.sub("tip|wrist", name, ARM)))
    assert len({*other.joint_names}) == len({*link_names(other)}) == 4
    assert (other.joint_names[-1], link_names(other)[-1]) == (name, name)
    q, v = np.random.default_rng(0).normal(size=(2, 5, 4))
    powers = [nm.extended(each, Surface.of(each), q, v).power for each in (one, other)]
    np.testing.assert_array_equal(*powers)


def test_limits_are_those_of_the_file(tmp_path):
    found = limits_of(Robot.load(written(tmp_path, ARM)))
    ranges = [each.upper - each.lower for each in found.values()]
    np.testing.assert_allclose(ranges, [np.inf, np.radians(190), np.inf, np.inf])
    centres = [each.centre for each in found.values()]
    np.testing.assert_allclose(centres, [0.0, np.radians(5), 0.0, 0.0])
    assert all(np.isinf(each.velocity) for each in found.values())


def test_a_free_joint_that_comes_first_makes_the_base_float(tmp_path):
    path = written(tmp_path, LEGS)
    assert Robot.load(path).floating_base
    assert Robot.load(path, floating_base=False).nv == 2
    arm = Robot.load(written(tmp_path, ARM, "arm.xml"), floating_base=True)
    assert (arm.floating_base, arm.nv) == (True, 10)
    assert link_names(arm)[0] == "world"


@pytest.mark.parametrize(("text", "floats", "nv"), [(ARM, False, 4), (LEGS, True, 8)])
def test_objects_that_move_freely_stay_where_the_file_puts_them(tmp_path, text, floats, nv):
    cup = f'<body name="cup" pos="1 2 3"><freejoint/>{BALL}</body></worldbody>'
    robot = Robot.load(written(tmp_path, text.replace("</worldbody>", cup)))
    assert (robot.floating_base, robot.nv) == (floats, nv)
    frame = robot.model.frames[robot.model.getFrameId("cup")]
    assert frame.parentJoint == 0
    np.testing.assert_array_equal(frame.placement.translation, [1.0, 2.0, 3.0])


def test_bodies_without_joints_are_not_merged_and_what_is_only_drawn_is_kept(tmp_path):
    shell = '<geom size="0.2" group="1" contype="0" conaffinity="0"/>'
    fixed = f'<body name="shell" pos="0 0 1">{shell}</body>'
    text = one_body(BALL + fixed, head='<compiler fusestatic="true" discardvisual="true"/>')
    assert [each.link for each in Robot.load(written(tmp_path, text)).mjcf.visual] == ["shell"]


def test_an_included_file_names_its_meshes_from_its_own_folder(tmp_path, monkeypatch):
    write_stl(tmp_path / "robots" / "arm" / "part.stl")
    head = '<compiler meshdir="."/><asset><mesh name="m" file="arm/part.stl"/></asset>'
    part = one_body('<geom type="mesh" mesh="m"/>', head=head)
    written(tmp_path, part, "robots/arm.xml")
    written(tmp_path, '<mujoco><include file="arm.xml"/></mujoco>', "robots/scene.xml")
    monkeypatch.chdir(tmp_path)
    areas = [
        nm.Surface.of(Robot.load(path)).area[0]
        for path in ("robots/scene.xml", tmp_path / "robots" / "scene.xml", "robots/arm.xml")
    ]
    assert areas[0] == areas[1] == areas[2] > 0


def test_a_coupled_joint_is_where_mujocos_equality_has_it(tmp_path):
    text = LEGS.replace('name="hip"', 'name="hip" ref="20"').replace(
        'name="knee"', 'name="knee" type="slide" ref="0.3"'
    )
    equality = '<equality><joint joint1="knee" joint2="hip" polycoef="0.1 -2 0 0 0"/></equality>'
    path = written(tmp_path, text.replace("</mujoco>", f"{equality}</mujoco>"))
    assert Robot.load(path).joint_names == ("hip", "knee")
    coupled = Robot.load(path, mimic=True)
    assert coupled.joint_names == ("hip",)
    mimic = coupled.mimics["knee"]
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    for hip in (-0.7, 0.4):
        data.qpos[7:] = hip, mimic.multiplier * hip + mimic.offset
        mujoco.mj_fwdPosition(model, data)
        assert data.efc_pos[data.efc_id == 0][0] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("kind", ["ball", "free"])
def test_an_equality_of_a_joint_of_many_axes_is_refused(tmp_path, kind):
    joint = f'<joint name="turn" type="{kind}"/>'
    inner = f'<body><joint name="inner"/>{BALL}</body>'
    for pair in ('joint1="turn" joint2="inner"', 'joint1="inner" joint2="turn"'):
        equality = f"<equality><joint {pair}/></equality></mujoco>"
        text = one_body(BALL + inner, joint=joint).replace("</mujoco>", equality)
        with pytest.raises(RobotError, match="only HINGE and SLIDE joint allowed"):
            Robot.load(written(tmp_path, text))


def test_an_equality_that_couples_no_joints_hides_none_that_follows(tmp_path):
    pairs = (
        '<connect body1="left" body2="shin" anchor="0 0 0"/>',
        '<joint joint1="knee" joint2="hip" polycoef="0 1 2 0 0"/>',  # not linear
        '<joint joint1="knee" joint2="hip" polycoef="0 1 0 0 2"/>',
        '<joint joint1="knee" polycoef="0 1 0 0 0"/>',  # held
        '<joint joint1="knee" joint2="hip" polycoef="0 1 0 0 0" active="false"/>',
        '<joint joint1="knee" joint2="hip" polycoef="0.1 -2 0 0 0"/>',
    )
    text = LEGS.replace("</mujoco>", f"<equality>{''.join(pairs)}</equality></mujoco>")
    assert Robot.load(written(tmp_path, text), mimic=True).mimics == {"knee": Mimic("hip", -2, 0.1)}


def test_of_two_files_of_a_name_the_one_beside_the_model_is_included(tmp_path):
    scene = written(tmp_path, '<mujoco><include file="parts/both.xml"/></mujoco>')
    written(tmp_path, LEGS, "legs.xml")
    written(tmp_path, '<mujoco><include file="legs.xml"/></mujoco>', "parts/both.xml")
    written(tmp_path, "no XML", "parts/legs.xml")
    assert Robot.load(scene).joint_names == ("hip", "knee")


def test_a_urdf_may_be_called_xml_and_is_known_by_its_root(tmp_path):
    text = f'<?xml version="1.0"?>\n<!-- {"a licence " * 20} -->\n<robot name="r"/>'
    assert mjcf.is_mjcf(written(tmp_path, text.replace("robot", "mujoco"), "m.xml"))
    text = URDF.replace('<visual><origin xyz="0 0 0.4"/>', "<visual>")
    robot = Robot.load(written(tmp_path, f"<!-- <mujoco> {'a licence ' * 20} -->{text}", "u.xml"))
    assert robot.mjcf is None
    assert robot.joint_names == ("one", "two")


STL = np.random.default_rng(0).normal(size=(20, 3, 3)).astype("<f4")


def write_stl(path):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(stl(STL))


def test_a_mesh_is_scaled_and_placed_as_mujoco_does(tmp_path):
    write_stl(tmp_path / "meshes" / "part.stl")
    head = (
        '<compiler meshdir="meshes"/><asset><mesh name="m" file="part.stl" scale="2 3 -1"'
        ' refpos="0.1 0.2 0.3" refquat="0.8 0.3 0.4 0.2"/></asset>'
    )
    geom = '<geom type="mesh" mesh="m" pos="1 2 3" quat="0.5 0.1 0.2 0.7"/>'
    path = written(tmp_path, one_body(geom, head=head))
    model = mujoco.MjModel.from_xml_path(str(path))
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.geom_quat[0])
    expected = model.mesh_vert @ turn.reshape(3, 3).T + model.geom_pos[0]
    found = triangles(Robot.load(path))[0].reshape(-1, 3)
    distance = np.linalg.norm(found[:, None] - expected, axis=2).min(axis=1)
    assert distance.max() < 1e-5  # MuJoCo has single precision


def test_meshes_are_read_wherever_they_stand_among_other_geoms(tmp_path):
    write_stl(tmp_path / "part.stl")
    head = '<asset><mesh name="m" file="part.stl"/></asset>'
    mesh = '<geom type="mesh" mesh="m"/>'
    for other in ('type="box" size="1 1 1"', 'type="box" mesh="m"'):
        box, areas = f'<geom {other} pos="9 0 0"/>', []
        for geoms in (box, mesh, mesh + box, box + mesh, box + mesh + box + mesh):
            robot = Robot.load(written(tmp_path, one_body(geoms, head=head)))
            areas.append(nm.Surface.of(robot).area.sum())
        both = areas[0] + areas[1]
        assert areas[2:] == pytest.approx([both, both, 2 * both])


def test_a_mesh_that_the_file_itself_holds_is_read(tmp_path):
    head = '<asset><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>'
    path = written(tmp_path, one_body('<geom type="mesh" mesh="m"/>', head=head))
    assert nm.Surface.of(Robot.load(path)).area[0] == pytest.approx(1.5 + np.sqrt(3) / 2)


@pytest.mark.parametrize(
    ("compiler", "file", "place"),
    [
        ('meshdir="meshes"', "a/part.stl", "meshes/a/part.stl"),
        ('meshdir="meshes" strippath="true"', "a/b/part.stl", "meshes/part.stl"),
        ('assetdir="parts"', "part.stl", "parts/part.stl"),
    ],
)
def test_a_mesh_is_where_the_compiler_says(tmp_path, compiler, file, place):
    head = f'<compiler {compiler}/><asset><mesh file="{file}"/></asset>'
    path = written(tmp_path, one_body('<geom type="mesh" mesh="part"/>', head=head))
    robot = Robot.load(path)
    assert robot.joint_names == ("turn",)
    with pytest.raises(MeshError, match=f"mesh {place}: not found"):
        triangles(robot)
    write_stl(tmp_path / place)
    assert len(triangles(Robot.load(path))[0]) == len(STL)


URDF = """<robot name="r"><link name="base"/>
  <link name="a">
    <visual><origin xyz="0.1 0.2 0.3" rpy="0.3 -0.2 0.5"/>
      <geometry><box size="0.2 0.3 0.4"/></geometry></visual>
    <visual><origin xyz="0 0 0.4"/><geometry><mesh filename="part.stl" scale="0.1 0.2 0.1"/>
      </geometry></visual></link>
  <link name="b">
    <visual><geometry><cylinder radius="0.05" length="0.6"/></geometry></visual>
    <visual><origin xyz="0.2 0 0"/><geometry><sphere radius="0.1"/></geometry></visual>
    <visual><origin xyz="0 0.3 0" rpy="0.7 0 0"/>
      <geometry><capsule radius="0.1" length="0.3"/></geometry></visual></link>
  <joint name="one" type="revolute"><parent link="base"/><child link="a"/>
    <origin xyz="0 0 1"/><axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="1" velocity="9"/>
  </joint>
  <joint name="two" type="prismatic"><parent link="a"/><child link="b"/>
    <origin xyz="0.3 0 0.2"/><axis xyz="0.6 0.8 0"/>
    <limit lower="-2" upper="2" effort="1" velocity="9"/></joint>
</robot>"""
MJCF = """<mujoco><compiler angle="radian" eulerseq="XYZ"/>
  <asset><mesh name="part" file="part.stl" scale="0.1 0.2 0.1"/></asset>
  <worldbody><body name="a" pos="0 0 1"><joint name="one" axis="0 0 1" range="-2 2"/>
    <geom type="box" size="0.1 0.15 0.2" pos="0.1 0.2 0.3" euler="0.3 -0.2 0.5"/>
    <geom type="mesh" mesh="part" pos="0 0 0.4"/>
    <body name="b" pos="0.3 0 0.2">
      <joint name="two" type="slide" axis="0.6 0.8 0" range="-2 2"/>
      <geom type="cylinder" size="0.05 0.3"/><geom size="0.1" pos="0.2 0 0"/>
      <geom type="capsule" size="0.1 0.15" pos="0 0.3 0" euler="0.7 0 0"/></body>
  </body></worldbody></mujoco>"""


def test_the_same_robot_as_urdf_and_as_mjcf_is_equally_loud(tmp_path):
    write_stl(tmp_path / "part.stl")
    run = excitation(Robot.load(written(tmp_path, URDF, "r.urdf")))
    paths = [tmp_path / "r.urdf", written(tmp_path, MJCF, "r.xml")]
    twists, noise = [], []
    for path in paths:
        robot = Robot.load(path)
        q, v = robot.configuration(run)
        twists.append(nm.link_twists(robot, q, v))
        noise.append(nm.extended(robot, nm.Surface.of(robot), q, v, "paper").power)
    np.testing.assert_allclose(*twists, atol=1e-9)
    np.testing.assert_allclose(*noise, rtol=1e-9)


def test_an_ellipsoid_is_a_sphere_whose_axes_are_stretched(tmp_path):
    geom = '<geom type="ellipsoid" size="0.3 0.5 0.8"/>'
    drawn = triangles(Robot.load(written(tmp_path, one_body(geom))))[0]
    np.testing.assert_allclose(np.linalg.norm(drawn / (0.3, 0.5, 0.8), axis=2), 1.0)


@pytest.mark.parametrize(
    ("geoms", "visual", "collision"),
    [
        # MuJoCo Menagerie: what is drawn is in group 2 and never collides, what collides in 3
        ([("box", 2, 0), ("capsule", 3, 1)], ["box"], ["capsule"]),
        # robosuite: what collides is in group 0, what is drawn in 1
        ([("capsule", 0, 1), ("box", 1, 0)], ["box"], ["capsule"]),
        # Gymnasium, dm_control: one set for both
        ([("box", 0, 1), ("capsule", 0, 1)], ["box", "capsule"], ["box", "capsule"]),
        # group 3 is not drawn, whatever collides
        ([("box", 2, 1), ("capsule", 3, 1)], ["box"], ["box", "capsule"]),
        ([("box", 2, 0), ("capsule", 3, 0)], ["box"], []),
        # a decoration beside it
        ([("box", 0, 1), ("capsule", 0, 0)], ["box", "capsule"], ["box"]),
    ],
)
def test_visual_geoms_are_those_that_are_drawn(tmp_path, geoms, visual, collision):
    text = "".join(
        f'<geom name="{kind}" type="{kind}" size="1 1 1" group="{group}" contype="{collides}"'
        f' conaffinity="{collides}"/>'
        for kind, group, collides in geoms
    )
    mjcf = Robot.load(written(tmp_path, one_body(text))).mjcf
    count = {"box": 12, "capsule": len(capsule(1.0, 2.0))}
    for shapes, expected in ((mjcf.visual, visual), (mjcf.collision, collision)):
        assert [len(shape.body) for shape in shapes] == [count[kind] for kind in expected]


def assets(element, head=""):
    return f"<mujoco>{head}<asset>{element}</asset></mujoco>"


ASSETS = ("mesh", "hfield", "model")
OUTSIDE = "secret.xml', which lies outside of"
PIPE = "names 'pipe.stl', which is no regular file"


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "the MJCF is empty"),
        ("hello", "not XML"),
        ("<sdf/>", "not an MJCF, its root is <sdf>, expected <mujoco>"),
        (one_body("<gem/>"), r"MuJoCo cannot read the MJCF \(XML Error: .*gem"),
        (one_body(BALL, joint='<joint name="a" type="ball"/>'), "'a' is a ball joint, which is n"),
        ('<mujoco><include file="gone.xml"/></mujoco>', "includes 'gone.xml', which is missing"),
        ("<mujoco><include/></mujoco>", "includes '', which is missing"),
        ('<mujoco><include file="../../../secret.xml"/></mujoco>', OUTSIDE),
        (assets('<mesh file="secret.xml"/>', '<compiler meshdir="../../.."/>'), OUTSIDE),
        *((assets(f'<{what} name="h" file="FOLDER/secret.xml"/>'), OUTSIDE) for what in ASSETS),
        *((assets(f'<{what} name="p" file="pipe.stl"/>'), PIPE) for what in ("hfield", "mesh")),
    ],
)
def test_a_file_that_is_no_robot_or_asks_for_others_is_refused_in_one_line(tmp_path, text, problem):
    written(tmp_path, ARM, "secret.xml")
    path = written(tmp_path, text.replace("FOLDER", str(tmp_path)), "a/b/c/robot.xml")
    os.mkfifo(path.with_name("pipe.stl"))
    with one_line(RobotError, problem):
        Robot.load(path)


LENGTHS = """<mujoco><compiler><lengthrange mode="all" inttotal="1e9" interval="1e8"/></compiler>
<worldbody><body name="b"><joint name="j"/><geom size="0.1"/></body></worldbody>
<actuator><motor name="m" joint="j"/></actuator></mujoco>"""
COPIES = f'<replicate count="{{}}" offset="1 0 0">{BALL}</replicate>'
MANY = f"<mujoco><worldbody>{COPIES}</worldbody></mujoco>"
ATTACKS = {
    "copies of copies": MANY.format(999).replace(BALL, COPIES.format(999)),
    "spheres": f"<mujoco><worldbody><body>{BALL * 600}</body></worldbody></mujoco>",
    "cells": (
        '<mujoco><asset><hfield name="h" nrow=" 30000" ncol="0030000" size="1 1 1 1"/></asset>'
        "</mujoco>"
    ),
    "numbers of users": '<mujoco><size nuser_body="1000000000"/></mujoco>',
    "ranges of lengths": LENGTHS,
    "a position that is no number": one_body(BALL, joint='<joint name="j" ref="nan"/>'),
    "a sphere that MuJoCo makes": (
        '<mujoco><asset><mesh name="m" builtin="sphere" params="12"/></asset><worldbody><body>'
        '<geom type="mesh" mesh="m"/></body></worldbody></mujoco>'
    ),
    "a model that contains itself": (
        '<mujoco><asset><model name="r" file="robot.xml"/></asset></mujoco>'
    ),
}


@pytest.mark.parametrize("attack", ATTACKS)
def test_what_would_take_gigabytes_or_minutes_is_refused_in_one_line(
    tmp_path, apart, attack, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    with one_line(RobotError):
        Surface.of(Robot.load(written(tmp_path, ATTACKS[attack])))
    assert os.listdir(tmp_path) == ["robot.xml"]  # no MUJOCO_LOG.TXT


def test_a_mesh_that_is_drawn_too_often_is_refused(tmp_path, monkeypatch):
    write_stl(tmp_path / "part.stl")
    geoms = '<geom type="mesh" mesh="part"/>' * 9
    head = '<asset><mesh name="part" file="part.stl"/></asset>'
    robot = Robot.load(written(tmp_path, one_body(geoms, head=head)))
    monkeypatch.setenv("NOISE_LIMIT_TRIANGLES", "100")
    with pytest.raises(nm.GeometryError, match="triangles, the limit is 100"):
        triangles(robot)


def test_an_mjcf_may_consist_of_two_hundred_files(tmp_path):
    for n in range(200):
        written(tmp_path, "<mujoco><asset/></mujoco>", f"part{n}.xml")
    parts = [f'<include file="part{n}.xml"/>' for n in range(200)]
    assert Robot.load(written(tmp_path, f"<mujoco>{''.join(parts[:199])}</mujoco>")).joints == ()
    with pytest.raises(RobotError, match="includes more than 200 files"):
        Robot.load(written(tmp_path, f"<mujoco>{''.join(parts)}</mujoco>"))


def test_bodies_and_joints_are_counted_when_they_are_compiled(tmp_path, monkeypatch):
    path = written(tmp_path, one_body(BALL * 2))
    monkeypatch.setenv("NOISE_LIMIT_BODIES", "3")  # with the world
    with pytest.raises(RobotError, match="4 bodies; the limit is 3"):
        Robot.load(path)
    monkeypatch.setenv("NOISE_LIMIT_JOINTS", "0")
    with pytest.raises(RobotError, match="1 joints; the limit is 0"):
        Robot.load(path)


def test_a_file_that_is_missing_or_whose_path_is_not_utf_8_is_named(tmp_path):
    with pytest.raises(RobotError, match=r"gone\.xml: there is no such MJCF file"):
        Robot.load(tmp_path / "gone.xml")
    path = written(tmp_path, ARM, os.fsdecode(b"\xff.xml"))
    with pytest.raises(RobotError, match="its path is not UTF-8, as MuJoCo needs it"):
        mjcf.read(path, [tmp_path])


@pytest.mark.parametrize(
    ("own", "shown"),
    [
        ('material="m"', 1),
        ('material="m" rgba="1 1 0 1"', 1),
        ('rgba="0 0 1 .5"', 1),
        ('rgba="1 1 1 0"', 0),
        ('material="clear"', 0),
        ('material="clear" rgba="1 1 0 1"', 1),
    ],
)
def test_geoms_that_can_be_seen_are_drawn_textures_and_skins_are_not_opened(tmp_path, own, shown):
    head = (
        '<asset><skin file="gone.skn"/><texture name="t" type="2d" file="gone.png"/>'
        '<material name="m" texture="t" rgba="1 0 0 1"/>'
        '<material name="clear" rgba="1 0 0 0"/></asset>'
    )
    robot = Robot.load(written(tmp_path, one_body(f'<geom size="1" {own}/>', head=head)))
    assert len(robot.mjcf.visual) == shown


def test_a_run_names_an_mjcf_relative_to_its_own_folder(tmp_path):
    path = written(tmp_path, LEGS, "models/legs.xml")
    run = excitation(Robot.load(path))
    replace(run, robot=os.path.relpath(path)).save(tmp_path / "run.npz")
    with np.load(tmp_path / "run.npz") as arrays:
        assert str(arrays["robot"]) == "models/legs.xml"
    noise = link_noise(Run.load(tmp_path / "run.npz"))
    assert noise.links == ("trunk", "left", "shin")
    assert noise.power.max() > 0


def test_without_a_package_the_error_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    monkeypatch.setitem(sys.modules, "mujoco_menagerie", None)
    with pytest.raises(RobotError, match=r"needs MuJoCo; `pip install 'noise-inspector\[sim\]'`"):
        Robot.load(written(tmp_path, ARM))
    with pytest.raises(RobotError, match=r"pip install 'noise-inspector\[menagerie\]'"):
        Robot.load("menagerie/unitree_go2")


def test_a_robot_of_the_menagerie_is_loaded_by_its_name(tmp_path, monkeypatch):
    pytest.importorskip("mujoco_menagerie")
    written(tmp_path, LEGS, "unitree_go2/go2.xml")
    written(tmp_path, '<mujoco><include file="go2.xml"/></mujoco>', "unitree_go2/scene.xml")
    monkeypatch.setenv("MENAGERIE_ROOT", str(tmp_path))
    for name in ("menagerie/unitree_go2", "menagerie/unitree_go2/scene"):
        robot = Robot.load(name)
        assert (robot.name, robot.joint_names) == (name, ("hip", "knee"))
        assert excitation(robot).robot == name
    with pytest.raises(UnknownRobotError, match="did you mean 'menagerie/unitree_go2'"):
        Robot.load("menagerie/unitree_go3")
    with pytest.raises(RobotError, match="no entry point 'scen'"):
        Robot.load("menagerie/unitree_go2/scen")
    with pytest.raises(RobotError, match="'unitree_g1' not found under MENAGERIE_ROOT"):
        Robot.load("menagerie/unitree_g1")


def test_a_robot_that_cannot_be_downloaded_says_what_to_do(tmp_path, monkeypatch):
    pytest.importorskip("mujoco_menagerie")
    monkeypatch.setenv("MENAGERIE_BASE_URL", (tmp_path / "nowhere").as_uri())
    monkeypatch.setenv("MENAGERIE_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.delenv("MENAGERIE_ROOT", raising=False)
    with pytest.raises(RobotError, match=r"be downloaded \(.*MENAGERIE_ROOT=path names") as e:
        Robot.load("menagerie/unitree_go2")
    assert "\n" not in str(e.value)
