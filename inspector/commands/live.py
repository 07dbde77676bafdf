"""`inspector live`: the noise of motion while it is measured."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from inspector.commands.options import Limits, ModelFiles, Overwrite, PackageRoot


class Format(StrEnum):
    """The output formats of findings while they come."""

    TEXT = "text"
    JSON = "json"


Rate = Annotated[float, typer.Option(min=1.0, help="Sampling rate in [Hz].", show_default=False)]
Robot = Annotated[
    str | None,
    typer.Option(
        help="The robot to draw: a name that `robots` lists, a URDF or an MJCF (robot.xml)."
    ),
]
Names = Annotated[str, typer.Option(help="Joints in the order of the columns: elbow,wrist,...")]
Save = Annotated[
    Path | None, typer.Option("--save", help="Write the recording to this file, open no viewer.")
]
Connect = Annotated[
    str | None,
    typer.Option(help="Send to the viewer at PORT or HOST:PORT; by default one is opened."),
]
OutputFormat = Annotated[
    Format, typer.Option("--format", help="Of findings: lines of text, or JSON lines.")
]
FailFast = Annotated[
    bool, typer.Option("--fail-fast", help="End at the first finding that counts.")
]
ReferenceFolder = Annotated[
    Path | None,
    typer.Option(
        "--reference",
        help="Compare the stream with these accepted runs, or a folder of good ones: every 3 s the"
        " last 6 s, and all of it at the end. A finding is reported at most 4.3 s late.",
    ),
]


def live(
    rate: Rate,
    robot: Robot = None,
    package_root: PackageRoot = None,
    limit: Limits = None,
    names: Names = "",
    save: Save = None,
    connect: Connect = None,
    format: OutputFormat = Format.TEXT,  # noqa: A002
    fail_fast: FailFast = False,
    reference: ReferenceFolder = None,
    model: ModelFiles = None,
    overwrite: Overwrite = False,
) -> None:
    """Show samples from standard input as they arrive.

    Findings are printed as they come.

    CSV has a header: time,elbow.velocity,elbow.velocity_desired,elbow.position
    JSON lines have one object each: {"time": 0.1, "velocity": [0.2]}
    Ctrl-C ends the recording.

    Exit status: 0 ok, 1 findings, 2 wrong usage, 3 bad input, 4 cannot tell, 5 output lost, 70 bug.
    """
    import sys
    from functools import partial

    from inspector.library import load_library
    from inspector.live import LiveError, LiveSession
    from inspector.live.pipe import Gate, follow
    from inspector.reference.store import Reference

    del package_root, limit  # have been set
    if sys.stdin.isatty():
        raise LiveError(
            "samples are read from standard input; pipe them in: robot | inspector live"
        )
    known = None if reference is None else Reference.load(reference)
    gate = Gate(_tell, as_json=format is Format.JSON, reference=known)
    session = partial(
        LiveSession,
        rate,
        robot=robot,
        library=load_library(model),
        save=save,
        connect=connect,
        overwrite=overwrite,
        keep_levels=known is not None,
        on_warning=partial(typer.echo, err=True),
        on_finding=gate.take,
        on_levels=None if known is None else gate.compare,
    )
    summary = follow(
        sys.stdin.buffer,
        tuple(name.strip() for name in names.split(",") if name.strip()),
        lambda found: session(joint_names=found),
        enough=lambda: fail_fast and gate.failed,
    )
    raise typer.Exit(gate.end(summary))


def _tell(line: str) -> None:
    from contextlib import suppress

    with suppress(OSError):  # the recording goes on; the command line says what is lost
        typer.echo(line)
