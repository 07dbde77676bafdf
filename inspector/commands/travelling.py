"""Commands that take labels, noise and scores in and out."""

from pathlib import Path
from typing import Annotated

import typer

from inspector.commands.options import ModelFiles, Overwrite, RunFile


def labels(
    run: RunFile,
    to: Annotated[
        Path | None, typer.Option("--to", help="Write the run's labels to this file.")
    ] = None,
    from_: Annotated[
        Path | None, typer.Option("--from", help="Read labels from this file, in place of its own.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="The run to write, with --from.")
    ] = None,
    format: Annotated[  # noqa: A002
        str, typer.Option("--format", help="noisytest, csv or audacity; else as the file ends.")
    ] = "",
    overwrite: Overwrite = False,
) -> None:
    """Print a run's annotated blocks, or take them to and from NoisyTest, CSV and Audacity."""
    from dataclasses import replace

    from inspector.errors import InspectorError
    from inspector.labelfiles import read_labels, write_labels
    from noisemodel import Run

    if to and from_:
        raise typer.BadParameter("name one of --to and --from")
    if bool(from_) != bool(output):
        raise typer.BadParameter("--from FILE and -o RUN go together")
    recorded = Run.load(run)
    if from_ and output:
        recorded = replace(recorded, blocks=read_labels(from_, recorded, format_name=format))
        recorded.save(output, overwrite=overwrite)
    elif not recorded.blocks:
        raise InspectorError(
            f"{run}: has no labels; `inspector labels --from` brings some in,"
            " `inspector classify --labels-to` writes what is found"
        )
    elif to:
        write_labels(recorded.blocks, to, format_name=format, overwrite=overwrite)
    for block in recorded.blocks:
        typer.echo(f"{block.label} from {block.start:.2f} s to {block.stop:.2f} s")
    if output or to:
        typer.echo(f"{output or to}: {len(recorded.blocks)} labels")


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
    """Write noise, labels and scores of a run for Foxglove, PlotJuggler and data frames."""
    from inspector import assets
    from inspector.export import export as write
    from inspector.labelling import load_library
    from noisemodel import Run

    library = load_library(model or assets.model_files())
    found = write(Run.load(run), output, library, kind=kind, overwrite=overwrite)
    for remark in found.remarks:
        typer.echo(f"  {remark}")
    typer.echo(f"{output}: {found}")
