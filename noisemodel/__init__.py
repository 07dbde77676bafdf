"""Robot noise from joint motion: the run, the robot, and the noise that the one makes.

Conventions: SI units; samples along the first axis; quaternions x, y, z, w; base velocity in the
base's own axes, linear, then angular, as Pinocchio has it. Source of the noise model: F. Sygulla
and D. Rixen, "Learning the Noise of Failure: Intelligent System Tests for Robots", Sec. II-A.
"""

from noisemodel.compare import Comparison, Comparisons, LeftOut, compare
from noisemodel.noise import KINDS, Noise, by_joint, extended, norms, simplified
from noisemodel.recorder import Recorder
from noisemodel.robot import ROBOTS, Robot, link_twists
from noisemodel.run import Block, Run, decimated, resample
from noisemodel.surface import Surface
from noisemodel.types import (
    GeometryError,
    MeshError,
    NoiseModelError,
    OutputError,
    RobotError,
    RunError,
    RunFileError,
    UnknownJointError,
    UnknownKindError,
    UnknownRobotError,
)

__all__ = [
    "KINDS",
    "ROBOTS",
    "Block",
    "Comparison",
    "Comparisons",
    "GeometryError",
    "LeftOut",
    "MeshError",
    "Noise",
    "NoiseModelError",
    "OutputError",
    "Recorder",
    "Robot",
    "RobotError",
    "Run",
    "RunError",
    "RunFileError",
    "Surface",
    "UnknownJointError",
    "UnknownKindError",
    "UnknownRobotError",
    "by_joint",
    "compare",
    "decimated",
    "extended",
    "link_twists",
    "norms",
    "resample",
    "simplified",
]
