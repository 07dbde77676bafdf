"""The command line: the commands in panels, and expected errors as one line."""

import io
import os
import sys
import traceback
from collections.abc import Callable
from contextlib import suppress
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from inspector.analysis.status import EXIT, OUTPUT_LOST, Status
from inspector.commands.adapt import adapt
from inspector.commands.audit import audit
from inspector.commands.baseline import baseline
from inspector.commands.classify import classify
from inspector.commands.compare import compare
from inspector.commands.diff import diff
from inspector.commands.evaluate import evaluate
from inspector.commands.expect import expect
from inspector.commands.export import export
from inspector.commands.import_ import import_
from inspector.commands.listen import listen
from inspector.commands.live import live
from inspector.commands.noise import noise
from inspector.commands.report import report
from inspector.commands.robots import robots
from inspector.commands.shot import shot
from inspector.commands.simulate import app as simulate
from inspector.commands.smoothness import smoothness
from inspector.commands.train import train
from inspector.commands.tune import tune
from inspector.commands.view import view
from inspector.text import printable

RENAMED = {"labels": "export (--labels findings, --labels annotated, --annotate FILE)"}
"""Commands of the version before, and what does their work now."""


class _Group(TyperGroup):
    """Commands; what they say of a wrong value begins with the value."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        if args and args[0] in RENAMED:
            typer.echo(f"inspector: `{args[0]}` is now `{RENAMED[args[0]]}`", err=True)
            raise typer.Exit(2)
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except typer.BadParameter as error:
            error.message = error.message.removeprefix("Value error, ")  # of pydantic
            raise


app = typer.Typer(
    cls=_Group,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    epilog="Example: inspector view",
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
    """Find faults of a robot in the noise that its joints would make."""


def _add(panel: str, command: Callable[..., None], example: str, *, name: str = "") -> None:
    """Add a command to a panel of `inspector --help`, and an example to its own help."""
    add = app.command(name or None, rich_help_panel=panel, epilog=f"Example: {example}")
    add(command)


_add("Look", view, "inspector view run.npz")
_add("Look", live, "inspector live --rate 1000 --robot panda < samples.csv")
_add("Look", noise, "inspector noise run.npz --kind normal --csv noise.csv")
_add("Look", listen, "inspector listen before.npz after.npz -o noise.wav")
_add("Look", shot, "inspector shot run.npz -o run.png")
_add("Look", report, "inspector report run.npz -o run.html")
_add("Look", compare, "inspector compare --robots panda,go2 --csv comparison.csv")
_add("Look", robots, "inspector robots")
_add("Judge", classify, "inspector classify run.npz --format junit")
_add("Judge", expect, "inspector expect runs/")
_add("Judge", diff, "inspector diff reference/ candidate/ --report changes/")
_add("Judge", audit, "inspector audit run.npz")
_add("Judge", smoothness, "inspector smoothness episodes/ --picture smoothness.png")
_add("Import and export", import_, "inspector import log.csv -o run.npz", name="import")
_add("Import and export", export, "inspector export run.npz -o run.mcap")
_add("Train", train, "inspector train data/ --part training --rate 1000 -o model.npz")
_add("Train", adapt, "inspector adapt good1.npz good2.npz -o robot.npz --alarms 1")
_add("Train", baseline, "inspector baseline good1.npz good2.npz -o baseline.npz --alarms 1")
_add("Train", tune, "inspector tune data/ --profile logbands --grid C=1,10 -o tuned.jsonl")
_add("Train", evaluate, "inspector evaluate model.npz data/ --part test")
app.add_typer(simulate, name="simulate", rich_help_panel="Simulate")


def main() -> None:
    """Run the command line: expected errors end as one line with 2, 3 or 5, bugs with 70."""
    # Matrices are small here: more threads mostly wait, and waiting takes processor time.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Of a file that it cannot write, rerun tells in several lines; we do in one.
    os.environ.setdefault("RUST_LOG", "warn,re_log_encoding=off,re_sdk=off")
    output = _standard_output()
    for stream in (sys.stdout, sys.stderr):  # names of files need not be text in their encoding
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    odd = next((each for each in sys.argv[1:] if printable(each) != each), None)
    if odd is not None:
        typer.echo(f"inspector: {printable(odd)}: has control characters", err=True)
        sys.exit(2)
    status = _run(output)
    if output is not None:
        with suppress(OSError):
            sys.stdout.flush()
        if output.lost is not None and status not in (OUTPUT_LOST, EXIT[Status.INTERNAL_ERROR]):
            reason = f"standard output: cannot be written ({output.lost.strerror})"
            typer.echo(f"inspector: output lost: {reason}", err=True)
            status = OUTPUT_LOST
    sys.exit(status)


class _StandardOutput(io.FileIO):
    """Standard output that keeps its first error, and drops what comes after it.

    Libraries end a program whose reader is gone with 1, which would be that of a finding.
    """

    lost: OSError | None = None

    def write(self, data: Any, /) -> int:
        if self.lost is None:
            try:
                return super().write(data)
            except OSError as error:
                self.lost = error
                raise
        return memoryview(data).nbytes


def _standard_output() -> _StandardOutput | None:
    """Watch standard output for errors, if it is a file or a pipe, or closed."""
    plain = sys.__stdout__
    if sys.stdout is not plain or (plain is not None and plain.isatty()):
        return None
    if plain is None:  # was closed: whatever is written is lost
        watched = _StandardOutput(os.open(os.devnull, os.O_RDONLY), "w")
        sys.stdout = io.TextIOWrapper(io.BufferedWriter(watched), encoding="utf-8")
        return watched
    watched = _StandardOutput(plain.fileno(), "w", closefd=False)
    sys.stdout = io.TextIOWrapper(
        io.BufferedWriter(watched), encoding=plain.encoding, errors=plain.errors
    )
    return watched


def _run(output: _StandardOutput | None) -> int:
    """Run the command line; the exit status."""
    try:
        app()
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else 0
    except Exception as error:
        if output is not None and error is output.lost:
            return 0  # `main` says it
        return _failed(error)
    return 0


def _failed(error: Exception) -> int:
    """Print an expected error as one line, or the traceback of a bug; the exit status."""
    if isinstance(error, ValueError):
        import noiseclassifier as nc
        import noisemodel
        from inspector.analysis.verdict import EXPECTED
        from inspector.errors import OptionError
        from inspector.recording.viewer import DisplayError
        from noiseclassifier.scenarios import ScenarioError

        if isinstance(error, (*EXPECTED, ScenarioError)):
            typer.echo(f"inspector: {printable(str(error))}", err=True)
            if isinstance(error, (OptionError, noisemodel.UnknownKindError)):
                return 2
            output = isinstance(error, (noisemodel.OutputError, nc.OutputError))
            lost = output and isinstance(error.__cause__, OSError)
            return OUTPUT_LOST if lost or isinstance(error, DisplayError) else 3
    traceback.print_exception(error)
    return EXIT[Status.INTERNAL_ERROR]  # Python's own would be that of a finding
