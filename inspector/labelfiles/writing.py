"""Write the labels of a run, or what was found in it, to a file."""

from collections.abc import Sequence
from pathlib import Path

from inspector.labelfiles.entry import Span
from inspector.labelfiles.errors import EntryError, LabelFileError
from inspector.labelfiles.formats import format_of
from noisemodel.atomic import replacing


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
