"""The limbs of a robot: which joints carry each of its effectors."""

from collections.abc import Mapping
from functools import lru_cache

from noiseclassifier.scenarios.robots import ROBOTS
from noisemodel import Robot


@lru_cache(maxsize=8)
def limbs(name: str) -> Mapping[str, tuple[str, ...]]:
    """Driven joints from the base to each effector of a robot."""
    robot = ROBOTS[name]
    if len(robot.effectors) == 1:
        return {}
    model = Robot.load(name).model
    carriers = {
        effector.frame: model.frames[model.getFrameId(effector.frame)].parentJoint
        for effector in robot.effectors
    }
    return {
        frame: tuple(
            model.names[joint]
            for joint in model.supports[carrier]
            if model.names[joint] in robot.drives.joints
        )
        for frame, carrier in carriers.items()
    }
