"""`inspector shot`: a picture of a recording."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import typer

from inspector.commands.options import (
    Floor,
    Kind,
    ModelFiles,
    Output,
    Overwrite,
    opened,
    reads_logs,
)
from inspector.commands.outputs import check_suffix

if TYPE_CHECKING:
    from inspector.logs.opening import Reading


@reads_logs
def shot(
    run: Annotated[
        Path, typer.Argument(help="A run file or log, or a recording (.rrd).", show_default=False)
    ],
    output: Output,
    at: Annotated[
        float | None,
        typer.Option(
            "--at",
            help="Time in seconds; by default that of a run's worst finding, 0 of a recording.",
        ),
    ] = None,
    size: Annotated[str, typer.Option("--size", help="Width and height in pixels.")] = "1440x900",
    model: ModelFiles = None,
    kind: Kind = "normal",
    floor: Floor = None,
    overwrite: Overwrite = False,
    *,
    reading: "Reading",
) -> None:
    """Write a PNG of what the viewer shows, without a display.

    Needs a Vulkan driver (Debian: mesa-vulkan-drivers libvulkan1).
    """
    from inspector import assets
    from inspector.analysis.analyse import analyse_file
    from inspector.library import load_library
    from inspector.recording import picture as shooting
    from inspector.recording.run import write
    from inspector.sound import worst_time
    from noisemodel.atomic import refuse_existing

    check_suffix(output, ".png")
    shooting.require()
    refuse_existing(output, overwrite=overwrite)
    points = shooting.parse_size(size)
    with TemporaryDirectory() as folder:
        recording, seconds = run, at or 0.0
        if run.suffix != ".rrd":
            library = load_library(assets.model_files(model))
            source = opened(run, reading)
            first, last = (float(source.run.time[place]) for place in (0, -1))
            if at is not None and not first <= at <= last:
                raise typer.BadParameter(
                    f"--at {at:g}: the run lasts from {first:.2f} s to {last:.2f} s"
                )
            found = analyse_file(source, library, kind=kind)
            recording = Path(folder) / "run.rrd"
            seconds = worst_time(found) if at is None else at
            write(found, recording, floor=floor)
        complaints = shooting.shoot(recording, output, seconds, size=points, overwrite=overwrite)
    typer.echo(f"{output}: {run} at {seconds:.2f} s")
    for complaint in complaints:
        typer.echo(f"  the viewer reports: {complaint}", err=True)
