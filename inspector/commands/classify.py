"""`inspector classify`: the verdicts on runs."""

from collections.abc import Sequence
from dataclasses import replace
from datetime import date
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from inspector.analysis.status import OUTPUT_LOST, Status, Unknown, worst
from inspector.commands.options import (
    Dask,
    ModelFiles,
    Overwrite,
    finite,
    jobs_or_dask,
    reads_logs,
    say_assumed,
)
from inspector.commands.outputs import BadInput, files_of, tried, written

if TYPE_CHECKING:
    from inspector.expectations.expectations import Expectations
    from inspector.library import Library
    from inspector.logs.opening import Reading


class Format(StrEnum):
    """The output formats of verdicts."""

    TEXT = "text"
    JSON = "json"
    JUNIT = "junit"
    GITHUB = "github"
    SARIF = "sarif"
    MARKDOWN = "markdown"


def _of_gate(*names: str, **settings: Any) -> Any:
    return typer.Option(*names, rich_help_panel="What fails a run", **settings)


def _of_output(*names: str, **settings: Any) -> Any:
    return typer.Option(*names, rich_help_panel="Output", **settings)


@reads_logs
def classify(
    runs: Annotated[
        list[Path],
        typer.Argument(
            help="Run files, any logs that `import` reads, NoisyTest's logs; folders of them.",
            show_default=False,
        ),
    ],
    format: Annotated[Format, _of_output("--format", help="Output format.")] = Format.TEXT,  # noqa: A002
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, help="Parallel runs.")] = 1,
    dask: Dask = "",
    model: ModelFiles = None,
    labels_to: Annotated[
        Path | None, _of_output(help="Write the findings to this folder, one file per run.")
    ] = None,
    labels_format: Annotated[
        str, _of_output(help="Format of these files: noisytest, csv or audacity.")
    ] = "audacity",
    localise: Annotated[
        bool,
        _of_output("--localise", help="Add the localisation of each finding to the JSON."),
    ] = False,
    write: Annotated[
        list[str] | None,
        _of_output("--write", help="FORMAT=FILE: write another format as well; repeatable."),
    ] = None,
    report: Annotated[
        Path | None,
        _of_output("--report", help="Write index.html with a picture of each run to this folder."),
    ] = None,
    report_url: Annotated[
        str,
        _of_output("--report-url", help="Where this folder is published, for links to pictures."),
    ] = "",
    overwrite: Overwrite = False,
    resume: Annotated[
        Path | None,
        typer.Option("--resume", help="Keep verdicts in this file; continue if it exists."),
    ] = None,
    unknown: Annotated[
        Unknown,
        _of_gate(help="Frames out of distribution, two or more: a finding, or ignored."),
    ] = Unknown.FINDING,
    expect: Annotated[
        Path | None,
        _of_gate("--expect", help="Expectations (TOML); by default the nearest expect.toml."),
    ] = None,
    no_expect: Annotated[bool, _of_gate("--no-expect", help="Apply no expectations.")] = False,
    fail_on_class: Annotated[
        list[str] | None,
        _of_gate("--fail-on-class", help="Only findings of this class; repeatable, or a,b,c."),
    ] = None,
    min_score: Annotated[
        float | None,
        _of_gate("--min-score", callback=finite, help="Only findings of this score or more."),
    ] = None,
    min_duration: Annotated[
        float,
        _of_gate(
            "--min-duration",
            min=0.0,
            callback=finite,
            help="Only findings of so many seconds or more.",
        ),
    ] = 0.0,
    on_bad_input: Annotated[
        BadInput, _of_gate("--on-bad-input", help="A file that cannot be read: fails, or ignored.")
    ] = BadInput.FAIL,
    *,
    reading: "Reading",
) -> None:
    """Classify runs and print verdicts; the exit status is the worst.

    Exit status:

      0  ok: no run has a finding that counts
      1  findings: at least one run has one, or lacks one that is required
      2  wrong usage
      3  bad input: a file cannot be read, or the cluster of --dask is lost
      4  cannot tell: say, the rate is too low for every model
      5  output lost: an output could not be written
     70  internal error: a bug, with its traceback on standard error

    Of several, the worst: 70, 5, 3, 1, 4, 0.
    """
    from inspector import assets
    from inspector.analysis.verdict import classify_files, exit_status
    from inspector.expectations.expectations import NAME
    from inspector.expectations.judge import Gate, judge, without_run
    from inspector.library import load_library
    from inspector.logs.opening import left_out, sources
    from inspector.progress import progress
    from inspector.report.cases import published
    from inspector.report.formats import FORMATS
    from noisemodel.atomic import refuse_existing

    if localise and format is not Format.JSON:
        raise typer.BadParameter("--localise takes --format json")
    if expect is not None and no_expect:
        raise typer.BadParameter("--expect and --no-expect exclude each other")
    files = files_of(write or [], list(Format), overwrite=overwrite)
    library = load_library(assets.model_files(model))
    gate = Gate(_classes(fail_on_class or [], library), min_score, min_duration)
    found, others = sources(runs, reading)
    shown = [each.shown for each in found]
    for path in files:
        refuse_existing(path, overwrite=overwrite, read=shown)
    logs = {each.path for each in found}  # some are folders
    folders = {
        each: each / NAME
        for each in runs
        if each.is_dir() and (each not in logs or (each / NAME).is_file())
    }
    expected = {} if no_expect else _expected([*shown, *folders.values()], expect, library)
    applied = {each.path: each for each in expected.values()}.values()
    today = date.today()
    targets = {}
    if labels_to:
        from inspector.labelfiles import label_paths

        targets = label_paths(shown, labels_to, format_name=labels_format, overwrite=overwrite)
    draw = None
    if report is not None:
        from inspector.report import html, index

        html.require()
        index.prepare(report, overwrite=overwrite)
        draw = partial(index.draw, folder=report)
    settings: dict[str, Any] = {
        "reading": reading,
        "unknown": unknown,
        "localise": localise or any(each.by_joint for each in applied),
        "draw": draw,
        "jobs": jobs_or_dask(jobs, dask),
    }
    if resume is None:
        classified = classify_files(found, library, **settings)
    else:
        from inspector.analysis.resuming import classify_resumed

        classified = classify_resumed(found, library, resume, **settings)
    classified = progress(classified, "classify", total=len(found))
    place = {path: number for number, path in enumerate(shown)}
    verdicts = [
        replace(
            judge(each, expected.get(each.path), gate=gate, today=today),
            ignored=each.status is Status.BAD_INPUT and on_bad_input is BadInput.IGNORE,
            picture_url=published(each.picture, report, report_url),
        )
        for each in sorted(classified, key=lambda each: place[each.path])
    ]
    for expectations in applied:
        full = expectations.path.resolve()
        about = [
            folder
            for folder, beside in folders.items()
            if expected.get(beside) == expectations or full.is_relative_to(folder.resolve())
        ]
        if (absent := without_run(verdicts, expectations, about)) is not None:
            verdicts.append(absent)
    if unread := [path for path in others if path.name != NAME]:
        typer.echo(f"inspector: {left_out(unread)}", err=True)
    say_assumed({str(verdict.path): verdict.assumed for verdict in verdicts})
    for expectations in applied:
        for remark in expectations.remarks(today):
            typer.echo(f"inspector: {remark}", err=True)
    lost = [line for verdict in verdicts for line in verdict.lost]
    lost += written(verdicts, FORMATS, format, files, overwrite=overwrite)
    if targets:
        from inspector.labelfiles import write_findings

        save = partial(
            write_findings,
            [verdict for verdict in verdicts if verdict.path in targets],
            targets,
            format_name=labels_format,
            overwrite=overwrite,
        )
        lost += tried(save, str(labels_to))
    if report is not None:
        lost += tried(lambda: index.write(verdicts, report), str(report))
    for bad in verdicts:
        if bad.status in (Status.BAD_INPUT, Status.INTERNAL_ERROR):
            typer.echo(f"{bad.trace}inspector: {bad.path}: {bad.message}", err=True)
    for line in lost:
        typer.echo(f"inspector: output lost: {line}", err=True)
    raise typer.Exit(worst([exit_status(verdicts), *([OUTPUT_LOST] if lost else [])]))


def _classes(given: Sequence[str], library: "Library") -> tuple[str, ...]:
    """The classes that fail a run."""
    from inspector.expectations.expectations import classes_found
    from noisemodel.errors import hint

    known = classes_found(library)
    names = [name for each in given for name in each.split(",")]
    for name in names:
        if name not in known:
            raise typer.BadParameter(
                f"{name!r} is none of {', '.join(known)}{hint(name, known)}",
                param_hint="'--fail-on-class'",
            )
    return tuple(names)


def _expected(
    runs: Sequence[Path], chosen: Path | None, library: "Library"
) -> "dict[Path, Expectations]":
    """The expectations of each run, or file of a folder, that has some."""
    from inspector.expectations.expectations import found_for, read

    if chosen is None:
        expected = found_for(runs)
    else:
        only = read(chosen)
        expected = dict.fromkeys(runs, only)
    for expectations in expected.values():
        expectations.check_classes(library)
    return expected
