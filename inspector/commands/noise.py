"""`inspector noise`: the noise level of a run, by joints and links."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from inspector.commands.options import Overwrite, RunFile, opened, reads_logs, say_warnings

if TYPE_CHECKING:
    from inspector.logs.opening import Reading


@reads_logs
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
    *,
    reading: "Reading",
) -> None:
    """Print the noise level of a run, by joints and links."""
    from inspector.analysis.level import default_kinds, estimate, noise_level, write_csv

    recorded = opened(run, reading).run
    say_warnings(recorded)
    estimates = tuple(estimate(recorded, each) for each in kind or default_kinds(recorded))
    if csv:
        write_csv(recorded, estimates, csv, overwrite=overwrite)
    typer.echo(f"{run}: {recorded.duration:.2f} s at {recorded.rate:g} Hz")
    for each in estimates:
        typer.echo(str(noise_level(recorded, each)))
