"""Labels as NoisyTest's TOML: chunk_ranges and chunk_labels in a table [data].

`noiseclassifier.noisytest` reads it and `scenarios.noisytest` writes it. A stop of -1 is the end of
the recording, so that no other label may stop there.
"""

from collections.abc import Iterator, Sequence
from math import inf

from inspector.labels.entry import Entry, EntryError, Span
from noiseclassifier.errors import AnnotationError
from noiseclassifier.noisytest import END, parse_annotations
from noisemodel import Block


def render(spans: Sequence[Span]) -> str:
    """Labels as NoisyTest has them beside each of its logs.

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
    from noiseclassifier.scenarios.noisytest import annotations  # brings all scenarios

    return annotations([Block(span.start, span.stop, span.label) for span in spans])


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
        for count, block in enumerate(parse_annotations(text), start=1):
            stop = None if block.stop == inf else block.stop
            yield Entry(block.start, stop, block.label, f"chunk {count}")
    except AnnotationError as error:
        raise EntryError(error.problem, error.where) from error
