"""Rows of a CSV whose header names what each column holds."""

from collections.abc import Iterator, Sequence
from math import nan
from typing import Any

import numpy as np

from inspector.live.rows import Note, Rows
from inspector.live.samples import SIGNALS, LiveError
from inspector.logs.clocks import UNITS
from inspector.logs.csv import numbers_in
from inspector.logs.names import (
    TIME_UNITS,
    Naming,
    column_signal,
    factor_of,
    listed,
    time_column,
    without_unit,
)
from noisemodel.types import Array

UNKNOWN = ["", "nan", "NaN", "NAN", "null"]
"""Cells of what is not known."""


class CsvReader:
    """Reads rows under a header such as ``time,elbow.velocity,elbow.position``.

    Args:
        names: Names of the joints in the order that is wanted; by default that of the columns.
    """

    def __init__(self, head: bytes, names: tuple[str, ...]) -> None:
        text = head.decode("utf-8-sig", errors="replace").strip().lstrip("# ")
        self._delimiter = next((mark for mark in ",;\t" if mark in text), ",")
        self._header = [cell.strip() for cell in text.split(self._delimiter)]
        found: dict[str, dict[str, int]] = {}
        naming = Naming.of(self._header)
        for place, column in enumerate(self._header):
            meaning = column_signal(column, naming)
            if meaning is not None and meaning[0] in SIGNALS and factor_of(column) == 1.0:
                joint = meaning[1]
                known = joint if isinstance(joint, str) else _numbered(joint - naming.first, names)
                found.setdefault(meaning[0], {})[known] = place
        if "velocity" not in found:
            raise LiveError(
                "the header names no velocity; expected columns such as elbow.velocity,"
                f" they are {listed(self._header)}"
            )
        self.names = names or tuple(found["velocity"])
        for signal, places in found.items():
            if lacking := [name for name in self.names if name not in places]:
                raise LiveError(f"the header has no {signal} of joint {lacking[0]!r}")
        self._places = {
            signal: _run([places[name] for name in self.names]) for signal, places in found.items()
        }
        time = time_column(self._header)
        self._time = self._header.index(time) if time else None
        self._second = float(UNITS[TIME_UNITS.get(without_unit(time)[1], "seconds")])
        self._options = self._arrow_options()

    def read(self, lines: bytes, first: int, note: Note) -> Iterator[Rows]:
        """Read whole lines; the others are counted.

        Args:
            note: Called with each row that cannot be read.
        """
        table = self._read_numbers(lines)
        if table is None:
            table = self._read_table(lines)
        if table is None:
            table = self._read_lines(lines, first, note)
        if len(table):
            signals = {name: table[:, places] for name, places in self._places.items()}
            yield Rows(signals, None if self._time is None else table[:, self._time] * self._second)

    def _read_numbers(self, lines: bytes) -> Array | None:
        """Read rows of plain numbers; None if a cell is anything else."""
        columns = range(len(self._header))
        found = numbers_in(lines, len(columns), self._delimiter, columns)
        return None if found is None else found[0]

    def _read_table(self, lines: bytes) -> Array | None:
        """Read rows that are all well formed; None if one is not."""
        import pyarrow as pa
        from pyarrow import csv

        try:
            table = csv.read_csv(pa.py_buffer(lines), **self._options)
        except pa.ArrowInvalid:
            return None
        # Columns lie one after the other, as Arrow has them: turning them over costs a copy.
        return np.array([column.to_numpy() for column in table.columns]).T

    def _arrow_options(self) -> dict[str, Any]:
        """Options of Arrow's reader: making them for each chunk takes a quarter of reading."""
        import pyarrow as pa
        from pyarrow import csv

        columns = [str(place) for place in range(len(self._header))]
        return {
            "read_options": csv.ReadOptions(column_names=columns, use_threads=False),
            "parse_options": csv.ParseOptions(delimiter=self._delimiter),
            "convert_options": csv.ConvertOptions(
                column_types=dict.fromkeys(columns, pa.float64()), null_values=UNKNOWN
            ),
        }

    def _read_lines(self, lines: bytes, first: int, note: Note) -> Array:
        rows = []
        for number, line in enumerate(lines.splitlines(), start=first):
            if not line.strip():
                continue
            try:
                rows.append(self._row(line.decode(errors="replace").split(self._delimiter)))
            except ValueError as error:
                note("malformed rows", f"line {number}: {str(error)[:200]}; such rows are left out")
                if self._time is None:  # without stamps, the row alone keeps the time
                    rows.append([nan] * len(self._header))
        return np.array(rows).reshape(-1, len(self._header))

    def _row(self, cells: Sequence[str]) -> list[float]:
        if len(cells) != len(self._header):
            raise ValueError(f"{len(cells)} cells where the header names {len(self._header)}")
        return [nan if cell.strip() in UNKNOWN else float(cell) for cell in cells]


def _numbered(number: str | int, names: tuple[str, ...]) -> str:
    """The name of a joint that a column has by its number."""
    number = int(number)
    return names[number] if number < len(names) else f"joint{number + 1}"


def _run(places: list[int]) -> list[int] | slice:
    """Columns beside each other need not be copied together."""
    first, stop = places[0], places[0] + len(places)
    return slice(first, stop) if places == list(range(first, stop)) else places
