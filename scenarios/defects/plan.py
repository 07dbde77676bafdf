"""What a defect is, and what it sees of a robot's plan."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np

from noisemodel.types import Array
from scenarios.contacts import Contact
from scenarios.faults import Faults
from scenarios.shapes import Box, Effector

Range: TypeAlias = tuple[float, float]
"""Between which values a seed draws."""


@dataclass(frozen=True)
class Units:
    """What a robot's size makes of the sizes of what goes wrong.

    Attributes:
        length: In [m]; a speed of so many lengths a second grows with it too.
        force: In [N].
        torque: In [N m].
    """

    length: float = 1.0
    force: float = 1.0
    torque: float = 1.0


class Plan(Protocol):
    """What a robot is to do, as far as it matters to what goes wrong."""

    @property
    def time(self) -> Array:
        """Time of each tick, shape (ticks,), in [s]."""
        ...

    @property
    def duration(self) -> float:
        """How long it lasts, in [s]."""
        ...

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """The planned contacts."""
        ...

    @property
    def effectors(self) -> tuple[Effector, ...]:
        """What touches."""
        ...

    @property
    def ground(self) -> tuple[Box, ...]:
        """What it stands on."""
        ...

    @property
    def units(self) -> Units:
        """The robot's own units."""
        ...


class Defect(Protocol):
    """Settings from which faults are drawn."""

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw the faults of one run."""
        ...


@dataclass(frozen=True)
class NoDefect:
    """A robot as good as robots are."""

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw no faults."""
        return Faults()


def begun(plan: Plan, effectors: Sequence[int] = ()) -> list[Contact]:
    """List the contacts that begin during the run, those of some effectors or of all."""
    return [
        contact
        for contact in plan.contacts
        if contact.start > 0 and (not effectors or contact.effector in effectors)
    ]
