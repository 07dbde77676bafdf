"""`inspector evaluate`: the measures of a model on annotated runs."""

from pathlib import Path
from typing import Annotated

import typer

from inspector.commands.options import InPart, Inputs, Overwrite
from inspector.training.part import By, Part


def evaluate(
    model: Annotated[
        Path, typer.Argument(help="A model file, or the name of a shipped one.", show_default=False)
    ],
    inputs: Inputs,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Write JSON to this file.")
    ] = None,
    picture: Annotated[
        Path | None, typer.Option(help="Write a PNG (needs the extra `report`).")
    ] = None,
    part: InPart = Part.ALL,
    by: Annotated[
        By | None, typer.Option(help="Print one whole table: by robot, domain or scenario.")
    ] = None,
    seen_too: Annotated[
        bool,
        typer.Option(
            "--seen-too", help="Accept runs that the model was trained on; the report lists them."
        ),
    ] = False,
    overwrite: Overwrite = False,
) -> None:
    """Evaluate a model on annotated runs that it was not trained on."""
    from inspector import assets
    from inspector.training.evaluation import Outputs
    from inspector.training.evaluation import as_json as json_of
    from inspector.training.evaluation import evaluate as evaluate_model
    from noiseclassifier.evaluation.assessment import table

    outputs = Outputs(output, picture, overwrite=overwrite)
    outputs.check()
    (file,) = assets.model_files([model])
    report = evaluate_model(file, inputs, part=part, seen_too=seen_too)
    outputs.write(report, file)
    typer.echo(json_of(report, file) if as_json else table(report, by or ""))
