"""`inspector evaluate`: the measures of a model on annotated runs."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from inspector.commands.options import InPart, Inputs, Overwrite


class By(StrEnum):
    """What the runs of an evaluation are grouped by."""

    ROBOT = "robot"
    DOMAIN = "domain"
    SCENARIO = "scenario"


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
    part: InPart = "all",
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
    from inspector.library import model_files
    from inspector.training import train
    from noiseclassifier.assessment import table
    from noisemodel.files import refuse_existing, replacing

    for path in filter(None, (output, picture)):
        refuse_existing(path, overwrite=overwrite)
    if picture:
        train.require()
    (file,) = model_files([model])
    report = train.evaluate(file, inputs, part=part, seen_too=seen_too)
    text = train.as_json(report, file)
    if output:
        with replacing(output, overwrite=overwrite) as temporary:
            temporary.write_text(text + "\n", encoding="utf-8")
    if picture:
        train.draw(report, picture, title=file.stem, overwrite=overwrite)
    typer.echo(text if as_json else table(report, by or ""))
