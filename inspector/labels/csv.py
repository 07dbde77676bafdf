"""Labels as CSV, with columns start, stop and label; findings also have a score."""

import csv
import io
from collections.abc import Iterator, Sequence

from inspector.labels.entry import Entry, EntryError, Span, number
from inspector.text import cell, uncell
from noiseclassifier import Event

COLUMNS = ("start", "stop", "label")


def render(spans: Sequence[Span]) -> str:
    """CSV text of some labels.

    Args:
        spans: The labels; scores are written if they are findings.
    """
    text = io.StringIO(newline="")
    scored = [span for span in spans if isinstance(span, Event)]
    writer = csv.writer(text, lineterminator="\n")
    if scored:
        writer.writerow((*COLUMNS, "score"))
        writer.writerows(
            (repr(e.start), repr(e.stop), cell(e.label), repr(e.score)) for e in scored
        )
    else:
        writer.writerow(COLUMNS)
        writer.writerows((repr(span.start), repr(span.stop), cell(span.label)) for span in spans)
    return text.getvalue()


def parse(text: str) -> Iterator[Entry]:
    """Labels of CSV text.

    Args:
        text: A header that names start, stop and label in any order, then a row per label; other
            columns are ignored.

    Yields:
        The labels.

    Raises:
        EntryError: If the header lacks a column, or a row has other cells than the header.
    """
    rows = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        header = [name.strip().lower() for name in next(rows, [])]
        if missing := [name for name in COLUMNS if name not in header]:
            raise EntryError(
                f"there is no column {missing[0]!r}; expected {', '.join(COLUMNS)}", "line 1"
            )
        for cells in rows:
            where = f"line {rows.line_num}"
            if not cells:
                continue
            if len(cells) != len(header):
                raise EntryError(
                    f"{len(cells)} cells where the header names {len(header)} columns", where
                )
            start, stop, label = (cells[header.index(name)] for name in COLUMNS)
            yield Entry(number(start, where), number(stop, where), uncell(label), where)
    except csv.Error as error:
        raise EntryError(f"not CSV ({error})", f"line {rows.line_num}") from error
