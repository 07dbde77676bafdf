"""The drives of a robot, as data."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Drivetrain:
    """One drive per joint, nominal values.

    Attributes:
        stiffness: Position gain of each drive, in [N m/rad].
        damping: Velocity gain of each drive, in [N m s/rad].
        torque: Limit of each drive, in [N m].
        armature: Inertia of each drive at its joint, in [kg m²].
        friction: Coulomb friction of each joint, in [N m].
        viscous: Viscous friction of each joint, in [N m s/rad].
    """

    joints: tuple[str, ...]
    stiffness: tuple[float, ...]
    damping: tuple[float, ...]
    torque: tuple[float, ...]
    armature: tuple[float, ...]
    friction: tuple[float, ...]
    viscous: tuple[float, ...]
