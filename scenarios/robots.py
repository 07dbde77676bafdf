"""The robots that can be simulated, as data."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from scenarios.shapes import Rod


@dataclass(frozen=True, kw_only=True)
class Arm:
    """An arm that picks from a table.

    Attributes:
        name: Its name in ``noisemodel.ROBOTS``.
        joints: The joints that move; all others are locked.
        tool: The rod that it holds.
        rest: Joint positions before it moves, the tool pointing down, in [rad].
        stiffness: Position gain of each drive, in [N m/rad].
        damping: Velocity gain of each drive, in [N m s/rad].
        torque: Limit of each drive, in [N m].
        armature: Inertia of each drive as its joint sees it, in [kg m²].
        friction: Coulomb friction of each joint, in [N m].
        viscous: Viscous friction of each joint, in [N m s/rad].
        table: Height of the table, in [m].
        reach: Ranges of x and of y of the places on the table, in [m].
        contact: Time constant of the tool's rubber tip, in [s].
        force_gain: Speed of the tool per error of the contact force, in [m/(s N)].
        force_filter: Time constant of the low-pass on the contact force, in [s].
    """

    name: str
    joints: tuple[str, ...]
    tool: Rod
    rest: tuple[float, ...]
    stiffness: tuple[float, ...]
    damping: tuple[float, ...]
    torque: tuple[float, ...]
    armature: tuple[float, ...]
    friction: tuple[float, ...]
    viscous: tuple[float, ...]
    table: float
    reach: tuple[tuple[float, float], tuple[float, float]]
    contact: float
    force_gain: float
    force_filter: float

    @property
    def family(self) -> str:
        """The kind of robot: what its scenarios can ask of it."""
        return "arm"


PANDA = Arm(
    name="panda",
    joints=tuple(f"panda_joint{number}" for number in range(1, 8)),
    tool=Rod(frame="panda_hand", length=0.08, radius=0.01),
    rest=(0.0, -0.3, 0.0, -2.2, 0.0, 1.9, 0.785),
    stiffness=(3000.0,) * 4 + (1000.0,) * 3,
    damping=(60.0,) * 4 + (15.0,) * 3,
    torque=(87.0,) * 4 + (12.0,) * 3,
    armature=(0.3,) * 4 + (0.1,) * 3,
    friction=(0.6,) * 4 + (0.3,) * 3,
    viscous=(0.5,) * 7,
    table=0.1,
    reach=((0.4, 0.58), (-0.2, 0.2)),
    contact=0.015,
    force_gain=1.2e-3,
    force_filter=0.005,
)

ROBOTS: Mapping[str, Arm] = MappingProxyType({robot.name: robot for robot in (PANDA,)})
"""What can be simulated, by name."""
