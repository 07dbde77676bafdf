"""Scene of a humanoid, its ground and its controller."""

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

from noiseclassifier.scenarios.clock import STEP
from noiseclassifier.scenarios.collision import box_changes
from noiseclassifier.scenarios.faults import Faults
from noiseclassifier.scenarios.humanoid.control import WalkControl
from noiseclassifier.scenarios.humanoid.footsteps import footsteps, stopping
from noiseclassifier.scenarios.humanoid.gesture import gesture
from noiseclassifier.scenarios.humanoid.motions import Stand, Stroll
from noiseclassifier.scenarios.humanoid.plan import Plan
from noiseclassifier.scenarios.humanoid.robots import LEGS, Humanoid
from noiseclassifier.scenarios.humanoid.stabilizer import Stabilizer
from noiseclassifier.scenarios.humanoid.standing import stand
from noiseclassifier.scenarios.humanoid.walking import GRAVITY, walk
from noiseclassifier.scenarios.imperfections import Imperfections, real_model
from noiseclassifier.scenarios.loop import Scene
from noiseclassifier.scenarios.motions import Walk
from noiseclassifier.scenarios.mujoco_model import build
from noiseclassifier.scenarios.physics import Physics
from noiseclassifier.scenarios.reduced import reduced_model
from noiseclassifier.scenarios.sensing import sensors_of
from noiseclassifier.scenarios.wholebody import WholeBody
from noisemodel.types import Array

SETTLING = 500
"""Ticks before the recording during which the robot comes to rest on its feet."""
LEVER = 0.05
"""Noise of torque sensors per noise of force sensors, in [m]."""


def plan(
    robot: Humanoid, motion: Walk | Stroll | Stand, rng: np.random.Generator, duration: float
) -> Plan:
    """Plan of the motion of one run.

    Args:
        duration: Duration of the run, in [s].
    """
    if isinstance(motion, Walk):
        return walk(robot, footsteps(robot, motion, rng, duration), duration)
    if isinstance(motion, Stroll):
        steps = stopping(robot, motion, rng, duration)
        return walk(robot, steps, duration, upper=gesture(robot, motion.upper, rng, duration))
    return stand(robot, motion, rng, duration)


def scene(robot: Humanoid, plan: Plan, faults: Faults, imperfections: Imperfections) -> Scene:
    """Scene of one run."""
    model = reduced_model(robot)
    boxes = (*(plan.ground if faults.ground is None else faults.ground), *faults.boxes)
    world = _world(robot, model, boxes, imperfections)
    where = sensors_of(world)
    strength = np.pad(faults.gain(plan.time), (SETTLING, 0), "edge") * imperfections.force_gain
    shifted = _shifted(plan, faults).after(SETTLING)
    body = standing(robot, model, shifted)
    weight = float(pin.computeTotalMass(model)) * GRAVITY
    stabilizer = Stabilizer(
        shifted, robot.effectors, robot.gains, strength=strength, weight=weight, where=where
    )
    return Scene(
        model=world,
        start=_mujoco_start(body.configuration, faults.offsets(len(robot.drives.joints))),
        control=WalkControl(body, stabilizer, shifted, weight=weight, where=where),
        effectors=len(robot.effectors),
        settling=SETTLING,
        noise=_noise(robot, world.nsensordata, where, imperfections),
        changes=box_changes(world, boxes),
    )


def bodies(robot: Humanoid) -> int:
    """Number of moving bodies of a humanoid."""
    return int(reduced_model(robot).njoints) - 1


def standing(robot: Humanoid, model: Any, plan: Plan) -> WholeBody:
    """The robot, standing as a plan starts."""
    start = pin.neutral(model)
    start[2], start[7:] = robot.centre, robot.rest
    body = WholeBody(model, robot.effectors, start, upper=len(robot.drives.joints) - LEGS)
    level = np.eye(3)
    body.follow(
        plan.places[0], [level, level], plan.centre[0], level, upper=plan.upper[0], steps=20
    )
    return body


def _shifted(plan: Plan, faults: Faults) -> Plan:
    if faults.shift is None:
        return plan
    return replace(plan, places=plan.places + faults.shift(plan.time))


def _world(
    robot: Humanoid, model: Any, boxes: tuple[Any, ...], imperfections: Imperfections
) -> Any:
    """MuJoCo model of the real robot and the real ground."""
    drives = robot.drives
    physics = Physics(
        timestep=STEP,
        armature=np.array(drives.armature),
        damping=np.array(drives.viscous) * imperfections.viscous,
        friction=np.array(drives.friction) * imperfections.friction,
    )
    real = real_model(model, robot.carrier, np.zeros(3), imperfections)
    return build(real, physics, effectors=robot.effectors, boxes=boxes)


def _mujoco_start(configuration: Array, offsets: Array) -> Array:
    """Configuration, as MuJoCo has it, at which the encoders read the given one."""
    place, (x, y, z, w), joints = configuration[:3], configuration[3:7], configuration[7:]
    return np.concatenate((place, (w, x, y, z), joints - offsets))


def _noise(
    robot: Humanoid, sensors: int, where: dict[str, slice], imperfections: Imperfections
) -> Array:
    """Standard deviations of the sensors; those of the base are exact."""
    noise = np.zeros(sensors)
    for sole in robot.effectors:
        noise[where[f"{sole.frame}.force"]] = imperfections.force_noise
        noise[where[f"{sole.frame}.torque"]] = LEVER * imperfections.force_noise
    return noise
