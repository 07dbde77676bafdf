"""Defects of a robot or its world: settings from which a seed draws faults.

A defect acts in one of six places: ground, encoder, planned motion, sensors, gains, forces from
outside. It depends on the plan only by time, ground, contacts and motion, not on the robot.
"""

from noiseclassifier.scenarios.defects.air import Collisions, JointStops, Pushes
from noiseclassifier.scenarios.defects.edge import Overhang, StepDown
from noiseclassifier.scenarios.defects.ground import GivingWay, Obstacles
from noiseclassifier.scenarios.defects.plan import Defect, NoDefect, Plan, Range, Units
from noiseclassifier.scenarios.defects.scaled import Scaled
from noiseclassifier.scenarios.defects.signals import (
    Decalibration,
    ForceGain,
    Multisine,
    ReferenceJumps,
    SensorJumps,
)

__all__ = [
    "Collisions",
    "Decalibration",
    "Defect",
    "ForceGain",
    "GivingWay",
    "JointStops",
    "Multisine",
    "NoDefect",
    "Obstacles",
    "Overhang",
    "Plan",
    "Pushes",
    "Range",
    "ReferenceJumps",
    "Scaled",
    "SensorJumps",
    "StepDown",
    "Units",
]
