"""The command line: the commands under their names, and expected errors as one line."""

import os
import sys
from typing import Annotated

import typer

from inspector.commands.audit import audit
from inspector.commands.baseline import baseline
from inspector.commands.classify import classify
from inspector.commands.compare import compare
from inspector.commands.evaluate import evaluate
from inspector.commands.export import export
from inspector.commands.import_ import import_
from inspector.commands.labels import labels
from inspector.commands.listen import listen
from inspector.commands.live import live
from inspector.commands.noise import noise
from inspector.commands.report import report
from inspector.commands.robots import robots
from inspector.commands.shot import shot
from inspector.commands.simulate import app as simulate
from inspector.commands.train import train
from inspector.commands.tune import tune
from inspector.commands.view import view

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


app.command()(view)
app.command()(live)
app.command()(classify)
app.command()(noise)
app.command()(listen)
app.command()(shot)
app.command()(report)
app.command("import")(import_)
app.command()(audit)
app.command()(labels)
app.command()(export)
app.add_typer(simulate, name="simulate")
app.command()(train)
app.command()(baseline)
app.command()(tune)
app.command()(evaluate)
app.command()(compare)
app.command()(robots)


def main() -> None:
    """Run the command line; expected errors become one line and exit status 3."""
    # Matrices are small here: more threads mostly wait, and waiting takes processor time.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        app()
    except ValueError as error:
        from inspector.analysis.verdict import EXPECTED
        from scenarios import ScenarioError

        if not isinstance(error, (*EXPECTED, ScenarioError)):
            raise
        typer.echo(f"inspector: {error}", err=True)
        sys.exit(3)
