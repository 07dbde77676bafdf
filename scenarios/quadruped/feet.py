"""Feet that leave their plan: to keep the balance, and to give way to forces."""

import numpy as np

from noisemodel.types import Array
from scenarios.clock import TICK
from scenarios.quadruped.feeling import Feeling
from scenarios.quadruped.robots import Quadruped
from scenarios.quadruped.standing import GRAVITY, Standing
from scenarios.quadruped.trotting import Plan

BALANCE = 0.7
"""Share of the capture point's offset by which the feet are placed to regain the velocity."""
FURTHEST = 0.3
"""How far feet are placed from where they were planned, as a share of the robot's height."""
DECIDED = 0.8
"""Share of its way after which a foot's place is not changed any more."""
DESCENDING = 0.5
"""Share of its way after which a foot may meet the ground."""
MET = 0.15
"""Force that tells a foot that it has met the ground, as a share of the weight."""
LEVELLING = 50.0
"""Rate at which a foot in the air makes up for the tilt of the body, in [1/s]."""
LEAK = 4.0
"""Rate at which a foot comes back from where its contact force has moved it, in [1/s]."""
SMOOTHING = 0.008
"""Time constant of the low-pass on the speed at which feet are moved up or down, in [s]."""
HIGHEST = 0.16
"""How far feet are moved up or down, as a share of the robot's height."""


class Feet:
    """Moves feet off their plan.

    Args:
        robot: The robot.
        standing: How it stands at first.
        plan: What it is to do.
        gain: Scale of the feedback of forces at each tick, shape (ticks,).
    """

    def __init__(self, robot: Quadruped, standing: Standing, plan: Plan, gain: Array) -> None:
        feet = len(robot.feet)
        self._plan, self._lever = plan, standing.feet
        self._lean = 1 + robot.attitude_gain  # from the tilt that is asked for to the measured one
        self._gain = robot.force_gain * gain
        self._load = plan.weight * plan.load
        # A body at velocity v stops over a foot that stands v sqrt(h/g) ahead: the capture point.
        self._balance = BALANCE * np.sqrt(plan.size / GRAVITY)
        self._left, self._right = np.zeros((feet, 2)), np.zeros((feet, 2))
        self._rise, self._speed = np.zeros(feet), np.zeros(feet)
        self._early = np.zeros(feet, dtype=bool)

    def places(self, number: int, feeling: Feeling) -> Array:
        """Place the feet.

        Args:
            number: Which tick it is.
            feeling: What the robot feels.

        Returns:
            Shape (feet, 3), in [m].
        """
        places: Array = self._plan.feet[number].copy()
        places[:, :2] += self._step(number, feeling)
        places[:, 2] += self._yield(number, feeling)
        return places

    def _step(self, number: int, feeling: Feeling) -> Array:
        """Bring feet in the air to where they keep the balance, shape (feet, 2).

        They stand off their plan as the whole robot does, and further against its slip; a tilted
        body has them, as it has them level, where an upright one would.
        """
        plan = self._plan
        swing, progress = plan.swing[number], plan.progress[number]
        begins = swing & ~plan.swing[number - 1]
        self._left[begins] = self._right[begins]
        furthest = FURTHEST * plan.size
        balance = np.minimum(np.maximum(self._balance * feeling.slip, -furthest), furthest)
        lever = plan.feet[number, :, :2] - plan.centre[number, :2]
        turned = feeling.turn * lever[:, ::-1] * (-1.0, 1.0)  # of a small angle
        upright = self._lean * plan.size * np.array((feeling.pitch, -feeling.roll))
        undecided = swing & (progress < DECIDED)
        self._right[undecided] = (feeling.home + balance + turned + upright)[undecided]
        return np.asarray(self._left + progress[:, None] * (self._right - self._left))

    def _yield(self, number: int, feeling: Feeling) -> Array:
        """Move feet up or down, shape (feet,).

        In the air they keep level to the ground. On the ground they give way to forces that were
        not planned; so does, from then on, a foot that meets the ground too early.
        """
        plan, swing = self._plan, self._plan.swing[number]
        met = (plan.progress[number] > DESCENDING) & (feeling.force > MET * plan.weight)
        self._early = swing & (self._early | met)
        tilt = feeling.pitch * self._lever[:, 0] - feeling.roll * self._lever[:, 1]
        levelling = LEVELLING * (self._lean * tilt - self._rise)
        giving = self._gain[number] * (feeling.force - self._load[number]) - LEAK * self._rise
        wanted = np.where(swing & ~self._early, levelling, giving)
        self._speed += TICK / (SMOOTHING + TICK) * (wanted - self._speed)
        rise = self._rise + TICK * self._speed
        rise += self._early * (plan.feet[number - 1, :, 2] - plan.feet[number, :, 2])
        highest = HIGHEST * plan.size
        self._rise = np.minimum(np.maximum(rise, -highest), highest)
        return self._rise
