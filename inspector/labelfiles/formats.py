"""The formats that labels travel in, by name and by the ending of a file."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from inspector.errors import InspectorError
from inspector.labelfiles import audacity, noisytest, table
from inspector.labelfiles.entry import Entry, Span


@dataclass(frozen=True)
class Format:
    """A way to write labels.

    Attributes:
        suffix: The ending of its files.
        render: Writes labels.
        parse: Reads them.
    """

    suffix: str
    render: Callable[[Sequence[Span]], str]
    parse: Callable[[str], Iterator[Entry]]


FORMATS = {
    "noisytest": Format(".toml", noisytest.render, noisytest.parse),
    "csv": Format(".csv", table.render, table.parse),
    "audacity": Format(".txt", audacity.render, audacity.parse),
}
"""All formats by name."""


def format_of(path: Path, name: str = "") -> Format:
    """Choose a format.

    Args:
        path: The file, whose ending tells the format unless ``name`` does.
        name: The format's name, may be empty.

    Raises:
        InspectorError: If there is no such format.
    """
    if name and name not in FORMATS:
        raise InspectorError(f"no format {name!r} of labels; there are {', '.join(FORMATS)}")
    if name:
        return FORMATS[name]
    for each in FORMATS.values():
        if path.suffix.lower() == each.suffix:
            return each
    known = ", ".join(f"{each.suffix} ({name})" for name, each in FORMATS.items())
    raise InspectorError(f"{path}: no format of labels ends so; there are {known}")
