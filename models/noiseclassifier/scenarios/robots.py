"""The robots that can be simulated."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import TypeAlias

from noiseclassifier.scenarios.arm.robots import ARMS, PANDA, UR5, UR10, Arm
from noiseclassifier.scenarios.humanoid.robots import G1, HUMANOIDS, TALOS, Humanoid
from noiseclassifier.scenarios.quadruped.robots import ANYMAL, GO2, QUADRUPEDS, SOLO12, Quadruped

Simulated: TypeAlias = Arm | Humanoid | Quadruped
"""A robot of any family."""

_ROBOTS: tuple[Simulated, ...] = (TALOS, G1, GO2, SOLO12, ANYMAL, PANDA, UR5, UR10)

ROBOTS: Mapping[str, Simulated] = MappingProxyType({robot.name: robot for robot in _ROBOTS})
"""The robots that can be simulated, by name."""

WIDE: Mapping[str, Simulated] = MappingProxyType(
    {robot.name: robot for robot in (*ARMS, *QUADRUPEDS, *HUMANOIDS)}
)
"""All robots of the wide domains, by name."""

TARGETS = ("xarm7", "tiago_no_hand", "a1", "hyq", "talos")
"""Robots that nothing is learnt from, by choice or by licence (docs/robots.md)."""
