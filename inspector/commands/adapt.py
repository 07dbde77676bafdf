"""`inspector adapt`: adapt a general model to a robot by good runs of it."""

from functools import partial
from pathlib import Path
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


def adapt(
    ctx: typer.Context,
    inputs: GoodRuns,
    output: Output,
    alarms: Alarms = 1.0,
    model: Annotated[
        Path | None,
        typer.Option(
            help="The general model: a file, or the name of a shipped one; by default the shipped"
            " one.",
            show_default=False,
        ),
    ] = None,
    rate: ModelRate = None,
    part: InPart = Part.ALL,
    overwrite: Overwrite = False,
) -> None:
    """Adapt the shipped model to your robot, using fault-free runs."""
    from inspector.training.adaptation import adapt as adapt_model

    reading: Reading = ctx.obj

    adapted = adapt_model(
        inputs,
        output,
        alarms=alarms,
        model=model,
        rate=rate,
        part=part,
        overwrite=overwrite,
        reading=reading,
        remark=partial(typer.echo, err=True),
    )
    typer.echo(str(adapted))
    profile = adapted.learnt.classifier.profile
    typer.echo(
        f"{output}: written, for {profile.rate:g} Hz and {', '.join(profile.signals)};"
        f" classify --model {output} finds failures of this robot"
    )
