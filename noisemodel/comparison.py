"""Kinds of noise estimates compared on one motion, and how the result prints."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from noisemodel.run import Block
from noisemodel.types import Array

if TYPE_CHECKING:
    import pyarrow

TERMS = ("A", "B", "C")
"""The terms of the paper's mean speed."""

LOUDEST = 5
"""Links that are printed by name."""

REFERENCES = ("normal", "mean")
"""The other kinds are compared with the first of these that is among them."""

BANDS = ((0.0, 20.0), (20.0, 100.0), (100.0, 500.0), (500.0, np.inf))
"""Parts of the spectrum for which distances are given one by one, in [Hz]."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """How kinds of noise estimates differ on one motion.

    Attributes:
        kinds: The kinds.
        names: The links.
        correlation: Of the envelopes of each two kinds, shape (kinds, kinds); nan where an
            envelope does not change.
        distance: Log-spectral distance of each two kinds: root mean square of the difference
            of their spectra over time and frequency, shape (kinds, kinds), in [dB].
        frequency: Shape (frequency,), in [Hz].
        distance_by_frequency: The same over time alone, shape (kinds, kinds, frequency).
        contrast: Mean power in the events over that of the rest, shape (kinds,), in [dB]; nan
            without events.
        shares: Share of each link in the energy, shape (kinds, links).
        terms: Share of A, B and C of each link in the energy that "paper" gives the whole robot,
            (A + B + C)² being (A + B + C) A + (A + B + C) B + (A + B + C) C, shape (links, 3).
    """

    kinds: tuple[str, ...]
    names: tuple[str, ...]
    correlation: Array
    distance: Array
    frequency: Array
    distance_by_frequency: Array
    contrast: Array
    shares: Array
    terms: Array

    @property
    def reference(self) -> int:
        """Index of the kind that the others are compared with: normal, else mean, else the last."""
        named = (self.kinds.index(kind) for kind in REFERENCES if kind in self.kinds)
        return next(named, len(self.kinds) - 1)

    @property
    def loudest(self) -> tuple[str, float]:
        """The link with the largest share in the energy of the reference, and that share."""
        shares = self.shares[self.reference]
        return self.names[shares.argmax()], float(shares.max())

    def by_band(self, kind: int, other: int) -> Array:
        """Spectral distance of two kinds in each of ``BANDS``.

        Args:
            kind: Index of a kind.
            other: Index of another.

        Returns:
            Shape (bands,), in [dB]; nan above the Nyquist frequency.
        """
        squares = self.distance_by_frequency[kind, other] ** 2
        inside = [(self.frequency >= low) & (self.frequency < high) for low, high in BANDS]
        return np.array([np.sqrt(squares[at].mean()) if at.any() else np.nan for at in inside])

    def to_arrow(self) -> "pyarrow.Table":
        """Tabulate a row for each ordered pair of kinds.

        Returns:
            A table with the columns ``kind``, ``other``, ``correlation`` of the envelopes,
            ``distance_db`` of the spectra and its parts ``distance_<band>_db`` by frequency; nan
            where a number does not exist.
        """
        import pyarrow

        numbers = range(len(self.kinds))
        return pyarrow.Table.from_pylist(
            [
                {"kind": self.kinds[kind], "other": self.kinds[other], **self.pair(kind, other)}
                for kind in numbers
                for other in numbers
            ]
        )

    def pair(self, kind: int, other: int) -> dict[str, float]:
        """Correlation and distances of two kinds, by the names of their columns in a table.

        Args:
            kind: Index of a kind.
            other: Index of another.
        """
        distances = zip(BANDS, self.by_band(kind, other).tolist(), strict=True)
        return {
            "correlation": float(self.correlation[kind, other]),
            "distance_db": float(self.distance[kind, other]),
            **{f"distance_{_column(*band)}_db": distance for band, distance in distances},
        }

    def __str__(self) -> str:
        head = "".join(f"{kind:>11}" for kind in self.kinds)
        lines = [f"{'correlation of envelopes':28}{head}"]
        lines += [_row(k, row, ".3f") for k, row in zip(self.kinds, self.correlation, strict=True)]
        lines.append(f"{'spectral distance [dB]':28}{head}")
        lines += [_row(k, row, ".1f") for k, row in zip(self.kinds, self.distance, strict=True)]
        lines.append(f"{'':28}{head}")
        if not np.isnan(self.contrast).all():
            lines.append(_row("contrast of events [dB]", self.contrast, ".1f"))
        order = np.argsort(-self.shares.max(axis=0), kind="stable")[:LOUDEST]
        lines += [_row(self.names[link], self.shares[:, link], ".1%") for link in order]
        parts = zip(TERMS, self.terms.sum(axis=0), strict=True)
        listed = ", ".join(f"{term} {share:.1%}" for term, share in parts)
        return "\n".join([*lines, f"of the energy of paper: {listed}"])


@dataclass(frozen=True, eq=False)
class RobotComparison:
    """Kinds of noise estimates compared on one robot and its motion.

    Attributes:
        name: The robot, or the run file.
        floating_base: Whether the robot's base moves freely.
        joints: How many joints the motion has.
        time: Of the samples, shape (samples,), in [s].
        rate: Samples per second, in [Hz].
        events: What should stand out: the run's blocks that are not "ok".
        comparison: How the kinds differ.
        pressure: Estimated pressure by each kind, its root mean square being 1,
            shape (kinds, samples).
        contrast: Mean square of the pressure above 10 Hz in each event, over that outside of all
            events, shape (kinds, events), in [dB].
        links_with_surface: How many links have a surface.
        remarks: What the comparison leaves out, a sentence each.
    """

    name: str
    floating_base: bool
    joints: int
    time: Array
    rate: float
    events: tuple[Block, ...]
    comparison: Comparison
    pressure: Array
    contrast: Array
    links_with_surface: int
    remarks: tuple[str, ...]

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds that were compared."""
        return self.comparison.kinds

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

    def rows(self, labels: Sequence[str]) -> Iterator[dict[str, str | bool | int | float]]:
        """Tabulate the numbers of each kind, by the names of their columns in a table.

        Args:
            labels: The labels of events that have a column.

        Yields:
            A row for each kind.
        """
        compared, reference = self.comparison, self.comparison.reference
        shares = zip(TERMS, compared.terms.sum(axis=0).tolist(), strict=True)
        facts = {
            "name": self.name,
            "floating_base": self.floating_base,
            "joints": self.joints,
            "links": len(compared.names),
            "links_with_surface": self.links_with_surface,
            "rate_hz": self.rate,
            **{f"share_{term}": share for term, share in shares},
        }
        for index, kind in enumerate(self.kinds):
            contrasts = zip(labels, self.by_label(index, labels).tolist(), strict=True)
            loudest = int(compared.shares[index].argmax())
            yield {
                **facts,
                "kind": kind,
                "reference": self.kinds[reference],
                **compared.pair(index, reference),
                **{f"contrast_{label}_db": contrast for label, contrast in contrasts},
                "loudest_share": float(compared.shares[index, loudest]),
                "loudest_link": compared.names[loudest],
            }

    def __str__(self) -> str:
        return f"{self.name}, {len(self.time)} samples at {self.rate:g} Hz\n{self.comparison}"


def _row(name: str, values: Array, form: str) -> str:
    return f"{name:28}" + "".join(f"{value:>11{form}}" for value in values)


def _column(low: float, high: float) -> str:
    return f"{low:.0f}_up" if np.isinf(high) else f"{low:.0f}_{high:.0f}"
