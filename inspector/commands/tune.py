"""`inspector tune`: a grid search over the settings of a profile."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from inspector.commands.options import Dask, InPart, Inputs, Overwrite, jobs_or_dask


class By(StrEnum):
    """The criterion that ranks points; the log-loss breaks ties."""

    BALANCED_ACCURACY = "balanced-accuracy"
    LOG_LOSS = "log-loss"
    SUBSET_ACCURACY = "subset-accuracy"


Output = Annotated[
    Path,
    typer.Option(
        "--output",
        "-o",
        help="Results file, one line of JSON per point; resumes if it exists.",
    ),
]
Validation = Annotated[
    list[Path] | None,
    typer.Option(help="Runs of a validation set, instead of folds; repeatable."),
]
Folds = Annotated[
    int | None, typer.Option(min=2, help="Folds of the cross-validation.", show_default="5")
]
Profile = Annotated[
    str,
    typer.Option(
        help="joints, norms, scalar, logbands, noisytest-rbf, noisytest-linear, paper-rbf or"
        " paper-linear."
    ),
]
Rate = Annotated[
    float, typer.Option(min=1.0, help="Rate of the model in [Hz]; faster runs are decimated.")
]
Grid = Annotated[
    list[str] | None,
    typer.Option(
        help="paper, or a setting and its values: stride=224:1024:100, C=0.1:1000:x10,"
        " gamma=1e-4,1e-3, bands=comb,adjacent; repeatable.",
        show_default="paper",
    ),
]
Criterion = Annotated[By, typer.Option(help="Ranks the points; the log-loss breaks ties.")]
Train = Annotated[
    Path | None,
    typer.Option(help="Train the best point on all training runs, write the model."),
]
Picture = Annotated[
    Path | None,
    typer.Option(
        help="Draw the accuracy along each setting around the best point, as PNG (needs the"
        " extra `report`)."
    ),
]
Rows = Annotated[int, typer.Option(min=1, help="Number of points to print.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Jobs = Annotated[int, typer.Option("--jobs", "-j", min=1, help="Parallel processes.")]


def tune(
    training: Inputs,
    output: Output,
    validation: Validation = None,
    folds: Folds = None,
    part: InPart = "all",
    profile: Profile = "noisytest-rbf",
    rate: Rate = 10000.0,
    grid: Grid = None,
    criterion: Criterion = By.BALANCED_ACCURACY,
    train: Train = None,
    picture: Picture = None,
    rows: Rows = 10,
    as_json: AsJson = False,
    jobs: Jobs = 1,
    dask: Dask = "",
    overwrite: Overwrite = False,
) -> None:
    """Tune a profile's settings by grid search; resumes if killed."""
    if validation and folds:
        raise typer.BadParameter("name runs with --validation, or a number of --folds, not both")
    from json import dumps

    from inspector.report.picture import require
    from inspector.training.tune import Search
    from inspector.training.tune import tune as tune_profile
    from noisemodel.files import refuse_existing

    if picture:
        refuse_existing(picture, overwrite=overwrite)
        require()

    search = Search(
        training=training,
        validation=validation or (),
        part=part,
        folds=folds or 5,
        profile=profile,
        rate=rate,
        grid=grid or ("paper",),
    )
    where = jobs_or_dask(jobs, dask)
    tuned = tune_profile(search, output, model=train, jobs=where, overwrite=overwrite)
    report = dumps(tuned.as_dict(criterion.value, rows=rows), indent=2)
    typer.echo(report if as_json else tuned.table(criterion.value, rows=rows))
    if picture:
        tuned.draw(picture, criterion.value, overwrite=overwrite)
    if train:
        tuned.train(train, criterion.value, overwrite=overwrite)
        typer.echo(f"{train}: written, the best point trained on all training runs", err=as_json)
