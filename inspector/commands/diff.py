"""`inspector diff`: runs before and after a change of code."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from inspector.analysis.status import Unknown
from inspector.commands.options import ModelFiles, Overwrite


class Format(StrEnum):
    """The output formats of a difference."""

    TEXT = "text"
    JSON = "json"


class FailOn(StrEnum):
    """What gives the exit status 1."""

    NEW = "new"
    WORSE = "worse"
    ANY = "any"


def diff(
    reference: Annotated[
        Path, typer.Argument(help="Runs before the change: a folder, or one.", show_default=False)
    ],
    candidate: Annotated[
        Path, typer.Argument(help="Runs after the change: a folder, or one.", show_default=False)
    ],
    format: Annotated[Format, typer.Option("--format", help="Output format.")] = Format.TEXT,  # noqa: A002
    fail_on: Annotated[
        FailOn,
        typer.Option(
            "--fail-on",
            help="Exit status 1 at new or louder findings, at a verdict worse, or at any of both.",
        ),
    ] = FailOn.WORSE,
    margin: Annotated[
        float, typer.Option(min=1.0, help="A change within this is the same, in dB.")
    ] = 6.0,
    report: Annotated[
        Path | None,
        typer.Option(
            "--report",
            help="Write recording and picture of the worst pair and diff.json to this folder.",
        ),
    ] = None,
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, help="Parallel runs.")] = 1,
    model: ModelFiles = None,
    robot: Annotated[
        bool, typer.Option("--robot/--no-robot", help="Compare the links of known robots.")
    ] = True,
    unknown: Annotated[
        Unknown,
        typer.Option(help="Frames out of distribution, two or more: a finding, or ignored."),
    ] = Unknown.FINDING,
    overwrite: Overwrite = False,
) -> None:
    """Compare runs with a reference: better, same or worse.

    Runs are paired by scenario and seed of their meta, or by file name:
    walk-1 and walk-2 are repetitions. "Worse" takes 5 and 5 of a scenario.

    Exit status:

      0  nothing that --fail-on names
      1  worse, or new findings
      2  wrong usage
      3  bad input: a file cannot be read, or nothing can be paired
      4  cannot tell: too few repetitions of every scenario
    """
    from inspector import assets
    from inspector.library import load_library
    from inspector.progress import progress
    from inspector.regression import output
    from inspector.regression import report as reporting
    from inspector.regression.difference import difference
    from inspector.regression.measure import Measured, Unreadable, measure_files
    from inspector.regression.pairing import files_in, paired

    if report:
        reporting.prepare(report, overwrite=overwrite)
    library = load_library(assets.model_files(model))
    sides = [files_in(path) for path in (reference, candidate)]
    files = [*sides[0], *sides[1]]
    measured = list(
        progress(
            measure_files(files, library, links=robot, unknown=unknown, jobs=jobs),
            "diff",
            total=len(files),
        )
    )
    split = len(sides[0])
    before, after = (
        [run for run in side if isinstance(run, Measured)]
        for side in (measured[:split], measured[split:])
    )
    unreadable = [run for run in measured if isinstance(run, Unreadable)]
    for bad in unreadable:
        typer.echo(f"inspector: {bad.path}: {bad.problem}", err=True)
    if not before or not after:
        raise typer.Exit(3)
    found = difference(
        paired(before, after, (reference, candidate)), margin=margin, unreadable=unreadable
    )
    typer.echo((output.as_json if format is Format.JSON else output.as_text)(found))
    for bad in found.unreadable[len(unreadable) :]:
        typer.echo(f"inspector: {bad.path}: {bad.problem}", err=True)
    if report and found.scenarios:
        told = reporting.write(found, report, library, robot=robot, overwrite=overwrite)
        typer.echo(told, err=format is Format.JSON)
    raise typer.Exit(found.exit_status(new=fail_on is not FailOn.WORSE, worse=fail_on != "new"))
