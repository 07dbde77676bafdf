"""`inspector classify`: the verdicts on runs."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from inspector.analysis.status import Unknown
from inspector.commands.options import ModelFiles, Overwrite, reads_logs, say_assumed

if TYPE_CHECKING:
    from inspector.logs.opening import Reading


class Format(StrEnum):
    """The output formats of verdicts."""

    TEXT = "text"
    JSON = "json"
    JUNIT = "junit"
    GITHUB = "github"


@reads_logs
def classify(
    runs: Annotated[
        list[Path],
        typer.Argument(
            help="Run files, any logs that `import` reads, NoisyTest's logs; folders of them.",
            show_default=False,
        ),
    ],
    format: Annotated[Format, typer.Option("--format", help="Output format.")] = Format.TEXT,  # noqa: A002
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, help="Parallel runs.")] = 1,
    model: ModelFiles = None,
    labels_to: Annotated[
        Path | None, typer.Option(help="Write the findings to this folder, one file per run.")
    ] = None,
    labels_format: Annotated[
        str, typer.Option(help="Format of these files: noisytest, csv or audacity.")
    ] = "audacity",
    localise: Annotated[
        bool,
        typer.Option("--localise", help="Add the localisation of each finding to the JSON."),
    ] = False,
    unknown: Annotated[
        Unknown,
        typer.Option(help="Frames out of distribution, two or more: a finding, or ignored."),
    ] = Unknown.FINDING,
    overwrite: Overwrite = False,
    *,
    reading: "Reading",
) -> None:
    """Classify runs and print verdicts; the exit status is the worst.

    Exit status:

      0  ok: no run has a finding
      1  findings: at least one run has one
      2  wrong usage
      3  bad input: a file cannot be read
      4  cannot tell: say, the rate is too low for every model
    """
    from inspector import assets
    from inspector.analysis.verdict import classify_files, exit_status
    from inspector.library import load_library
    from inspector.logs.opening import left_out, sources
    from inspector.progress import progress
    from inspector.report.formats import FORMATS

    if localise and format is not Format.JSON:
        raise typer.BadParameter("--localise takes --format json")
    library = load_library(assets.model_files(model))
    found, others = sources(runs, reading)
    targets = {}
    if labels_to:
        from inspector.labels.findings import label_paths, write_findings

        targets = label_paths(
            [each.shown for each in found],
            labels_to,
            format_name=labels_format,
            overwrite=overwrite,
        )
    classified = classify_files(
        found, library, reading=reading, unknown=unknown, localise=localise, jobs=jobs
    )
    verdicts = list(progress(classified, "classify", total=len(found)))
    if others:
        typer.echo(f"inspector: {left_out(others)}", err=True)
    say_assumed({str(verdict.path): verdict.assumed for verdict in verdicts})
    typer.echo(FORMATS[format](verdicts))
    if targets:
        write_findings(verdicts, targets, format_name=labels_format, overwrite=overwrite)
    for bad in verdicts:
        if bad.status == "bad-input":
            typer.echo(f"inspector: {bad.path}: {bad.message}", err=True)
    raise typer.Exit(exit_status(verdicts))
