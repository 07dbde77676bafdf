"""`inspector accept`: what is normal for a robot's scenarios."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from inspector.commands.options import ModelFiles, NumberOfJobs, Runs, say_assumed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from inspector.library import Library
    from inspector.logs.read import Reading, Source
    from inspector.verdict import Verdict


Reason = Annotated[str, typer.Option("--reason", help="Why they are accepted; reviewers read it.")]
Store = Annotated[
    Path | None,
    typer.Option(
        "--output", "-o", help="The store; by default the nearest reference/, or a new one."
    ),
]
Only = Annotated[
    list[str] | None,
    typer.Option("--only", help="Scenarios to accept, such as pick or 'walk*'; repeatable."),
]
By = Annotated[str, typer.Option("--by", help="Who accepts them; you by default.")]
InCI = Annotated[bool, typer.Option("--in-ci", help="Write though CI=true is set.")]


def accept(
    ctx: typer.Context,
    runs: Runs,
    reason: Reason,
    output: Store = None,
    only: Only = None,
    by: By = "",
    in_ci: InCI = False,
    jobs: NumberOfJobs = 1,
    model: ModelFiles = None,
) -> None:
    """Accept good runs: from then on `classify` finds what is louder than they are.

    Runs are grouped into scenarios by their names and motions. What was accepted and is not run
    stays as it is. A run like the accepted ones joins them, of which the newest ten stay; a run
    that differs replaces them.

    The exit status is 2 with CI=true, 3 if a run cannot be read, 5 if the store cannot be written.
    """
    import os
    from fnmatch import fnmatchcase

    from inspector.errors import InspectorError
    from inspector.library import load_library
    from inspector.logs.read import sources
    from inspector.reference import store as kept_in

    if os.environ.get("CI", "").lower() in ("true", "1") and not in_ci:
        raise typer.BadParameter("CI=true: a person accepts runs, after review (--in-ci overrides)")
    if not reason.strip():
        raise typer.BadParameter("say why these runs are accepted", param_hint="'--reason'")
    first = runs[0]
    if not first.exists():
        raise InspectorError(f"{first}: no such file or folder")
    beside = (first if first.is_file() else first.absolute()).parent / kept_in.FOLDER
    store = output or kept_in.find(first) or beside
    levels = kept_in.measured(runs, ctx.obj)
    if only:
        levels = [each for each in levels if any(fnmatchcase(each.name, one) for one in only)]
    if not levels:
        raise InspectorError(f"no run is of {' or '.join(only or [])} (--only)")
    named = {each.run for each in levels}
    found = [each for each in sources(runs, ctx.obj)[0] if str(each.shown) in named]
    verdicts = _classified(found, load_library(model), ctx.obj, jobs)
    after, changes = kept_in.accept_into(
        store,
        levels,
        wanted=kept_in.wanted_in(levels, {str(each.path): each.events for each in verdicts}),
        reason=reason.strip(),
        by=by or kept_in.who(),
    )
    for each in verdicts:
        for event in each.events:
            typer.echo(
                f"inspector: {each.path}: {event}: accepted with it; is that wanted?", err=True
            )
    for name, words in changes:
        typer.echo(f"{name}: {words}")
    kept = len(after.scenarios) - len({name for name, _ in changes})
    typer.echo(f"{store / kept_in.NAME}: written; {kept} other scenarios stay as they were")


def _classified(
    runs: "Sequence[Source]", library: "Library", reading: "Reading", jobs: int
) -> "list[Verdict]":
    """What the general model says of runs, all of which can be read."""
    from inspector.errors import InspectorError, Status
    from inspector.text import progress
    from inspector.verdict import classify_files

    classified = classify_files(runs, library, reading=reading, jobs=jobs)
    verdicts = list(progress(classified, "accept", total=len(runs)))
    say_assumed({str(verdict.path): verdict.assumed for verdict in verdicts})
    for each in verdicts:
        if each.status in (Status.BAD_INPUT, Status.INTERNAL_ERROR):
            raise InspectorError(f"{each.path}: {each.message}; nothing is accepted")
    return verdicts
