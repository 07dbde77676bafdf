"""`inspector audit`: what a log can show."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from inspector.commands.options import ModelFiles

if TYPE_CHECKING:
    from inspector.logs.read import Reading


class Format(StrEnum):
    """The output formats of an audit."""

    TEXT = "text"
    JSON = "json"


def audit(
    ctx: typer.Context,
    logs: Annotated[
        list[Path],
        typer.Argument(help="Run files, or any logs; folders of them.", show_default=False),
    ],
    format: Annotated[Format, typer.Option("--format", help="Output format.")] = Format.TEXT,  # noqa: A002
    model: ModelFiles = None,
) -> None:
    """Print what logs can show: rates, quantisation, failure classes.

    Exit status:

      0  every log can show a failure class
      2  wrong usage
      3  bad input: a file cannot be read
      4  cannot tell: a log can show no failure class
    """
    from inspector.audit.audit import as_json, audit_all, text
    from inspector.library import load_library

    reading: Reading = ctx.obj

    library = load_library(model)
    found, failed, assumed, others = audit_all(logs, library, reading)
    if others:
        typer.echo(f"inspector: {others}", err=True)
    if format is Format.JSON:
        typer.echo(as_json(found, failed, assumed))
    elif found:
        typer.echo("\n\n".join(text(name, audit, assumed[name]) for name, audit in found.items()))
    for name, message in failed.items():
        typer.echo(f"inspector: {name}: {message}", err=True)
    observable = all(audit.observable for audit in found.values())
    raise typer.Exit(3 if failed else 0 if observable else 4)
