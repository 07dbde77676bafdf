"""Label files of other tools: annotated blocks read and written, findings written.

- *noisytest*: TOML with ``chunk_ranges`` and ``chunk_labels`` in a table ``data``; a stop of -1 is
  the end of the recording, so that no other label may stop there;
- *csv*: columns start, stop and label, in any order; findings also have a score;
- *audacity*: a line for each label, with start, stop and text between tabs.

Times are the run's, in [s]; numbers are written with all digits.
"""

import csv
import io
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from math import inf, isfinite
from pathlib import Path
from typing import NamedTuple

from inspector.errors import InspectorError
from inspector.text import cell, uncell
from noiseclassifier import Event
from noiseclassifier.errors import AnnotationError
from noiseclassifier.jsontext import text_of
from noiseclassifier.noisytest import END, parse_annotations
from noisemodel import Block, Run
from noisemodel.files import write_whole

COLUMNS = ("start", "stop", "label")
Span = Block | Event
# A label of a file, to infinity if it lasts to the end of the run, and its place: "line 3".
Entry = tuple[Block, str]


def write_labels(spans: Sequence[Span], path: Path, *, overwrite: bool = False) -> None:
    """Write annotated blocks or findings to a file, in the format of its suffix."""
    text = format_of(path).render(spans, path)
    write_whole(path, text, overwrite=overwrite)


def read_labels(path: Path, run: Run) -> tuple[Block, ...]:
    """Annotated blocks of a run, read from a file and checked, in order of time."""
    chosen = format_of(path)
    try:
        return _checked(sorted(chosen.parse(text_of(path))), run)
    except OSError as error:
        raise InspectorError(f"{path}: cannot be read ({error.strerror})") from error
    except AnnotationError as error:
        where = error.where and f", {error.where}"
        raise InspectorError(f"{path}{where}: {error.problem}") from error
    except ValueError as error:
        raise InspectorError(f"{path}: not a file of labels: {error}") from error


def _checked(entries: Sequence[Entry], run: Run) -> tuple[Block, ...]:
    """The blocks of a run, which lie within it and overlap by a sample at most."""
    begin, last = float(run.time[0]), float(run.time[-1])
    step = (last - begin) / (len(run.time) - 1)
    earliest, latest = begin - step, last + 2 * step
    blocks = list[Block]()
    for block, where in entries:
        label = block.label
        if block.stop == inf:
            block = replace(block, stop=last + step)
        if not label or not label.isprintable():
            raise AnnotationError(f"{label!r} is empty or cannot be printed", where)
        if not earliest <= block.start < block.stop <= latest:
            raise AnnotationError(
                f"{label!r} from {block.start:g} s to {block.stop:g} s is empty, or lies outside of"
                f" the run, {earliest:g} s to {latest:g} s",
                where,
            )
        if blocks and block.start < blocks[-1].stop - step:
            raise AnnotationError(
                f"blocks overlap: {label!r} starts at {block.start:g} s, before"
                f" {blocks[-1].label!r} stops at {blocks[-1].stop:g} s",
                where,
            )
        blocks.append(block)
    return tuple(sorted(blocks))


def _time(text: str, where: str) -> float:
    """A finite time parsed from text, in [s]."""
    try:
        value = float(text)
    except ValueError:
        value = inf
    if not isfinite(value):
        raise AnnotationError(f"{text!r} is not a time in seconds", where)
    return value


def _render_audacity(spans: Sequence[Span], _path: Path) -> str:
    return "".join(f"{span.start!r}\t{span.stop!r}\t{span.label}\n" for span in spans)


def _parse_audacity(text: str) -> Iterator[Entry]:
    for row, line in enumerate(text.split("\n"), start=1):
        where, cells = f"line {row}", line.removesuffix("\r").split("\t", maxsplit=2)
        if cells == [""] or cells[0] == "\\":  # frequencies of a spectral selection
            continue
        if len(cells) != 3:
            expected = "expected start, stop and label between tabs"
            raise AnnotationError(f"{expected}, not {line[:80]!r}", where)
        start, stop, label = cells
        yield Block(_time(start, where), _time(stop, where), label), where


def _render_csv(spans: Sequence[Span], _path: Path) -> str:
    text = io.StringIO(newline="")
    scored = [span for span in spans if isinstance(span, Event)]
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow((*COLUMNS, "score") if scored else COLUMNS)
    for each in scored or spans:
        score = [repr(each.score)] if isinstance(each, Event) else []
        writer.writerow([repr(each.start), repr(each.stop), cell(each.label), *score])
    return text.getvalue()


def _parse_csv(text: str) -> Iterator[Entry]:
    rows = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        header = [name.strip().lower() for name in next(rows, [])]
        if missing := [name for name in COLUMNS if name not in header]:
            expected = f"expected {', '.join(COLUMNS)}"
            raise AnnotationError(f"there is no column {missing[0]!r}; {expected}", "line 1")
        for cells in rows:
            where = f"line {rows.line_num}"
            if cells and len(cells) != len(header):
                there = f"{len(cells)} cells where the header names {len(header)} columns"
                raise AnnotationError(there, where)
            if cells:
                start, stop, label = (cells[header.index(name)] for name in COLUMNS)
                yield Block(_time(start, where), _time(stop, where), uncell(label)), where
    except csv.Error as error:
        raise AnnotationError(f"not CSV ({error})", f"line {rows.line_num}") from error


def _render_noisytest(spans: Sequence[Span], path: Path) -> str:
    for span in spans:
        if span.stop == END:
            raise InspectorError(
                f"{path}: label {span.label!r} stops at -1 s, the end of the recording in"
                " NoisyTest; use another format"
            )
    # Both numbers of a range have a decimal point: NoisyTest's TOML reader takes no mixed ones.
    ranges = "".join(f"    [{float(each.start)!r}, {float(each.stop)!r}],\n" for each in spans)
    labels = "".join(f"    {json.dumps(each.label, ensure_ascii=False)},\n" for each in spans)
    return f"[data]\nchunk_ranges = [\n{ranges}]\nchunk_labels = [\n{labels}]\n"


def _parse_noisytest(text: str) -> Iterator[Entry]:
    for count, block in enumerate(parse_annotations(text), start=1):
        yield Block(*block), f"chunk {count}"


class Format(NamedTuple):
    """A format of label files: its name, what writes labels, and what reads them."""

    name: str
    render: Callable[[Sequence[Span], Path], str]
    parse: Callable[[str], Iterator[Entry]]


# All formats by suffix.
FORMATS = {
    ".toml": Format("noisytest", _render_noisytest, _parse_noisytest),
    ".csv": Format("csv", _render_csv, _parse_csv),
    ".txt": Format("audacity", _render_audacity, _parse_audacity),
}


def format_of(path: Path) -> Format:
    """Format of a file by its suffix."""
    if found := FORMATS.get(path.suffix.lower()):
        return found
    known = ", ".join(f"{suffix} ({each.name})" for suffix, each in FORMATS.items())
    raise InspectorError(f"{path}: no format of labels has this suffix; there are {known}")
