"""Robot noise from joint motion: the run, the robot, and the noise that the one makes.

Conventions: SI units; samples along the first axis; quaternions x, y, z, w; base velocity in the
base's own axes, linear, then angular, as Pinocchio has it. Source of the noise model: F. Sygulla
and D. Rixen, "Learning the Noise of Failure: Intelligent System Tests for Robots", Sec. II-A.
"""

from noisemodel.block import Block
from noisemodel.catalog import ROBOTS
from noisemodel.errors import (
    NoiseModelError,
    OutputError,
    RobotError,
    RunError,
    RunFileError,
    UnknownJointError,
    UnknownRobotError,
)
from noisemodel.kinematics import link_twists
from noisemodel.lowering import lowered
from noisemodel.robot import Robot
from noisemodel.run import Run
from noisemodel.simplified import simplified

__all__ = [
    "ROBOTS",
    "Block",
    "NoiseModelError",
    "OutputError",
    "Robot",
    "RobotError",
    "Run",
    "RunError",
    "RunFileError",
    "UnknownJointError",
    "UnknownRobotError",
    "link_twists",
    "lowered",
    "simplified",
]
