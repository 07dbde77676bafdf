"""`inspector export`: noise, labels and scores for other tools; label files, and runs with them."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from inspector.commands.options import ModelFiles, Overwrite, RunFile, opened
from inspector.text import counted

if TYPE_CHECKING:
    from inspector.logs.read import Reading
    from noisemodel import Run


class Labels(StrEnum):
    """What a label file holds."""

    FINDINGS = "findings"
    ANNOTATED = "annotated"


Output = Annotated[
    Path,
    typer.Option(
        "--output",
        "-o",
        help="The file to write: .mcap, .csv or .parquet; labels as .toml (NoisyTest), .csv or"
        " .txt (Audacity); a run as .npz.",
    ),
]
LabelsOption = Annotated[
    Labels | None,
    typer.Option("--labels", help="Write a label file of the findings or annotated blocks."),
]
Annotate = Annotated[
    Path | None,
    typer.Option("--annotate", help="Write the run with the labels of this file instead."),
]
Kind = Annotated[
    str, typer.Option("--kind", help="Extended noise: normal, rms, mean, paper, A, B or C.")
]
Layouts = Annotated[
    bool,
    typer.Option("--layouts", help="Write layouts for Foxglove and PlotJuggler beside .mcap."),
]


def export(
    ctx: typer.Context,
    run: RunFile,
    output: Output,
    labels: LabelsOption = None,
    annotate: Annotate = None,
    kind: Kind = "normal",
    model: ModelFiles = None,
    layouts: Layouts = False,
    overwrite: Overwrite = False,
) -> None:
    """Write noise, labels and scores for other tools.

    Foxglove and PlotJuggler read MCAP, which holds the joints' motion as well; data frames read
    CSV and Parquet; annotation tools and spreadsheets read label files.
    """
    from inspector.export.tables import LAYOUTS
    from inspector.export.tables import export as write
    from inspector.library import load_library
    from noisemodel.files import refuse_existing

    reading: Reading = ctx.obj
    if labels and annotate:
        raise typer.BadParameter("name one of --labels and --annotate")
    refuse_existing(output, overwrite=overwrite)
    if annotate:
        _annotated(opened(run, reading).run, annotate, output, overwrite=overwrite)
        return
    library = load_library(model)
    recorded = opened(run, reading).run
    if labels:
        from inspector.analysis import analyse
        from inspector.export.labels import write_labels

        findings = labels is Labels.FINDINGS
        spans = analyse(recorded, library).findings if findings else recorded.blocks
        write_labels(spans, output, overwrite=overwrite)
        for each in spans:
            typer.echo(f"{each.label} from {each.start:.2f} s to {each.stop:.2f} s")
        typer.echo(f"{output}: {counted(len(spans), 'label')}")
        return
    found = write(recorded, output, library, kind=kind, overwrite=overwrite, layouts=layouts)
    typer.echo(f"{run}: {found.analysis.headline}")
    for remark in found.remarks:
        typer.echo(f"  {remark}")
    typer.echo(f"{output}: {found}")
    if layouts:
        typer.echo(f"  layouts: {', '.join(str(output.with_suffix(each)) for each in LAYOUTS)}")


def _annotated(run: "Run", labels: Path, output: Path, *, overwrite: bool) -> None:
    """Write a run whose annotated blocks are the labels of a file."""
    from dataclasses import replace

    from inspector.export.labels import read_labels

    blocks = read_labels(labels, run)
    replace(run, blocks=blocks).save(output, overwrite=overwrite)
    typer.echo(f"{output}: {counted(len(blocks), 'label')}")
