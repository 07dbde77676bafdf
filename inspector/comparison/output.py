"""The files that a comparison of noise models is written to: CSV, a recording, a picture."""

import csv
from dataclasses import dataclass
from pathlib import Path

from inspector.comparison import picture
from inspector.errors import InspectorError
from inspector.text import cell
from noisemodel import Comparisons
from noisemodel.atomic import refuse_existing, replacing

MOST = 8
"""Robots that a recording may hold; more make the viewer too slow."""


@dataclass(frozen=True)
class Outputs:
    """What to write; None is not written.

    Attributes:
        csv: All numbers.
        recording: For the viewer.
        picture: A PNG file.
        overwrite: Whether files that exist may be replaced.
    """

    csv: Path | None = None
    recording: Path | None = None
    picture: Path | None = None
    overwrite: bool = False

    def check(self, count: int) -> None:
        """Refuse what cannot be written before long work is done for it.

        Args:
            count: How many robots and runs will be compared.

        Raises:
            OutputError: If a file exists and may not be replaced, or cannot be written.
            InspectorError: If a recording cannot hold so many, or matplotlib is not installed.
        """
        for path in filter(None, (self.csv, self.recording, self.picture)):
            refuse_existing(path, overwrite=self.overwrite)
        if self.recording and count > MOST:
            raise InspectorError(
                f"{self.recording}: a recording holds {MOST} robots and runs at most, not {count};"
                " name some of them, or write --csv and --picture alone"
            )
        if self.picture:
            picture.require()

    def write(self, found: Comparisons) -> None:
        """Write the files.

        Args:
            found: One comparison or more.

        Raises:
            OutputError: If a file exists and may not be replaced, or cannot be written.
        """
        if self.csv:
            write_csv(found, self.csv, overwrite=self.overwrite)
        if self.recording:
            from inspector.comparison.recording import write

            write(found, self.recording, overwrite=self.overwrite)
        if self.picture:
            picture.draw(found, self.picture, overwrite=self.overwrite)


def write_csv(found: Comparisons, path: Path, *, overwrite: bool = False) -> None:
    """Write a row for each robot and kind, with the columns of ``Comparisons.to_arrow``.

    Args:
        found: One comparison or more.
        path: The file to write.
        overwrite: Whether a file that exists may be replaced.

    Raises:
        OutputError: If the file exists or cannot be written.
    """
    table = found.to_arrow()
    with (
        replacing(path, overwrite=overwrite) as temporary,
        temporary.open("w", newline="", encoding="utf-8") as file,
    ):
        writer = csv.DictWriter(file, table.column_names, lineterminator="\n")
        writer.writeheader()
        for row in table.to_pylist():
            writer.writerow({name: _cell(name, value) for name, value in row.items()})


def _cell(name: str, value: str | bool | int | float) -> str | int:
    """Print a number as the CSV of earlier versions did."""
    if isinstance(value, float):
        return f"{value:g}" if name == "rate_hz" else f"{value:.4f}"
    if isinstance(value, str):
        return cell(value)
    return int(value) if isinstance(value, bool) else value
