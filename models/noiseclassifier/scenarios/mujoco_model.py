"""A MuJoCo model made from a Pinocchio model: same joints, same order, same inertias.

Only effectors and boxes collide; meshes are never read, so robots load whose meshes MuJoCo cannot.
"""

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from noiseclassifier.scenarios.collision import add_boxes, add_effector, quaternion
from noiseclassifier.scenarios.errors import UnsupportedModelError
from noiseclassifier.scenarios.physics import Physics
from noiseclassifier.scenarios.sensing import add_sensors
from noiseclassifier.scenarios.shapes import Box, Effector
from noisemodel import RobotError
from noisemodel.joints import Joint, table_of

TYPES = {
    "revolute": mujoco.mjtJoint.mjJNT_HINGE,
    "continuous": mujoco.mjtJoint.mjJNT_HINGE,
    "prismatic": mujoco.mjtJoint.mjJNT_SLIDE,
}


def build(
    model: Any, physics: Physics, *, effectors: Sequence[Effector] = (), boxes: Sequence[Box] = ()
) -> Any:
    """MuJoCo model with one torque actuator per joint."""
    spec = mujoco.MjSpec()
    spec.option.timestep = physics.timestep
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10  # firm friction: tools do not creep
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # divergence must show
    spec.compiler.degree = False
    joints = _joints(model)
    bodies = _add_bodies(spec, model, joints, physics)
    for effector in effectors:
        add_effector(spec, bodies, model, effector, physics)
    add_sensors(spec, effectors, joints[0].name if joints[0].kind == "floating" else None)
    add_boxes(spec, boxes, physics)
    try:
        return spec.compile()
    except ValueError as error:
        problem = " ".join(str(error).split())
        raise UnsupportedModelError(f"MuJoCo refuses the robot: {problem}") from error


def _add_bodies(spec: Any, model: Any, joints: Sequence[Joint], physics: Physics) -> list[Any]:
    """Add all bodies with their joints and drives; the world comes first."""
    bodies = [spec.worldbody]
    driven = 0
    for index, joint in enumerate(joints):
        body = bodies[joint.parent].add_body(name=joint.name, **_pose(model, index + 1))
        _give_inertia(body, model.inertias[index + 1])
        bodies.append(body)
        if joint.kind == "floating":
            body.add_freejoint(name=joint.name)
            continue
        body.add_joint(
            name=joint.name,
            type=TYPES[joint.kind],
            axis=(np.eye(3) if joint.turn is None else joint.turn)[joint.axis],
            armature=physics.armature[driven],
            damping=[physics.damping[driven], 0, 0],
            frictionloss=physics.friction[driven],
        )
        spec.add_actuator(
            name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT
        ).set_to_motor()
        driven += 1
    return bodies


def _joints(model: Any) -> tuple[Joint, ...]:
    try:
        joints = table_of(model)
    except RobotError as error:
        raise UnsupportedModelError(str(error)) from error
    for joint in joints:
        if joint.kind not in TYPES and not (joint.kind == "floating" and joint is joints[0]):
            raise UnsupportedModelError(
                f"joint {joint.name!r} is {joint.kind}; {', '.join(TYPES)} joints can be simulated"
            )
    return joints


def _pose(model: Any, index: int) -> dict[str, Any]:
    placement = model.jointPlacements[index]
    return {"pos": placement.translation, "quat": quaternion(placement.rotation)}


def _give_inertia(body: Any, inertia: Any) -> None:
    tensor = inertia.inertia
    body.mass = inertia.mass
    body.ipos = inertia.lever
    body.fullinertia = [tensor[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    body.explicitinertial = True
