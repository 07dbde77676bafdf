"""Plan of the motion of a humanoid, at every tick."""

from dataclasses import dataclass, replace

import numpy as np

from noiseclassifier.scenarios.clock import TICK, times
from noiseclassifier.scenarios.contacts import Contact
from noiseclassifier.scenarios.defects.plan import Units
from noiseclassifier.scenarios.faults import Integers
from noiseclassifier.scenarios.shapes import Box, Effector
from noisemodel.types import Array


@dataclass(frozen=True, eq=False)
class Plan:
    """Plan of the motion of a humanoid, at every tick.

    Attributes:
        places: Of the soles, shape (ticks, feet, 3), in [m].
        yaws: Directions of the soles, shape (ticks, feet), in [rad].
        swinging: The foot in the air, or -1, shape (ticks,).
        zmp: Zero-moment point, x and y, shape (ticks, 2), in [m].
        centre: Centre of mass, shape (ticks, 3), in [m].
        upper: Positions of the upper body's joints, shape (ticks, joints), in [rad].
        rate: Natural frequency of the inverted pendulum, in [rad/s].
    """

    places: Array
    yaws: Array
    swinging: Integers
    zmp: Array
    centre: Array
    upper: Array
    rate: float
    contacts: tuple[Contact, ...]
    effectors: tuple[Effector, ...]
    ground: tuple[Box, ...]
    size: float

    @property
    def time(self) -> Array:
        """Time of each tick, shape (ticks,), in [s]."""
        return times(len(self.zmp), TICK)

    @property
    def units(self) -> Units:
        """Units of 1 for a robot of size 1, for equal shape and density."""
        return Units(length=self.size, force=self.size**3, torque=self.size**4)

    @property
    def duration(self) -> float:
        """Duration, in [s]."""
        return len(self.zmp) * TICK

    @property
    def heading(self) -> Array:
        """Direction of the base, shape (ticks,), in [rad]."""
        return np.asarray(self.yaws.mean(axis=1))

    @property
    def left(self) -> Array:
        """Planned share of the weight on the left foot, shape (ticks,)."""
        left, right = self.places[:, 0, :2], self.places[:, 1, :2]
        apart = left - right
        share = ((self.zmp - right) * apart).sum(axis=1) / np.square(apart).sum(axis=1)
        share = np.clip(share, 0.0, 1.0)
        return np.asarray(np.where(self.swinging < 0, share, self.swinging == 1))

    def after(self, ticks: int) -> "Plan":
        """The plan after some ticks of rest."""

        def later(signal: Array) -> Array:
            return np.concatenate((np.repeat(signal[:1], ticks, axis=0), signal))

        return replace(
            self,
            places=later(self.places),
            yaws=later(self.yaws),
            swinging=np.pad(self.swinging, (ticks, 0), "edge"),
            zmp=later(self.zmp),
            centre=later(self.centre),
            upper=later(self.upper),
            contacts=tuple(contact.later(ticks * TICK) for contact in self.contacts),
        )
