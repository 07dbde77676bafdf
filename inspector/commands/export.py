"""`inspector export`: noise, labels and scores for other tools."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from inspector.commands.options import ModelFiles, Overwrite, RunFile, opened, reads_logs

if TYPE_CHECKING:
    from inspector.logs.opening import Reading


@reads_logs
def export(
    run: RunFile,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="The file to write: .mcap, .csv or .parquet.")
    ],
    kind: Annotated[
        str, typer.Option("--kind", help="Extended noise: normal, rms, mean, paper, A, B or C.")
    ] = "normal",
    model: ModelFiles = None,
    layouts: Annotated[
        bool,
        typer.Option("--layouts", help="Write layouts for Foxglove and PlotJuggler beside .mcap."),
    ] = False,
    overwrite: Overwrite = False,
    *,
    reading: "Reading",
) -> None:
    """Write noise, labels and scores as MCAP, CSV or Parquet.

    Foxglove and PlotJuggler read MCAP, which holds the joints' motion as well; data frames read
    CSV and Parquet.
    """
    from inspector import assets
    from inspector.export import LAYOUTS
    from inspector.export import export as write
    from inspector.library import load_library
    from noisemodel.atomic import refuse_existing

    refuse_existing(output, overwrite=overwrite, read=[run])
    library = load_library(assets.model_files(model))
    found = write(
        opened(run, reading).run,
        output,
        library,
        kind=kind,
        overwrite=overwrite,
        layouts=layouts,
    )
    typer.echo(f"{run}: {found.analysis.headline}")
    for remark in found.remarks:
        typer.echo(f"  {remark}")
    typer.echo(f"{output}: {found}")
    if layouts:
        typer.echo(f"  layouts: {', '.join(str(output.with_suffix(each)) for each in LAYOUTS)}")
