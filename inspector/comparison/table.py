"""What comparisons of noise models say, as text for people."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from inspector.comparison.compared import BANDS, Compared, labels_of
from noisemodel.comparison import TERMS
from noisemodel.types import Array

GROUP = 3
"""Robots that a median is taken of at least."""
NAME = 26
"""Width of a robot's name in print."""


@dataclass(frozen=True)
class Columns:
    """Some columns of a table.

    Attributes:
        title: What they tell.
        names: Their names.
        values: Takes the numbers from a comparison, shape (columns,).
        form: Format of a number.
        least: Width of the narrowest column.
    """

    title: str
    names: Sequence[str]
    values: Callable[[Compared], Array]
    form: str
    least: int = 5

    @property
    def head(self) -> tuple[str, str]:
        """The title over the names."""
        names = " " + "".join(
            f"{name:>{width}}" for name, width in zip(self.names, self._widths, strict=True)
        )
        return f" {self.title:^{len(names) - 1}}", names

    def row(self, values: Array) -> str:
        """Print numbers under the names; a dash where there is none."""
        return " " + "".join(
            f"{value:>{width}{self.form}}" if np.isfinite(value) else f"{'-':>{width}}"
            for value, width in zip(values, self._widths, strict=True)
        )

    @property
    def _widths(self) -> list[int]:
        return [max(self.least, len(name) + 1) for name in self.names]


def table(found: Sequence[Compared]) -> str:
    """Print a row for each robot, then what holds of all: distance by frequency, and contrast.

    Args:
        found: One comparison or more, of the same kinds.

    Returns:
        Lines of text.
    """
    kinds, held = found[0].kinds, found[0].reference
    others = [kind for kind in kinds if kind != kinds[held]]
    columns = (
        Columns("share in paper", TERMS, lambda one: one.found.terms.sum(axis=0), ".0%"),
        Columns("correlation", others, lambda one: _others(one, one.found.correlation), ".2f", 6),
        Columns("distance [dB]", others, lambda one: _others(one, one.found.distance), ".1f"),
    )
    lines = [f"Held against {kinds[held]!r}; F: floating base; last: the loudest link"]
    lines += _robots(found, columns)
    lines += ["", f"Of all {len(found)}, medians" if len(found) > 1 else "By kind"]
    lines += _kinds(found)
    lines += [f"{one.name}: {remark}" for one in found for remark in one.remarks]
    return "\n".join(lines)


def medians(rows: Sequence[Array]) -> Array:
    """Take the median of each column over the rows that have a number there.

    Args:
        rows: One or more, each of shape (columns,).

    Returns:
        Shape (columns,); nan where no row has a number.
    """
    finite = [column[np.isfinite(column)] for column in np.array(rows).T]
    return np.array([np.median(column) if len(column) else np.nan for column in finite])


def _robots(found: Sequence[Compared], columns: Sequence[Columns]) -> Iterator[str]:
    for line in zip(*(part.head for part in columns), strict=True):
        yield f"{'':{NAME + 2}}{''.join(line)}".rstrip()
    for one in found:
        cells = "".join(part.row(part.values(one)) for part in columns)
        link, share = one.loudest
        base = "F" if one.floating_base else " "
        yield f"{_short(one.name):{NAME}} {base}{cells}  {share:4.0%} {link}"
    for floating, word in ((False, "fixed"), (True, "floating")):
        group = [one for one in found if one.floating_base == floating]
        if len(group) >= GROUP:
            cells = "".join(p.row(medians([p.values(one) for one in group])) for p in columns)
            yield f"{f'median of {len(group)} {word}':{NAME}}  {cells}"


def _kinds(found: Sequence[Compared]) -> Iterator[str]:
    """Print a row for each kind."""
    labels, none = labels_of(found), lambda _: np.empty(0)
    bands = Columns("distance by frequency [dB]", [_band(*band) for band in BANDS], none, ".1f")
    events = Columns("contrast of events above 10 Hz [dB]", labels, none, ".1f")
    for first, second in zip(bands.head, events.head, strict=True):
        yield f"{'':{NAME + 2}}{first}{second if labels else ''}".rstrip()
    for index, kind in enumerate(found[0].kinds):
        distance = bands.row(medians([one.by_band(index) for one in found]))
        contrast = events.row(medians([one.by_label(index, labels) for one in found]))
        yield f"{kind:{NAME}}  {distance}{contrast}".rstrip()


def _others(one: Compared, square: Array) -> Array:
    """Take the reference's row of a table of kinds, without the reference itself."""
    return np.delete(square[one.reference], one.reference)


def _short(name: str) -> str:
    """Keep the end of a name that is too long, by which paths differ."""
    return name if len(name) <= NAME else f"…{name[1 - NAME :]}"


def _band(low: float, high: float) -> str:
    return f"{low:.0f} Hz up" if np.isinf(high) else f"{low:.0f}-{high:.0f} Hz"
