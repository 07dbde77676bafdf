"""`inspector labels`: annotated blocks of a run, from and for other tools."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from inspector.commands.options import Overwrite, RunFile, opened, reads_logs
from inspector.text import counted

if TYPE_CHECKING:
    from inspector.logs.opening import Reading


@reads_logs
def labels(
    run: RunFile,
    to: Annotated[
        Path | None, typer.Option("--to", help="Write the labels of the run to this file.")
    ] = None,
    from_: Annotated[
        Path | None,
        typer.Option("--from", help="Replace the labels of the run by those of this file."),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="The run file to write, with --from.")
    ] = None,
    format: Annotated[  # noqa: A002
        str,
        typer.Option("--format", help="noisytest, csv or audacity; by default from the suffix."),
    ] = "",
    overwrite: Overwrite = False,
    *,
    reading: "Reading",
) -> None:
    """Print, import or export the annotated blocks of a run."""
    from dataclasses import replace

    from inspector.errors import InspectorError
    from inspector.labels import read_labels, write_labels

    if to and from_:
        raise typer.BadParameter("name one of --to and --from")
    if bool(from_) != bool(output):
        raise typer.BadParameter("--from FILE and -o RUN go together")
    recorded = opened(run, reading).run
    if from_ and output:
        recorded = replace(recorded, blocks=read_labels(from_, recorded, format_name=format))
        recorded.save(output, overwrite=overwrite)
    elif not recorded.blocks:
        raise InspectorError(
            f"{run}: has no labels; `inspector labels --from` imports labels,"
            " `inspector classify --labels-to` writes the findings"
        )
    elif to:
        write_labels(recorded.blocks, to, format_name=format, overwrite=overwrite)
    for block in recorded.blocks:
        typer.echo(f"{block.label} from {block.start:.2f} s to {block.stop:.2f} s")
    if output or to:
        typer.echo(f"{output or to}: {counted(len(recorded.blocks), 'label')}")
