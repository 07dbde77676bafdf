"""Read the labels of a run from a file, and check that they fit it."""

from collections.abc import Sequence
from itertools import pairwise
from math import inf
from pathlib import Path

from inspector.labels.entry import Entry, EntryError, LabelFileError
from inspector.labels.formats import format_of
from noisemodel import Block, Run


def read_labels(path: Path, run: Run, *, format_name: str = "") -> tuple[Block, ...]:
    """Read the annotated blocks of a run.

    Args:
        path: The file.
        run: The run that the labels are of.
        format_name: "noisytest", "csv" or "audacity"; the file's ending tells unless given.

    Returns:
        The blocks, in order of time.

    Raises:
        InspectorError: If there is no such format.
        LabelFileError: If the file cannot be read or is damaged, or a label is reversed, lies
            outside of the run or overlaps another.
    """
    chosen = format_of(path, format_name)
    try:
        text = path.read_bytes().decode("utf-8-sig")
        entries = sorted(chosen.parse(text), key=_order)
    except OSError as error:
        raise LabelFileError(path, f"cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise LabelFileError(path, "no labels: it is no text in UTF-8") from error
    except EntryError as error:
        raise LabelFileError(path, error.problem, error.where) from error
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
    """Refuse what is no label, is reversed, or lies outside of the run by more than a sample."""
    said = f"{block.label!r} from {block.start:g} s to {block.stop:g} s"
    if not block.label or not block.label.isprintable():
        problem = f"{block.label!r} is no label; it is empty or cannot be printed"
    elif not block.start < block.stop:
        problem = f"{said} stops before it starts, or lasts no time"
    elif block.start < reach[0] or block.stop > reach[1]:
        problem = f"{said} lies outside of the run, {reach[0]:g} s to {reach[1]:g} s"
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
