"""Quadrupeds that can be simulated, as data."""

from dataclasses import dataclass, field
from math import sqrt

from noiseclassifier.scenarios.drivetrain import Drivetrain
from noiseclassifier.scenarios.shapes import Ball


@dataclass(frozen=True, kw_only=True)
class Quadruped:
    """A robot on four legs with round feet.

    Attributes:
        rest: Joint positions when it stands, in [rad].
        period: Nominal time of a cycle, in which each foot steps once, in [s].
        height: Nominal height of a swing, in [m].
        speed: Highest speed ahead, in [m/s].
        turning: Highest speed of turning, in [rad/s].
        attitude_filter: Time constant of the low-pass on the attitude, in [s].
        force_gain: Speed of a foot per error of its contact force, in [m/(s N)].
        force_filter: Time constant of the low-pass on the contact forces, in [s].
        payload: Largest mass on its back that the controller has no model of, in [kg].
        force_noise: Largest standard deviation of the force sensors' noise, in [N].
    """

    name: str
    drives: Drivetrain
    feet: tuple[Ball, Ball, Ball, Ball]
    rest: tuple[float, ...]
    period: float
    height: float
    speed: float
    turning: float
    attitude_gain: float
    attitude_filter: float
    force_gain: float
    force_filter: float
    payload: float
    force_noise: float
    held: dict[str, float] = field(default_factory=dict)
    length_scale: float = 1.0

    @property
    def family(self) -> str:
        """The family of robots, which has its own scenarios."""
        return "quadruped"

    @property
    def effectors(self) -> tuple[Ball, ...]:
        """The parts that may be in contact with the environment."""
        return self.feet


def _joints(legs: str, parts: str) -> tuple[str, ...]:
    return tuple(f"{leg}_{part}" for leg in legs.split() for part in parts.split())


def _feet(names: str, radius: float) -> tuple[Ball, Ball, Ball, Ball]:
    front_left, front_right, rear_left, rear_right = (Ball(name, radius) for name in names.split())
    return front_left, front_right, rear_left, rear_right


GO2 = Quadruped(
    name="go2",
    drives=Drivetrain(
        joints=_joints("FL FR RL RR", "hip_joint thigh_joint calf_joint"),
        stiffness=(300.0,) * 12,
        damping=(6.0,) * 12,
        torque=(23.7, 23.7, 45.4) * 4,
        armature=(0.02,) * 12,
        friction=(0.2,) * 12,
        viscous=(0.05,) * 12,
    ),
    feet=_feet("FL_foot FR_foot RL_foot RR_foot", 0.022),
    rest=(0.0, 0.8, -1.6) * 4,
    period=0.46,
    height=0.06,
    speed=0.45,
    turning=0.5,
    attitude_gain=0.6,
    attitude_filter=0.01,
    force_gain=2e-4,
    force_filter=0.01,
    payload=0.5,
    force_noise=1.0,
)

SOLO12 = Quadruped(
    name="solo12",
    drives=Drivetrain(
        joints=_joints("FL FR HL HR", "HAA HFE KFE"),
        stiffness=(30.0,) * 12,
        damping=(0.4,) * 12,
        torque=(8.0,) * 12,
        armature=(0.005,) * 12,
        friction=(0.02,) * 12,
        viscous=(0.01,) * 12,
    ),
    feet=_feet("FL_FOOT FR_FOOT HL_FOOT HR_FOOT", 0.016),
    rest=(0.0, 0.8, -1.6) * 4,
    period=0.4,
    height=0.045,
    speed=0.25,
    turning=0.5,
    attitude_gain=0.6,
    attitude_filter=0.01,
    force_gain=1e-3,
    force_filter=0.01,
    payload=0.08,
    force_noise=0.15,
)

ANYMAL = Quadruped(
    name="anymal",
    drives=Drivetrain(
        joints=_joints("LF LH RF RH", "HAA HFE KFE"),
        stiffness=(800.0,) * 12,
        damping=(15.0,) * 12,
        torque=(80.0,) * 12,
        armature=(0.1,) * 12,
        friction=(0.5,) * 12,
        viscous=(0.2,) * 12,
    ),
    feet=_feet("LF_FOOT RF_FOOT LH_FOOT RH_FOOT", 0.031),
    rest=(0.0, 0.7, -1.4, 0.0, -0.7, 1.4) * 2,
    period=0.55,
    height=0.08,
    speed=0.5,
    turning=0.5,
    attitude_gain=0.6,
    attitude_filter=0.01,
    force_gain=2e-4,
    force_filter=0.01,
    payload=1.0,
    force_noise=2.0,
)


def _similar(
    name: str,
    joints: tuple[str, ...],
    feet: str,
    *,
    mass: float,
    leg: float,
    rest: tuple[float, ...] = GO2.rest,
    torque: tuple[float, ...] = (),
    held: dict[str, float] | None = None,
) -> Quadruped:
    """A robot that is dynamically similar to Go2, at equal Froude numbers.

    Lengths grow with the leg, forces with the mass, times with the square root of the leg
    (Alexander and Jayes, A dynamic similarity hypothesis for the gaits of quadrupedal mammals, J.
    Zoology 1983); gains, limits and losses follow from their units.

    Args:
        mass: Of the whole robot, in [kg].
        leg: Length of thigh and shank, in [m].
        rest: Joint positions when it stands, in [rad].
        torque: Limits of the drives of one leg, in [N m]; by default similar ones.
    """
    length, force = leg / _GO2_LEG, mass / _GO2_MASS
    time, moment = sqrt(length), force * length
    drives, count = GO2.drives, len(joints)
    limits = torque * 4 or tuple(moment * limit for limit in drives.torque)
    return Quadruped(
        name=name,
        drives=Drivetrain(
            joints=joints,
            stiffness=(moment * drives.stiffness[0],) * count,
            damping=(moment * time * drives.damping[0],) * count,
            torque=limits,
            armature=(moment * length * drives.armature[0],) * count,
            friction=(moment * drives.friction[0],) * count,
            viscous=(moment * time * drives.viscous[0],) * count,
        ),
        feet=_feet(feet, length * GO2.feet[0].radius),
        rest=rest,
        period=time * GO2.period,
        height=length * GO2.height,
        speed=length / time * GO2.speed,
        turning=GO2.turning / time,
        attitude_gain=GO2.attitude_gain,
        attitude_filter=GO2.attitude_filter,
        force_gain=length / time / force * GO2.force_gain,
        force_filter=GO2.force_filter,
        payload=force * GO2.payload,
        force_noise=force * GO2.force_noise,
        held=held or {},
    )


_GO2_LEG, _GO2_MASS = 0.426, 16.085
_UNITREE = "FL_foot FR_foot RL_foot RR_foot"
_ANYBOTICS = "LF_FOOT RF_FOOT LH_FOOT RH_FOOT"
_INWARD = (0.0, 0.75, -1.5, 0.0, -0.75, 1.5) * 2
"""Knees of the front legs to the rear, those of the rear legs to the front."""

A1 = _similar("a1", GO2.drives.joints, _UNITREE, mass=13.741, leg=0.4, torque=(33.5,) * 3)
GO1 = _similar(
    "go1", GO2.drives.joints, _UNITREE, mass=13.101, leg=0.426, torque=(23.7, 23.7, 35.55)
)
B1 = _similar("b1", GO2.drives.joints, _UNITREE, mass=55.689, leg=0.7, torque=(91.0, 93.3, 140.0))
LAIKAGO = _similar("laikago", GO2.drives.joints, _UNITREE, mass=25.433, leg=0.5)
ANYMAL_C = _similar(
    "anymal_c", ANYMAL.drives.joints, _ANYBOTICS, mass=52.135, leg=0.6516, rest=_INWARD
)
HYQ = _similar(
    "hyq",
    _joints("lf lh rf rh", "haa_joint hfe_joint kfe_joint"),
    "lf_foot rf_foot lh_foot rh_foot",
    mass=86.774,
    leg=0.696,
    rest=_INWARD,
)
B1_Z1 = _similar(
    "b1_z1", GO2.drives.joints, _UNITREE, mass=60.910, leg=0.7, torque=(91.0, 93.3, 140.0)
)
ANYMAL_KINOVA = _similar(
    "anymal_kinova",
    ANYMAL.drives.joints,
    _ANYBOTICS,
    mass=35.693,
    leg=0.6098,
    rest=_INWARD,
    held={
        "j2s6s200_joint_2": 3.0,
        "j2s6s200_joint_3": 1.0,
        "j2s6s200_joint_5": 3.0,
    },
)

QUADRUPEDS = (GO2, SOLO12, ANYMAL, A1, GO1, B1, LAIKAGO, ANYMAL_C, HYQ, B1_Z1, ANYMAL_KINOVA)
"""Those that stand up in simulation."""
