"""Export as one wide table: a row for each sample, with its frame and its block."""

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import noiseclassifier as nc
from inspector.export.content import Content
from inspector.text import cell
from noisemodel.types import Array

UNITS = {
    "time": "s",
    "simplified": "rad/s",
    "extended": "W",
    "frame_start": "s",
    "frame_stop": "s",
}
"""Units of the columns that have one."""


def arrow_table(content: Content) -> Any:
    """Exported data as an Arrow table.

    Columns are time, simplified, extended (with a robot), annotated (with blocks), and with labels
    frame_start, frame_stop, label and a score_<class> each: those of the frame whose middle is
    nearest, and null before the first and after the last frame's share.

    Args:
        content: The exported data.

    Returns:
        A ``pyarrow.Table``, whose fields have their unit as metadata.
    """
    import pyarrow as pa

    columns = dict(_columns(content))
    fields = [
        pa.field(name, pa.array(values).type, metadata=_unit(name))
        for name, values in columns.items()
    ]
    about = {"format": "noise-export/1", "model": content.analysis.model, "extended": content.kind}
    return pa.table(
        [pa.array(values) for values in columns.values()], pa.schema(fields, metadata=about)
    )


def write_parquet(content: Content, path: Path) -> None:
    """Write the table as Parquet.

    Args:
        content: The exported data.
        path: The file to write.
    """
    from pyarrow import parquet

    with path.open("wb") as file:  # its own errors lack the number
        parquet.write_table(arrow_table(content), file, compression="zstd")


def write_csv(content: Content, path: Path) -> None:
    """Write the table as CSV, numbers with all digits.

    Args:
        content: The exported data.
        path: The file to write.
    """
    import pyarrow.csv

    table = arrow_table(content)
    for place, name in enumerate(table.column_names):
        if name in ("label", "annotated"):
            cells = [None if each is None else cell(each) for each in table[name].to_pylist()]
            table = table.set_column(place, name, [cells])
    with path.open("w", newline="", encoding="utf-8") as file:
        # Arrow would quote all names, which not every reader of CSV accepts.
        csv.writer(file, lineterminator="\n").writerow(table.column_names)
    with path.open("ab") as stream:
        pyarrow.csv.write_csv(table, stream, pyarrow.csv.WriteOptions(include_header=False))


def _unit(name: str) -> dict[str, str] | None:
    return {"unit": UNITS[name]} if name in UNITS else None


def _columns(content: Content) -> Iterator[tuple[str, Any]]:
    yield "time", content.time
    yield "simplified", content.simplified
    if content.extended is not None:
        yield "extended", content.extended
    if content.analysis.run.blocks:
        yield "annotated", _annotated(content)
    if content.analysis.labels is not None:
        yield from _framed(content.time, content.analysis.labels)


def _annotated(content: Content) -> list[str | None]:
    labels: list[str | None] = [None] * len(content.time)
    for block in content.analysis.run.blocks:
        first, last = np.searchsorted(content.time, (block.start, block.stop))
        labels[first:last] = [block.label] * int(last - first)
    return labels


def _framed(time: Array, labels: nc.Labels) -> Iterator[tuple[str, Any]]:
    """Columns of the frame whose middle is nearest to each sample, null outside of all shares."""
    import pyarrow as pa

    middles = (labels.start + labels.stop) / 2
    share = np.median(np.diff(middles)) if len(middles) > 1 else labels.stop[0] - labels.start[0]
    nearest = np.searchsorted((middles[1:] + middles[:-1]) / 2, time)
    outside = np.abs(time - middles[nearest]) > share / 2

    def column(values: Any) -> Any:
        return pa.array(values[nearest], mask=outside)

    yield "frame_start", column(labels.start)
    yield "frame_stop", column(labels.stop)
    yield "label", column(labels.debounced.astype(object))
    for place, name in enumerate(labels.classes):
        yield f"score_{name}", column(labels.scores[:, place])
