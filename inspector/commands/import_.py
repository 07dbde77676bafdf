"""`inspector import`: run files from logs of robots."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from inspector.commands.options import Overwrite
from inspector.errors import EXIT, OUTPUT_LOST, Status, worst

if TYPE_CHECKING:
    from inspector.logs.read import Reading


def import_(
    ctx: typer.Context,
    logs: Annotated[
        list[Path],
        typer.Argument(
            help="CSV, Parquet, HDF5, npz, ROS bags, LeRobot data sets, folders.",
            show_default=False,
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="The run file to write; a folder for several runs."),
    ] = None,
    save_mapping: Annotated[
        Path | None, typer.Option(help="Save these options as a mapping (TOML).")
    ] = None,
    list_: Annotated[
        bool, typer.Option("--list", help="List the contents of the logs, write nothing.")
    ] = False,
    overwrite: Overwrite = False,
) -> None:
    """Convert logs of robots to run files.

    The exit status is 3 if a log cannot be read, 5 if a run file cannot be written; the others are.
    Called again after an interruption, it writes the run files that a folder lacks.
    """
    from inspector.logs.read import import_logs, listing
    from inspector.text import printable

    reading: Reading = ctx.obj
    options = reading.options
    if list_:
        for line in (line for log in logs for line in listing(log, options)):
            typer.echo(printable(line))
        return
    if output is None:
        raise typer.BadParameter("name the run file to write", param_hint="'--output' / '-o'")
    statuses = [0]
    for result in import_logs(
        logs,
        output,
        options,
        desired=reading.desired,
        episodes=reading.episodes,
        overwrite=overwrite,
        progress=_progress,
    ):
        if result.problem:
            statuses.append(OUTPUT_LOST if result.lost else EXIT[Status.BAD_INPUT])
            typer.echo(f"inspector: {result.problem}", err=True)
            continue
        if result.kept:
            typer.echo(f"{result.path}: kept, it is there already")
            continue
        for remark in result.remarks:
            typer.echo(f"  {remark}")
        typer.echo(f"{result.path}: {result.duration:.2f} s at {result.rate:g} Hz")
    if save_mapping:
        options.save(save_mapping, overwrite=overwrite)
    raise typer.Exit(worst(statuses))


def _progress(items: Iterable[Any], total: int) -> Iterator[Any]:
    from inspector.text import progress

    return progress(items, "import", total=total)
