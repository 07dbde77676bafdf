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
    reads_logs,
)
from inspector.training.part import Part

if TYPE_CHECKING:
    from inspector.logs.opening import Reading


@partial(reads_logs, without={"rate"})
def adapt(
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
    *,
    reading: "Reading",
) -> None:
    """Adapt a general model to a robot by good runs of it."""
    from inspector.training.adaptation import adapt as adapt_model

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
