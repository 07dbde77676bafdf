"""Label tracks of Audacity: a line for each label, with start, stop and text between tabs."""

from collections.abc import Iterator, Sequence

from inspector.labels.entry import Entry, EntryError, Span, number


def render(spans: Sequence[Span]) -> str:
    """Label track of some labels.

    Args:
        spans: The labels.
    """
    return "".join(f"{span.start!r}\t{span.stop!r}\t{span.label}\n" for span in spans)


def parse(text: str) -> Iterator[Entry]:
    """Labels of a label track.

    Args:
        text: The track; lines with the frequencies of spectral selections are ignored.

    Yields:
        Its labels.

    Raises:
        EntryError: If a line is not part of a label track.
    """
    for row, line in enumerate(text.split("\n"), start=1):
        where, cells = f"line {row}", line.removesuffix("\r").split("\t", maxsplit=2)
        if cells == [""] or cells[0] == "\\":
            continue
        if len(cells) != 3:
            raise EntryError(
                f"expected start, stop and label between tabs, not {line[:80]!r}", where
            )
        yield Entry(number(cells[0], where), number(cells[1], where), cells[2], where)
