"""What a comparison of noise estimates found, and how it prints."""

from dataclasses import dataclass

import numpy as np

from noisemodel.types import Array

TERMS = ("A", "B", "C")
"""The terms of the paper's mean speed."""

LOUDEST = 5
"""Links that are printed by name."""


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
        said = ", ".join(f"{term} {share:.1%}" for term, share in parts)
        return "\n".join([*lines, f"of the energy of paper: {said}"])


def _row(name: str, values: Array, form: str) -> str:
    return f"{name:28}" + "".join(f"{value:>11{form}}" for value in values)
