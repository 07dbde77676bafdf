"""`inspector train`: train a model on annotated runs."""

from typing import Annotated

import typer

from inspector.commands.options import InPart, Inputs, Output, Overwrite


def train(
    inputs: Inputs,
    output: Output,
    profile: Annotated[
        str,
        typer.Option(
            help="general, for any rate; or of one rate: joints, norms, scalar, logbands,"
            " noisytest-rbf, noisytest-linear, paper-rbf or paper-linear."
        ),
    ] = "general",
    rate: Annotated[
        float | None,
        typer.Option(
            min=1.0,
            help="Rate of a model of one rate in [Hz], by default 10000; faster runs are"
            " decimated.",
        ),
    ] = None,
    part: InPart = "all",
    overwrite: Overwrite = False,
) -> None:
    """Train a model on annotated runs."""
    from inspector.training.train import train as train_model

    measures, left_out = train_model(inputs, profile, rate, output, part=part, overwrite=overwrite)
    typer.echo(f"{measures}\n{left_out}")
    typer.echo(f"{output}: written; the measures above are of the training frames")
