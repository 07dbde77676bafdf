"""Physical properties of a simulation that a URDF lacks."""

from dataclasses import dataclass

from noisemodel.types import Array


@dataclass(frozen=True, kw_only=True)
class Physics:
    """Physical properties that a URDF lacks.

    Attributes:
        timestep: In [s].
        armature: Inertia of each drive at its joint, shape (joints,), in [kg m²] or [kg].
        damping: Viscous friction of each joint, shape (joints,), in [N m s] or [N s/m].
        friction: Coulomb friction of each joint, shape (joints,), in [N m] or [N].
        contact: Time constant of a contact, in [s].
    """

    timestep: float
    armature: Array
    damping: Array
    friction: Array
    contact: float = 0.005
    grip: float = 0.8
