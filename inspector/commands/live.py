"""The command that shows motion while it happens."""

from pathlib import Path
from typing import Annotated

import typer

from inspector.commands.options import ModelFiles, Overwrite


def live(
    rate: Annotated[
        float, typer.Option(min=1.0, help="Samples per second, in [Hz].", show_default=False)
    ],
    robot: Annotated[
        str | None, typer.Option(help="A listed robot, or a URDF, to draw as it moves.")
    ] = None,
    names: Annotated[
        str, typer.Option(help="Joints in the order of their columns: elbow,wrist,...")
    ] = "",
    save: Annotated[
        Path | None, typer.Option("--save", help="Write the recording here, open nothing.")
    ] = None,
    connect: Annotated[
        str | None,
        typer.Option(help="Show it in the viewer at PORT or HOST:PORT; else one is opened."),
    ] = None,
    model: ModelFiles = None,
    overwrite: Overwrite = False,
) -> None:
    """Show samples as they come on standard input, as CSV with a header or JSON lines.

    CSV names its columns: time,elbow.velocity,elbow.velocity_desired,elbow.position,... JSON has
    an object per line: {"time": 0.1, "velocity": [...], "position": [...]}. Ctrl-C ends it.
    """
    import sys
    from functools import partial

    from inspector import assets
    from inspector.library import load_library
    from inspector.live import LiveError, LiveSession
    from inspector.live.feeding import follow

    if sys.stdin.isatty():
        raise LiveError(
            "samples are read from standard input; pipe them in: robot | inspector live"
        )
    session = partial(
        LiveSession,
        rate,
        robot=robot,
        library=load_library(assets.model_files(model)),
        save=save,
        connect=connect,
        overwrite=overwrite,
        on_warning=partial(typer.echo, err=True),
    )
    given = tuple(name.strip() for name in names.split(",") if name.strip())
    summary = follow(sys.stdin.buffer, given, lambda found: session(joint_names=found))
    typer.echo(str(summary))
