"""Quadrupeds that can be simulated, as data."""

from dataclasses import dataclass, field

from scenarios.drivetrain import Drivetrain
from scenarios.shapes import Ball


@dataclass(frozen=True, kw_only=True)
class Quadruped:
    """A robot on four legs with round feet.

    Attributes:
        name: Its name in ``noisemodel.ROBOTS``.
        drives: Its drives, in the order of the URDF's joints.
        feet: Its feet: front left, front right, rear left, rear right.
        rest: Joint positions when it stands, in [rad].
        period: Nominal time of a cycle, in which each foot steps once, in [s].
        height: Nominal height of a swing, in [m].
        speed: Highest speed ahead, in [m/s].
        turning: Highest speed of turning, in [rad/s].
        attitude_gain: Tilt of the base against its measured tilt, as a share of it.
        attitude_filter: Time constant of the low-pass on the attitude, in [s].
        force_gain: Speed of a foot per error of its contact force, in [m/(s N)].
        force_filter: Time constant of the low-pass on the contact forces, in [s].
        payload: Largest mass on its back that the controller has no model of, in [kg].
        force_noise: Largest standard deviation of the force sensors' noise, in [N].
        held: Positions of the locked joints that are not at zero, by name.
        length_scale: Scale of all lengths of the URDF.
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
