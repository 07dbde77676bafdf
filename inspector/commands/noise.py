"""`inspector noise`: the noise level of a run, by joints and links."""

from pathlib import Path
from typing import Annotated

import typer

from inspector.commands.options import Overwrite, RunFile


def noise(
    run: RunFile,
    kind: Annotated[
        list[str] | None,
        typer.Option("--kind", help="simplified, paper, A, B, C, mean, rms, normal; repeatable."),
    ] = None,
    csv: Annotated[
        Path | None, typer.Option("--csv", help="Write the noise over time to this file.")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Print the noise level of a run, by joints and links."""
    from inspector.analysis.level import default_kinds, estimate, noise_level, write_csv
    from noisemodel import Run

    recorded = Run.load(run)
    estimates = tuple(estimate(recorded, each) for each in kind or default_kinds(recorded))
    if csv:
        write_csv(recorded, estimates, csv, overwrite=overwrite)
    typer.echo(f"{run}: {recorded.duration:.2f} s at {recorded.rate:g} Hz")
    for each in estimates:
        typer.echo(str(noise_level(recorded, each)))
