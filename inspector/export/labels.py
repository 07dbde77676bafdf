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
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from math import inf, isfinite
from pathlib import Path
from typing import NamedTuple

from inspector.errors import InspectorError, OptionError, Status
from inspector.text import cell, uncell
from inspector.verdict import Verdict
from noiseclassifier import Event
from noiseclassifier.errors import AnnotationError
from noiseclassifier.jsontext import text_of
from noiseclassifier.noisytest import END, parse_annotations
from noisemodel import Block, Run
from noisemodel.files import refuse_existing, replacing

COLUMNS = ("start", "stop", "label")
Span = Block | Event
Entry = tuple[Block, str]
"""A label of a file, to infinity if it lasts to the end of the run, and its place: "line 3"."""


def write_labels(
    spans: Sequence[Span], path: Path, *, format_name: str = "", overwrite: bool = False
) -> None:
    """Write annotated blocks or findings to a file.

    Args:
        format_name: "noisytest", "csv" or "audacity"; by default by the suffix.
        overwrite: Whether a file that exists may be replaced.
    """
    text = format_of(path, format_name).render(spans, path)
    with replacing(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(text.encode())


def read_labels(path: Path, run: Run, *, format_name: str = "") -> tuple[Block, ...]:
    """Annotated blocks of a run, read from a file and checked, in order of time.

    Args:
        format_name: "noisytest", "csv" or "audacity"; by default by the suffix.
    """
    chosen = format_of(path, format_name)
    try:
        entries = sorted(chosen.parse(text_of(path), path))
    except OSError as error:
        raise InspectorError(f"{path}: cannot be read ({error.strerror})") from error
    except AnnotationError as error:
        where = error.where and f", {error.where}"
        raise InspectorError(f"{path}{where}: {error.problem}") from error
    except InspectorError:
        raise
    except ValueError as error:
        raise InspectorError(f"{path}: not a file of labels: {error}") from error
    begin, last = float(run.time[0]), float(run.time[-1])
    step = (last - begin) / (len(run.time) - 1)
    blocks = [
        Block(block.start, last + step if block.stop == inf else block.stop, block.label)
        for block, _ in entries
    ]
    places = [f"{path}, {where}" for _, where in entries]
    for block, where in zip(blocks, places, strict=True):
        if problem := _problem(block, begin - step, last + 2 * step):
            raise InspectorError(f"{where}: {problem}")
    for (before, after), where in zip(pairwise(blocks), places[1:], strict=False):
        if after.start < before.stop - step:
            raise InspectorError(
                f"{where}: blocks overlap: {after.label!r} starts at {after.start:g} s, before"
                f" {before.label!r} stops at {before.stop:g} s"
            )
    return tuple(sorted(blocks))


def label_paths(
    runs: Sequence[Path], folder: Path, *, format_name: str, overwrite: bool = False
) -> dict[Path, Path]:
    """Label files of runs in a folder, which is made, checked before the runs are classified."""
    suffix = format_of(folder, format_name).suffix
    targets: dict[Path, Path] = {}
    for run in dict.fromkeys(runs):
        target = folder / f"{run.stem}{suffix}"
        if twin := next((other for other, path in targets.items() if path == target), None):
            raise InspectorError(f"the labels of {twin} and {run} would both be {target}")
        targets[run] = target
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InspectorError(f"{folder}: cannot be made a folder ({error.strerror})") from error
    for target in targets.values():
        refuse_existing(target, overwrite=overwrite)
    return targets


def write_findings(
    verdicts: Iterable[Verdict],
    targets: Mapping[Path, Path],
    *,
    overwrite: bool = False,
) -> None:
    """Write the findings of each run that was classified; one without has an empty file."""
    for verdict in verdicts:
        if verdict.status in (Status.OK, Status.FINDINGS):
            write_labels(verdict.events, targets[verdict.path], overwrite=overwrite)


def _problem(block: Block, earliest: float, latest: float) -> str:
    """Why a label is refused: it is not printable, reversed, or outside of the run."""
    label = f"{block.label!r} from {block.start:g} s to {block.stop:g} s"
    if not block.label or not block.label.isprintable():
        return f"{block.label!r} is not a label; it is empty or cannot be printed"
    if not block.start < block.stop:
        return f"{label} stops before it starts, or has no duration"
    if block.start < earliest or block.stop > latest:
        return f"{label} lies outside of the run, {earliest:g} s to {latest:g} s"
    return ""


def _time(text: str, place: str) -> float:
    """A finite time parsed from text, in [s]."""
    try:
        value = float(text)
    except ValueError:
        value = inf
    if not isfinite(value):
        raise InspectorError(f"{place}: {text!r} is not a time in seconds")
    return value


def _render_audacity(spans: Sequence[Span], _path: Path) -> str:
    return "".join(f"{span.start!r}\t{span.stop!r}\t{span.label}\n" for span in spans)


def _parse_audacity(text: str, path: Path) -> Iterator[Entry]:
    for row, line in enumerate(text.split("\n"), start=1):
        where = f"line {row}"
        place, cells = f"{path}, {where}", line.removesuffix("\r").split("\t", maxsplit=2)
        if cells == [""] or cells[0] == "\\":  # frequencies of a spectral selection
            continue
        if len(cells) != 3:
            raise InspectorError(
                f"{place}: expected start, stop and label between tabs, not {line[:80]!r}"
            )
        yield Block(_time(cells[0], place), _time(cells[1], place), cells[2]), where


def _render_csv(spans: Sequence[Span], _path: Path) -> str:
    text = io.StringIO(newline="")
    scored = [span for span in spans if isinstance(span, Event)]
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow((*COLUMNS, "score") if scored else COLUMNS)
    for each in scored or spans:
        score = [repr(each.score)] if isinstance(each, Event) else []
        writer.writerow([repr(each.start), repr(each.stop), cell(each.label), *score])
    return text.getvalue()


def _parse_csv(text: str, path: Path) -> Iterator[Entry]:
    rows = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        header = [name.strip().lower() for name in next(rows, [])]
        if missing := [name for name in COLUMNS if name not in header]:
            raise InspectorError(
                f"{path}, line 1: there is no column {missing[0]!r}; expected {', '.join(COLUMNS)}"
            )
        for cells in rows:
            where = f"line {rows.line_num}"
            place = f"{path}, {where}"
            if not cells:
                continue
            if len(cells) != len(header):
                raise InspectorError(
                    f"{place}: {len(cells)} cells where the header names {len(header)} columns"
                )
            start, stop, label = (cells[header.index(name)] for name in COLUMNS)
            yield Block(_time(start, place), _time(stop, place), uncell(label)), where
    except csv.Error as error:
        raise InspectorError(f"{path}, line {rows.line_num}: not CSV ({error})") from error


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


def _parse_noisytest(text: str, _path: Path) -> Iterator[Entry]:
    for count, block in enumerate(parse_annotations(text), start=1):
        yield Block(block.start, block.stop, block.label), f"chunk {count}"


class Format(NamedTuple):
    """A format of label files: its suffix, what writes labels, and what reads them."""

    suffix: str
    render: Callable[[Sequence[Span], Path], str]
    parse: Callable[[str, Path], Iterator[Entry]]


FORMATS = {
    "noisytest": Format(".toml", _render_noisytest, _parse_noisytest),
    "csv": Format(".csv", _render_csv, _parse_csv),
    "audacity": Format(".txt", _render_audacity, _parse_audacity),
}
"""All formats by name."""


def format_of(path: Path, name: str = "") -> Format:
    """Format of a file, by name, else by its suffix."""
    if name and name not in FORMATS:
        raise OptionError(f"no format {name!r} of labels; there are {', '.join(FORMATS)}")
    if name:
        return FORMATS[name]
    for each in FORMATS.values():
        if path.suffix.lower() == each.suffix:
            return each
    known = ", ".join(f"{each.suffix} ({name})" for name, each in FORMATS.items())
    raise InspectorError(f"{path}: no format of labels has this suffix; there are {known}")
