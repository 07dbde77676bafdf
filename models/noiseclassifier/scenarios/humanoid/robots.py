"""Humanoids that can be simulated, as data."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from noiseclassifier.scenarios.drivetrain import Drivetrain
from noiseclassifier.scenarios.shapes import Sole

LEGS = 12
"""How many of a humanoid's drives, the first ones, are in its legs."""


@dataclass(frozen=True, kw_only=True)
class Gains:
    """Gains of a stabilizer.

    Attributes:
        integral: Its rate per error, in [1/s].
        tilt: Rate of a sole's tilt per error of its torque, in [rad/(s N m)].
        level: Rate at which soles return to level, in [1/s].
        height: Rate of the feet's difference in height per error of the difference of their
            forces, in [m/(s N)].
        even: Rate at which that difference decays, in [1/s].
        filter: Time constant of the low-pass on forces and torques, in [s].
    """

    capture: float = 2.0
    integral: float = 1.0
    tilt: float
    level: float = 0.5
    height: float
    even: float = 1.0
    filter: float = 0.02


@dataclass(frozen=True, kw_only=True)
class Humanoid:
    """A humanoid that walks on two soles.

    Attributes:
        rest: Joint positions near those in which it stands, in [rad].
        centre: Height of the centre of mass over the soles, in [m].
        apart: Half of the distance between the feet, in [m].
        stride: Longest step forwards and sideways, in [m], and its turn, in [rad].
        payload: Largest mass that the controller has no model of, in [kg].
        force_noise: Largest standard deviation of the force sensors' noise, in [N].
        reach: Largest deviation of each moving joint of the upper body from its rest, in [rad].
    """

    name: str
    drives: Drivetrain
    effectors: tuple[Sole, Sole]
    rest: tuple[float, ...]
    centre: float
    apart: float
    stride: tuple[float, float, float]
    pace: float = 1.0
    gains: Gains
    carrier: str
    payload: float
    force_noise: float
    size: float = 1.0
    held: dict[str, float] = field(default_factory=dict)
    reach: tuple[float, ...] = ()
    length_scale: float = 1.0

    @property
    def family(self) -> str:
        """The family of robots, which has its own scenarios."""
        return "humanoid"


TALOS = Humanoid(
    name="talos",
    drives=Drivetrain(
        joints=tuple(f"leg_{side}_{n}_joint" for side in ("left", "right") for n in range(1, 7)),
        stiffness=(10000.0,) * 12,
        damping=(150.0,) * 12,
        torque=(400.0,) * 12,
        armature=(0.3,) * 12,
        friction=(2.0,) * 12,
        viscous=(1.0,) * 12,
    ),
    effectors=(
        Sole("left_sole_link", (0.105, 0.0625)),
        Sole("right_sole_link", (0.105, 0.0625)),
    ),
    rest=(0.0, 0.0, -0.411, 0.859, -0.448, 0.0) * 2,
    centre=0.855,
    apart=0.085,
    stride=(0.3, 0.08, 0.15),
    gains=Gains(tilt=0.02, height=2e-4, filter=0.01),
    carrier="torso_2_link",
    payload=2.0,
    force_noise=2.0,
    held={
        "arm_left_1_joint": 0.258,
        "arm_left_2_joint": 0.173,
        "arm_left_4_joint": -0.525,
        "arm_right_1_joint": -0.258,
        "arm_right_2_joint": -0.173,
        "arm_right_4_joint": -0.525,
    },
)

_ANKLE_TO_SOLE = (0.035, 0.0, -0.035)

G1 = Humanoid(
    name="g1",
    drives=Drivetrain(
        joints=tuple(
            f"{side}_{joint}_joint"
            for side in ("left", "right")
            for joint in (
                "hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll",
            )
        ),
        stiffness=(3000.0,) * 12,
        damping=(40.0,) * 12,
        torque=(150.0,) * 12,
        armature=(0.1,) * 12,
        friction=(0.5,) * 12,
        viscous=(0.2,) * 12,
    ),
    effectors=(
        Sole("left_ankle_roll_link", (0.085, 0.03), _ANKLE_TO_SOLE, 0.01),
        Sole("right_ankle_roll_link", (0.085, 0.03), _ANKLE_TO_SOLE, 0.01),
    ),
    rest=(-0.35, 0.0, 0.0, 0.7, -0.35, 0.0) * 2,
    centre=0.65,
    apart=0.105,
    stride=(0.24, 0.06, 0.15),
    pace=0.75,
    gains=Gains(tilt=0.05, height=8e-4, filter=0.01),
    carrier="torso_link",
    payload=0.8,
    force_noise=0.8,
    size=0.75,
    held={
        "left_shoulder_pitch_joint": 0.2,
        "left_shoulder_roll_joint": 0.2,
        "left_elbow_joint": 0.6,
        "right_shoulder_pitch_joint": 0.2,
        "right_shoulder_roll_joint": -0.2,
        "right_elbow_joint": 0.6,
    },
)  # fmt: skip


TALOS_MASS = 90.3
"""In [kg]."""
UPPER = {
    "stiffness": 0.2, "damping": 0.2, "torque": 0.25,
    "armature": 0.2, "friction": 0.2, "viscous": 0.2,
}  # fmt: skip
"""Drives of an upper body, relative to those of the legs."""


def similar(name: str, mass: float, joints: tuple[str, ...], centre: float, **own: Any) -> Humanoid:
    """A humanoid with TALOS's drives, steps and stabilizer, scaled to its mass and height.

    Dynamic similarity: with lengths in proportion to the height of the centre of mass and times to
    the period of a pendulum of that length, two robots of one shape have the same motion (Alexander
    and Jayes, A dynamic similarity hypothesis for the gaits of quadrupedal mammals, J. Zool. 1983).

    Args:
        mass: In [kg].
        centre: Height of the centre of mass over the soles, in [m].
    """
    length, weight = centre / TALOS.centre, mass / TALOS_MASS
    time, torque = length**0.5, weight * length
    scales = {
        "stiffness": torque, "damping": torque * time, "torque": torque,
        "armature": torque * length, "friction": torque, "viscous": torque * time,
    }  # fmt: skip
    drives = {
        field: tuple(scale * value for value in getattr(TALOS.drives, field))
        for field, scale in scales.items()
    }
    along, across, turn = TALOS.stride
    return Humanoid(
        name=name,
        drives=Drivetrain(joints=joints, **drives),
        centre=centre,
        stride=(along * length, across * length, turn),
        pace=time,
        gains=replace(
            TALOS.gains,
            tilt=TALOS.gains.tilt / (torque * time),
            height=TALOS.gains.height * length / (weight * time),
        ),
        payload=TALOS.payload * weight,
        force_noise=TALOS.force_noise * weight,
        size=length,
        **own,
    )


def moving(robot: Humanoid, upper: Mapping[str, tuple[float, float]]) -> Humanoid:
    """The same humanoid with an upper body that moves.

    Args:
        upper: Rest and largest deviation of each joint of the upper body that is to move, in the
            order of the URDF's joints, in [rad].
    """
    drives = {
        field: (
            *getattr(robot.drives, field),
            *(share * getattr(robot.drives, field)[0],) * len(upper),
        )
        for field, share in UPPER.items()
    }
    rest, reach = zip(*upper.values(), strict=True)
    return replace(
        robot,
        drives=Drivetrain(joints=(*robot.drives.joints, *upper), **drives),
        rest=(*robot.rest, *rest),
        reach=reach,
        held={joint: angle for joint, angle in robot.held.items() if joint not in upper},
    )


def _sides(names: str, left: str, right: str) -> tuple[str, ...]:
    """Names with {} for the side, first of the left, then of the right one."""
    return tuple(name.format(side) for side in (left, right) for name in names.split())


_SWING = 0.5
"""Largest deviation of a shoulder or an elbow from its rest, in [rad]."""
_TWIST = 0.25
"""Largest deviation of a waist from its rest, in [rad]."""

G1_MOVING = moving(
    replace(G1, name="g1_with_hands"),
    {
        "waist_yaw_joint": (0.0, _TWIST),
        "left_shoulder_pitch_joint": (0.2, _SWING),
        "left_shoulder_roll_joint": (0.3, 0.25),
        "left_elbow_joint": (0.6, _SWING),
        "right_shoulder_pitch_joint": (0.2, _SWING),
        "right_shoulder_roll_joint": (-0.3, 0.25),
        "right_elbow_joint": (0.6, _SWING),
    },
)
ALEXANDER = moving(
    similar(
        "alexander",
        49.1,
        _sides("{}_HIP_X {}_HIP_Z {}_HIP_Y {}_KNEE_Y {}_ANKLE_Y {}_ANKLE_X", "LEFT", "RIGHT"),
        effectors=(
            Sole("LEFT_FOOT", (0.1, 0.045), (0.05, 0.0, -0.0715)),
            Sole("RIGHT_FOOT", (0.1, 0.045), (0.05, 0.0, -0.0715)),
        ),
        rest=(0.0, 0.0, -0.4, 0.8, -0.4, 0.0) * 2,
        centre=0.6,
        apart=0.11,
        carrier="TORSO_LINK",
    ),
    {"SPINE_Z": (0.0, 2 * _TWIST)},
)
# The inertias of Romeo's right arm are no body's (A + B < C): it is held, as a part of the trunk.
ROMEO = moving(
    similar(
        "romeo_small",
        40.5,
        _sides("{}HipYaw {}HipRoll {}HipPitch {}KneePitch {}AnklePitch {}AnkleRoll", "L", "R"),
        effectors=(
            Sole("l_sole", (0.095, 0.06), (0.024, 0.0075, 0.0)),
            Sole("r_sole", (0.095, 0.06), (0.024, -0.0075, 0.0)),
        ),
        rest=(0.0, 0.0, -0.4, 0.8, -0.4, 0.0) * 2,
        centre=0.65,
        apart=0.1,
        carrier="torso",
    ),
    {
        "TrunkYaw": (0.0, _TWIST),
        "LShoulderPitch": (1.3, _SWING),
        "LShoulderYaw": (0.3, 0.25),
        "LElbowYaw": (-0.7, _SWING),
    },
)
# Its arms are held: each of their links has an inertia of 1 kg m², too much for drives of an arm.
# It has no shapes; its soles are our choice.
SIMPLE = similar(
    "simple_humanoid",
    130.8,
    _sides("{}LEG_HIP_R {}LEG_HIP_P {}LEG_HIP_Y {}LEG_KNEE {}LEG_ANKLE_P {}LEG_ANKLE_R", "L", "R"),
    0.74,
    effectors=(
        Sole("l_ankle", (0.12, 0.06), (0.03, 0.0, -0.1)),
        Sole("r_ankle", (0.12, 0.06), (0.03, 0.0, -0.1)),
    ),
    rest=(0.0, -0.4, 0.0, 0.8, -0.4, 0.0) * 2,
    apart=0.09,
    carrier="torso",
    held={"LARM_ELBOW": -0.7, "RARM_ELBOW": -0.7},
)

HUMANOIDS = (TALOS, G1, G1_MOVING, ALEXANDER, ROMEO, SIMPLE)
"""All humanoids that can be simulated."""


def scaled(robot: Humanoid, factor: float) -> Humanoid:
    """The same humanoid with all lengths times a factor."""
    along, across, turn = robot.stride
    left, right = robot.effectors
    return replace(
        robot,
        effectors=(_scaled(left, factor), _scaled(right, factor)),
        centre=factor * robot.centre,
        apart=factor * robot.apart,
        stride=(factor * along, factor * across, turn),
        length_scale=factor * robot.length_scale,
    )


def _scaled(sole: Sole, factor: float) -> Sole:
    (along, across), (x, y, z) = sole.patch, sole.point
    return Sole(
        sole.frame,
        (factor * along, factor * across),
        (factor * x, factor * y, factor * z),
        factor * sole.thickness,
    )
