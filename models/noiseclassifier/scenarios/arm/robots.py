"""Arms that can be simulated, as data."""

import math
from dataclasses import dataclass, field
from typing import Any

from noiseclassifier.scenarios.defects.plan import Units
from noiseclassifier.scenarios.drivetrain import Drivetrain
from noiseclassifier.scenarios.shapes import Rod


@dataclass(frozen=True, kw_only=True)
class Arm:
    """An arm that picks from a table or moves in the air.

    Attributes:
        rest: Joint positions before it moves, in [rad]; the tool points down if it picks.
        table: Height of the table, in [m].
        reach: Ranges of x and of y of the places on the table, in [m]; None if it cannot pick.
        contact: Time constant of the tool's rubber tip, in [s].
        force_gain: Speed of the tool per error of the contact force, in [m/(s N)].
        force_filter: Time constant of the low-pass on the contact force, in [s].
        payload: Largest mass at the tool that the controller has no model of, in [kg].
        force_noise: Largest standard deviation of the force sensor's noise, in [N].
    """

    name: str
    drives: Drivetrain
    tool: Rod
    rest: tuple[float, ...]
    table: float = 0.0
    reach: tuple[tuple[float, float], tuple[float, float]] | None = None
    contact: float = 0.015
    force_gain: float = 1e-3
    force_filter: float = 0.005
    payload: float = 0.3
    force_noise: float = 0.4
    held: dict[str, float] = field(default_factory=dict)
    units: Units = field(default_factory=Units)
    length_scale: float = 1.0

    @property
    def family(self) -> str:
        """The family of robots, which has its own scenarios."""
        return "arm"

    @property
    def effectors(self) -> tuple[Rod, ...]:
        """The parts that may be in contact with the environment."""
        return (self.tool,)


PANDA = Arm(
    name="panda",
    drives=Drivetrain(
        joints=tuple(f"panda_joint{number}" for number in range(1, 8)),
        stiffness=(3000.0,) * 4 + (1000.0,) * 3,
        damping=(60.0,) * 4 + (15.0,) * 3,
        torque=(87.0,) * 4 + (12.0,) * 3,
        armature=(0.3,) * 4 + (0.1,) * 3,
        friction=(0.6,) * 4 + (0.3,) * 3,
        viscous=(0.5,) * 7,
    ),
    tool=Rod(frame="panda_hand", length=0.08, radius=0.01),
    rest=(0.0, -0.3, 0.0, -2.2, 0.0, 1.9, 0.785),
    table=0.1,
    reach=((0.4, 0.58), (-0.2, 0.2)),
    contact=0.015,
    force_gain=1.2e-3,
    force_filter=0.005,
)

_UR = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)

UR5 = Arm(
    name="ur5",
    drives=Drivetrain(
        joints=_UR,
        stiffness=(4000.0,) * 3 + (1000.0,) * 3,
        damping=(80.0,) * 3 + (15.0,) * 3,
        torque=(150.0,) * 3 + (28.0,) * 3,
        armature=(1.0,) * 3 + (0.2,) * 3,
        friction=(3.0,) * 3 + (0.6,) * 3,
        viscous=(1.0,) * 3 + (0.5,) * 3,
    ),
    tool=Rod(frame="tool0", length=0.08, radius=0.01),
    rest=(0.0, -1.4, 1.7, -1.87, -1.571, 0.0),
    table=0.1,
    reach=((0.4, 0.58), (-0.2, 0.2)),
    contact=0.015,
    force_gain=8e-4,
    force_filter=0.005,
)

UR10 = Arm(
    name="ur10",
    drives=Drivetrain(
        joints=_UR,
        stiffness=(10000.0,) * 3 + (2000.0,) * 3,
        damping=(200.0,) * 3 + (30.0,) * 3,
        torque=(330.0,) * 3 + (54.0,) * 3,
        armature=(2.0,) * 3 + (0.4,) * 3,
        friction=(6.0,) * 3 + (1.2,) * 3,
        viscous=(2.0,) * 3 + (1.0,) * 3,
    ),
    tool=Rod(frame="tool0", length=0.08, radius=0.01),
    rest=(0.0, -1.5, 1.8, -1.87, -1.571, 0.0),
    table=0.1,
    reach=((0.6, 0.8), (-0.25, 0.25)),
    contact=0.015,
    force_gain=8e-4,
    force_filter=0.005,
)


def nominal(
    joints: tuple[str, ...], inertia: tuple[float, ...], torque: tuple[float, ...]
) -> Drivetrain:
    """Nominal drives of an arm of which no better ones are known.

    Inertia and friction of drives grow with their torque, as those above do; gains give each joint
    alone, with all others at rest, a natural frequency of 8 Hz and half the critical damping.

    Args:
        inertia: Inertia that each joint moves at rest, in [kg m²].
        torque: Limit of each drive, in [N m].
    """
    rate = 2 * math.pi * 8.0
    armature = tuple(0.005 * one for one in torque)
    moved = tuple(link + drive for link, drive in zip(inertia, armature, strict=True))
    return Drivetrain(
        joints=joints,
        stiffness=tuple(rate**2 * one for one in moved),
        damping=tuple(rate * one for one in moved),
        torque=torque,
        armature=armature,
        friction=tuple(0.01 * one for one in torque),
        viscous=tuple(0.006 * one for one in torque),
    )


def _numbered(pattern: str, count: int) -> tuple[str, ...]:
    return tuple(pattern.format(number) for number in range(1, count + 1))


def _arm(name: str, drives: Drivetrain, capacity: float, tool: Rod, **settings: Any) -> Arm:
    """An arm by its drives, and the force at the tool, in any direction, that they bear at rest.

    Units of force and torque are 1 for Panda, which bears 47 N.
    """
    units = Units(force=capacity / 47.0, torque=max(drives.torque) / max(PANDA.drives.torque))
    return Arm(
        name=name,
        drives=drives,
        tool=tool,
        units=units,
        payload=0.3 * units.force,
        force_noise=0.4 * units.force,
        **settings,
    )


XARM7 = _arm(
    "xarm7",
    nominal(
        _numbered("joint{}", 7),
        inertia=(0.4, 0.91, 0.53, 0.45, 0.004, 0.012, 0.0),
        torque=(50.0, 50.0, 30.0, 30.0, 30.0, 20.0, 20.0),
    ),
    37.0,
    Rod(frame="link_eef", length=0.08, radius=0.01),
    rest=(0.0, -0.262, 0.0, 0.982, 0.0, 1.244, 0.0),
    table=0.1,
    reach=((0.34, 0.48), (-0.18, 0.18)),
    force_gain=8e-4,
)

UR3 = _arm(
    "ur3",
    nominal(
        _UR,
        inertia=(0.21, 0.39, 0.13, 0.008, 0.003, 0.001),
        torque=(56.0, 56.0, 28.0, 12.0, 12.0, 12.0),
    ),
    67.0,
    Rod(frame="tool0", length=0.06, radius=0.01),
    rest=(-0.359, -1.566, 1.583, -1.588, -1.571, 1.45),
    table=0.05,
    reach=((0.24, 0.38), (-0.15, 0.15)),
    force_gain=8e-4,
)

BAXTER = _arm(
    "baxter",
    nominal(
        ("left_s0", "left_s1", "left_e0", "left_e1", "left_w0", "left_w1", "left_w2"),
        inertia=(2.09, 2.3, 0.86, 0.62, 0.104, 0.093, 0.041),
        torque=(80.0, 80.0, 50.0, 50.0, 15.0, 15.0, 15.0),
    ),
    31.0,
    Rod(frame="left_gripper", length=0.08, radius=0.01),
    rest=(-0.648, -1.184, 0.008, 1.275, -0.003, 1.479, 0.0),
    table=-0.05,
    reach=((0.6, 0.75), (0.2, 0.5)),
    force_gain=8e-4,
)

KINOVA = _arm(
    "kinova",
    nominal(
        _numbered("j2s6s200_joint_{}", 6),
        inertia=(0.32, 0.69, 0.24, 0.028, 0.031, 0.001),
        torque=(40.0, 80.0, 40.0, 20.0, 20.0, 20.0),
    ),
    69.0,
    Rod(frame="j2s6s200_end_effector", length=0.05, radius=0.01),
    rest=(1.16, 3.03, 5.0, -0.69, 4.37, 0.27),
)

Z1 = _arm(
    "z1",
    nominal(
        _numbered("joint{}", 6),
        inertia=(0.28, 0.63, 0.27, 0.053, 0.022, 0.001),
        torque=(30.0, 60.0, 30.0, 30.0, 30.0, 30.0),
    ),
    64.0,
    Rod(frame="link06", length=0.05, radius=0.01),
    rest=(0.0, 1.6, -1.5, 0.5, 0.0, 0.0),
)

_SO = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")

SO100 = _arm(
    "so100",
    nominal(_SO, inertia=(0.012, 0.012, 0.007, 0.001, 0.0, 0.0), torque=(3.0,) * 6),
    11.0,
    Rod(frame="jaw", length=0.03, radius=0.005),
    rest=(0.0, 1.8, -1.6, 0.6, 0.0, 0.3),
)

SO101 = _arm(
    "so101",
    nominal(_SO, inertia=(0.01, 0.01, 0.008, 0.001, 0.0, 0.0), torque=(3.0,) * 6),
    8.0,
    Rod(frame="gripper_frame_link", length=0.03, radius=0.005),
    rest=(0.0, -0.3, 0.4, 0.6, 0.0, 0.3),
)

TIAGO = _arm(
    "tiago_no_hand",
    nominal(
        _numbered("arm_{}_joint", 7),
        inertia=(1.1, 0.68, 0.19, 0.17, 0.001, 0.001, 0.0),
        torque=(39.0, 39.0, 18.0, 18.0, 7.0, 7.0, 7.0),
    ),
    37.0,
    Rod(frame="arm_tool_link", length=0.05, radius=0.01),
    rest=(0.67, 0.42, -2.15, 1.35, 0.79, -0.66, 1.23),
)

TIAGO_PRO = _arm(
    "tiago_pro",
    nominal(
        _numbered("arm_left_{}_joint", 7),
        inertia=(0.68, 0.38, 0.3, 0.27, 0.015, 0.016, 0.001),
        torque=(43.0, 43.0) + (26.0,) * 5,
    ),
    64.0,
    Rod(frame="arm_left_tool_link", length=0.05, radius=0.01),
    rest=(2.38, -1.23, -1.78, -1.76, -2.4, 2.25, 0.0),
)

ARMS = (
    PANDA, UR3, UR5, UR10, KINOVA, XARM7, Z1, SO100, SO101, TIAGO, TIAGO_PRO, BAXTER,
)  # fmt: skip
"""All arms; those that cannot pick have no ``reach``."""
