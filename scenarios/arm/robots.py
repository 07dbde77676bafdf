"""Arms that can be simulated, as data."""

from dataclasses import dataclass, field

from scenarios.drivetrain import Drivetrain
from scenarios.shapes import Rod


@dataclass(frozen=True, kw_only=True)
class Arm:
    """An arm that picks from a table.

    Attributes:
        name: Its name in ``noisemodel.ROBOTS``.
        drives: Its drives, in the order of the URDF's joints.
        tool: The rod that it holds.
        rest: Joint positions before it moves, the tool pointing down, in [rad].
        table: Height of the table, in [m].
        reach: Ranges of x and of y of the places on the table, in [m].
        contact: Time constant of the tool's rubber tip, in [s].
        force_gain: Speed of the tool per error of the contact force, in [m/(s N)].
        force_filter: Time constant of the low-pass on the contact force, in [s].
        payload: Largest mass at the tool that the controller has no model of, in [kg].
        force_noise: Largest standard deviation of the force sensor's noise, in [N].
        held: Positions of the locked joints that are not at zero, by name.
        length_scale: Scale of all lengths of the URDF.
    """

    name: str
    drives: Drivetrain
    tool: Rod
    rest: tuple[float, ...]
    table: float
    reach: tuple[tuple[float, float], tuple[float, float]]
    contact: float
    force_gain: float
    force_filter: float
    payload: float = 0.3
    force_noise: float = 0.4
    held: dict[str, float] = field(default_factory=dict)
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
