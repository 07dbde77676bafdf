"""`inspector expect`: a first file of expectations."""

import shlex
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from inspector.analysis.status import EXIT, Status, worst
from inspector.commands.options import ModelFiles, Overwrite, say_assumed
from inspector.text import counted

if TYPE_CHECKING:
    from inspector.logs.opening import Reading


def expect(
    ctx: typer.Context,
    runs: Annotated[
        list[Path],
        typer.Argument(help="Run files or logs; folders of them.", show_default=False),
    ],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="The file to write; expect.toml beside the runs."),
    ] = None,
    required: Annotated[
        bool, typer.Option("--required", help="Require what was found; else it is allowed.")
    ] = False,
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, help="Parallel runs.")] = 1,
    model: ModelFiles = None,
    overwrite: Overwrite = False,
) -> None:
    """Write a first expect.toml, which allows what is found in runs.

    `classify` applies the nearest expect.toml: beside a run, or in a folder above it. Edit it:
    allow, require, forbid, waive until a date, or set a budget (docs/expectations.md).

    The exit status is 3 if a run cannot be read, 70 at a bug; the others are written, if any.
    """
    from inspector import assets
    from inspector.expectations.expectations import is_nearest
    from inspector.expectations.first import first, path_for
    from inspector.library import load_library
    from inspector.logs.opening import sources
    from inspector.progress import progress
    from inspector.verdict import classify_files
    from noisemodel.atomic import refuse_existing, replacing

    reading: Reading = ctx.obj

    path = path_for(runs, output)
    refuse_existing(path, overwrite=overwrite)
    library = load_library(assets.model_files(model))
    found, _ = sources(runs, reading)
    classified = classify_files(found, library, reading=reading, jobs=jobs)
    verdicts = list(progress(classified, "classify", total=len(found)))
    say_assumed({str(verdict.path): verdict.assumed for verdict in verdicts})
    bad = [each for each in verdicts if each.status in (Status.BAD_INPUT, Status.INTERNAL_ERROR)]
    for each in bad:
        typer.echo(f"{each.trace}inspector: {each.path}: {each.message}", err=True)
    status = worst(EXIT[each.status] for each in bad)
    read = len(verdicts) - len(bad)
    if not read:
        raise typer.Exit(status)
    content = first(verdicts, path.parent, required=required, today=date.today())
    with replacing(path, overwrite=overwrite) as temporary:
        temporary.write_text(content, encoding="utf-8")
    number = sum(len(each.events) for each in verdicts)
    findings, of = counted(number, "finding"), counted(read, "run")
    became = "required" if required else "allowed"
    typer.echo(f"{path}: {findings} of {of} {became}; edit it, then")
    by_itself = all(is_nearest(path, each.shown) for each in found)
    named = [] if by_itself else ["--expect", str(path)]
    typer.echo(f"  {shlex.join(['inspector', 'classify', *map(str, runs), *named])}")
    raise typer.Exit(status)
