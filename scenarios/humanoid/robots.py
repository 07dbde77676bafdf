"""Humanoids that can be simulated, as data."""

from dataclasses import dataclass, field

from scenarios.drivetrain import Drivetrain
from scenarios.shapes import Sole


@dataclass(frozen=True, kw_only=True)
class Gains:
    """Gains of a stabilizer.

    Attributes:
        capture: Shift of the zero-moment point per error of the capture point.
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
    """A humanoid that walks on two soles, its upper body held still.

    Attributes:
        name: Its name in ``noisemodel.ROBOTS``.
        drives: Its drives, in the order of the URDF's joints: left leg, right leg.
        effectors: Left and right sole.
        rest: Joint positions near those in which it stands, in [rad].
        centre: Height of the centre of mass over the soles, in [m].
        apart: Half of the distance between the feet, in [m].
        stride: Longest step forwards and sideways, in [m], and its turn, in [rad].
        pace: Duration of its steps, relative to that of the motion.
        gains: Of its stabilizer.
        carrier: Frame that carries the payload.
        payload: Largest mass that the controller has no model of, in [kg].
        force_noise: Largest standard deviation of the force sensors' noise, in [N].
        size: Its size, relative to that which the defects of the scenarios are defined for.
        held: Positions of the locked joints that are not at zero, by name.
        length_scale: Scale of all lengths of the URDF.
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
