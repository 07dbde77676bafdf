"""Corrections of the planned feet: foot placement and compliance."""

import numpy as np

from noiseclassifier.scenarios.clock import TICK
from noiseclassifier.scenarios.quadruped.estimation import StateEstimate
from noiseclassifier.scenarios.quadruped.robots import Quadruped
from noiseclassifier.scenarios.quadruped.standing import GRAVITY, Standing
from noiseclassifier.scenarios.quadruped.trotting import Plan
from noisemodel.types import Array

BALANCE = 0.7
"""Gain of the foot placement on the offset of the capture point."""
FURTHEST = 0.3
"""Largest distance of feet from their planned place, as a share of the robot's height."""
FIXED = 0.8
"""Share of its path after which the place of a foot is fixed."""
DESCENDING = 0.5
"""Share of its path after which a foot may touch down early."""
CONTACT = 0.15
"""Force above which a foot is in contact, as a share of the weight."""
LEVELLING = 50.0
"""Rate at which a foot in the air compensates the tilt of the body, in [1/s]."""
LEAK = 4.0
"""Rate at which the compliance of a foot decays, in [1/s]."""
SMOOTHING = 0.008
"""Time constant of the low-pass on the vertical speed of feet, in [s]."""
HIGHEST = 0.16
"""Largest vertical correction of feet, as a share of the robot's height."""


class Feet:
    """Places of the feet, corrected by feedback.

    Args:
        gain: Scale of the feedback of forces at each tick, shape (ticks,).
    """

    def __init__(self, robot: Quadruped, standing: Standing, plan: Plan, gain: Array) -> None:
        feet = len(robot.feet)
        self._plan, self._lever = plan, standing.feet
        self._lean = 1 + robot.attitude_gain  # from the commanded tilt to the measured one
        self._gain = robot.force_gain * gain
        self._load = plan.weight * plan.load
        # A body at velocity v stops over a foot that stands v sqrt(h/g) ahead: the capture point.
        self._balance = BALANCE * np.sqrt(plan.size / GRAVITY)
        self._left, self._right = np.zeros((feet, 2)), np.zeros((feet, 2))
        self._rise, self._speed = np.zeros(feet), np.zeros(feet)
        self._early = np.zeros(feet, dtype=bool)

    def places(self, number: int, estimate: StateEstimate) -> Array:
        """Places of the feet.

        Returns:
            Shape (feet, 3), in [m].
        """
        places: Array = self._plan.feet[number].copy()
        places[:, :2] += self._placement(number, estimate)
        places[:, 2] += self._compliance(number, estimate)
        return places

    def _placement(self, number: int, estimate: StateEstimate) -> Array:
        """Horizontal correction of the feet, shape (feet, 2), in [m].

        Feet in the air follow the position correction of the robot, are placed further in the
        direction of its slip, and compensate the tilt of the body.
        """
        plan = self._plan
        swing, progress = plan.swing[number], plan.progress[number]
        begins = swing & ~plan.swing[number - 1]
        self._left[begins] = self._right[begins]
        furthest = FURTHEST * plan.size
        balance = np.minimum(np.maximum(self._balance * estimate.slip, -furthest), furthest)
        lever = plan.feet[number, :, :2] - plan.centre[number, :2]
        turned = estimate.yaw_correction * lever[:, ::-1] * (-1.0, 1.0)  # of a small angle
        upright = self._lean * plan.size * np.array((estimate.pitch, -estimate.roll))
        adjustable = swing & (progress < FIXED)
        target = estimate.position_correction + balance + turned + upright
        self._right[adjustable] = target[adjustable]
        return np.asarray(self._left + progress[:, None] * (self._right - self._left))

    def _compliance(self, number: int, estimate: StateEstimate) -> Array:
        """Vertical correction of the feet, shape (feet,), in [m].

        Feet in the air stay level to the ground. Feet on the ground comply with deviations from the
        planned force, as does a foot from an early touch-down on.
        """
        plan, swing = self._plan, self._plan.swing[number]
        in_contact = (plan.progress[number] > DESCENDING) & (estimate.force > CONTACT * plan.weight)
        self._early = swing & (self._early | in_contact)
        tilt = estimate.pitch * self._lever[:, 0] - estimate.roll * self._lever[:, 1]
        levelling = LEVELLING * (self._lean * tilt - self._rise)
        compliant = self._gain[number] * (estimate.force - self._load[number]) - LEAK * self._rise
        desired = np.where(swing & ~self._early, levelling, compliant)
        self._speed += TICK / (SMOOTHING + TICK) * (desired - self._speed)
        rise = self._rise + TICK * self._speed
        rise += self._early * (plan.feet[number - 1, :, 2] - plan.feet[number, :, 2])
        highest = HIGHEST * plan.size
        self._rise = np.minimum(np.maximum(rise, -highest), highest)
        return self._rise
