"""`inspector report`: a page about a run."""

from typing import Annotated

import typer

from inspector.commands.options import Kind, ModelFiles, Output, Overwrite, RunFile


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
    from inspector import assets
    from inspector.analysis.inspection import inspect
    from inspector.audit import audit
    from inspector.audit.formats import text
    from inspector.library import load_library
    from inspector.report import html
    from inspector.report.markdown import verdict
    from noisemodel.atomic import refuse_existing

    html.require()
    refuse_existing(output, overwrite=overwrite)
    library = load_library(model or assets.model_files())
    found = inspect(run, library, robot=robot, kind=kind)
    seen = text(found.name, audit(found.run, library))
    html.write(found, output, audit=seen, overwrite=overwrite)
    typer.echo(f"{output}: {verdict(found)} ({output.stat().st_size / 1e6:.1f} MB)")
