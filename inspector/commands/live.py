"""`inspector live`: the noise of motion while it is measured."""

from pathlib import Path
from typing import Annotated

import typer

from inspector.commands.options import ModelFiles, Overwrite, PackageRoot


def live(
    rate: Annotated[
        float, typer.Option(min=1.0, help="Sampling rate in [Hz].", show_default=False)
    ],
    robot: Annotated[
        str | None,
        typer.Option(
            help="The robot to draw: a name that `robots` lists, a URDF or an MJCF (robot.xml)."
        ),
    ] = None,
    package_root: PackageRoot = None,
    names: Annotated[
        str, typer.Option(help="Joints in the order of the columns: elbow,wrist,...")
    ] = "",
    save: Annotated[
        Path | None,
        typer.Option("--save", help="Write the recording to this file, open no viewer."),
    ] = None,
    connect: Annotated[
        str | None,
        typer.Option(help="Send to the viewer at PORT or HOST:PORT; by default one is opened."),
    ] = None,
    model: ModelFiles = None,
    overwrite: Overwrite = False,
) -> None:
    """Show samples from standard input as they arrive.

    CSV has a header: time,elbow.velocity,elbow.velocity_desired,elbow.position
    JSON lines have one object each: {"time": 0.1, "velocity": [0.2]}
    Ctrl-C ends the recording.
    """
    import sys
    from functools import partial

    from inspector import assets
    from inspector.library import load_library
    from inspector.live import LiveError, LiveSession
    from inspector.live.feeding import follow

    del package_root  # has been allowed
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
