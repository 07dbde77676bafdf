"""Commands on models: `train`, `tune` and `evaluate`."""

from json import dumps
from pathlib import Path
from typing import Annotated, Literal

import typer

from inspector import training as learning
from inspector.commands import shared
from inspector.commands.shared import argument, option
from inspector.library import model_files
from noiseclassifier.assessment import table


def train(
    inputs: shared.Inputs,
    output: Annotated[Path, option("The file to write.", "--output", "-o")],
    profile: Annotated[
        str,
        option(
            "general, for any rate; or of one rate: logbands, noisytest-rbf, noisytest-linear,"
            " paper-rbf or paper-linear."
        ),
    ] = "general",
    rate: Annotated[
        float | None,
        option(
            "Rate of a model of one rate in [Hz], by default 10000; faster runs are decimated.",
            min=1.0,
        ),
    ] = None,
    part: shared.InPart = "all",
    overwrite: shared.Overwrite = False,
) -> None:
    """Train a model on annotated runs."""
    shared.check_suffix(output, ".npz")
    measures, left_out = learning.train(
        inputs, profile, rate, output, part=part, overwrite=overwrite
    )
    typer.echo(f"{measures}\n{left_out}")
    typer.echo(f"{output}: written; the measures above are of the training frames")


Grid = Annotated[
    list[str] | None,
    option(
        "paper, or a setting and its values: stride=224:1024:100, C=0.1:1000:x10,"
        " gamma=1e-4,1e-3, bands=comb,adjacent; repeatable.",
        show_default="paper",
    ),
]


def tune(
    training: shared.Inputs,
    output: Annotated[
        Path,
        option("Results file, one line of JSON per point; resumes if it exists.", "--output", "-o"),
    ],
    validation: Annotated[
        list[Path] | None, option("Runs of a validation set, instead of folds; repeatable.")
    ] = None,
    folds: Annotated[
        int | None, option("Folds of the cross-validation.", min=2, show_default="5")
    ] = None,
    part: shared.InPart = "all",
    profile: Annotated[
        str, option("logbands, noisytest-rbf, noisytest-linear, paper-rbf or paper-linear.")
    ] = "noisytest-rbf",
    rate: Annotated[
        float, option("Rate of the model in [Hz]; faster runs are decimated.", min=1.0)
    ] = 10000.0,
    grid: Grid = None,
    train: Annotated[
        Path | None, option("Train the best point on all training runs, write the model.")
    ] = None,
    as_json: shared.AsJson = False,
    jobs: shared.NumberOfJobs = 1,
    dask: shared.Dask = "",
    overwrite: shared.Overwrite = False,
) -> None:
    """Tune a profile's settings by grid search; resumes if killed."""
    if validation and folds:
        raise typer.BadParameter("name runs with --validation, or a number of --folds, not both")
    tuned = learning.tune(
        training,
        output,
        validation=validation or (),
        number_of_folds=folds or 5,
        part=part,
        profile=profile,
        rate=rate,
        grid=grid or ("paper",),
        model=train,
        jobs=shared.jobs_or_dask(jobs, dask),
        overwrite=overwrite,
    )
    typer.echo(dumps(tuned.as_dict(), indent=2) if as_json else tuned.table())
    if train:
        tuned.train(train, overwrite=overwrite)
        typer.echo(f"{train}: written, the best point trained on all training runs", err=as_json)


def evaluate(
    model: Annotated[Path, argument("A model file, or the name of a shipped one.")],
    inputs: shared.Inputs,
    as_json: shared.AsJson = False,
    part: shared.InPart = "all",
    by: Annotated[
        Literal["robot", "domain", "scenario"] | None,
        option("Print one whole table: by robot, domain or scenario."),
    ] = None,
    seen_too: Annotated[
        bool,
        option("Accept runs that the model was trained on; the report lists them.", "--seen-too"),
    ] = False,
) -> None:
    """Evaluate a model on annotated runs that it was not trained on."""
    (file,) = model_files([model])
    report = learning.evaluate(file, inputs, part=part, seen_too=seen_too)
    document = {"model": file.name, **report.as_dict()}
    shown = dumps(document, indent=1, allow_nan=False) if as_json else table(report, by or "")
    typer.echo(shown)
