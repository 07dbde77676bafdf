"""Labels as NoisyTest's TOML: chunk_ranges and chunk_labels in a table [data].

Both numbers of a range are written with a decimal point, since NoisyTest's TOML reader refuses
lists of mixed types. A stop of -1 is the end of the recording, so no label may stop at -1 s.
"""

import json
import tomllib
from collections.abc import Iterator, Sequence
from typing import Any

from inspector.labels.entry import Entry, EntryError, Span

END = -1.0
"""Stop of a label that ends with the recording."""

LATEST = 1e12
"""Largest accepted time, in [s]."""


def render(spans: Sequence[Span]) -> str:
    """TOML text of some labels, as NoisyTest stores it beside each log.

    Args:
        spans: The labels.

    Raises:
        EntryError: If one stops at -1 s, which is the end of the recording.
    """
    for span in spans:
        if span.stop == END:
            raise EntryError(
                f"label {span.label!r} stops at -1 s, the end of the recording in NoisyTest;"
                " use another format"
            )
    ranges = "".join(f"    [{span.start!r}, {span.stop!r}],\n" for span in spans)
    labels = "".join(f"    {json.dumps(span.label, ensure_ascii=False)},\n" for span in spans)
    return f"[data]\nchunk_ranges = [\n{ranges}]\nchunk_labels = [\n{labels}]\n"


def parse(text: str) -> Iterator[Entry]:
    """Labels of NoisyTest's annotations.

    Args:
        text: TOML.

    Yields:
        The labels.

    Raises:
        EntryError: If it is not TOML, lacks the lists, or they have other contents.
    """
    try:
        data = tomllib.loads(text).get("data", {})
    except tomllib.TOMLDecodeError as error:
        raise EntryError(f"not TOML ({error})") from error
    table = data if isinstance(data, dict) else {}
    ranges, labels = table.get("chunk_ranges"), table.get("chunk_labels")
    if not (isinstance(ranges, list) and isinstance(labels, list)):
        raise EntryError("lacks the lists chunk_ranges and chunk_labels in a table [data]")
    if len(ranges) != len(labels):
        raise EntryError(f"{len(ranges)} chunk_ranges and {len(labels)} chunk_labels")
    for count, (span, label) in enumerate(zip(ranges, labels, strict=True), start=1):
        yield _entry(span, label, f"chunk {count}")


def _entry(span: Any, label: Any, where: str) -> Entry:
    numbers = isinstance(span, list) and [
        type(each) in (int, float) and -LATEST < each < LATEST for each in span
    ]
    if numbers != [True, True] or not isinstance(label, str):
        raise EntryError(
            f"{span!r} with label {label!r}, expected [start, stop] in seconds and text", where
        )
    start, stop = float(span[0]), float(span[1])
    return Entry(start, None if stop == END else stop, label, where)
