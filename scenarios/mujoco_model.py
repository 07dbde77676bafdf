"""A MuJoCo model made from a Pinocchio model: same joints, same order, same inertias.

Only rods and boxes touch; meshes are never read, so robots load whose meshes MuJoCo cannot read.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin

from noisemodel import RobotError
from noisemodel.joints import Joint, table_of
from noisemodel.types import Array
from scenarios.errors import UnsupportedModelError
from scenarios.shapes import Box, Rod

TYPES = {
    "revolute": mujoco.mjtJoint.mjJNT_HINGE,
    "continuous": mujoco.mjtJoint.mjJNT_HINGE,
    "prismatic": mujoco.mjtJoint.mjJNT_SLIDE,
}
ROBOT, WORLD = 1, 2
"""Contact groups: the robot touches the world, never itself."""


@dataclass(frozen=True, kw_only=True)
class Physics:
    """What a URDF does not say.

    Attributes:
        timestep: In [s].
        armature: Inertia of each drive as its joint sees it, shape (joints,), in [kg m²] or [kg].
        damping: Viscous friction of each joint, shape (joints,), in [N m s] or [N s/m].
        friction: Coulomb friction of each joint, shape (joints,), in [N m] or [N].
        contact: Time constant of a contact, in [s].
        grip: Coefficient of friction of a contact.
    """

    timestep: float
    armature: Array
    damping: Array
    friction: Array
    contact: float = 0.005
    grip: float = 0.8


def build(
    model: Any, physics: Physics, *, rods: Sequence[Rod] = (), boxes: Sequence[Box] = ()
) -> Any:
    """Generate a MuJoCo model with one torque actuator per joint and one touch sensor per rod.

    Args:
        model: A ``pinocchio.Model``, any tree of revolute, continuous and prismatic joints; every
            moving body has a mass.
        physics: What the Pinocchio model does not say.
        rods: Shapes of the robot.
        boxes: Shapes of the world.

    Returns:
        A compiled ``mujoco.MjModel``; actuators are in joint order, sensors in rod order.

    Raises:
        UnsupportedModelError: If a joint is of another kind, or MuJoCo refuses a body.
    """
    spec = mujoco.MjSpec()
    spec.option.timestep = physics.timestep
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10  # firm friction: tools do not creep
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # divergence must show
    spec.compiler.degree = False
    bodies = [spec.worldbody]
    for index, joint in enumerate(_joints(model)):
        body = bodies[joint.parent].add_body(name=joint.name, **_pose(model, index + 1))
        _give_inertia(body, model.inertias[index + 1])
        body.add_joint(
            name=joint.name,
            type=TYPES[joint.kind],
            axis=(np.eye(3) if joint.turn is None else joint.turn)[joint.axis],
            armature=physics.armature[index],
            damping=[physics.damping[index], 0, 0],
            frictionloss=physics.friction[index],
        )
        spec.add_actuator(
            name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT
        ).set_to_motor()
        bodies.append(body)
    for number, rod in enumerate(rods):
        _add_rod(spec, bodies, model, rod, f"tip{number}", physics)
    for box in boxes:
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=box.centre,
            size=box.half,
            **_touch(WORLD, ROBOT, physics),
        )
    try:
        return spec.compile()
    except ValueError as error:
        problem = " ".join(str(error).split())
        raise UnsupportedModelError(f"MuJoCo refuses the robot: {problem}") from error


def _joints(model: Any) -> tuple[Joint, ...]:
    try:
        joints = table_of(model)
    except RobotError as error:
        raise UnsupportedModelError(str(error)) from error
    for joint in joints:
        if joint.kind not in TYPES:
            raise UnsupportedModelError(
                f"joint {joint.name!r} is {joint.kind}; {', '.join(TYPES)} joints can be simulated"
            )
    return joints


def _pose(model: Any, index: int) -> dict[str, Any]:
    placement = model.jointPlacements[index]
    return {"pos": placement.translation, "quat": _quaternion(placement.rotation)}


def _quaternion(rotation: Array) -> list[float]:
    """Quaternion in MuJoCo's order: w, x, y, z."""
    q = pin.Quaternion(rotation)
    return [q.w, q.x, q.y, q.z]


def _give_inertia(body: Any, inertia: Any) -> None:
    tensor = inertia.inertia
    body.mass = inertia.mass
    body.ipos = inertia.lever
    body.fullinertia = [tensor[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    body.explicitinertial = True


def _touch(own: int, other: int, physics: Physics) -> dict[str, Any]:
    return {
        "contype": own,
        "conaffinity": other,
        "friction": [physics.grip, 0.01, 0.001],
        "solref": [physics.contact, 1.0],
    }


def _add_rod(
    spec: Any, bodies: Sequence[Any], model: Any, rod: Rod, name: str, physics: Physics
) -> None:
    """Add a capsule whose outermost point lies at the rod's length, and feel its tip."""
    frame = model.frames[model.getFrameId(rod.frame)]
    body = bodies[frame.parentJoint]
    rotation = _quaternion(frame.placement.rotation)
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        size=[rod.radius, rod.length / 2 - rod.radius, 0],  # MuJoCo leaves the round ends out
        pos=frame.placement.act(np.array([0, 0, rod.length / 2])),
        quat=rotation,
        **_touch(ROBOT, WORLD, physics),
    )
    body.add_site(
        name=name,
        pos=frame.placement.act(np.array([0, 0, rod.length])),
        size=[2.5 * rod.radius] * 3,
    )
    spec.add_sensor(
        name=name,
        type=mujoco.mjtSensor.mjSENS_TOUCH,
        objtype=mujoco.mjtObj.mjOBJ_SITE,
        objname=name,
    )
