"""Whole-body inverse kinematics reaches its targets, and its Jacobian is the true one."""

import numpy as np
import pinocchio as pin
import pytest

from noiseclassifier.scenarios.robots import WIDE
from noiseclassifier.scenarios.world import WholeBody, reduced_model

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
        places, turns, centre, base = _targets(robot, 1e-3 * tick)
        body.follow(places, turns, centre, base)
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
