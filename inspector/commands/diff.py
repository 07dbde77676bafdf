"""`inspector diff`: runs before and after a change of code."""

from dataclasses import replace
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from inspector.analysis.status import OUTPUT_LOST, Unknown, worst
from inspector.commands.options import BadInput, Dask, ModelFiles, Overwrite, jobs_or_dask
from inspector.commands.outputs import files_of, tried, written


class Format(StrEnum):
    """The output formats of a difference."""

    TEXT = "text"
    JSON = "json"
    JUNIT = "junit"
    GITHUB = "github"
    MARKDOWN = "markdown"


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
            help="Exit status 1 at new or louder findings, at a verdict worse, or at any: both,"
            " and runs that only the reference has.",
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
    report_url: Annotated[
        str, typer.Option("--report-url", help="Where this folder is published, for its picture.")
    ] = "",
    write: Annotated[
        list[str] | None,
        typer.Option("--write", help="FORMAT=FILE: write another format as well; repeatable."),
    ] = None,
    on_bad_input: Annotated[
        BadInput,
        typer.Option("--on-bad-input", help="A file that cannot be read: fails, or ignored."),
    ] = BadInput.FAIL,
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, help="Parallel runs.")] = 1,
    dask: Dask = "",
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
    Findings of a scenario that only the candidate has are new.

    Exit status:

      0  nothing that --fail-on names
      1  worse, new findings, or runs that are missing, as --fail-on says
      2  wrong usage
      3  bad input: a file cannot be read, nothing can be paired, or no cluster is reached
      4  cannot tell: too few repetitions of every scenario
      5  output lost: an output could not be written
     70  internal error: a bug, with its traceback on standard error

    Of several, the worst: 70, 5, 3, 1, 4, 0.
    """
    from inspector import assets
    from inspector.library import load_library
    from inspector.progress import progress
    from inspector.regression import output
    from inspector.regression import report as reporting
    from inspector.regression.difference import Gate, difference
    from inspector.regression.measure import Measured, Unreadable, measure_files
    from inspector.regression.pairing import Pairing, files_in, paired
    from inspector.report.cases import published

    where = jobs_or_dask(jobs, dask)
    files = files_of(write or [], list(Format), overwrite=overwrite)
    if report:
        reporting.prepare(report, overwrite=overwrite)
    library = load_library(assets.model_files(model))
    sides = [files_in(path) for path in (reference, candidate)]
    runs = [*sides[0], *sides[1]]
    measured = list(
        progress(
            measure_files(runs, library, links=robot, unknown=unknown, jobs=where),
            "diff",
            total=len(runs),
        )
    )
    split = len(sides[0])
    before, after = (
        [run for run in side if isinstance(run, Measured)]
        for side in (measured[:split], measured[split:])
    )
    unreadable = [run for run in measured if isinstance(run, Unreadable)]
    for bad in unreadable:
        typer.echo(f"{bad.trace}inspector: {bad.path}: {bad.problem}", err=True)
    roots = (reference, candidate)
    pairing = paired(before, after, roots) if before and after else Pairing("file name", ())
    found = difference(pairing, margin=margin, unreadable=unreadable)
    gate = Gate(
        new=fail_on is not FailOn.WORSE,
        worse=fail_on is not FailOn.NEW,
        unreadable=on_bad_input is BadInput.FAIL,
        missing=fail_on is FailOn.ANY,
    )
    drawn = report / reporting.PICTURE if report and found.scenarios else None
    address = published(drawn, report, report_url)
    found = replace(found, gate=gate, picture=drawn, picture_url=address)
    told: list[str] = []
    lost: list[str] = []
    if report and found.scenarios:
        save = partial(reporting.write, found, report, library, robot=robot, overwrite=overwrite)
        lost += tried(lambda: told.append(save()), str(report))
    lost += written(found, output.FORMATS, format, files, overwrite=overwrite)
    for line in told:
        typer.echo(line, err=format is not Format.TEXT)
    for bad in found.unreadable[len(unreadable) :]:
        typer.echo(f"inspector: {bad.path}: {bad.problem}", err=True)
    for line in lost:
        typer.echo(f"inspector: output lost: {line}", err=True)
    raise typer.Exit(worst([found.exit_status, *([OUTPUT_LOST] if lost else [])]))
