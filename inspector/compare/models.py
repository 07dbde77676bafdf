"""Comparisons of noise models as CSV."""

import csv
from pathlib import Path

from inspector.text import cell
from noisemodel import Comparisons
from noisemodel.files import replacing


def write_csv(found: Comparisons, path: Path, *, overwrite: bool = False) -> None:
    """Write a row for each robot and kind, with the columns of ``Comparisons.to_arrow``."""
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
