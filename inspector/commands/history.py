"""`inspector history`: results over commits."""

from pathlib import Path
from typing import Annotated

import typer

from inspector.commands.options import Overwrite
from inspector.errors import EXIT, Status


def history(
    results: Annotated[
        Path,
        typer.Argument(help="A folder of files of `classify --write json=FILE`, one per commit."),
    ],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Write a page (.html) to this file.")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Show the results of many commits, and where they changed.

    Files are in order of their names, and named after their commit behind the last dash:
    0061-3f2a1c9.json. The exit status is 3 if one cannot be read; the others are shown.
    """
    from inspector.report.history import page, read
    from noisemodel.files import refuse_existing, replacing

    if output:
        refuse_existing(output, overwrite=overwrite)
    found = read(results)
    for line in found.lines():
        typer.echo(line)
    for problem in found.problems:
        typer.echo(f"inspector: {problem}", err=True)
    if output:
        with replacing(output, overwrite=overwrite) as temporary:
            temporary.write_text(page(found), encoding="utf-8")
    raise typer.Exit(EXIT[Status.BAD_INPUT] if found.problems else 0)
