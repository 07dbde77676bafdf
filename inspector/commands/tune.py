"""The command that tunes profiles."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from inspector.commands.options import InPart, Inputs, Overwrite
from inspector.training.part import Part


class By(StrEnum):
    """What makes a point the best; of equals, the log-loss decides."""

    BALANCED_ACCURACY = "balanced-accuracy"
    LOG_LOSS = "log-loss"
    SUBSET_ACCURACY = "subset-accuracy"


def tune(
    training: Inputs,
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            help="The results, a line of JSON for each point; a file that exists is gone on with.",
        ),
    ],
    validation: Annotated[
        list[Path] | None,
        typer.Option(help="Other runs to measure by, instead of folds; may be repeated."),
    ] = None,
    folds: Annotated[
        int | None, typer.Option(min=2, help="Folds of the training runs.", show_default="5")
    ] = None,
    part: InPart = Part.ALL,
    profile: Annotated[
        str,
        typer.Option(
            help="joints, general, scalar, logbands, noisytest-rbf, noisytest-linear, paper-rbf or"
            " paper-linear."
        ),
    ] = "noisytest-rbf",
    rate: Annotated[
        float, typer.Option(min=1.0, help="Rate of the model in [Hz]; faster runs are lowered.")
    ] = 10000.0,
    grid: Annotated[
        list[str] | None,
        typer.Option(
            help="paper, or a setting and its values: stride=224:1024:100, C=0.1:1000:x10,"
            " gamma=1e-4,1e-3, bands=comb,adjacent; may be repeated.",
            show_default="paper",
        ),
    ] = None,
    criterion: Annotated[
        By, typer.Option(help="What makes a point the best; then log-loss.")
    ] = By.BALANCED_ACCURACY,
    train: Annotated[
        Path | None, typer.Option(help="Train the best point on all training runs into this file.")
    ] = None,
    rows: Annotated[int, typer.Option(min=1, help="Points to print.")] = 10,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, help="Processes at once.")] = 1,
    overwrite: Overwrite = False,
) -> None:
    """Tune a profile's stride, C, gamma and more; killed and called again, it goes on."""
    if validation and folds:
        raise typer.BadParameter("name runs with --validation, or a number of --folds, not both")
    from json import dumps

    from inspector.training.tuning import Question
    from inspector.training.tuning import tune as tune_profile
    from inspector.training.tuningtable import as_dict, table

    question = Question(
        training=training,
        validation=validation or (),
        part=part,
        folds=folds or 5,
        profile=profile,
        rate=rate,
        grid=grid or ("paper",),
    )
    tuned = tune_profile(question, output, model=train, jobs=jobs, overwrite=overwrite)
    report = dumps(as_dict(tuned, criterion.value, rows=rows), indent=2)
    typer.echo(report if as_json else table(tuned, criterion.value, rows=rows))
    if train:
        tuned.train(train, criterion.value, overwrite=overwrite)
        typer.echo(f"{train}: written, the best point trained on all training runs", err=as_json)
