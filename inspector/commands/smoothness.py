"""`inspector smoothness`: episodes from the smoothest to the roughest."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from inspector.commands.options import ModelFiles, Overwrite


class Format(StrEnum):
    """The output formats of a ranking."""

    TEXT = "text"
    CSV = "csv"
    JSON = "json"


class By(StrEnum):
    """The scores, by their names in ``inspector.smoothness``, too slow to import here."""

    LEVEL = "level"
    SPARC = "sparc"
    LDLJ = "ldlj"
    ACTION_RATE = "action_rate"
    ACTION_CURVATURE = "action_curvature"
    FLAGGED = "flagged"
    TRACKING = "tracking"


def smoothness(
    ctx: typer.Context,
    logs: Annotated[
        list[Path],
        typer.Argument(
            help="Run files, logs that `import` reads, LeRobot data sets, or folders of them.",
            show_default=False,
        ),
    ],
    by: Annotated[
        By | None,
        typer.Option(
            help="The score to order by; by default level, action_curvature for data sets."
        ),
    ] = None,
    format: Annotated[Format, typer.Option("--format", help="Output format.")] = Format.TEXT,  # noqa: A002
    picture: Annotated[
        Path | None,
        typer.Option(help="Write histograms of the scores as PNG (needs the extra `report`)."),
    ] = None,
    labels: Annotated[
        bool, typer.Option("--labels/--no-labels", help="Classify episodes from 80 Hz on.")
    ] = True,
    model: ModelFiles = None,
    overwrite: Overwrite = False,
) -> None:
    """Rank episodes of policies and demonstrations by smoothness.

    The exit status is 3 if a log cannot be read; the others are ranked.
    """
    from inspector import smoothness as ranking
    from inspector.library import load_library
    from inspector.report.picture import require
    from inspector.text import progress
    from noisemodel.files import refuse_existing

    if picture:
        refuse_existing(picture, overwrite=overwrite)
        require()
    library = load_library(model) if labels else None
    episodes, failed = ranking.episodes_of(logs, ctx.obj)
    scored = ranking.scored_episodes(episodes, ctx.obj, library)
    found = progress(scored, "score", total=len(episodes))
    order = ranking.ranked([*found, *failed], by=by or "")
    write = {"text": ranking.as_text, "csv": ranking.as_csv, "json": ranking.as_json}
    typer.echo(write[format](order))
    if picture and order.episodes:
        ranking.draw(order.episodes, picture, overwrite=overwrite)
        typer.echo(f"{picture}", err=True)
    for each in order.failed:
        typer.echo(f"inspector: {each.name}: {each.problem}", err=True)
    raise typer.Exit(3 if order.failed else 0)
