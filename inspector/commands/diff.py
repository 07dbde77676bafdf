"""`inspector diff`: runs before and after a change of code."""

from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from inspector.commands.options import (
    BadInput,
    Dask,
    ModelFiles,
    NumberOfJobs,
    OnBadInput,
    Overwrite,
    ReportUrl,
    UnknownFrames,
    Write,
    jobs_or_dask,
)
from inspector.commands.outputs import files_of, tried, written
from inspector.errors import OUTPUT_LOST, Unknown, worst

if TYPE_CHECKING:
    from inspector.library import Library
    from inspector.reference.difference import Difference

RECORDING, PICTURE, NUMBERS = FILES = ("worst.rrd", "worst.png", "diff.json")
"""The files of --report."""


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


Before = Annotated[
    Path, typer.Argument(help="Runs before the change: a folder, or one.", show_default=False)
]
After = Annotated[
    Path, typer.Argument(help="Runs after the change: a folder, or one.", show_default=False)
]


OutputFormat = Annotated[Format, typer.Option("--format", help="Output format.")]
Failing = Annotated[
    FailOn,
    typer.Option("--fail-on", help="New or louder findings, scenarios that are worse, or any."),
]
LeastMargin = Annotated[
    float, typer.Option(min=0.0, help="Least margin from which a run is louder, in dB.")
]
Report = Annotated[
    Path | None,
    typer.Option(
        "--report", help="Write recording, picture and diff.json of the worst to this folder."
    ),
]
DrawRobot = Annotated[
    bool, typer.Option("--robot/--no-robot", help="Draw the robot in the recording.")
]


def diff(
    reference: Before,
    candidate: After,
    format: OutputFormat = Format.TEXT,  # noqa: A002
    fail_on: Failing = FailOn.WORSE,
    margin: LeastMargin = 0.0,
    report: Report = None,
    report_url: ReportUrl = "",
    write: Write = None,
    on_bad_input: OnBadInput = BadInput.FAIL,
    jobs: NumberOfJobs = 1,
    dask: Dask = "",
    model: ModelFiles = None,
    robot: DrawRobot = True,
    unknown: UnknownFrames = Unknown.FINDING,
    overwrite: Overwrite = False,
) -> None:
    """Compare runs with earlier ones: worse, better or same.

    A scenario is worse if it is louder after the change than each run before. Scenarios that are
    missing, renamed, cut or frozen fail too.

    Exit status: 0 as before, 1 worse, 2 wrong usage, 3 bad input, 4 cannot tell, 5 output lost.
    """
    from inspector.library import load_library
    from inspector.reference.difference import Gate, difference
    from inspector.report.formats import DIFF_FORMATS as FORMATS
    from inspector.report.formats import published

    files = files_of(write or [], list(Format), overwrite=overwrite)
    if report:
        _prepare(report, overwrite=overwrite)
    library = load_library(model)
    found = difference(
        reference,
        candidate,
        library,
        margin=margin,
        unknown=unknown,
        jobs=jobs_or_dask(jobs, dask),
    )
    for bad in found.failed:
        typer.echo(f"{bad.trace}inspector: {bad.path}: {bad.problem}", err=True)
    gate = Gate(
        new=fail_on is not FailOn.WORSE,
        worse=fail_on is not FailOn.NEW,
        failed=on_bad_input is BadInput.FAIL,
    )
    drawn = report / PICTURE if report and any(row.worst for row in found.rows) else None
    address = published(drawn, report, report_url)
    found = replace(found, gate=gate, picture=drawn, picture_url=address)
    lost: list[str] = []
    if report:
        lost += tried(lambda: _report(found, report, library, robot, overwrite), str(report))
    lost += written(found, FORMATS, format, files, overwrite=overwrite)
    for line in lost:
        typer.echo(f"inspector: output lost: {line}", err=True)
    raise typer.Exit(worst([found.exit_status, *([OUTPUT_LOST] if lost else [])]))


def _prepare(folder: Path, *, overwrite: bool) -> None:
    """Make the folder of the report, before long work is done for it."""
    from inspector.errors import InspectorError
    from inspector.report.picture import require
    from noisemodel.files import refuse_existing

    require("a report")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InspectorError(f"{folder}: cannot be made a folder ({error.strerror})") from error
    for name in FILES:
        refuse_existing(folder / name, overwrite=overwrite)


def _report(
    found: "Difference", folder: Path, library: "Library", robot: bool, overwrite: bool
) -> None:
    """Write the worst scenario as recording and picture, and all numbers."""
    from inspector.compare.pair import compare
    from inspector.compare.recording import write
    from inspector.report.formats import diff_json as as_json
    from inspector.report.picture import over_reference
    from noisemodel.files import replacing

    with replacing(folder / NUMBERS, overwrite=overwrite) as temporary:
        temporary.write_text(f"{as_json(found)}\n", encoding="utf-8")
    row = next((row for row in found.rows if row.worst is not None and row.before), None)
    if row is None or row.worst is None:
        return
    after = Path(row.worst.run.run)
    pair = compare(row.before[0], after, library, robot=robot)
    write(pair, folder / RECORDING, overwrite=overwrite)
    with replacing(folder / PICTURE, overwrite=overwrite) as temporary:
        title = f"{row.name}: {row.outcome}, {row.reason}; {after.name}"
        temporary.write_bytes(over_reference(row.worst, title))
