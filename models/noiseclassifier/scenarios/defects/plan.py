"""The interface of defects, and of the plan that they depend on."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np

from noiseclassifier.scenarios.contacts import Contact
from noiseclassifier.scenarios.faults import Faults
from noiseclassifier.scenarios.shapes import Box, Effector
from noisemodel.types import Array

Range: TypeAlias = tuple[float, float]
"""Limits between which a seed draws."""


@dataclass(frozen=True)
class Units:
    """Units that scale defects to the size of a robot.

    Attributes:
        length: In [m]; speeds in lengths per second scale with it too.
        force: In [N].
        torque: In [N m].
    """

    length: float = 1.0
    force: float = 1.0
    torque: float = 1.0


class Plan(Protocol):
    """Plan of a motion, as far as defects depend on it."""

    @property
    def time(self) -> Array:
        """Time of each tick, shape (ticks,), in [s]."""
        ...

    @property
    def duration(self) -> float:
        """Duration, in [s]."""
        ...

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """The planned contacts."""
        ...

    @property
    def effectors(self) -> tuple[Effector, ...]:
        """The effectors."""
        ...

    @property
    def ground(self) -> tuple[Box, ...]:
        """The ground."""
        ...

    @property
    def units(self) -> Units:
        """The units of the robot."""
        ...


class Defect(Protocol):
    """Settings from which a seed draws faults."""

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw the faults of one run."""
        ...


@dataclass(frozen=True)
class NoDefect:
    """No defect: only the imperfections of every robot."""

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw no faults."""
        return Faults()


def begun(plan: Plan, effectors: Sequence[int] = ()) -> list[Contact]:
    """Contacts that start during the run, of some effectors or of all."""
    return [
        contact
        for contact in plan.contacts
        if contact.start > 0 and (not effectors or contact.effector in effectors)
    ]
