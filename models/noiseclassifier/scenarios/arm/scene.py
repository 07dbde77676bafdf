"""Scene of an arm, its table if it picks, and its controller."""

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

from noiseclassifier.scenarios.arm import reaching
from noiseclassifier.scenarios.arm.control import HIGHEST_ACCELERATION, ToolControl
from noiseclassifier.scenarios.arm.following import JointControl
from noiseclassifier.scenarios.arm.picking import Plan, pick
from noiseclassifier.scenarios.arm.robots import Arm
from noiseclassifier.scenarios.clock import STEP
from noiseclassifier.scenarios.collision import box_changes
from noiseclassifier.scenarios.errors import UnsupportedModelError
from noiseclassifier.scenarios.faults import Faults
from noiseclassifier.scenarios.forces import forces
from noiseclassifier.scenarios.imperfections import Imperfections, real_model
from noiseclassifier.scenarios.loop import Control, Scene
from noiseclassifier.scenarios.motions import Picks, Reach
from noiseclassifier.scenarios.mujoco_model import build
from noiseclassifier.scenarios.physics import Physics
from noiseclassifier.scenarios.reduced import configuration, reduced_model
from noisemodel import Robot
from noisemodel.types import Array

SETTLING = 300
"""Ticks before the recording during which the arm comes to rest under its unknown load."""


def plan(
    arm: Arm, motion: Picks | Reach, rng: np.random.Generator, duration: float
) -> Plan | reaching.Plan:
    """Plan of the motion of one run.

    Args:
        duration: Duration of the run, in [s].
    """
    model = reduced_model(arm)
    if isinstance(motion, Reach):
        ability = _ability(arm)
        return reaching.reach(
            motion, rng, ability=ability, tool=arm.tool, units=arm.units, duration=duration
        )
    if arm.reach is None:
        raise UnsupportedModelError(f"{arm.name} has no table to pick from")
    data = model.createData()
    pin.framesForwardKinematics(model, data, configuration(model, np.array(arm.rest)))
    start = data.oMf[model.getFrameId(arm.tool.frame)].act(_tip(arm))
    return pick(
        motion,
        rng,
        start=start,
        tool=arm.tool,
        table=arm.table,
        reach=arm.reach,
        duration=duration,
        units=arm.units,
    )


def scene(
    arm: Arm, plan: Plan | reaching.Plan, faults: Faults, imperfections: Imperfections
) -> Scene:
    """Scene of one run."""
    model, rest = reduced_model(arm), np.array(arm.rest)
    boxes = (*(plan.ground if faults.ground is None else faults.ground), *faults.boxes)
    world = _world(arm, model, boxes, imperfections)
    return Scene(
        model=world,
        start=rest - faults.offsets(len(rest)),  # the encoders read the rest position
        control=_control(arm, model, plan, faults, imperfections),
        effectors=1,
        settling=SETTLING,
        noise=np.array([imperfections.force_noise]),
        changes=box_changes(world, boxes),
        forces=forces(world, (*plan.payloads, *faults.loads)),
    )


def _control(
    arm: Arm, model: Any, plan: Plan | reaching.Plan, faults: Faults, imperfections: Imperfections
) -> Control:
    """Controller of the tool, or of the joints, that rests at first."""
    if isinstance(plan, reaching.Plan):
        shift = faults.shift(plan.time)[:, 0] if faults.shift else np.zeros_like(plan.position)
        rest = ((SETTLING, 0), (0, 0))
        return JointControl(
            model,
            arm.tool,
            np.pad(plan.joints, rest, "edge"),
            np.pad(shift, rest),
            fastest=HIGHEST_ACCELERATION if plan.foreseen else 0.0,
        )
    gain = np.pad(faults.gain(plan.time), (SETTLING, 0), "edge")
    return ToolControl(
        model,
        arm.tool.frame,
        _tip(arm),
        np.array(arm.rest),
        _shifted(plan, faults).after(SETTLING),
        gain=arm.force_gain * imperfections.force_gain * gain,
        time_constant=arm.force_filter,
    )


def _ability(arm: Arm) -> reaching.Ability:
    """What an arm can do, by its URDF and its drives."""
    model, rest = Robot.load(arm.name, floating_base=False).model, np.array(arm.rest)
    joints = [model.joints[model.getJointId(name)] for name in arm.drives.joints]
    low, high = rest - reaching.TURN, rest + reaching.TURN
    for index, joint in enumerate(joints):
        if joint.nq == 1:  # a continuous joint has no limits
            low[index] = max(low[index], model.lowerPositionLimit[joint.idx_q] + reaching.MARGIN)
            high[index] = min(high[index], model.upperPositionLimit[joint.idx_q] - reaching.MARGIN)
    speed = np.array([model.velocityLimit[joint.idx_v] for joint in joints])
    return reaching.Ability(
        reduced_model(arm),
        rest,
        low=np.minimum(low, rest),
        high=np.maximum(high, rest),
        speed=reaching.SHARE * np.where(speed > 0, speed, np.inf),
        torque=np.array(arm.drives.torque),
        armature=np.array(arm.drives.armature),
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
