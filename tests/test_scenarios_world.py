"""Whole-body inverse kinematics, and models of MuJoCo that move, weigh and touch as Pinocchio's."""

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from noiseclassifier.scenarios.motions import Box, Tip
from noiseclassifier.scenarios.robots import WIDE
from noiseclassifier.scenarios.world import (
    WholeBody,
    box_changes,
    build,
    pinocchio_base,
    reduced_model,
    set_collision,
)
from noisemodel import Robot

G1 = WIDE["g1"]
TALOS = WIDE["talos"]

LEVEL = np.eye(3)


@pytest.fixture(params=[TALOS, G1], ids=lambda robot: robot.name)
def robot(request):
    return request.param


def body_of(robot):
    model = reduced_model(robot)
    start = pin.neutral(model)
    start[2], start[7:] = robot.centre, robot.rest
    return WholeBody(model, robot.effectors, start)


def stand(robot, *, places=None, turn=LEVEL, shift=(0.0, 0.0, 0.0), base=LEVEL):
    """A body that has come to rest with its feet side by side, but for the changes."""
    body = body_of(robot)
    if places is None:
        places = np.array([[0.0, robot.apart, 0.0], [0.0, -robot.apart, 0.0]])
    centre = np.array([0.0, 0.0, robot.centre]) + shift
    body.follow(places, [turn, LEVEL], centre, base, steps=12)
    return body


def reached(robot, configuration):
    """Where soles, centre of mass and base really are, computed apart."""
    model = reduced_model(robot)
    data = model.createData()
    pin.framesForwardKinematics(model, data, configuration)
    soles = [
        data.oMf[model.getFrameId(sole.frame)] * pin.SE3(LEVEL, np.array(sole.point))
        for sole in robot.effectors
    ]
    return soles, pin.centerOfMass(model, data, configuration), data.oMi[1].rotation


def test_soles_centre_of_mass_and_base_reach_their_targets(robot):
    places = np.array([[0.05, robot.apart + 0.02, 0.03], [-0.04, -robot.apart, 0.0]])
    turn, base = pin.rpy.rpyToMatrix(0.05, -0.1, 0.2), pin.rpy.rpyToMatrix(0.0, 0.02, 0.1)
    shift = np.array([0.01, -0.02, -0.03])
    body = stand(robot, places=places, turn=turn, shift=shift, base=base)
    soles, centre, rotation = reached(robot, body.configuration)
    for sole, place, wanted in zip(soles, places, (turn, LEVEL), strict=True):
        np.testing.assert_allclose(sole.translation, place, rtol=0, atol=1e-10)
        np.testing.assert_allclose(sole.rotation, wanted, rtol=0, atol=1e-10)
    np.testing.assert_allclose(centre, np.add((0, 0, robot.centre), shift), rtol=0, atol=1e-10)
    np.testing.assert_allclose(rotation, base, rtol=0, atol=1e-10)


def test_lifting_a_foot_moves_the_joints_by_its_column(robot):
    middle = stand(robot)
    middle.follow(*_targets(robot, 0.0))
    for foot in (0, 1):
        up, down = (_lifted(robot, foot, height) for height in (1e-5, -1e-5))
        slope = (up - down)[7:] / 2e-5
        np.testing.assert_allclose(middle.lift[foot], slope, rtol=1e-5, atol=1e-6)


def _targets(robot, height, foot=0):
    places = np.array([[0.0, robot.apart, 0.0], [0.0, -robot.apart, 0.0]])
    places[foot, 2] = height
    return places, [LEVEL, LEVEL], np.array([0.0, 0.0, robot.centre]), LEVEL


def _lifted(robot, foot, height):
    body = stand(robot)
    return body.follow(*_targets(robot, height, foot), steps=8)


def test_one_step_follows_a_slow_motion(robot):
    body = stand(robot)
    for tick in range(50):
        body.follow(*_targets(robot, 1e-3 * tick))
    (left, _), _, _ = reached(robot, body.configuration)
    assert left.translation[2] == pytest.approx(0.049, abs=1e-5)


def test_the_torques_of_a_robot_that_stands_leave_nothing_for_its_base(robot):
    body = stand(robot)
    body.follow(*_targets(robot, 0.0))
    model = reduced_model(robot)
    gravity = pin.computeGeneralizedGravity(model, model.createData(), body.configuration)
    weight = pin.computeTotalMass(model) * 9.81
    bearing = np.zeros((2, 6))
    bearing[:, 2] = weight / 2
    torque = body.hold(bearing.ravel())
    # d'Alembert: the ground's forces and these torques balance gravity in every direction.
    equations = np.concatenate((bearing.ravel(), np.zeros(6)))
    borne = np.linalg.solve(body.inverse.T, equations)
    residual = borne + np.concatenate((np.zeros(6), torque)) - gravity
    np.testing.assert_allclose(residual, 0, atol=1e-8)
    assert torque[3] == pytest.approx(torque[9], rel=0.05)  # one knee as the other


ODD = """<robot name="odd"><link name="base"/>
<link name="a"><inertial><origin xyz="0.1 0 0.2" rpy="0.3 0 0"/><mass value="2"/>
  <inertia ixx="0.03" iyy="0.04" izz="0.05" ixy="0.001" ixz="0" iyz="0.002"/></inertial></link>
<link name="b"><inertial><mass value="1"/>
  <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="c"><inertial><mass value="0.5"/>
  <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="a"/>
  <origin xyz="0 0.1 0.4" rpy="0.1 0.2 0.3"/><axis xyz="1 2 -1"/>
  <limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
<joint name="slide" type="prismatic"><parent link="a"/><child link="b"/>
  <origin xyz="0.3 0 0" rpy="0 -0.5 0"/><axis xyz="0 1 1"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="spin" type="continuous"><parent link="a"/><child link="c"/>
  <origin xyz="0 0 0.2" rpy="1 0 0"/><axis xyz="0 1 0"/></joint></robot>"""


def physics(joints):
    return dict.fromkeys(("armature", "damping", "friction"), np.zeros(joints))


@pytest.fixture(params=["panda", "odd"])
def model(request):
    if request.param == "odd":
        return pin.buildModelFromXML(ODD)
    return Robot.load("panda").model


def states(model, rng):
    """One state, in Pinocchio's and in MuJoCo's words: they differ for continuous joints."""
    angles = rng.uniform(-0.5, 0.5, model.nv)
    q = np.concatenate(
        [
            [np.cos(angle), np.sin(angle)] if joint.nq == 2 else [angle]
            for joint, angle in zip(list(model.joints)[1:], angles, strict=True)
        ]
    )
    return q, angles, rng.uniform(-2, 2, model.nv)


def test_bodies_are_where_pinocchio_has_them_move_as_fast_and_take_the_same_torques(model):
    rng = np.random.default_rng(0)
    built = build(model, **physics(model.nv))
    ours, theirs = model.createData(), mujoco.MjData(built)
    for _ in range(5):
        q, angles, v = states(model, rng)
        acceleration = rng.uniform(-3, 3, model.nv)
        pin.forwardKinematics(model, ours, q, v)
        theirs.qpos[:], theirs.qvel[:], theirs.qacc[:] = angles, v, acceleration
        mujoco.mj_inverse(built, theirs)
        torque = pin.rnea(model, model.createData(), q, v, acceleration)
        np.testing.assert_allclose(theirs.qfrc_inverse, torque, rtol=1e-6, atol=1e-8)
        for index in range(1, model.njoints):
            body = built.body(model.names[index]).id
            np.testing.assert_allclose(
                theirs.xpos[body], ours.oMi[index].translation, rtol=0, atol=1e-8
            )
            np.testing.assert_allclose(
                theirs.xmat[body].reshape(3, 3), ours.oMi[index].rotation, rtol=0, atol=1e-8
            )
            twist = np.zeros(6)
            mujoco.mj_objectVelocity(built, theirs, mujoco.mjtObj.mjOBJ_XBODY, body, twist, 1)
            np.testing.assert_allclose(twist[3:], ours.v[index].linear, rtol=0, atol=1e-8)
            np.testing.assert_allclose(twist[:3], ours.v[index].angular, rtol=0, atol=1e-8)


def test_actuators_are_the_joints_in_pinocchio_order(model):
    built = build(model, **physics(model.nv))
    assert [built.actuator(index).name for index in range(built.nu)] == list(model.names)[1:]
    assert built.nq == built.nv == model.nv


def test_a_rod_touches_with_its_tip_and_its_sensor_measures_the_weight_on_it():
    urdf = """<robot name="lift"><link name="base"/><link name="tool"><inertial>
      <mass value="2"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>
      </inertial></link><joint name="slide" type="prismatic"><parent link="base"/>
      <child link="tool"/><origin xyz="0 0 0.5" rpy="3.141592653589793 0 0"/><axis xyz="0 0 1"/>
      <limit lower="0" upper="1" effort="1" velocity="1"/></joint></robot>"""
    built = build(
        pin.buildModelFromXML(urdf),
        **physics(1),
        effectors=(Tip("tool", length=0.1, radius=0.01),),
        boxes=(Box(centre=(0.0, 0.0, 0.15), half=(0.2, 0.2, 0.05)),),
    )
    data = mujoco.MjData(built)
    data.qpos[0] = 0.1999  # the tip hangs 0.1 mm above the box, whose top is at 0.2 m
    mujoco.mj_forward(built, data)
    assert data.ncon == 0
    for _ in range(5000):
        mujoco.mj_step(built, data)
    assert data.qpos[0] == pytest.approx(0.2, abs=1e-3)
    assert data.sensordata[0] == pytest.approx(2 * 9.81, rel=1e-3)


def test_the_base_is_converted_to_pinocchios_conventions():
    rng = np.random.default_rng(3)
    model = pin.buildModelFromXML(ODD, pin.JointModelFreeFlyer())
    model.inertias[1] = pin.Inertia.FromSphere(3.0, 0.1)
    built = build(model, **physics(model.nv - 6))
    theirs, ours = mujoco.MjData(built), model.createData()
    theirs.qpos[:7] = rng.normal(size=7)
    theirs.qpos[3:7] /= np.linalg.norm(theirs.qpos[3:7])
    theirs.qvel[:6] = rng.normal(size=6)
    mujoco.mj_forward(built, theirs)
    pose, velocity = pinocchio_base(theirs.qpos[None, :7], theirs.qvel[None, :6])
    q, v = pin.neutral(model), np.zeros(model.nv)
    q[:7], v[:6] = pose[0], velocity[0]
    pin.forwardKinematics(model, ours, q, v)
    twist = np.zeros(6)
    body = built.body("root_joint").id
    mujoco.mj_objectVelocity(built, theirs, mujoco.mjtObj.mjOBJ_XBODY, body, twist, 1)
    np.testing.assert_allclose(ours.v[1].vector, [*twist[3:], *twist[:3]], rtol=0, atol=1e-12)
    np.testing.assert_allclose(ours.oMi[1].translation, theirs.qpos[:3], rtol=0, atol=1e-12)


def test_boxes_appear_and_vanish():
    boxes = (Box((0, 0, 0), (1, 1, 1)), Box((0, 0, 0), (1, 1, 1), since=0.5, until=0.8))
    model = pin.buildModelFromXML(ODD)
    built = build(model, **physics(model.nv), boxes=boxes)
    late = built.geom("box1").id
    assert box_changes(built, boxes) == {500: [(late, True)], 800: [(late, False)]}
    assert (built.geom_contype[late], built.geom_contype[built.geom("box0").id]) == (0, 2)
    set_collision(built, late, present=True)
    assert built.geom_contype[late] == 2
