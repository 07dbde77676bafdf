"""Imperfections of every robot, healthy ones too: drawn once per seed."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from noisemodel.types import Array


@dataclass(frozen=True, kw_only=True)
class Imperfections:
    """Deviations of one robot from its model; scales multiply the nominal values.

    Attributes:
        payload: Mass unknown to the controller, in [kg].
        encoder_noise: Standard deviation of the encoders' noise, in [rad].
        encoder_bandwidth: Natural frequency of the filter that reports velocities, in [Hz].
        force_noise: Standard deviation of the force sensors' noise per millisecond, in [N].
    """

    stiffness: tuple[float, ...]
    damping: tuple[float, ...]
    force_gain: float
    mass: tuple[float, ...]
    payload: float
    friction: tuple[float, ...]
    viscous: tuple[float, ...]
    encoder_bits: int
    encoder_noise: float
    encoder_bandwidth: float
    force_noise: float
    torque_delay: int

    @classmethod
    def draw(
        cls, rng: np.random.Generator, joints: int, *, bodies: int, payload: float, force: float
    ) -> Self:
        """Draw the imperfections of one robot.

        Args:
            payload: Largest mass that the controller has no model of, in [kg].
            force: Largest standard deviation of the force sensors' noise, in [N].
        """

        def scales(spread: float, count: int = joints) -> tuple[float, ...]:
            return tuple(rng.uniform(1 - spread, 1 + spread, count).tolist())

        return cls(
            stiffness=scales(0.05),
            damping=scales(0.05),
            force_gain=float(rng.uniform(0.95, 1.05)),
            mass=scales(0.05, bodies),
            payload=float(rng.uniform(0.0, payload)),
            friction=scales(0.5),
            viscous=scales(0.5),
            encoder_bits=int(rng.integers(21, 24)),
            encoder_noise=float(rng.uniform(0.2e-6, 1e-6)),
            encoder_bandwidth=float(rng.uniform(400, 700)),
            force_noise=float(rng.uniform(force / 4, force)),
            torque_delay=int(rng.integers(2, 7)),
        )

    @property
    def encoder_step(self) -> float:
        """Resolution of an encoder, in [rad]."""
        return float(2 * np.pi / 2**self.encoder_bits)


def real_model(model: Any, frame: str, point: Array, imperfections: Imperfections) -> Any:
    """A robot's model with its real masses, unknown to its controller.

    Args:
        point: Where it hangs, in the frame's axes, shape (3,), in [m].
    """
    import pinocchio as pin

    real = model.copy()
    for index, scale in enumerate(imperfections.mass, start=1):
        given = model.inertias[index]
        real.inertias[index] = pin.Inertia(given.mass * scale, given.lever, given.inertia * scale)
    holder = model.frames[model.getFrameId(frame)]
    real.appendBodyToJoint(
        holder.parentJoint,
        pin.Inertia.FromSphere(imperfections.payload, 0.02),
        holder.placement * pin.SE3(np.eye(3), point),
    )
    return real
