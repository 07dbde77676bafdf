"""Commands that train models, and measure them."""

from pathlib import Path
from typing import Annotated

import typer

from inspector.commands.options import Inputs, Output, Overwrite


def train(
    inputs: Inputs,
    output: Output,
    profile: Annotated[
        str, typer.Option(help="logbands, noisytest-rbf, noisytest-linear, paper-rbf, paper-linear")
    ] = "logbands",
    rate: Annotated[
        float, typer.Option(min=1.0, help="Rate of the model in [Hz]; faster runs are lowered.")
    ] = 10000.0,
    overwrite: Overwrite = False,
) -> None:
    """Train a model on annotated runs."""
    from inspector.training import train as train_model

    typer.echo(str(train_model(inputs, profile, rate, output, overwrite=overwrite)))
    typer.echo(f"{output}: written; measured above on the frames that it was trained on")


def evaluate(
    model: Annotated[Path, typer.Argument(help="A model file.", show_default=False)],
    inputs: Inputs,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Measure a model on annotated runs that it was not trained on."""
    from json import dumps

    from inspector.training import evaluate as evaluate_model

    report = evaluate_model(model, inputs)
    typer.echo(dumps(report.as_dict(), indent=2) if as_json else str(report))
