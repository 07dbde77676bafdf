"""What a comparison of noise models found on one motion."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import noisemodel as nm
from noisemodel.types import Array

REFERENCES = ("normal", "mean")
"""What the other kinds are held against: the first of these that is among them."""

BANDS = ((0.0, 20.0), (20.0, 100.0), (100.0, 500.0), (500.0, np.inf))
"""Parts of the spectrum whose distances are told apart, in [Hz]."""


@dataclass(frozen=True, eq=False)
class Compared:
    """Noise models compared on one motion.

    Attributes:
        name: The robot, or the run file.
        floating_base: Whether the robot's base moves freely.
        joints: How many joints the motion has.
        time: Of the samples, shape (samples,), in [s].
        rate: Samples per second, in [Hz].
        events: What should stand out: the run's blocks that are not "ok".
        found: The comparison.
        pressure: Estimated pressure by each kind, its root mean square being 1,
            shape (kinds, samples).
        contrast: Mean square of the pressure above 10 Hz in each event, over that outside of all
            events, shape (kinds, events), in [dB].
        with_surface: How many links have one.
        remarks: What the comparison leaves out, a sentence each.
    """

    name: str
    floating_base: bool
    joints: int
    time: Array
    rate: float
    events: tuple[nm.Block, ...]
    found: nm.Comparison
    pressure: Array
    contrast: Array
    with_surface: int
    remarks: tuple[str, ...]

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds that were compared."""
        return self.found.kinds

    @property
    def reference(self) -> int:
        """Index of the kind that the others are held against: normal, else mean, else the last."""
        named = (self.kinds.index(kind) for kind in REFERENCES if kind in self.kinds)
        return next(named, len(self.kinds) - 1)

    @property
    def loudest(self) -> tuple[str, float]:
        """The link with the largest share in the energy of the reference, and that share."""
        shares = self.found.shares[self.reference]
        return self.found.names[shares.argmax()], float(shares.max())

    def by_band(self, kind: int) -> Array:
        """Spectral distance of a kind to the reference in each of ``BANDS``.

        Args:
            kind: Index of the kind.

        Returns:
            Shape (bands,), in [dB]; nan above half the rate.
        """
        squares = self.found.distance_by_frequency[kind, self.reference] ** 2
        frequency = self.found.frequency
        inside = [(frequency >= low) & (frequency < high) for low, high in BANDS]
        return np.array([np.sqrt(squares[at].mean()) if at.any() else np.nan for at in inside])

    def by_label(self, kind: int, labels: Sequence[str]) -> Array:
        """Mean contrast of the events with each label.

        Args:
            kind: Index of the kind.
            labels: The labels.

        Returns:
            Shape (labels,), in [dB]; nan where there is no such event.
        """
        own = np.array([event.label for event in self.events])
        inside = [own == label for label in labels]
        levels = self.contrast[kind]
        return np.array([levels[at].mean() if at.any() else np.nan for at in inside])


@dataclass(frozen=True)
class Failed:
    """A run or a robot that could not be compared.

    Attributes:
        name: The robot, or the run file.
        message: Why not, in one line.
    """

    name: str
    message: str


def labels_of(found: Sequence[Compared]) -> tuple[str, ...]:
    """Name the labels of all events, in the order in which they come."""
    return tuple(dict.fromkeys(event.label for one in found for event in one.events))
