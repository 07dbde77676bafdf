"""The stabilizer: heights and tilts of the soles that keep a walking robot upright.

After Kajita et al., Biped walking stabilization based on linear inverted pendulum tracking, IROS
2010, and Caron et al., Stair climbing stabilization of the HRP-4 humanoid robot, ICRA 2019: the
error of the capture point moves the zero-moment point; the load of each sole follows; soles
comply until they bear it. Points of the plane are complex numbers here.
"""

from cmath import rect
from collections.abc import Mapping, Sequence
from math import atan2
from typing import Any

import numpy as np

from noiseclassifier.scenarios.clock import TICK
from noiseclassifier.scenarios.humanoid.plan import Plan
from noiseclassifier.scenarios.humanoid.robots import Gains
from noiseclassifier.scenarios.shapes import Sole
from noisemodel.types import Array

INSIDE = 0.77
"""Largest offset of the zero-moment point in a sole, as a share of its half extent."""
STEEPEST = 0.25
"""Largest tilt of a sole, in [rad]."""
FURTHEST = 0.04
"""Largest deviation of a foot from its plan in height, in [m]."""
DRIFT = 0.05
"""Largest integral of the capture point's error, in [m s]."""
TOUCH = 30.0
"""Force above which a sole is in contact, in [N]."""
FLAT = 5.0
"""Rate at which a sole in the air returns to its plan, in [1/s]."""


class Stabilizer:
    """Heights and tilts of the soles from plan and sensors, once per tick.

    Args:
        strength: Scale of the gains of the force control at each tick, shape (ticks,).
        weight: Weight of the nominal robot, in [N].
    """

    def __init__(
        self,
        plan: Plan,
        soles: Sequence[Sole],
        gains: Gains,
        *,
        strength: Array,
        weight: float,
        where: Mapping[str, slice],
    ) -> None:
        self._gains, self._strength, self._rate = gains, strength.tolist(), plan.rate
        self._share = TICK / (gains.filter + TICK)
        # Torques of a sole that bears the whole robot at its edge.
        self._most = [
            (weight * across, weight * along) for along, across in (sole.patch for sole in soles)
        ]
        self._reach = [[INSIDE * half for half in sole.patch] for sole in soles]
        velocity = np.gradient(plan.centre, TICK, axis=0)
        self._zmp: list[complex] = _points(plan.zmp)
        self._capture: list[complex] = _points(plan.centre + velocity / plan.rate)
        self._places: list[list[complex]] = _points(plan.places)
        self._yaws, self._heading = plan.yaws.tolist(), plan.heading.tolist()
        self._swinging = plan.swinging.tolist()
        self._bearing = [where[f"{sole.frame}.force"].start + 2 for sole in soles]
        self._turning = [where[f"{sole.frame}.torque"].start for sole in soles]
        self._standing = [where[f"{sole.frame}.place"].start for sole in soles]
        self._centre, self._moving = where["centre.place"].start, where["centre.velocity"].start
        self._turn = where["base.turn"].start
        self._drift = 0j
        self._errors = [[0.0, 0.0, 0.0] for _ in soles]
        self._tilts = [[0.0, 0.0] for _ in soles]
        self._height = 0.0

    def step(self, number: int, sensors: Array) -> tuple[list[float], list[list[float]]]:
        """Advance by one tick.

        Returns:
            Height of each sole over its plan, in [m], and its tilts about its own x and y axes,
            in [rad].
        """
        values = sensors.tolist()
        measured = [
            (-values[bearing], _within(-values[turning], x), _within(-values[turning + 1], y))
            for bearing, turning, (x, y) in zip(
                self._bearing, self._turning, self._most, strict=True
            )
        ]
        zmp = self._zmp[number]
        if number:  # there are no sensor values before the first tick
            zmp += self._correction(number, values)
        desired = self._desired(number, zmp, measured[0][0] + measured[1][0])
        gains, strength, swinging = self._gains, self._strength[number], self._swinging[number]
        for foot, (error, tilt) in enumerate(zip(self._errors, self._tilts, strict=True)):
            for axis in (0, 1, 2):
                error[axis] += self._share * (
                    measured[foot][axis] - desired[foot][axis] - error[axis]
                )
            for axis in (0, 1):
                rate = strength * gains.tilt * error[1 + axis] - gains.level * tilt[axis]
                if not desired[foot][0] > 0 and measured[foot][0] < TOUCH:
                    rate = -FLAT * tilt[axis]
                tilt[axis] = _within(tilt[axis] + TICK * rate, STEEPEST)
        # The foot that bears too little goes down, the other one up.
        rate = strength * gains.height * (self._errors[0][0] - self._errors[1][0])
        flying = swinging >= 0 and measured[swinging][0] < TOUCH
        self._height += TICK * (rate - (FLAT if flying else gains.even) * self._height)
        self._height = _within(self._height, 2 * FURTHEST)
        return [self._height / 2, -self._height / 2], self._tilts

    def _correction(self, number: int, values: list[float]) -> complex:
        """Shift of the zero-moment point by the error of the capture point, in [m]."""
        left, places = self._left(number, self._zmp[number]), self._places[number]
        w, x, y, z = values[self._turn : self._turn + 4]
        heading = atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        # Relative to the feet, whose places are fixed.
        feet = [_point(values, start) for start in self._standing]
        real = _point(values, self._centre) + _point(values, self._moving) / self._rate
        real -= left * feet[0] + (1 - left) * feet[1]
        real *= rect(1.0, self._heading[number] - heading)
        error = left * places[0] + (1 - left) * places[1] + real - self._capture[number]
        self._drift += TICK * error
        self._drift *= min(1.0, DRIFT / (abs(self._drift) + 1e-9))
        return self._gains.capture * error + self._gains.integral * self._drift

    def _desired(self, number: int, zmp: complex, borne: float) -> list[tuple[float, float, float]]:
        """Desired load of each sole: force, torques about x and y."""
        left, places = self._left(number, zmp), self._places[number]
        beside = zmp - left * places[0] - (1 - left) * places[1]
        desired = []
        for share, yaw, reach in zip(
            (left, 1 - left), self._yaws[number], self._reach, strict=True
        ):
            point = beside * rect(1.0, -yaw)
            along, across = _within(point.real, reach[0]), _within(point.imag, reach[1])
            load = share * borne
            desired.append((load, load * across, -load * along))
        return desired

    def _left(self, number: int, zmp: complex) -> float:
        """Share of the weight on the left foot for a zero-moment point."""
        if self._swinging[number] >= 0:
            return float(self._swinging[number] == 1)
        left, right = self._places[number]
        apart = left - right
        share = ((zmp - right) * apart.conjugate()).real / abs(apart) ** 2
        return min(max(share, 0.0), 1.0)


def _points(signal: Array) -> Any:
    """X and y, the first of the last axis, as lists of complex numbers."""
    return (signal[..., 0] + 1j * signal[..., 1]).tolist()


def _point(values: list[float], start: int) -> complex:
    return complex(values[start], values[start + 1])


def _within(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)
