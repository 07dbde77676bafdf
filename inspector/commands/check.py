"""Commands that check runs: `classify`, `diff`, `accept`, `audit`, `smoothness` and more."""

import os
from collections.abc import Collection, Sequence
from dataclasses import replace
from datetime import date
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal, NoReturn

import typer

from inspector.commands import shared
from inspector.commands.shared import argument, option
from inspector.errors import EXIT, InspectorError, Status, Unknown
from inspector.library import Library, load_library
from inspector.logs.read import left_out, sources
from inspector.reference import store
from inspector.reference.difference import Difference, difference
from inspector.reference.verdicts import Gate, References, classes_found, still_absent
from inspector.report.formats import DIFF_FORMATS, FORMATS, text
from inspector.report.picture import over_reference, require
from inspector.text import progress
from inspector.verdict import UNREAD, Verdict, classify_files, exit_status, read_results
from noisemodel.files import refuse_existing, write_whole
from noisemodel.types import hint

Format = Annotated[
    Literal["text", "json", "junit", "github", "sarif", "markdown"], option("Output format.")
]

# --- classify

Verbose = Annotated[
    bool, option("All that was assumed, and the runs of scenarios.", "--verbose", "-v")
]
ReportFolder = Annotated[
    Path | None, option("Write index.html with a picture of each run to this folder.")
]
Accepted = Annotated[
    Path | None,
    option("Accepted runs, or a folder of good ones; by default the nearest reference/."),
]
FailOnClass = Annotated[
    list[str] | None, option("Fail only on findings of this class; repeatable, or a,b,c.")
]
MinScore = Annotated[
    float | None, option("Fail only on findings of this score or more, 0 to 1.", min=0.0, max=1.0)
]
MinDuration = Annotated[
    float, option("Fail only on findings of so many seconds.", min=0.0, callback=shared.finite)
]


def classify(
    ctx: typer.Context,
    runs: shared.Runs,
    format: Format = "text",  # noqa: A002
    verbose: Verbose = False,
    jobs: shared.NumberOfJobs = 1,
    dask: shared.Dask = "",
    model: shared.ModelFiles = None,
    write: shared.Write = None,
    report: ReportFolder = None,
    overwrite: shared.Overwrite = False,
    resume: Annotated[
        Path | None, option("Keep verdicts in this file; continue if it exists.")
    ] = None,
    unknown: shared.UnknownFrames = Unknown.FINDING,
    reference: Accepted = None,
    no_reference: Annotated[bool, option("Use the general model alone.", "--no-reference")] = False,
    fail_on_class: FailOnClass = None,
    min_score: MinScore = None,
    min_duration: MinDuration = 0.0,
    on_bad_input: shared.OnBadInput = "fail",
) -> None:
    """Classify runs and print verdicts.

    Exit status: 0 ok, 1 findings, 2 wrong usage, 3 bad input, 4 cannot tell, 5 output lost, 70 bug.
    With several runs it is the highest-priority one: 70 > 5 > 3 > 1 > 4 > 0.
    """
    library = load_library(model)
    found, others = sources(runs, ctx.obj)
    shown = [each.shown for each in found]
    references = References() if no_reference else References.found(shown, reference, ctx.obj)
    gate = Gate(_classes(fail_on_class or [], library), min_score, min_duration)
    formats = FORMATS | {"text": partial(text, verbose=verbose)}
    outputs = shared.outputs_of(write, formats, overwrite=overwrite)
    draw = None
    if report:
        require("a report")
        draw = partial(_index_in(report, outputs, overwrite=overwrite).draw, folder=report)
    classified = classify_files(
        found,
        library,
        reading=ctx.obj,
        unknown=unknown,
        draw=draw,
        reference=references if references.of else None,
        jobs=shared.jobs_or_dask(jobs, dask),
        resume=resume,
    )
    known = {each.path: each for each in progress(classified, "classify", total=len(found))}
    judged = [references.judge(known[path], gate, date.today()) for path in shown]
    ignored = Status.BAD_INPUT if on_bad_input == "ignore" else None
    verdicts = [replace(each, ignored=each.status is ignored) for each in judged]
    verdicts += references.absent(verdicts, [each for each in runs if each.is_dir()])

    shared.say_assumed({str(each.path): each.assumed for each in verdicts}, verbose=verbose)
    if remark := left_out(others):
        typer.echo(f"inspector: {remark}", err=True)
    _end(verdicts, shared.written(verdicts, formats[format], outputs))


def _index_in(folder: Path, outputs: dict[Path, Any], *, overwrite: bool) -> Any:
    """The module of pages, which takes long to import; the index becomes one of the outputs."""
    from inspector.report import html

    shared.prepare(folder, html.PAGE, overwrite=overwrite)
    outputs[folder] = partial(html.write_index, folder=folder)
    return html


def _classes(given: Sequence[str], library: Library) -> tuple[str, ...]:
    """The classes that fail a run."""
    known = classes_found(library)
    names = [name for each in given for name in each.split(",")]
    if (other := next((name for name in names if name not in known), None)) is not None:
        problem = f"{other!r} is none of {', '.join(known)}{hint(other, known)}"
        raise typer.BadParameter(problem, param_hint="'--fail-on-class'")
    return tuple(names)


def _name_failed(verdicts: Sequence[Verdict]) -> None:
    """Print on standard error which runs could not be read."""
    for bad in verdicts:
        if bad.status in UNREAD:
            typer.echo(f"{bad.trace}inspector: {bad.path}: {bad.message}", err=True)


def _end(verdicts: Sequence[Verdict], lost: Sequence[str]) -> NoReturn:
    """Name the runs that could not be read, and end with the exit status of all."""
    _name_failed(verdicts)
    shared.end(exit_status(verdicts), [*(line for each in verdicts for line in each.lost), *lost])


# --- diff

# The files of --report.
RECORDING, PICTURE, NUMBERS = FILES = ("worst.rrd", "worst.png", "diff.json")


def diff(
    reference: Annotated[Path, argument("Runs before the change: a folder, or one.")],
    candidate: Annotated[Path, argument("Runs after the change: a folder, or one.")],
    format: Annotated[  # noqa: A002
        Literal["text", "json", "junit", "github", "markdown"], option("Output format.")
    ] = "text",
    fail_on: Annotated[
        Literal["new", "worse", "any"],
        option("New or louder findings, scenarios that are worse, or any."),
    ] = "worse",
    margin: Annotated[
        float, option("Least margin from which a run is louder, in dB.", min=0.0)
    ] = 0.0,
    report: Annotated[
        Path | None, option("Write recording, picture and diff.json of the worst to this folder.")
    ] = None,
    write: shared.Write = None,
    on_bad_input: shared.OnBadInput = "fail",
    jobs: shared.NumberOfJobs = 1,
    dask: shared.Dask = "",
    model: shared.ModelFiles = None,
    unknown: shared.UnknownFrames = Unknown.FINDING,
    overwrite: shared.Overwrite = False,
) -> None:
    """Compare runs with earlier ones: worse, better or same.

    A scenario is worse if it is louder after the change than each run before. Scenarios that are
    missing, cut or frozen fail too.

    Exit status: 0 as before, 1 worse, 2 wrong usage, 3 bad input, 4 cannot tell, 5 output lost.
    """
    outputs = shared.outputs_of(write, DIFF_FORMATS, overwrite=overwrite)
    library, where = load_library(model), shared.jobs_or_dask(jobs, dask)
    if report:
        require("a report")
        shared.prepare(report, *FILES, overwrite=overwrite)
        outputs[report] = partial(_write_worst, folder=report, library=library, overwrite=overwrite)
    found = difference(reference, candidate, library, margin=margin, unknown=unknown, jobs=where)
    _name_failed(found.failed)
    drawn = report / PICTURE if report and any(row.worst for row in found.rows) else None
    found = replace(
        found,
        new_fails=fail_on != "worse",
        worse_fails=fail_on != "new",
        unread_fails=on_bad_input == "fail",
        picture=drawn,
    )
    shared.end(found.exit_status, shared.written(found, DIFF_FORMATS[format], outputs))


def _write_worst(found: Difference, folder: Path, library: Library, overwrite: bool) -> None:
    """Write the worst scenario as recording and picture, and all numbers."""
    from inspector.compare import compare, write

    write_whole(folder / NUMBERS, f"{DIFF_FORMATS['json'](found)}\n", overwrite=overwrite)
    row = next((row for row in found.rows if row.worst is not None and row.before), None)
    if row is None or row.worst is None:
        return
    after = Path(row.worst.run.run)
    runs, recording = (row.before[0], after, library), folder / RECORDING
    try:
        write(compare(*runs), recording, overwrite=overwrite)
    except InspectorError:  # the robot cannot be drawn: a mesh is missing
        write(compare(*runs, robot=False), recording, overwrite=overwrite)
    title = f"{row.name}: {row.outcome}, {row.reason}; {after.name}"
    write_whole(folder / PICTURE, over_reference(row.worst, title), overwrite=overwrite)


# --- accept


def accept(
    ctx: typer.Context,
    runs: shared.Runs,
    reason: Annotated[str, option("Why they are accepted; reviewers read it.")],
    output: Annotated[
        Path | None,
        option("The store; by default the nearest reference/, or a new one.", "--output", "-o"),
    ] = None,
    only: Annotated[
        list[str] | None, option("Scenarios to accept, such as pick or 'walk*'; repeatable.")
    ] = None,
    by: Annotated[str, option("Who accepts them; you by default.")] = "",
    in_ci: Annotated[bool, option("Write though CI=true is set.", "--in-ci")] = False,
    jobs: shared.NumberOfJobs = 1,
    model: shared.ModelFiles = None,
) -> None:
    """Accept good runs: from then on `classify` finds what is louder than they are.

    Runs are grouped into scenarios by their names and motions. What was accepted and is not run
    stays as it is. A run like the accepted ones joins them, of which the newest ten stay; a run
    that differs replaces them.

    The exit status is 2 with CI=true, 3 if a run cannot be read, 5 if the store cannot be written.
    """
    if os.environ.get("CI", "").lower() in ("true", "1") and not in_ci:
        raise typer.BadParameter("CI=true: a person accepts runs, after review (--in-ci overrides)")
    if not reason.strip():
        raise typer.BadParameter("say why these runs are accepted", param_hint="'--reason'")
    first = runs[0]
    if not first.exists():
        raise InspectorError(f"{first}: no such file or folder")
    beside = (first if first.is_file() else first.absolute()).parent / store.FOLDER
    folder = output or store.find(first) or beside
    levels = store.by_motion(store.measured(runs, ctx.obj), store.kept_in(folder))
    if only:
        levels = [each for each in levels if any(fnmatchcase(each.name, one) for one in only)]
    if not levels:
        raise InspectorError(f"no run is of {' or '.join(only or [])} (--only)")
    verdicts = _verdicts_on({each.run for each in levels}, runs, load_library(model), ctx.obj, jobs)
    after, changes = store.accept_into(
        folder,
        levels,
        events={str(each.path): each.events for each in verdicts},
        reason=reason.strip(),
        by=by or store.who(),
    )
    for each in verdicts:
        for event in each.events:
            said = f"{each.path}: {event}: accepted with it; is that wanted?"
            typer.echo(f"inspector: {said}", err=True)
    for name, words in changes:
        typer.echo(f"{name}: {words}")
    kept = len(after.scenarios) - len({name for name, _ in changes})
    typer.echo(f"{folder / store.NAME}: written; {kept} other scenarios stay as they were")


def _verdicts_on(
    wanted: Collection[str], runs: Sequence[Path], library: Library, reading: Any, jobs: int
) -> list[Verdict]:
    """What the general model says of some of the runs, all of which can be read."""
    found = [each for each in sources(runs, reading)[0] if str(each.shown) in wanted]
    classified = classify_files(found, library, reading=reading, jobs=jobs)
    verdicts = list(progress(classified, "accept", total=len(found)))
    shared.say_assumed({str(verdict.path): verdict.assumed for verdict in verdicts})
    for each in verdicts:
        if each.status in UNREAD:
            raise InspectorError(f"{each.path}: {each.message}; nothing is accepted")
    return verdicts


# --- audit


def audit(
    ctx: typer.Context,
    logs: Annotated[list[Path], argument("Run files, or any logs; folders of them.")],
    format: shared.TextOrJson = "text",  # noqa: A002
    model: shared.ModelFiles = None,
) -> None:
    """Print what logs can show: rates, quantisation, failure classes.

    Exit status: 0 every log can show a failure class, 2 wrong usage, 3 bad input, 4 cannot tell: a
    log can show no failure class.
    """
    from inspector import audit as audits

    runs, others = sources(logs, ctx.obj)
    found, failed = audits.audit_all(runs, load_library(model), ctx.obj)
    if remark := left_out(others):
        typer.echo(f"inspector: {remark}", err=True)
    if format == "json":
        typer.echo(audits.as_json(found, failed))
    elif found:
        typer.echo("\n\n".join(audits.text(name, *each) for name, each in found.items()))
    for name, message in failed.items():
        typer.echo(f"inspector: {name}: {message}", err=True)
    observable = all(each.observable for each, _ in found.values())
    raise typer.Exit(3 if failed else 0 if observable else 4)


# --- smoothness

# Those of ``inspector.smoothness``, which would take too long to import here.
Scores = Literal["level", "sparc", "ldlj", "action_rate", "action_curvature"]


def smoothness(
    ctx: typer.Context,
    logs: Annotated[
        list[Path],
        argument("Run files, logs that `import` reads, LeRobot data sets, or folders of them."),
    ],
    by: Annotated[
        Scores | None,
        option("The score to order by; by default level, action_curvature for data sets."),
    ] = None,
    format: shared.TextOrJson = "text",  # noqa: A002
) -> None:
    """Rank episodes of policies and demonstrations by smoothness.

    The exit status is 3 if a log cannot be read; the others are ranked.
    """
    from inspector import smoothness as ranking

    order = ranking.ranked(*ranking.scored_episodes(logs, ctx.obj), by=by or "")
    typer.echo(ranking.as_json(order) if format == "json" else ranking.as_text(order))
    for name, problem in order.failed:
        typer.echo(f"inspector: {name}: {problem}", err=True)
    raise typer.Exit(3 if order.failed else 0)


# --- merge and history


def merge(
    results: Annotated[list[Path], argument("Files that `classify --write json=FILE` wrote.")],
    format: Format = "text",  # noqa: A002
    write: shared.Write = None,
    report: Annotated[Path | None, option("Write index.html with all runs to this folder.")] = None,
    overwrite: shared.Overwrite = False,
) -> None:
    """Join the results of several jobs into one.

    The exit status is the one that `classify` has for all of their runs.
    """
    outputs = shared.outputs_of(write, FORMATS, overwrite=overwrite)
    found: dict[Path, tuple[Verdict, Path]] = {}
    absent: list[Verdict] = []
    for path in results:
        for verdict in read_results(path):
            if not verdict.of_run:
                absent.append(verdict)
            elif verdict.path in found:
                first = found[verdict.path][1]
                raise InspectorError(f"{path}: the run {verdict.path} is in {first}, too")
            else:
                found[verdict.path] = verdict, path
    merged = [verdict for verdict, _ in found.values()]
    merged += still_absent(absent, merged)
    if report is not None:
        html = _index_in(report, outputs, overwrite=overwrite)
        merged = [html.with_picture(each, report) for each in merged]
    _end(merged, shared.written(merged, FORMATS[format], outputs))


def history(
    results: Annotated[
        Path, argument("A folder of files of `classify --write json=FILE`, one per commit.")
    ],
    output: Annotated[
        Path | None, option("Write a page (.html) to this file.", "--output", "-o")
    ] = None,
    overwrite: shared.Overwrite = False,
) -> None:
    """Show the results of many commits, and where they changed.

    Files are in order of their names, and named after their commit behind the last dash:
    0061-3f2a1c9.json. The exit status is 3 if one cannot be read; the others are shown.
    """
    from inspector.report import html

    if output:
        refuse_existing(output, overwrite=overwrite)
    found = html.read_history(results)
    for line in found.lines():
        typer.echo(line)
    for problem in found.problems:
        typer.echo(f"inspector: {problem}", err=True)
    if output:
        write_whole(output, html.history_page(found), overwrite=overwrite)
    raise typer.Exit(EXIT[Status.BAD_INPUT] if found.problems else 0)
