"""`inspector merge`: the results of several jobs as one."""

from pathlib import Path
from typing import Annotated

import typer

from inspector.commands.classify import Format, OutputFormat, say_lost
from inspector.commands.options import Overwrite, Write
from inspector.commands.outputs import files_of, tried, written
from inspector.errors import OUTPUT_LOST, worst


def merge(
    results: Annotated[
        list[Path],
        typer.Argument(help="Files that `classify --write json=FILE` wrote.", show_default=False),
    ],
    format: OutputFormat = Format.TEXT,  # noqa: A002
    write: Write = None,
    report: Annotated[
        Path | None, typer.Option(help="Write index.html with all runs to this folder.")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Join the results of several jobs into one.

    The exit status is the one that `classify` has for all of their runs.
    """
    from inspector.errors import InspectorError
    from inspector.report import index
    from inspector.report.formats import FORMATS
    from inspector.verdict import Verdict, exit_status, read_results

    files = files_of(write or [], list(Format), overwrite=overwrite)
    verdicts: dict[Path, Verdict] = {}
    where: dict[Path, Path] = {}
    for path in results:
        for verdict in read_results(path):
            if verdict.path in verdicts:
                first = where[verdict.path]
                raise InspectorError(f"{path}: the run {verdict.path} is in {first}, too")
            verdicts[verdict.path], where[verdict.path] = verdict, path
    merged = list(verdicts.values())
    if report is not None:
        index.prepare(report, overwrite=overwrite)
        merged = [index.with_picture(each, report) for each in merged]
    lost = written(merged, FORMATS, format, files, overwrite=overwrite)
    if report is not None:
        lost += tried(lambda: index.write(merged, report), str(report))
    say_lost(merged, lost)
    raise typer.Exit(worst([exit_status(merged), *([OUTPUT_LOST] if lost else [])]))
