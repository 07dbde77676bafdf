"""Export of a run to a file, in a format chosen by suffix."""

from collections.abc import Callable
from pathlib import Path

from inspector.errors import InspectorError
from inspector.export.content import Content, collect
from inspector.export.mcap import write_mcap
from inspector.export.table import write_csv, write_parquet
from inspector.library import Library
from noisemodel import Run
from noisemodel.atomic import refuse_existing, replacing

WRITERS: dict[str, Callable[[Content, Path], None]] = {
    ".mcap": write_mcap,
    ".csv": write_csv,
    ".parquet": write_parquet,
}
"""Writers by suffix."""


def export(
    run: Run, path: Path, library: Library, *, kind: str = "normal", overwrite: bool = False
) -> Content:
    """Write noise, labels and scores of a run.

    Args:
        run: The run.
        path: The file to write, ``.mcap``, ``.csv`` or ``.parquet``.
        library: Models to choose from by rate.
        kind: Kind of the extended noise, see ``noisemodel.extended``.
        overwrite: Whether a file that exists may be replaced.

    Returns:
        What was written.

    Raises:
        InspectorError: If there is no such format, or it needs an extra that is not installed.
        OutputError: If the file exists or cannot be written.
        NoiseModelError: If there is no such kind of noise, or the robot cannot be read.
    """
    write = WRITERS.get(path.suffix.lower())
    if write is None:
        raise InspectorError(
            f"{path}: no format of exports has this suffix; there are {', '.join(WRITERS)}"
        )
    refuse_existing(path, overwrite=overwrite)
    content = collect(run, library, kind=kind)
    with replacing(path, overwrite=overwrite) as temporary:
        write(content, temporary)
    return content
