"""Scene of a quadruped, its ground and its controller."""

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

from noiseclassifier.scenarios.clock import STEP
from noiseclassifier.scenarios.collision import box_changes
from noiseclassifier.scenarios.faults import Faults
from noiseclassifier.scenarios.imperfections import Imperfections, real_model
from noiseclassifier.scenarios.loop import Scene
from noiseclassifier.scenarios.motions import Trot
from noiseclassifier.scenarios.mujoco_model import build
from noiseclassifier.scenarios.physics import Physics
from noiseclassifier.scenarios.quadruped.control import TrotControl
from noiseclassifier.scenarios.quadruped.robots import Quadruped
from noiseclassifier.scenarios.quadruped.standing import Standing, stand
from noiseclassifier.scenarios.quadruped.trotting import Plan, trot
from noiseclassifier.scenarios.reduced import reduced_model
from noiseclassifier.scenarios.sensing import sensors_of
from noiseclassifier.scenarios.shapes import Box
from noisemodel.types import Array

SETTLING = 400
"""Ticks before the recording during which the robot comes to rest under its unknown load."""
ATTITUDE_NOISE = 1e-4
"""Standard deviation of the measured attitude per tick, in [rad]."""
VELOCITY_NOISE = 5e-3
"""Standard deviation of the measured velocity per tick, in [m/s]."""


def plan(robot: Quadruped, motion: Trot, rng: np.random.Generator, duration: float) -> Plan:
    """Plan of the motion of one run.

    Args:
        duration: Duration of the run, in [s].
    """
    return trot(robot, stand(robot), motion, rng, duration)


def scene(robot: Quadruped, plan: Plan, faults: Faults, imperfections: Imperfections) -> Scene:
    """Scene of one run."""
    model, standing = reduced_model(robot), stand(robot)
    boxes = (*(plan.ground if faults.ground is None else faults.ground), *faults.boxes)
    world = _world(robot, model, boxes, imperfections)
    sensors = sensors_of(world)
    gain = np.pad(faults.gain(plan.time), (SETTLING, 0), "edge") * imperfections.force_gain
    control = TrotControl(
        robot,
        model,
        standing,
        _shifted(plan, faults).after(SETTLING),
        sensors=sensors,
        gain=gain,
    )
    noise = np.zeros(world.nsensordata)
    noise[: len(robot.feet)] = imperfections.force_noise
    noise[sensors["base.turn"]] = ATTITUDE_NOISE / 2
    noise[sensors["centre.velocity"]] = VELOCITY_NOISE
    return Scene(
        model=world,
        start=_start(robot, model, standing, faults),
        control=control,
        effectors=len(robot.feet),
        settling=SETTLING,
        noise=noise,
        changes=box_changes(world, boxes),
    )


def bodies(robot: Quadruped) -> int:
    """Number of moving bodies of a quadruped, with its base."""
    return int(reduced_model(robot).njoints) - 1


def _shifted(plan: Plan, faults: Faults) -> Plan:
    if faults.shift is None:
        return plan
    return replace(plan, feet=plan.feet + faults.shift(plan.time))


def _world(
    robot: Quadruped, model: Any, boxes: tuple[Box, ...], imperfections: Imperfections
) -> Any:
    """MuJoCo model of the real robot and the ground."""
    physics = Physics(
        timestep=STEP,
        armature=np.array(robot.drives.armature),
        damping=np.array(robot.drives.viscous) * imperfections.viscous,
        friction=np.array(robot.drives.friction) * imperfections.friction,
    )
    real = real_model(model, model.frames[1].name, np.zeros(3), imperfections)
    return build(real, physics, effectors=robot.feet, boxes=boxes)


def _start(robot: Quadruped, model: Any, standing: Standing, faults: Faults) -> Array:
    """Configuration at which the encoders read the standing one, lowest foot on the ground."""
    configuration = standing.configuration.copy()
    configuration[7:] -= faults.offsets(len(configuration) - 7)
    data = model.createData()
    pin.framesForwardKinematics(model, data, configuration)
    lowest = min(data.oMf[model.getFrameId(foot.frame)].translation[2] for foot in robot.feet)
    configuration[2] += robot.feet[0].radius - lowest
    configuration[3:7] = configuration[[6, 3, 4, 5]]  # MuJoCo has w first
    return np.asarray(configuration)
