"""Drives of a robot: from encoder readings to velocities and torques."""

from collections import deque

import numpy as np

from noiseclassifier.scenarios.imperfections import Imperfections
from noisemodel.types import Array


def tracking_gains(bandwidth: float, step: float) -> tuple[float, float]:
    """Gains of the filter that estimates velocities from an encoder.

    At 10 kHz, differences of encoder counts would mask every motion; servo drives track their
    encoders instead. This is the critically damped alpha-beta filter: it predicts, and corrects
    position and velocity by a share of the innovation.

    Args:
        bandwidth: Natural frequency, in [Hz].
        step: Time between two readings, in [s].

    Returns:
        Share of the innovation that corrects the position, and its multiple that corrects the
        velocity, in [1/s]; both poles lie at exp(-2 pi bandwidth step).
    """
    pole = float(np.exp(-2 * np.pi * bandwidth * step))
    return 1 - pole**2, (1 - pole) ** 2 / step


class Drives:
    """The drives of all joints, one sample after the other.

    Args:
        start: Joint positions at rest, shape (joints,), in [rad].
        stiffness: Position gains, shape (joints,), in [N m/rad].
        damping: Velocity gains, shape (joints,), in [N m s/rad].
        limit: Largest torques, shape (joints,), in [N m].
        offset: Encoder error at rest, shape (joints,), in [rad].
        step: Time between two samples, in [s].
    """

    def __init__(
        self,
        start: Array,
        *,
        stiffness: Array,
        damping: Array,
        limit: Array,
        offset: Array,
        imperfections: Imperfections,
        step: float,
    ) -> None:
        self._stiffness, self._damping = stiffness, damping
        self._least, self._limit = -limit, limit
        self._count = imperfections.encoder_step
        self._step = step
        self._alpha, self._beta = tracking_gains(imperfections.encoder_bandwidth, step)
        self._tracked, self._velocity = start + offset, np.zeros_like(start)
        self._waiting: deque[Array] = deque(
            [np.zeros_like(start)] * imperfections.torque_delay, imperfections.torque_delay
        )

    def read(self, position: Array, error: Array) -> tuple[Array, Array]:
        """Readings of all encoders.

        Args:
            position: True joint positions, shape (joints,), in [rad].
            error: Error of the encoders, shape (joints,), in [rad].

        Returns:
            Positions, in [rad], and velocities, in [rad/s], as the drives report them.
        """
        reading = np.rint((position + error) / self._count) * self._count
        predicted = self._tracked + self._step * self._velocity
        innovation = reading - predicted
        self._tracked = predicted + self._alpha * innovation
        self._velocity = self._velocity + self._beta * innovation
        return reading, self._velocity

    def command(self, targets: Array, rates: Array, torque: Array) -> tuple[Array, Array, Array]:
        """What the drives follow over one tick.

        Args:
            targets: Positions of the reference, shape (samples, joints), in [rad].
            rates: Velocities of the reference, shape (samples, joints), in [rad/s].
            torque: Torques of the model, shape (joints,), in [N m].
        """
        return targets, rates, torque

    def torque(
        self, position: Array, velocity: Array, desired: Array, rate: Array, feedforward: Array
    ) -> Array:
        """Torques that act now, after the delay of the drives.

        Args:
            position: Positions read, shape (joints,), in [rad].
            velocity: Velocities reported, shape (joints,), in [rad/s].
            desired: Positions to follow, shape (joints,), in [rad].
            rate: Velocities to follow, shape (joints,), in [rad/s].
            feedforward: Torques of the model, shape (joints,), in [N m].

        Returns:
            Torques that act now, shape (joints,), in [N m].
        """
        demanded = feedforward + self._stiffness * (desired - position)
        demanded += self._damping * (rate - velocity)
        return self._delayed(demanded)

    def measured(self, acting: Array) -> Array:
        """Torques that the drives measure while some act, shape (joints,), in [N m]: the same."""
        return acting

    def _delayed(self, demanded: Array) -> Array:
        """Torques demanded before the delay, within the limits."""
        acting = self._waiting.popleft()
        self._waiting.append(np.minimum(np.maximum(demanded, self._least), self._limit))
        return acting
