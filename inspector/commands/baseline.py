"""The command that learns from good runs alone."""

from typing import Annotated

import typer

from inspector.commands.options import InPart, Inputs, Output, Overwrite
from inspector.training.part import Part


def baseline(
    inputs: Inputs,
    output: Output,
    alarms: Annotated[
        float, typer.Option(help="False alarms to bear in an hour of good motion.")
    ] = 1.0,
    profile: Annotated[
        str,
        typer.Option(
            help="general (desired, measured, error) or scalar (the noise alone); by default what"
            " the first run feeds."
        ),
    ] = "",
    rate: Annotated[
        float | None,
        typer.Option(
            min=1.0, help="Rate of the model in [Hz]; faster runs are lowered.", show_default=False
        ),
    ] = None,
    part: InPart = Part.ALL,
    overwrite: Overwrite = False,
) -> None:
    """Learn from good runs alone what is good; what departs from that is then found."""
    from inspector.training.baseline import learn

    learnt = learn(
        inputs,
        output,
        alarms=alarms,
        profile=profile,
        rate=rate,
        part=part,
        overwrite=overwrite,
    )
    typer.echo(str(learnt))
    typer.echo(f"{output}: written; classify --model {output} finds what departs from these runs")
