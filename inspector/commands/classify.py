"""`inspector classify`: the verdicts on runs."""

from dataclasses import replace
from datetime import date
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from inspector.commands.options import (
    BadInput,
    Dask,
    ModelFiles,
    NumberOfJobs,
    OnBadInput,
    Overwrite,
    ReportUrl,
    Runs,
    UnknownFrames,
    Write,
    finite,
    jobs_or_dask,
    say_assumed,
)
from inspector.commands.outputs import files_of, tried, written
from inspector.errors import OUTPUT_LOST, Status, Unknown, worst

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from inspector.analysis import Analysis
    from inspector.library import Library
    from inspector.logs.read import Source
    from inspector.reference.verdicts import References
    from inspector.verdict import Verdict


class Format(StrEnum):
    """The output formats of verdicts."""

    TEXT = "text"
    JSON = "json"
    JUNIT = "junit"
    GITHUB = "github"
    SARIF = "sarif"
    MARKDOWN = "markdown"


def _gate(*names: str, **settings: Any) -> Any:
    return typer.Option(*names, rich_help_panel="What fails a run", **settings)


OutputFormat = Annotated[Format, typer.Option("--format", help="Output format.")]
Verbose = Annotated[
    bool, typer.Option("--verbose", "-v", help="All that was assumed, and the runs of scenarios.")
]
LabelsTo = Annotated[
    Path | None, typer.Option(help="Write the findings to this folder, one file per run.")
]
LabelsFormat = Annotated[
    str, typer.Option(help="Format of these files: noisytest, csv or audacity.")
]
Report = Annotated[
    Path | None, typer.Option(help="Write index.html with a picture of each run to this folder.")
]
Resume = Annotated[
    Path | None, typer.Option(help="Keep verdicts in this file; continue if it exists.")
]
ReferenceFolder = Annotated[
    Path | None,
    _gate(
        "--reference",
        help="Accepted runs, or a folder of good ones; by default the nearest reference/.",
    ),
]
NoReference = Annotated[bool, _gate("--no-reference", help="Use the general model alone.")]
FailOnClass = Annotated[
    list[str] | None,
    _gate("--fail-on-class", help="Only findings of this class; repeatable, or a,b,c."),
]
MinScore = Annotated[
    float | None,
    _gate("--min-score", callback=finite, help="Only findings of this score or more, 0 to 1."),
]
MinDuration = Annotated[
    float,
    _gate("--min-duration", min=0.0, callback=finite, help="Only findings of so many seconds."),
]


# Longer than 60 lines: 23 of them are its options.
def classify(
    ctx: typer.Context,
    runs: Runs,
    format: OutputFormat = Format.TEXT,  # noqa: A002
    verbose: Verbose = False,
    jobs: NumberOfJobs = 1,
    dask: Dask = "",
    model: ModelFiles = None,
    labels_to: LabelsTo = None,
    labels_format: LabelsFormat = "audacity",
    localise: Annotated[bool, typer.Option("--localise", hidden=True)] = True,
    write: Write = None,
    report: Report = None,
    report_url: ReportUrl = "",
    overwrite: Overwrite = False,
    resume: Resume = None,
    unknown: UnknownFrames = Unknown.FINDING,
    reference: ReferenceFolder = None,
    no_reference: NoReference = False,
    fail_on_class: FailOnClass = None,
    min_score: MinScore = None,
    min_duration: MinDuration = 0.0,
    on_bad_input: OnBadInput = BadInput.FAIL,
) -> None:
    """Classify runs and print verdicts.

    Exit status: 0 ok, 1 findings, 2 wrong usage, 3 bad input, 4 cannot tell, 5 output lost, 70 bug.
    With several runs it is the highest-priority one: 70 > 5 > 3 > 1 > 4 > 0.
    """
    from inspector.library import load_library
    from inspector.logs.read import sources
    from inspector.reference.verdicts import Gate, References
    from inspector.report.formats import FORMATS, published, text
    from inspector.text import progress
    from inspector.verdict import classify_files, exit_status

    del localise  # of 0.6: each finding is localised now
    if reference is not None and no_reference:
        raise typer.BadParameter("--reference and --no-reference exclude each other")
    library = load_library(model)
    found, others = sources(runs, ctx.obj)
    shown = [each.shown for each in found]
    beside = References() if no_reference else References.found(shown, reference, ctx.obj)
    files = files_of(write or [], list(Format), overwrite=overwrite)
    outputs = [
        *_labels(found, labels_to, labels_format, overwrite=overwrite),
        *_page(report, overwrite=overwrite),
    ]
    _check_score(min_score, library, unknown)
    gate = Gate(_classes(fail_on_class or [], library), min_score, min_duration)

    where, draw = jobs_or_dask(jobs, dask), _drawing(report)
    classified = classify_files(
        found,
        library,
        reading=ctx.obj,
        unknown=unknown,
        draw=draw,
        reference=beside if beside.of else None,
        jobs=where,
        resume=resume,
    )
    classified = progress(classified, "classify", total=len(found))

    place = {path: number for number, path in enumerate(shown)}
    verdicts = [
        replace(
            beside.judge(each, gate, date.today()),
            ignored=each.status is Status.BAD_INPUT and on_bad_input is BadInput.IGNORE,
            picture_url=published(each.picture, report, report_url),
        )
        for each in sorted(classified, key=lambda each: place[each.path])
    ]
    verdicts += beside.absent(verdicts, [each for each in runs if each.is_dir()])

    _say(verdicts, others, beside, verbose=verbose)
    lost = [line for verdict in verdicts for line in verdict.lost]
    formats = FORMATS | {"text": partial(text, verbose=verbose)}
    lost += written(verdicts, formats, format, files, overwrite=overwrite)
    for name, save in outputs:
        lost += tried(partial(save, verdicts), name)
    say_lost(verdicts, lost)
    raise typer.Exit(worst([exit_status(verdicts), *([OUTPUT_LOST] if lost else [])]))


def _classes(given: "Sequence[str]", library: "Library") -> tuple[str, ...]:
    """The classes that fail a run."""
    from inspector.reference.verdicts import classes_found
    from noisemodel.types import hint

    known = classes_found(library)
    names = [name for each in given for name in each.split(",")]
    for name in names:
        if name not in known:
            raise typer.BadParameter(
                f"{name!r} is none of {', '.join(known)}{hint(name, known)}",
                param_hint="'--fail-on-class'",
            )
    return tuple(names)


def _check_score(least: float | None, library: "Library", unknown: Unknown) -> None:
    """Refuse a score that no finding has, or that all findings have."""
    from noiseclassifier import General

    models = library.values()
    settings = [each.recipe if isinstance(each, General) else each.profile for each in models]
    if least is None or any(each.estimator == "svm" for each in settings):
        return  # whose scores have any size
    alarm = min(each.alarm for each in settings) if unknown is Unknown.IGNORE else 0.0
    if least > 1.0 or least <= alarm:
        told = "are probabilities, at most 1" if least > 1.0 else f"are above {alarm:g} anyway"
        raise typer.BadParameter(f"{least:g}: all scores {told}", param_hint="'--min-score'")


def _labels(
    runs: "Sequence[Source]", folder: Path | None, form: str, *, overwrite: bool
) -> "list[tuple[str, Callable[[Sequence[Verdict]], object]]]":
    """What writes the findings as label files, if a folder is named; its files are checked."""
    if folder is None:
        return []
    from inspector.export.labels import label_paths, write_findings

    shown = [each.shown for each in runs]
    targets = label_paths(shown, folder, format_name=form, overwrite=overwrite)

    def write(verdicts: "Sequence[Verdict]") -> None:
        of_runs = [each for each in verdicts if each.path in targets]
        write_findings(of_runs, targets, format_name=form, overwrite=overwrite)

    return [(str(folder), write)]


def _page(
    folder: Path | None, *, overwrite: bool
) -> "list[tuple[str, Callable[[Sequence[Verdict]], object]]]":
    """What writes the page on all runs, if a folder is named; its files are checked."""
    if folder is None:
        return []
    from inspector.report import index
    from inspector.report.picture import require

    require("a report")
    index.prepare(folder, overwrite=overwrite)
    return [(str(folder), lambda verdicts: index.write(verdicts, folder))]


def _drawing(folder: Path | None) -> "Callable[[Analysis, Verdict, Any], Path] | None":
    """What draws each run into the folder of the report."""
    if folder is None:
        return None
    from inspector.report import index

    return partial(index.draw, folder=folder)


def _say(
    verdicts: "Sequence[Verdict]",
    others: "Sequence[Path]",
    beside: "References",
    *,
    verbose: bool,
) -> None:
    """Print on standard error what was left out and assumed, and which waivers expire."""
    from inspector.logs.read import left_out

    if others:
        typer.echo(f"inspector: {left_out(others)}", err=True)
    say_assumed({str(verdict.path): verdict.assumed for verdict in verdicts}, verbose=verbose)
    for remark in beside.remarks(date.today()):
        typer.echo(f"inspector: {remark}", err=True)


def say_lost(verdicts: "Sequence[Verdict]", lost: "Sequence[str]") -> None:
    """Print on standard error which runs could not be read, and which outputs not be written."""
    for bad in verdicts:
        if bad.status in (Status.BAD_INPUT, Status.INTERNAL_ERROR):
            typer.echo(f"{bad.trace}inspector: {bad.path}: {bad.message}", err=True)
    for line in lost:
        typer.echo(f"inspector: output lost: {line}", err=True)
