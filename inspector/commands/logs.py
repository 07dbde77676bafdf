"""Commands on logs of robots."""

from pathlib import Path
from typing import Annotated

import typer

from inspector.commands.options import Output, Overwrite


def import_(
    log: Annotated[Path, typer.Argument(help="A wide CSV log.", show_default=False)],
    output: Output,
    desired: Annotated[
        Path | None, typer.Option(help="Another CSV, with the desired motion on its own clock.")
    ] = None,
    robot: Annotated[str | None, typer.Option(help="A listed robot, or a URDF.")] = None,
    rate: Annotated[
        float | None, typer.Option(min=1.0, help="The log's rate in [Hz], if it is known.")
    ] = None,
    map_: Annotated[
        list[str] | None,
        typer.Option("--map", help="velocity.JOINT=COLUMN; may be repeated."),
    ] = None,
    degrees: Annotated[bool, typer.Option(help="Angles in the log are in degrees.")] = False,
    overwrite: Overwrite = False,
) -> None:
    """Turn a CSV log into a run file."""
    from inspector.importing import read_csv

    imported = read_csv(
        log, desired=desired, robot=robot, rate=rate, mapping=map_ or (), degrees=degrees
    )
    imported.run.save(output, overwrite=overwrite)
    for remark in imported.remarks:
        typer.echo(f"  {remark}")
    typer.echo(f"{output}: {imported.run.duration:.2f} s at {imported.run.rate:g} Hz")
