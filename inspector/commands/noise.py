"""`inspector noise`: how loud a run is, and which joints and links make it so."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from inspector.commands.options import Overwrite, RunFile

if TYPE_CHECKING:
    pass


def noise(
    run: RunFile,
    kind: Annotated[
        list[str] | None,
        typer.Option("--kind", help="simplified, paper, A, B, C, mean, rms, normal; repeatable."),
    ] = None,
    csv: Annotated[
        Path | None, typer.Option("--csv", help="Write the noises over time here.")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Print how loud a run is, when, and which joints and links make it so."""
    from inspector.analysis.level import default_kinds, estimate, loudness, write_csv
    from noisemodel import Run

    recorded = Run.load(run)
    estimates = tuple(estimate(recorded, each) for each in kind or default_kinds(recorded))
    if csv:
        write_csv(recorded, estimates, csv, overwrite=overwrite)
    typer.echo(f"{run}: {recorded.duration:.2f} s at {recorded.rate:g} Hz")
    for each in estimates:
        typer.echo(str(loudness(recorded, each)))
