"""Export of a run to a file, in a format chosen by suffix."""

from collections.abc import Callable
from pathlib import Path

from inspector.errors import OptionError
from inspector.export.content import Content, collect
from inspector.export.layouts import foxglove, plotjuggler
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

LAYOUTS: dict[str, Callable[[Content], str]] = {
    ".foxglove.json": foxglove,
    ".plotjuggler.xml": plotjuggler,
}
"""Layouts by the suffix that takes the place of ``.mcap``."""


def export(
    run: Run,
    path: Path,
    library: Library,
    *,
    kind: str = "normal",
    overwrite: bool = False,
    layouts: bool = False,
) -> Content:
    """Write noise, labels and scores of a run.

    Args:
        run: The run.
        path: The file to write, ``.mcap``, ``.csv`` or ``.parquet``.
        library: Models to choose from by rate.
        kind: Kind of the extended noise, see ``noisemodel.extended``.
        overwrite: Whether a file that exists may be replaced.
        layouts: Whether to write layouts for Foxglove and PlotJuggler beside it, see `LAYOUTS`.

    Returns:
        What was written.

    Raises:
        OptionError: If there is no such format, or layouts for another than MCAP.
        InspectorError: If the format needs an extra that is not installed.
        OutputError: If the file exists or cannot be written.
        NoiseModelError: If there is no such kind of noise, or the robot cannot be read.
    """
    write = WRITERS.get(path.suffix.lower())
    if write is None:
        raise OptionError(
            f"{path}: no format of exports has this suffix; there are {', '.join(WRITERS)}"
        )
    if layouts and write is not write_mcap:
        raise OptionError(f"{path}: layouts are for .mcap")
    others = {path.with_suffix(suffix): make for suffix, make in LAYOUTS.items() if layouts}
    for each in (path, *others):
        refuse_existing(each, overwrite=overwrite)
    content = collect(run, library, kind=kind)
    with replacing(path, overwrite=overwrite) as temporary:
        write(content, temporary)
    for each, make in others.items():
        with replacing(each, overwrite=overwrite) as temporary:
            temporary.write_text(make(content), encoding="utf-8")
    return content
