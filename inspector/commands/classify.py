"""The command that judges runs."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from inspector.commands.options import ModelFiles, Overwrite


class Format(StrEnum):
    """How verdicts are written."""

    TEXT = "text"
    JSON = "json"
    JUNIT = "junit"
    GITHUB = "github"


class OnUnknown(StrEnum):
    """What becomes of frames that are out of distribution and below the alarm threshold."""

    FINDING = "finding"
    IGNORE = "ignore"


def classify(
    runs: Annotated[
        list[Path], typer.Argument(help="Run files, or NoisyTest's logs.", show_default=False)
    ],
    format: Annotated[Format, typer.Option("--format", help="How to print.")] = Format.TEXT,  # noqa: A002
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, help="Runs at once.")] = 1,
    model: ModelFiles = None,
    labels_to: Annotated[
        Path | None, typer.Option(help="Write findings into this folder, a file per run.")
    ] = None,
    labels_format: Annotated[
        str, typer.Option(help="Of those files: noisytest, csv or audacity.")
    ] = "audacity",
    localise: Annotated[
        bool, typer.Option("--localise", help="In JSON, add the localisation of each finding.")
    ] = False,
    unknown: Annotated[
        OnUnknown,
        typer.Option(help="Frames out of distribution, two or more: a finding, or ignored."),
    ] = OnUnknown.FINDING,
    overwrite: Overwrite = False,
) -> None:
    """Label runs; exit 0 if all are quiet, 1 findings, 3 bad input, 4 cannot tell."""
    from inspector import assets
    from inspector.analysis.analyse import Unknown
    from inspector.analysis.verdict import exit_status, judge_all
    from inspector.labels.findings import label_paths, write_findings
    from inspector.library import load_library
    from inspector.progress import progress
    from inspector.report.formats import FORMATS

    if localise and format is not Format.JSON:
        raise typer.BadParameter("--localise takes --format json")
    library = load_library(assets.model_files(model))
    targets = {}
    if labels_to:
        targets = label_paths(runs, labels_to, format_name=labels_format, overwrite=overwrite)
    judged = judge_all(runs, library, unknown=Unknown(unknown.value), localise=localise, jobs=jobs)
    verdicts = list(progress(judged, "classify", total=len(runs)))
    typer.echo(FORMATS[format](verdicts))
    if targets:
        write_findings(verdicts, targets, format_name=labels_format, overwrite=overwrite)
    for bad in verdicts:
        if bad.status == "bad-input":
            typer.echo(f"inspector: {bad.path}: {bad.message}", err=True)
    raise typer.Exit(exit_status(verdicts))
