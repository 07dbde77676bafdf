"""`inspector export`: noise, labels and scores for other tools."""

from pathlib import Path
from typing import Annotated

import typer

from inspector.commands.options import ModelFiles, Overwrite, RunFile


def export(
    run: RunFile,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="The file to write: .mcap, .csv or .parquet.")
    ],
    kind: Annotated[
        str, typer.Option("--kind", help="Extended noise: normal, rms, mean, paper, A, B or C.")
    ] = "normal",
    model: ModelFiles = None,
    overwrite: Overwrite = False,
) -> None:
    """Write noise, labels and scores as MCAP, CSV or Parquet.

    Foxglove and PlotJuggler read MCAP; data frames read CSV and Parquet.
    """
    from inspector import assets
    from inspector.export import export as write
    from inspector.library import load_library
    from noisemodel import Run

    library = load_library(assets.model_files(model))
    found = write(Run.load(run), output, library, kind=kind, overwrite=overwrite)
    typer.echo(f"{run}: {found.analysis.headline}")
    for remark in found.remarks:
        typer.echo(f"  {remark}")
    typer.echo(f"{output}: {found}")
