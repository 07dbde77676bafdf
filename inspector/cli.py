"""The command line: the commands under their names, and expected errors as one line."""

import sys

import typer

from inspector.commands import (
    auditing,
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
)

app = typer.Typer(
    help="Inspect the noise that a robot's joints would make.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
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
app.command()(learning.evaluate)
app.command()(comparing.compare)
app.command()(comparing.robots)


def main() -> None:
    """Run the command line; expected errors become one line and exit status 3."""
    try:
        app()
    except ValueError as error:
        from inspector.verdict import EXPECTED
        from scenarios import ScenarioError

        if not isinstance(error, (*EXPECTED, ScenarioError)):
            raise
        typer.echo(f"inspector: {error}", err=True)
        sys.exit(3)
