"""`inspector audit`: what a log can show."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from inspector.commands.options import ModelFiles


class Format(StrEnum):
    """The output formats of an audit."""

    TEXT = "text"
    JSON = "json"


def audit(
    logs: Annotated[
        list[Path],
        typer.Argument(help="Run files, or logs that `import` reads.", show_default=False),
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
    from inspector import assets
    from inspector.audit.formats import as_json, text
    from inspector.audit.logs import audit_all
    from inspector.library import load_library

    found, failed = audit_all(logs, load_library(assets.model_files(model)))
    if format is Format.JSON:
        typer.echo(as_json(found, failed))
    elif found:
        typer.echo("\n\n".join(text(name, audit) for name, audit in found.items()))
    for name, message in failed.items():
        typer.echo(f"inspector: {name}: {message}", err=True)
    observable = all(audit.observable for audit in found.values())
    raise typer.Exit(3 if failed else 0 if observable else 4)
