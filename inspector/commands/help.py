"""`inspector help`: the help of a command, or of a topic."""

from typing import Annotated

import typer


def help(  # noqa: A001
    ctx: typer.Context,
    topic: Annotated[
        str, typer.Argument(help="A command, or logs: how logs are read.", show_default=False)
    ] = "",
) -> None:
    """Print the help of a command or a topic: logs."""
    parent = ctx.parent
    assert parent is not None
    if not topic:
        typer.echo(parent.get_help())
        return
    if topic == "logs":
        typer.echo("Options on reading logs, taken by all commands that open logs:\n")
        for option in parent.command.commands["import"].added:  # type: ignore[attr-defined]
            typer.echo(f"  {option.opts[0]:15} {option.help}")
        return
    command = parent.command.commands.get(topic)  # type: ignore[attr-defined]
    if command is None:
        raise typer.BadParameter(f"{topic!r} is no command and no topic", param_hint="TOPIC")
    with command.make_context(topic, [], parent=parent, resilient_parsing=True) as inner:
        typer.echo(inner.get_help())
