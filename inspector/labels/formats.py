"""The formats that labels travel in, by name and by the ending of a file."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from inspector.errors import InspectorError
from inspector.labels import audacity, csv, noisytest
from inspector.labels.entry import Entry, EntryError, LabelFileError, Span
from noisemodel.atomic import replacing


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
    "csv": Format(".csv", csv.render, csv.parse),
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


def write_labels(
    spans: Sequence[Span], path: Path, *, format_name: str = "", overwrite: bool = False
) -> None:
    """Write labels to a file.

    Args:
        spans: Annotated blocks, or findings.
        path: The file to write.
        format_name: "noisytest", "csv" or "audacity"; the file's ending tells unless given.
        overwrite: Whether a file that exists may be replaced.

    Raises:
        InspectorError: If there is no such format.
        LabelFileError: If the format cannot say one of the labels.
        OutputError: If the file exists or cannot be written.
    """
    chosen = format_of(path, format_name)
    try:
        text = chosen.render(spans)
    except EntryError as error:
        raise LabelFileError(path, error.problem, error.where) from error
    with replacing(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(text.encode())
