"""`inspector import`: run files from logs of robots."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

from inspector.commands.options import Overwrite


def import_(
    logs: Annotated[
        list[Path],
        typer.Argument(
            help="CSV, Parquet, HDF5, npz, ROS bags or LeRobot data sets.", show_default=False
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="The run file to write; a folder for several runs."),
    ] = None,
    desired: Annotated[
        Path | None, typer.Option(help="Another log, with the desired motion on its own clock.")
    ] = None,
    robot: Annotated[
        str | None, typer.Option(help="A name that `robots` lists, or a URDF.")
    ] = None,
    rate: Annotated[
        float | None, typer.Option(min=1.0, help="Rate of the log in [Hz], if it is known.")
    ] = None,
    map_: Annotated[
        list[str] | None,
        typer.Option("--map", help="velocity.JOINT=COLUMN or position=ARRAY[7:]; repeatable."),
    ] = None,
    mapping: Annotated[Path | None, typer.Option(help="A saved mapping (TOML).")] = None,
    save_mapping: Annotated[
        Path | None, typer.Option(help="Save these options as a mapping (TOML).")
    ] = None,
    joints: Annotated[
        str | None, typer.Option(help="Names of the columns of arrays: a,b,c.")
    ] = None,
    topic: Annotated[
        list[str] | None, typer.Option(help="Read this topic of a bag; repeatable.")
    ] = None,
    episode: Annotated[
        list[str] | None, typer.Option(help="Read this episode of a data set; repeatable.")
    ] = None,
    offset: Annotated[
        float | None,
        typer.Option(help="Added to the time stamps of --desired, in seconds; else estimated."),
    ] = None,
    units: Annotated[
        str | None, typer.Option(help="Unit of angles: radians, degrees or normalised.")
    ] = None,
    degrees: Annotated[bool, typer.Option("--degrees", help="Angles are in degrees.")] = False,
    list_: Annotated[
        bool, typer.Option("--list", help="List the contents of the logs, write nothing.")
    ] = False,
    overwrite: Overwrite = False,
) -> None:
    """Convert logs of robots to run files.

    The exit status is 3 if a log cannot be read; the others are written.
    """
    from inspector.logs.batch import import_logs
    from inspector.logs.reading import listing, read_options

    options = read_options(
        map_ or (),
        saved=mapping,
        robot=robot,
        rate=rate,
        units="degrees" if degrees else units,
        joints=joints.split(",") if joints else None,
        topics=topic,
        offset=offset,
    )
    if list_:
        for line in (line for log in logs for line in listing(log, options)):
            typer.echo(line)
        return
    if output is None:
        raise typer.BadParameter("name the run file to write", param_hint="'--output' / '-o'")
    failed = False
    for result in import_logs(
        logs,
        output,
        options,
        desired=desired,
        episodes=episode or (),
        overwrite=overwrite,
        progress=_progress,
    ):
        failed |= bool(result.problem)
        if result.problem:
            typer.echo(f"inspector: {result.problem}", err=True)
            continue
        for remark in result.remarks:
            typer.echo(f"  {remark}")
        typer.echo(f"{result.path}: {result.duration:.2f} s at {result.rate:g} Hz")
    if save_mapping:
        options.save(save_mapping, overwrite=overwrite)
    if failed:
        raise typer.Exit(3)


def _progress(items: Iterable[Any], total: int) -> Iterator[Any]:
    from inspector.progress import progress

    return progress(items, "import", total=total)
