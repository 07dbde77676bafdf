"""`inspector accept`: what is normal for a robot's scenarios."""

from pathlib import Path
from typing import Annotated

import typer

from inspector.commands.options import ModelFiles, NumberOfJobs, Runs, say_assumed


def accept(
    ctx: typer.Context,
    runs: Runs,
    reason: Annotated[
        str, typer.Option("--reason", help="Why they are accepted; reviewers read it.")
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="The store; by default the nearest reference/, or a new one."
        ),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option("--only", help="Scenarios to accept, such as pick or 'walk*'; repeatable."),
    ] = None,
    by: Annotated[str, typer.Option("--by", help="Who accepts them; you by default.")] = "",
    in_ci: Annotated[bool, typer.Option("--in-ci", help="Write though CI=true is set.")] = False,
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

    from inspector import assets
    from inspector.errors import InspectorError
    from inspector.library import load_library
    from inspector.logs.read import sources
    from inspector.progress import progress
    from inspector.reference.store import (
        FOLDER,
        NAME,
        accept_into,
        find,
        measured,
        wanted_in,
        who,
    )
    from inspector.status import Status
    from inspector.verdict import classify_files

    if os.environ.get("CI", "").lower() in ("true", "1") and not in_ci:
        raise typer.BadParameter("CI=true: a person accepts runs, after review (--in-ci overrides)")
    if not reason.strip():
        raise typer.BadParameter("say why these runs are accepted", param_hint="'--reason'")
    first = runs[0]
    if not first.exists():
        raise InspectorError(f"{first}: no such file or folder")
    store = (
        output or find(first) or (first if first.is_file() else first.absolute()).parent / FOLDER
    )
    levels = measured(runs, ctx.obj)
    if only:
        levels = [each for each in levels if any(fnmatchcase(each.name, one) for one in only)]
    if not levels:
        raise InspectorError(f"no run is of {' or '.join(only or [])} (--only)")
    library = load_library(assets.model_files(model))
    found = [
        each
        for each in sources(runs, ctx.obj)[0]
        if str(each.shown) in {level.run for level in levels}
    ]
    classified = classify_files(found, library, reading=ctx.obj, jobs=jobs)
    verdicts = list(progress(classified, "accept", total=len(found)))
    say_assumed({str(verdict.path): verdict.assumed for verdict in verdicts})
    for each in verdicts:
        if each.status in (Status.BAD_INPUT, Status.INTERNAL_ERROR):
            raise InspectorError(f"{each.path}: {each.message}; nothing is accepted")
    after, changes = accept_into(
        store,
        levels,
        wanted=wanted_in(levels, {str(each.path): each.events for each in verdicts}),
        reason=reason.strip(),
        by=by or who(),
    )
    for each in verdicts:
        for event in each.events:
            typer.echo(
                f"inspector: {each.path}: {event}: accepted with it; is that wanted?", err=True
            )
    for change in changes:
        typer.echo(str(change))
    kept = len(after.scenarios) - len({change.name for change in changes})
    typer.echo(f"{store / NAME}: written; {kept} other scenarios stay as they were")
