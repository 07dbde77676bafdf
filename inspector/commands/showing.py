"""Commands that put a run on paper: a picture of its recording, a page to send around."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from inspector.commands.options import Kind, ModelFiles, Output, Overwrite, RunFile


def shot(
    run: Annotated[
        Path, typer.Argument(help="A run file, or a recording (.rrd).", show_default=False)
    ],
    output: Output,
    at: Annotated[
        float | None,
        typer.Option("--at", help="Time in seconds; else that of the worst finding."),
    ] = None,
    size: Annotated[str, typer.Option("--size", help="Width and height, in points.")] = "1440x900",
    model: ModelFiles = None,
    kind: Kind = "normal",
    overwrite: Overwrite = False,
) -> None:
    """Write what the viewer shows as a PNG, without a display (needs a Vulkan driver)."""
    from inspector import assets
    from inspector import shot as shooting
    from inspector.inspection import inspect
    from inspector.labelling import load_library
    from inspector.recording import write
    from inspector.sound.clip import first_look
    from noisemodel.atomic import refuse_existing

    shooting.require()
    refuse_existing(output, overwrite=overwrite)
    points = shooting.parse_size(size)
    with TemporaryDirectory() as folder:
        recording, seconds = run, at or 0.0
        if run.suffix != ".rrd":
            found = inspect(run, load_library(model or assets.model_files()), kind=kind)
            recording = Path(folder) / "run.rrd"
            seconds = first_look(found) if at is None else at
            write(found, recording)
        complaints = shooting.shoot(recording, output, seconds, size=points, overwrite=overwrite)
    typer.echo(f"{output}: {run} at {seconds:.2f} s")
    for complaint in complaints:
        typer.echo(f"  the viewer reports: {complaint}", err=True)


def report(
    run: RunFile,
    output: Output,
    model: ModelFiles = None,
    robot: Annotated[
        bool, typer.Option("--robot/--no-robot", help="Look at the robot, and hear its links.")
    ] = True,
    kind: Kind = "normal",
    overwrite: Overwrite = False,
) -> None:
    """Write a page with pictures, tables and sound, for those without a viewer."""
    from inspector import assets, htmlreport
    from inspector.audit import audit
    from inspector.audit.formats import text
    from inspector.inspection import inspect
    from inspector.labelling import load_library
    from inspector.report import verdict
    from noisemodel.atomic import refuse_existing

    htmlreport.require()
    refuse_existing(output, overwrite=overwrite)
    library = load_library(model or assets.model_files())
    found = inspect(run, library, robot=robot, kind=kind)
    seen = text(found.name, audit(found.run, library))
    htmlreport.write(found, output, audit=seen, overwrite=overwrite)
    typer.echo(f"{output}: {verdict(found)} ({output.stat().st_size / 1e6:.1f} MB)")
