"""Commands that import and export: `import` and `export`."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import typer

from inspector import export as exports
from inspector.analysis import analyse
from inspector.commands import shared
from inspector.commands.shared import argument, opened, option
from inspector.errors import EXIT, OUTPUT_LOST, Status, worst
from inspector.export import read_labels, write_labels
from inspector.library import load_library
from inspector.logs.read import import_logs, listing
from inspector.text import counted, printable, progress
from noisemodel.files import refuse_existing


def import_(
    ctx: typer.Context,
    logs: Annotated[
        list[Path], argument("CSV, Parquet, HDF5, npz, ROS bags, LeRobot data sets, folders.")
    ],
    output: Annotated[
        Path | None,
        option("The run file to write; a folder for several runs.", "--output", "-o"),
    ] = None,
    save_mapping: Annotated[Path | None, option("Save these options as a mapping (TOML).")] = None,
    list_: Annotated[
        bool, option("List the contents of the logs, write nothing.", "--list")
    ] = False,
    overwrite: shared.Overwrite = False,
) -> None:
    """Convert logs of robots to run files.

    The exit status is 3 if a log cannot be read, 5 if a run file cannot be written; the others are.
    """
    reading = ctx.obj
    if list_:
        for line in (line for log in logs for line in listing(log, reading.options)):
            typer.echo(printable(line))
        return
    if output is None:
        raise typer.BadParameter("name the run file to write", param_hint="'--output' / '-o'")
    statuses = [0]
    for result in import_logs(
        logs,
        output,
        reading,
        overwrite=overwrite,
        progress=lambda items, total: progress(items, "import", total=total),
    ):
        if result.problem:
            statuses.append(OUTPUT_LOST if result.lost else EXIT[Status.BAD_INPUT])
            typer.echo(f"inspector: {result.problem}", err=True)
            continue
        for remark in result.remarks:
            typer.echo(f"  {remark}")
        typer.echo(f"{result.path}: {result.duration:.2f} s at {result.rate:g} Hz")
    if save_mapping:
        reading.options.save(save_mapping, overwrite=overwrite)
    raise typer.Exit(worst(statuses))


def export(
    ctx: typer.Context,
    run: shared.RunFile,
    output: Annotated[
        Path,
        option(
            "The file to write: .mcap, .csv or .parquet; labels as .toml (NoisyTest), .csv or"
            " .txt (Audacity); a run as .npz.",
            "--output",
            "-o",
        ),
    ],
    labels: Annotated[
        Literal["findings", "annotated"] | None,
        option("Write a label file of the findings or annotated blocks."),
    ] = None,
    annotate: Annotated[
        Path | None, option("Write the run with the labels of this file instead.")
    ] = None,
    kind: Annotated[str, option("Extended noise: normal, rms, mean, paper, A, B or C.")] = "normal",
    model: shared.ModelFiles = None,
    overwrite: shared.Overwrite = False,
) -> None:
    """Write noise, labels and scores for other tools.

    Foxglove and PlotJuggler read MCAP, which holds the joints' motion as well; data frames read
    CSV and Parquet; annotation tools and spreadsheets read label files.
    """
    if labels and annotate:
        raise typer.BadParameter("name one of --labels and --annotate")
    refuse_existing(output, overwrite=overwrite)
    library = {} if annotate else load_library(model)
    recorded = opened(run, ctx.obj).run
    if annotate:
        blocks = read_labels(annotate, recorded)
        replace(recorded, blocks=blocks).save(output, overwrite=overwrite)
        told = counted(len(blocks), "label")
    elif labels:
        spans = analyse(recorded, library).findings if labels == "findings" else recorded.blocks
        write_labels(spans, output, overwrite=overwrite)
        for each in spans:
            typer.echo(f"{each.label} from {each.start:.2f} s to {each.stop:.2f} s")
        told = counted(len(spans), "label")
    else:
        written = exports.export(recorded, output, library, kind=kind, overwrite=overwrite)
        typer.echo(f"{run}: {written.analysis.headline}")
        for remark in written.remarks:
            typer.echo(f"  {remark}")
        told = str(written)
    typer.echo(f"{output}: {told}")
