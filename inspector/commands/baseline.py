"""`inspector baseline`: train a baseline on good runs."""

from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer

from inspector.commands.options import (
    Alarms,
    GoodRuns,
    InPart,
    ModelRate,
    Output,
    Overwrite,
)
from inspector.training.part import Part

if TYPE_CHECKING:
    from inspector.logs.opening import Reading


def baseline(
    ctx: typer.Context,
    inputs: GoodRuns,
    output: Output,
    alarms: Alarms = 1.0,
    profile: Annotated[
        str,
        typer.Option(
            help="general (desired, measured, error) or scalar (noise only); by default the richest"
            " that the first run has the signals for."
        ),
    ] = "",
    rate: ModelRate = None,
    part: InPart = Part.ALL,
    overwrite: Overwrite = False,
) -> None:
    """Train a baseline on fault-free runs only, to find anomalies."""
    from inspector.training.baseline import train

    reading: Reading = ctx.obj

    trained = train(
        inputs,
        output,
        alarms=alarms,
        profile=profile,
        rate=rate,
        part=part,
        overwrite=overwrite,
        reading=reading,
        remark=partial(typer.echo, err=True),
    )
    typer.echo(str(trained))
    typer.echo(f"{output}: written; classify --model {output} finds anomalies against these runs")
