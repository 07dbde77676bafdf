"""The command line: the commands under their names, and expected errors as one line."""

import os
import sys
from typing import Annotated

import typer

from inspector.commands import (
    auditing,
    baseline,
    comparing,
    hearing,
    judging,
    learning,
    living,
    logs,
    looking,
    showing,
    simulating,
    travelling,
    tuning,
)

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import PackageNotFoundError, version

        try:
            typer.echo(f"inspector {version('noise-inspector')}")
        except PackageNotFoundError:  # run from its folder
            typer.echo("inspector, not installed")
        raise typer.Exit


@app.callback()
def _inspector(
    _version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version."
        ),
    ] = False,
) -> None:
    """Inspect the noise that a robot's joints would make."""


app.command()(looking.view)
app.command()(living.live)
app.command()(judging.classify)
app.command()(looking.noise)
app.command()(hearing.listen)
app.command()(showing.shot)
app.command()(showing.report)
app.command("import")(logs.import_)
app.command()(auditing.audit)
app.command()(travelling.labels)
app.command()(travelling.export)
app.add_typer(simulating.app, name="simulate")
app.command()(learning.train)
app.command()(baseline.baseline)
app.command()(tuning.tune)
app.command()(learning.evaluate)
app.command()(comparing.compare)
app.command()(comparing.robots)


def main() -> None:
    """Run the command line; expected errors become one line and exit status 3."""
    # Matrices are small here: more threads mostly wait, and waiting takes processor time.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        app()
    except ValueError as error:
        from inspector.verdict import EXPECTED
        from scenarios import ScenarioError

        if not isinstance(error, (*EXPECTED, ScenarioError)):
            raise
        typer.echo(f"inspector: {error}", err=True)
        sys.exit(3)
