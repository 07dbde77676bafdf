"""Kinds of noise estimates compared on many robots, and the table that the result prints as."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from noisemodel.comparison import BANDS, TERMS, RobotComparison
from noisemodel.errors import NoiseModelError
from noisemodel.types import Array

if TYPE_CHECKING:
    import pyarrow

GROUP = 3
"""Robots that a median is taken of at least."""
NAME = 26
"""Width of a robot's name in print."""


@dataclass(frozen=True)
class LeftOut:
    """A robot or a run that could not be compared.

    Attributes:
        name: The robot, or the run file.
        reason: Why not, in one line.
    """

    name: str
    reason: str

    def __str__(self) -> str:
        return f"{self.name}: left out: {self.reason}"


@dataclass(frozen=True, eq=False)
class Comparisons:
    """Kinds of noise estimates compared on many robots, all on the same kinds.

    It has a length, an iterator and indices, all over ``robots``, and prints as a table.

    Attributes:
        robots: What could be compared, in the order of the robots.
        left_out: What could not, and why.
    """

    robots: tuple[RobotComparison, ...]
    left_out: tuple[LeftOut, ...] = ()

    @classmethod
    def of(cls, results: Iterable[RobotComparison | LeftOut]) -> "Comparisons":
        """Collect the results of robots."""
        found, left_out = list[RobotComparison](), list[LeftOut]()
        for result in results:
            if isinstance(result, LeftOut):
                left_out.append(result)
            else:
                found.append(result)
        return cls(tuple(found), tuple(left_out))

    def __len__(self) -> int:
        return len(self.robots)

    def __iter__(self) -> Iterator[RobotComparison]:
        return iter(self.robots)

    def __getitem__(self, index: int) -> RobotComparison:
        return self.robots[index]

    @property
    def labels(self) -> tuple[str, ...]:
        """The labels of all events, in the order in which they come."""
        return tuple(dict.fromkeys(event.label for one in self for event in one.events))

    def to_arrow(self) -> "pyarrow.Table":
        """Tabulate a row for each robot and kind.

        Returns:
            A table with the columns ``name``, ``floating_base``, ``joints``, ``links``,
            ``links_with_surface``, ``rate_hz``, ``share_A``, ``share_B`` and ``share_C`` of the
            paper's terms in its power, ``kind``, the ``reference`` that the kind is compared with,
            ``correlation``, ``distance_db`` and its parts ``distance_<band>_db`` by frequency,
            ``contrast_<label>_db`` of the events with each label, ``loudest_share`` and
            ``loudest_link``; nan where a number does not exist.

        Raises:
            NoiseModelError: If every robot was left out.
        """
        import pyarrow

        if not self.robots:
            raise NoiseModelError(f"no robot was compared; {'; '.join(map(str, self.left_out))}")
        labels = self.labels
        return pyarrow.Table.from_pylist([row for one in self for row in one.rows(labels)])

    def __str__(self) -> str:
        lines = list(_table(self)) if self.robots else []
        return "\n".join([*lines, *map(str, self.left_out)])


@dataclass(frozen=True)
class _Columns:
    """Some columns of a table.

    Attributes:
        title: What they hold.
        names: Their names.
        form: Format of a number.
        least: Width of the narrowest column.
    """

    title: str
    names: Sequence[str]
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


_Valued: TypeAlias = tuple[_Columns, Callable[[RobotComparison], Array]]
"""Columns, and what takes their numbers from a comparison, shape (columns,)."""


def _table(found: Comparisons) -> Iterator[str]:
    """Print a row for each robot, then distance by frequency and contrast of each kind."""
    compared = found[0].comparison
    kinds, reference = compared.kinds, compared.reference
    others = [kind for kind in kinds if kind != kinds[reference]]
    columns: tuple[_Valued, ...] = (
        (_Columns("share in paper", TERMS, ".0%"), lambda one: one.comparison.terms.sum(axis=0)),
        (
            _Columns("correlation", others, ".2f", 6),
            lambda one: np.delete(one.comparison.correlation[reference], reference),
        ),
        (
            _Columns("distance [dB]", others, ".1f"),
            lambda one: np.delete(one.comparison.distance[reference], reference),
        ),
    )
    yield f"Reference {kinds[reference]!r}; F: floating base; last: the loudest link"
    yield from _robots(found, columns)
    yield ""
    yield f"Of all {len(found)}, medians" if len(found) > 1 else "By kind"
    yield from _kinds(found)
    yield from (f"{one.name}: {remark}" for one in found for remark in one.remarks)


def medians(rows: Sequence[Array]) -> Array:
    """Take the median of each column over the rows that have a number there.

    Args:
        rows: One or more, each of shape (columns,).

    Returns:
        Shape (columns,); nan where no row has a number.
    """
    finite = [column[np.isfinite(column)] for column in np.array(rows).T]
    return np.array([np.median(column) if len(column) else np.nan for column in finite])


def _robots(found: Comparisons, columns: Sequence[_Valued]) -> Iterator[str]:
    for line in zip(*(part.head for part, _ in columns), strict=True):
        yield f"{'':{NAME + 2}}{''.join(line)}".rstrip()
    for one in found:
        cells = "".join(part.row(values(one)) for part, values in columns)
        link, share = one.comparison.loudest
        base = "F" if one.floating_base else " "
        yield f"{_short(one.name):{NAME}} {base}{cells}  {share:4.0%} {link}"
    for floating, word in ((False, "fixed"), (True, "floating")):
        group = [one for one in found if one.floating_base == floating]
        if len(group) >= GROUP:
            cells = "".join(
                part.row(medians([values(one) for one in group])) for part, values in columns
            )
            yield f"{f'median of {len(group)} {word}':{NAME}}  {cells}"


def _kinds(found: Comparisons) -> Iterator[str]:
    """Print a row for each kind."""
    labels = found.labels
    bands = _Columns("distance by frequency [dB]", [_band(*band) for band in BANDS], ".1f")
    events = _Columns("contrast of events above 10 Hz [dB]", labels, ".1f")
    for first, second in zip(bands.head, events.head, strict=True):
        yield f"{'':{NAME + 2}}{first}{second if labels else ''}".rstrip()
    reference = found[0].comparison.reference
    for index, kind in enumerate(found[0].kinds):
        apart = [one.comparison.by_band(index, reference) for one in found]
        contrast = events.row(medians([one.by_label(index, labels) for one in found]))
        yield f"{kind:{NAME}}  {bands.row(medians(apart))}{contrast}".rstrip()


def _short(name: str) -> str:
    """Keep the end of a name that is too long, by which paths differ."""
    return name if len(name) <= NAME else f"…{name[1 - NAME :]}"


def _band(low: float, high: float) -> str:
    return f"{low:.0f} Hz up" if np.isinf(high) else f"{low:.0f}-{high:.0f} Hz"
