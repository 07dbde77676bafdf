"""Label files, read and written in a format chosen by name or by suffix."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import inf
from pathlib import Path

from inspector.errors import InspectorError, OptionError
from inspector.labels import audacity, csv, noisytest
from inspector.labels.entry import Entry, EntryError, LabelFileError, Span
from noiseclassifier.jsontext import text_of
from noisemodel import Block, Run
from noisemodel.atomic import replacing


@dataclass(frozen=True)
class Format:
    """A format of label files.

    Attributes:
        suffix: Suffix of its files.
        render: Writes labels.
        parse: Reads them.
    """

    suffix: str
    render: Callable[[Sequence[Span]], str]
    parse: Callable[[str], Iterator[Entry]]


FORMATS = {
    "noisytest": Format(".toml", noisytest.render, noisytest.parse),
    "csv": Format(".csv", csv.render, csv.parse),
    "audacity": Format(".txt", audacity.render, audacity.parse),
}
"""All formats by name."""


def format_of(path: Path, name: str = "") -> Format:
    """Format of a file.

    Args:
        path: The file, whose suffix determines the format unless ``name`` does.
        name: The format's name, may be empty.

    Raises:
        OptionError: If there is no such format.
    """
    if name and name not in FORMATS:
        raise OptionError(f"no format {name!r} of labels; there are {', '.join(FORMATS)}")
    if name:
        return FORMATS[name]
    for each in FORMATS.values():
        if path.suffix.lower() == each.suffix:
            return each
    known = ", ".join(f"{each.suffix} ({name})" for name, each in FORMATS.items())
    raise InspectorError(f"{path}: no format of labels has this suffix; there are {known}")


def write_labels(
    spans: Sequence[Span], path: Path, *, format_name: str = "", overwrite: bool = False
) -> None:
    """Write labels to a file.

    Args:
        spans: Annotated blocks, or findings.
        path: The file to write.
        format_name: "noisytest", "csv" or "audacity"; by default by the suffix.
        overwrite: Whether a file that exists may be replaced.

    Raises:
        OptionError: If there is no such format.
        LabelFileError: If the format cannot represent one of the labels.
        OutputError: If the file exists or cannot be written.
    """
    chosen = format_of(path, format_name)
    try:
        text = chosen.render(spans)
    except EntryError as error:
        raise LabelFileError(path, error.problem, error.where) from error
    with replacing(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(text.encode())


def read_labels(path: Path, run: Run, *, format_name: str = "") -> tuple[Block, ...]:
    """Annotated blocks of a run, read from a file and checked.

    Args:
        path: The file.
        run: The run of the labels.
        format_name: "noisytest", "csv" or "audacity"; by default by the suffix.

    Returns:
        The blocks, in order of time.

    Raises:
        OptionError: If there is no such format.
        LabelFileError: If the file cannot be read or is damaged, or a label is reversed, lies
            outside of the run or overlaps another.
    """
    chosen = format_of(path, format_name)
    try:
        entries = sorted(chosen.parse(text_of(path)), key=_order)
    except OSError as error:
        raise LabelFileError(path, f"cannot be read ({error.strerror})") from error
    except EntryError as error:
        raise LabelFileError(path, error.problem, error.where) from error
    except ValueError as error:
        raise LabelFileError(path, f"not a file of labels: {error}") from error
    begin, last = float(run.time[0]), float(run.time[-1])
    step = (last - begin) / (len(run.time) - 1)
    blocks = [_block(entry, last + step) for entry in entries]
    for entry, block in zip(entries, blocks, strict=True):
        _check(path, entry, block, (begin - step, last + 2 * step))
    _check_apart(path, entries, blocks, step)
    return tuple(sorted(blocks))


def _order(entry: Entry) -> tuple[float, float, str]:
    return entry.start, inf if entry.stop is None else entry.stop, entry.label


def _block(entry: Entry, end: float) -> Block:
    return Block(entry.start, end if entry.stop is None else entry.stop, entry.label)


def _check(path: Path, entry: Entry, block: Block, reach: tuple[float, float]) -> None:
    """Refuse a label that is not printable, reversed, or outside of the run."""
    label = f"{block.label!r} from {block.start:g} s to {block.stop:g} s"
    if not block.label or not block.label.isprintable():
        problem = f"{block.label!r} is not a label; it is empty or cannot be printed"
    elif not block.start < block.stop:
        problem = f"{label} stops before it starts, or has no duration"
    elif block.start < reach[0] or block.stop > reach[1]:
        problem = f"{label} lies outside of the run, {reach[0]:g} s to {reach[1]:g} s"
    else:
        return
    raise LabelFileError(path, problem, entry.where)


def _check_apart(
    path: Path, entries: Sequence[Entry], blocks: Sequence[Block], step: float
) -> None:
    both = zip(entries, blocks, strict=True)
    for (_, before), (entry, after) in pairwise(both):
        if after.start < before.stop - step:
            raise LabelFileError(
                path,
                f"{after.label!r} starts at {after.start:g} s, before {before.label!r} stops at"
                f" {before.stop:g} s; the blocks of a run do not overlap",
                entry.where,
            )
