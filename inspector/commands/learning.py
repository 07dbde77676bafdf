"""Commands that train models, and measure them."""

from pathlib import Path
from typing import Annotated

import typer

from inspector.commands.options import InPart, Inputs, Output, Overwrite
from inspector.part import Part


def train(
    inputs: Inputs,
    output: Output,
    profile: Annotated[
        str,
        typer.Option(
            help="joints, general, scalar, logbands, noisytest-rbf, noisytest-linear, paper-rbf or"
            " paper-linear."
        ),
    ] = "general",
    rate: Annotated[
        float, typer.Option(min=1.0, help="Rate of the model in [Hz]; faster runs are lowered.")
    ] = 10000.0,
    part: InPart = Part.ALL,
    overwrite: Overwrite = False,
) -> None:
    """Train a model on annotated runs."""
    from inspector.training import train as train_model

    report = train_model(inputs, profile, rate, output, part=part, overwrite=overwrite)
    typer.echo(str(report))
    typer.echo(f"{output}: written; measured above on the frames that it was trained on")


def evaluate(
    model: Annotated[Path, typer.Argument(help="A model file.", show_default=False)],
    inputs: Inputs,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Write JSON to this file.")
    ] = None,
    picture: Annotated[
        Path | None, typer.Option(help="Write a PNG here (needs the extra `report`).")
    ] = None,
    part: InPart = Part.ALL,
    seen_too: Annotated[
        bool, typer.Option("--seen-too", help="Take runs that it was trained on, and say so.")
    ] = False,
    overwrite: Overwrite = False,
) -> None:
    """Measure a model on annotated runs that it was not trained on."""
    from inspector.evaluationoutput import Outputs
    from inspector.evaluationoutput import as_json as json_of
    from inspector.training import evaluate as evaluate_model

    outputs = Outputs(output, picture, overwrite=overwrite)
    outputs.check()
    report = evaluate_model(model, inputs, part=part, seen_too=seen_too)
    outputs.write(report, model)
    typer.echo(json_of(report, model) if as_json else str(report))
