"""Scene of an arm, its table and its controller."""

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

from noisemodel.types import Array
from scenarios.arm.control import ToolControl
from scenarios.arm.picking import Plan, pick
from scenarios.arm.robots import Arm
from scenarios.clock import STEP
from scenarios.collision import box_changes
from scenarios.faults import Faults
from scenarios.imperfections import Imperfections, real_model
from scenarios.loop import Scene
from scenarios.motions import Picks
from scenarios.mujoco_model import build
from scenarios.physics import Physics
from scenarios.reduced import reduced_model

SETTLING = 300
"""Ticks before the recording during which the arm comes to rest under its unknown load."""


def plan(arm: Arm, motion: Picks, rng: np.random.Generator, duration: float) -> Plan:
    """Plan of the motion of one run.

    Args:
        arm: The arm.
        motion: Plan of the motion.
        rng: Random number generator.
        duration: Duration of the run, in [s].

    Returns:
        The plan.
    """
    model = reduced_model(arm)
    data = model.createData()
    pin.framesForwardKinematics(model, data, np.array(arm.rest))
    start = data.oMf[model.getFrameId(arm.tool.frame)].act(_tip(arm))
    return pick(
        motion,
        rng,
        start=start,
        tool=arm.tool,
        table=arm.table,
        reach=arm.reach,
        duration=duration,
    )


def scene(arm: Arm, plan: Plan, faults: Faults, imperfections: Imperfections) -> Scene:
    """Scene of one run.

    Args:
        arm: The arm.
        plan: Plan of the motion.
        faults: The faults to inject.
        imperfections: The imperfections of the robot.

    Returns:
        The scene; it begins when the arm has come to rest.
    """
    model, rest = reduced_model(arm), np.array(arm.rest)
    boxes = (*(plan.ground if faults.ground is None else faults.ground), *faults.boxes)
    world = _world(arm, model, boxes, imperfections)
    gain = np.pad(faults.gain(plan.time), (SETTLING, 0), "edge")
    control = ToolControl(
        model,
        arm.tool.frame,
        _tip(arm),
        rest,
        _shifted(plan, faults).after(SETTLING),
        gain=arm.force_gain * imperfections.force_gain * gain,
        time_constant=arm.force_filter,
    )
    return Scene(
        model=world,
        start=rest - faults.offsets(len(rest)),  # the encoders read the rest position
        control=control,
        effectors=1,
        settling=SETTLING,
        noise=np.array([imperfections.force_noise]),
        changes=box_changes(world, boxes),
    )


def _shifted(plan: Plan, faults: Faults) -> Plan:
    if faults.shift is None:
        return plan
    return replace(plan, position=plan.position + faults.shift(plan.time)[:, 0])


def _tip(arm: Arm) -> Array:
    return np.array(arm.tool.point)


def _world(arm: Arm, model: Any, boxes: tuple[Any, ...], imperfections: Imperfections) -> Any:
    """MuJoCo model of the real robot, its table and the objects on it."""
    physics = Physics(
        timestep=STEP,
        armature=np.array(arm.drives.armature),
        damping=np.array(arm.drives.viscous) * imperfections.viscous,
        friction=np.array(arm.drives.friction) * imperfections.friction,
        contact=arm.contact,
    )
    real = real_model(model, arm.tool.frame, _tip(arm), imperfections)
    return build(real, physics, effectors=(arm.tool,), boxes=boxes)


def bodies(arm: Arm) -> int:
    """Number of moving bodies of an arm."""
    return int(reduced_model(arm).njoints) - 1
