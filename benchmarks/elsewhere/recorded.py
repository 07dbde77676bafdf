"""What a simulator elsewhere returns, and why it may not."""

from dataclasses import dataclass

import numpy as np

from noiseclassifier.scenarios.motions import Event
from noisemodel.types import Array

FASTEST = 60.0  # joint speed beyond which a simulation has diverged, in [rad/s]


class DroppedError(Exception):
    """A run that is not kept, such as one in which the robot fell."""


@dataclass(frozen=True, eq=False)
class Recorded:
    """Simulated motion, without sensors."""

    position: Array  # joint positions, shape (samples, joints), in [rad]
    velocity: Array  # joint velocities, shape (samples, joints), in [rad/s]
    effort: Array  # joint torques, shape (samples, joints), in [N m]
    events: tuple[Event, ...] = ()

    def checked(self, rate: float) -> "Recorded":
        """The same."""
        wild = ~(np.abs(self.velocity) < FASTEST).all(axis=1)
        if wild.any():
            raise DroppedError(f"diverged after {np.argmax(wild) / rate:.2f} s")
        return self
