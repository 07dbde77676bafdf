"""State estimate of a quadruped: low-passed sensors, and corrections towards its plan."""

from math import asin, atan2, cos, sin

import numpy as np

from noiseclassifier.scenarios.clock import TICK
from noiseclassifier.scenarios.quadruped.robots import Quadruped
from noisemodel.types import Array

POSITION_GAIN = 1.0
"""Rate of the correction per distance from the planned path, in [1/s]."""
VELOCITY_FILTER = 0.05
"""Time constant of the low-pass on the measured velocity, in [s]."""
LOWEST, STEEPEST = 0.5, 0.7
"""Share of its height below which, and tilt above which, in [rad], the robot has fallen."""


class StateEstimate:
    """State estimate, updated once per tick.

    Attributes:
        roll: Low-passed, less the planned one, in [rad].
        pitch: Low-passed, less the planned one, in [rad].
        slip: Low-passed velocity of the centre of mass less the planned one, shape (2,), in [m/s].
        position_correction: Correction of the path towards the plan, shape (2,), in [m].
        yaw_correction: Correction of the direction towards the plan, in [rad].
        force: Low-passed contact forces, shape (feet,), in [N].
    """

    def __init__(self, robot: Quadruped, sensors: dict[str, slice]) -> None:
        self._where = sensors
        self._tilt_share = _share(robot.attitude_filter)
        self._force_share = _share(robot.force_filter)
        self._slip_share = _share(VELOCITY_FILTER)
        self.roll = self.pitch = self.yaw_correction = 0.0
        self.slip, self.position_correction = np.zeros(2), np.zeros(2)
        self.force = np.zeros(len(robot.feet))

    def update(
        self, sensors: Array, *, place: Array, velocity: Array, yaw: float, tilt: Array
    ) -> None:
        """Update the estimate with the sensors of one tick.

        Args:
            place: Planned position of the centre of mass, shape (2,), in [m].
            velocity: Its planned velocity, shape (2,), in [m/s].
            yaw: The planned direction of the body, in [rad].
            tilt: Its planned roll and pitch, shape (2,), in [rad].
        """
        rolled, pitched = tilt.tolist()
        w, x, y, z = sensors[self._where["base.turn"]].tolist()
        roll = atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        pitch = asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
        off = yaw - atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        self.roll += self._tilt_share * (roll - rolled - self.roll)
        self.pitch += self._tilt_share * (pitch - pitched - self.pitch)
        self.yaw_correction += TICK * POSITION_GAIN * atan2(sin(off), cos(off))
        self.position_correction += (
            TICK * POSITION_GAIN * (place - sensors[self._where["centre.place"]][:2])
        )
        slip = sensors[self._where["centre.velocity"]][:2] - velocity
        self.slip += self._slip_share * (slip - self.slip)
        self.force += self._force_share * (sensors[: len(self.force)] - self.force)

    def fallen(self, sensors: Array, height: float) -> bool:
        """Whether the robot is too low for its height, or too much tilted."""
        _, x, y, _ = sensors[self._where["base.turn"]].tolist()
        low = float(sensors[self._where["centre.place"]][2]) < LOWEST * height
        return low or 1 - 2 * (x * x + y * y) < cos(STEEPEST)


def _share(time_constant: float) -> float:
    """Gain of a first-order low-pass per tick."""
    return TICK / (time_constant + TICK)
