"""`inspector baseline`: train a baseline on good runs."""

from typing import Annotated

import typer

from inspector.commands.options import InPart, Inputs, Output, Overwrite
from inspector.training.part import Part


def baseline(
    inputs: Inputs,
    output: Output,
    alarms: Annotated[
        float, typer.Option(help="False-alarm budget, per hour of good motion.")
    ] = 1.0,
    profile: Annotated[
        str,
        typer.Option(
            help="general (desired, measured, error) or scalar (noise only); by default the richest"
            " that the first run has the signals for."
        ),
    ] = "",
    rate: Annotated[
        float | None,
        typer.Option(
            min=1.0,
            help="Rate of the model in [Hz]; faster runs are decimated.",
            show_default=False,
        ),
    ] = None,
    part: InPart = Part.ALL,
    overwrite: Overwrite = False,
) -> None:
    """Train a baseline on good runs only, to find anomalies."""
    from inspector.training.baseline import train

    trained = train(
        inputs,
        output,
        alarms=alarms,
        profile=profile,
        rate=rate,
        part=part,
        overwrite=overwrite,
    )
    typer.echo(str(trained))
    typer.echo(f"{output}: written; classify --model {output} finds anomalies against these runs")
