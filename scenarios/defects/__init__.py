"""Defects of a robot or its world: settings from which a seed draws faults.

A defect acts in one of five places: ground, encoder, planned motion, sensors, gains. It depends on
the plan only by time, ground and contacts, not on the robot.
"""

from scenarios.defects.edge import Overhang, StepDown
from scenarios.defects.ground import GivingWay, Obstacles
from scenarios.defects.plan import Defect, NoDefect, Plan, Range, Units
from scenarios.defects.scaled import Scaled
from scenarios.defects.signals import (
    Decalibration,
    ForceGain,
    Multisine,
    ReferenceJumps,
    SensorJumps,
)

__all__ = [
    "Decalibration",
    "Defect",
    "ForceGain",
    "GivingWay",
    "Multisine",
    "NoDefect",
    "Obstacles",
    "Overhang",
    "Plan",
    "Range",
    "ReferenceJumps",
    "Scaled",
    "SensorJumps",
    "StepDown",
    "Units",
]
