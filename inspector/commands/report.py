"""`inspector report`: an HTML page about a run."""

from typing import TYPE_CHECKING, Annotated

import typer

from inspector.commands.options import (
    Floor,
    Kind,
    ModelFiles,
    Output,
    Overwrite,
    RunFile,
    opened,
    reads_logs,
)

if TYPE_CHECKING:
    from inspector.logs.opening import Reading


@reads_logs
def report(
    run: RunFile,
    output: Output,
    model: ModelFiles = None,
    no_robot: Annotated[
        bool, typer.Option("--no-robot", help="Do not draw the robot and the noise of its links.")
    ] = False,
    kind: Kind = "normal",
    floor: Floor = None,
    overwrite: Overwrite = False,
    *,
    reading: "Reading",
) -> None:
    """Write one HTML page about a run: pictures, tables, sound."""
    from inspector import assets
    from inspector.analysis.analyse import analyse_file
    from inspector.audit.formats import text
    from inspector.library import load_library
    from inspector.report import html
    from noisemodel.atomic import refuse_existing

    html.require()
    refuse_existing(output, overwrite=overwrite, read=[run])
    library = load_library(assets.model_files(model))
    found = analyse_file(opened(run, reading), library, links=not no_robot, kind=kind)
    assert found.audit is not None
    seen = text(found.name, found.audit)
    html.write(found, output, audit=seen, overwrite=overwrite, floor=floor)
    typer.echo(f"{output}: {found.headline} ({output.stat().st_size / 1e6:.1f} MB)")
