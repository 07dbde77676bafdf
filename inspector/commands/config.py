"""`inspector config`: the settings of a project that are in force."""

from typing import Any

import typer


def config(ctx: typer.Context) -> None:
    """Print the settings of this project that are in force.

    They are in inspector.toml, or in the table tool.noise-inspector of pyproject.toml: options on
    reading logs, model and jobs for all commands, and a table for each command, such as classify.
    The command line wins.
    """
    from inspector.config import find
    from inspector.errors import OptionError

    found = find()
    if found is None:
        typer.echo("no settings: no inspector.toml, no [tool.noise-inspector] in pyproject.toml")
        return
    group: Any = ctx.parent and ctx.parent.command
    for name in found.own:
        if name not in group.commands:
            raise OptionError(f"{found.path}: no command {name!r}")
    for name in group.commands:
        group.settings(name, found)  # refuses what is not known
    typer.echo(f"{found.path}:")
    for line in found.lines():
        typer.echo(f"  {line}")
