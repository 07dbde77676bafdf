"""The command line: the commands in panels, each imported when used; errors as one line."""

import errno
import io
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from inspector.errors import EXIT, OUTPUT_LOST, OptionError, Status
from inspector.text import printable, program_version

# The commands, each with what the help says of it.
PANELS = {
    "Inspect": {
        "view": "Show a run, or several side by side.",
        "noise": "Print noise levels by joint and link.",
        "listen": "Write the noise of runs as sound.",
        "live": "Show samples from standard input as they arrive.",
        "robots": "List the robots that are available by name.",
    },
    "Check": {
        "classify": "Classify runs and print verdicts.",
        "diff": "Compare runs with a reference: better, same or worse.",
        "accept": "Accept good runs: what is normal.",
        "audit": "Print what logs can show: rates, quantisation, failure classes.",
        "smoothness": "Rank episodes of policies and demonstrations by smoothness.",
        "merge": "Join the results of several jobs into one.",
        "history": "Show the results of many commits, and where they changed.",
    },
    "Import and export": {
        "import": "Convert logs of robots to run files.",
        "export": "Write noise, labels and scores for other tools.",
    },
    "Train": {
        "train": "Train a model on annotated runs.",
        "tune": "Tune a profile's settings by grid search; resumes if killed.",
        "evaluate": "Evaluate a model on annotated runs that it was not trained on.",
    },
    "Simulate": {"simulate": "Simulate runs with annotated failures."},
    "Help": {"help": "Print the help of a command or a topic: logs."},
}
IN = ("inspect", "check", "convert", "train", "simulate")  # the module of each panel
MODULES = {
    name: f"inspector.commands.{module}"
    for module, own in zip(IN, PANELS.values(), strict=False)
    for name in own
} | {"help": "inspector.cli"}
EXAMPLES = {
    "view": "view run.npz -o run.png",
    "noise": "noise run.npz --csv n.csv",
    "listen": "listen a.npz b.npz -o n.wav",
    "live": "live --rate 1000 --robot panda < samples.csv",
    "robots": "robots",
    "classify": "classify run.npz --format junit",
    "diff": "diff reference/ candidate/ --report changes/",
    "accept": 'accept runs/ --reason "first release"',
    "audit": "audit run.npz",
    "smoothness": "smoothness episodes/ --by sparc",
    "merge": "merge one.json two.json --report noise/",
    "history": "history results/ -o history.html",
    "import": "import log.csv -o run.npz",
    "export": "export run.npz -o run.mcap",
    "train": "train data/ --part training --rate 1000 -o model.npz",
    "tune": "tune data/ --profile logbands --grid C=1,10 -o t.jsonl",
    "evaluate": "evaluate model.npz data/ --part test",
    "simulate": "simulate run talos --scenario 7",
    "help": "help logs",
}
# Commands that take the options on reading logs.
READ_LOGS = frozenset(
    ("view", "noise", "listen", "classify", "accept", "audit", "smoothness", "import", "export")
)
# Commands of 0.6, and what does the same; to be dropped after one version.
RENAMED = {
    "adapt": "accept",
    "baseline": "accept",
    "expect": "accept",
    "shot": "view RUN -o FILE.png",
    "report": "view RUN -o FILE.html",
    "compare": "noise --compare",
    "labels": "export (--labels findings, --labels annotated, --annotate FILE)",
}
ABOUT = "Detect impacts, jumps and oscillations in robot joint data."
START = """\
Finds impacts, velocity jumps and oscillations in robot joint data.

  inspector view                    show the demo: a Panda that touches a table
  inspector classify log.csv        find faults in your own log
  inspector import log.csv --list   print what a log holds, if it is read wrongly

Next: `inspector --help` lists all commands, `inspector COMMAND -h` explains one,
`inspector help logs` lists the options on reading logs.
Exit status: 0 ok, 1 findings, 2 wrong usage, 3 bad input, 4 cannot tell, 5 output lost.
Tutorial: docs/tutorial.md"""
END = """\
Options
  --version   Print the version.
  -h, --help  Print this help.

`inspector COMMAND -h` explains a command, `inspector help logs` reading logs."""
LOGS = "How logs are read (--robot, --rate, --map, ...): `inspector help logs`."
# Names of options that are written; all other paths are read.
OUTPUTS = frozenset(("output", "save", "csv", "report", "save_mapping", "resume", "train"))
# Names of parameters that no file of settings sets.
UNSET = OUTPUTS | {"overwrite", "write", "in_ci", "help"}
INTERRUPTED = 130  # exit status after Ctrl-C, as of a shell
# Errors of the system about a path that a user typed, or of a disk: no bugs.
UNUSABLE = (errno.ENAMETOOLONG, errno.EACCES, errno.EPERM, errno.ENOSPC, errno.EROFS, errno.EIO)


# --- commands


def _coerce(checked: Callable[[], Any], value: Any, *, param: Any, ctx: Any) -> Any:
    """Take defaults and paths as they are: to check them, typer imports pydantic for 0.1 s."""
    many = param.multiple or param.nargs == -1
    if value is None or value is param.default:
        return () if value is None and many else value
    if many and isinstance(value, str):  # of a file of settings
        value = [value]
    paths = many and param.type_descriptor.annotation == list[Path]
    if paths and all(isinstance(each, str) and os.access(each, os.R_OK) for each in value):
        return list(map(Path, value))
    return checked().coerce(value, param=param, ctx=ctx)


class _Taking:
    """A command or group that has typer check what was typed alone."""

    def get_params(self, ctx: Any) -> list[Any]:
        found: list[Any] = super().get_params(ctx)  # type: ignore[misc]
        for each in found:
            if hasattr(each, "get_runtime_param"):  # of typer's latest versions
                coerce = partial(_coerce, each.get_runtime_param)
                each.get_runtime_param = partial(SimpleNamespace, coerce=coerce)
        return found


class _Command(_Taking, TyperCommand):
    """A command that replaces nothing that it reads; one that opens logs has a Reading (obj)."""

    def __init__(self, *args: Any, params: list[Any], help: str, **settings: Any) -> None:  # noqa: A002
        self.added = []
        if settings["name"] in READ_LOGS:
            from inspector.commands.shared import log_options

            self.reading = _converted(log_options, "logs")
            self.added = self.reading.params
            if settings["name"] != "import":
                help = f"{help}\n\n{LOGS}"  # noqa: A001
                for each in self.added:
                    each.hidden = True
        super().__init__(*args, params=[*params, *self.added], help=help, **settings)

    def invoke(self, ctx: Any) -> Any:
        """Run the command; no output in `OUTPUTS` may be one of its other files."""
        import ctypes

        from noisemodel.files import reading, refuse_read

        # Freed memory waits for the next arrays: to return it and get it anew takes a tenth.
        for number, name, size in ((-3, "MMAP", 2**25), (-1, "TRIM", 2**27)):  # see mallopt(3)
            os.environ.setdefault(f"MALLOC_{name}_THRESHOLD_", str(size))  # of processes to come
            with suppress(OSError, AttributeError):  # where the C library is another one
                ctypes.CDLL(None).mallopt(number, size)
        files: dict[bool, list[Path]] = {True: [], False: []}
        for name, value in ctx.params.items():
            paths = value if isinstance(value, list) else [value]
            if name == "robot" and isinstance(value, str):
                paths = [Path(value)]
            if name == "runs":  # of folders, commands name the logs: outputs may lie beside these
                # `Path.is_dir` raises an error where a name is too long.
                paths = [each for each in paths if each and not os.path.isdir(each)]  # noqa: PTH112
            files[name in OUTPUTS] += [each for each in paths if isinstance(each, Path)]
        if self.added:
            ctx.obj = self.reading.callback(**{x.name: ctx.params.pop(x.name) for x in self.added})
        with reading(files[False]):
            for path in files[True]:
                refuse_read(path)
            return super().invoke(ctx)


def _converted(function: Callable[..., Any], name: str, **settings: Any) -> Any:
    """A function as a command of click's; its help is plain, since rich is slow to import."""
    single = typer.Typer(add_completion=False, rich_markup_mode=None)
    single.command(name, **settings)(function)
    return typer.main.get_command(single)


@cache
def _command(name: str) -> Any:
    """Import a command."""
    module = import_module(MODULES[name])
    example = f"Example: inspector {EXAMPLES[name]}"
    if name == "simulate":
        group = typer.main.get_command(module.app)
        group.name, group.epilog = name, example
        return group
    found = getattr(module, name, None) or getattr(module, f"{name}_")  # import_, help_
    return _converted(found, name, cls=_Command, epilog=example)


class _Commands(Mapping[str, Any]):
    """The commands by name, each imported when it is asked for."""

    def __getitem__(self, name: str) -> Any:
        if name in RENAMED:
            raise OptionError(f"`inspector {name}` is now `inspector {RENAMED[name]}`")
        return _command(name)

    def __iter__(self) -> Iterator[str]:
        return iter(MODULES)

    def __len__(self) -> int:
        return len(MODULES)


class _Group(_Taking, TyperGroup):
    """`inspector` itself: its help imports no command."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands = _Commands()  # type: ignore[assignment]

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Print a line for each command, by panels."""
        lines = ["Usage: inspector [OPTIONS] COMMAND [ARGS]...", "", ABOUT]
        for panel, own in PANELS.items():
            lines += ["", panel, *(f"  {name:11} {summary}" for name, summary in own.items())]
        formatter.write("\n".join([*lines, "", END, ""]))

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Find a command, and the settings of the project for it."""
        name, command, rest = super().resolve_command(ctx, args)
        takes_none = name in ("help", "robots") or {"-h", "--help"} & set(rest)
        if name and not takes_none and (found := find_settings()) is not None:
            ctx.default_map = {name: settings_of(name, *found)}
        return name, command, rest

    def invoke(self, ctx: Any) -> Any:
        """Run a command; its end has an exit status of its own."""
        try:
            return super().invoke(ctx)
        except typer.BadParameter as error:
            error.message = error.message.removeprefix("Value error, ")  # of pydantic
            raise
        except EOFError as error:  # typer would end with 1, the status of a finding
            raise RuntimeError("a file ends too early") from error
        except KeyboardInterrupt:
            typer.echo("inspector: interrupted", err=True)
            raise typer.Exit(INTERRUPTED) from None


app = typer.Typer(
    cls=_Group,
    invoke_without_command=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.callback()
def _inspector(
    ctx: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    """Detect impacts, jumps and oscillations in robot joint data."""
    if version:
        typer.echo(f"inspector {program_version()}")
        raise typer.Exit
    if ctx.invoked_subcommand is None:
        typer.echo(START)


def help_(
    ctx: typer.Context,
    topic: Annotated[
        str, typer.Argument(help="A command, or logs: how logs are read.", show_default=False)
    ] = "",
) -> None:
    """Print the help of a command or a topic: logs."""
    parent: Any = ctx.parent
    if topic == "logs":
        typer.echo("Options on reading logs, taken by all commands that open logs:\n")
        for option in _command("import").added:
            typer.echo(f"  {option.opts[0]:15} {option.help}")
    elif not topic:
        typer.echo(parent.get_help())
    elif (command := parent.command.commands.get(topic)) is None:
        raise typer.BadParameter(f"{topic!r} is no command and no topic", param_hint="TOPIC")
    else:
        with command.make_context(topic, [], parent=parent, resilient_parsing=True) as inner:
            typer.echo(inner.get_help())


# --- settings of a project

FILE = "inspector.toml"
SHARED = frozenset(("model", "jobs"))  # settings of all commands, besides those on reading logs
# Settings that are paths, which are meant from the folder of the file.
PATHS = {"mapping", "desired", "model", "reference", "candidate", "runs", "package-root"}


def find_settings() -> tuple[Path, dict[str, Any]] | None:
    """The nearest file of settings with its content, up to the top of the repository.

    Keys are the long names of options, without dashes before them. Options on reading logs, `model`
    and `jobs` stand at the top and hold for all commands that have them; a table such as
    ``[classify]`` is for one command, with its arguments (``runs``). The command line wins.
    Nothing that is written can be set here: a file must not replace others.
    """
    start = Path.cwd().absolute()
    for folder in (start, *start.parents):
        path = folder / FILE
        if path.is_file():
            break
        if (folder / ".git").exists():
            return None
    else:
        return None
    from noiseclassifier.jsontext import from_toml, text_of

    try:
        return path, from_toml(text_of(path))
    except ValueError as error:
        raise OptionError(f"{path}: cannot be read ({error})") from error


def settings_of(name: str, path: Path, content: Mapping[str, Any]) -> dict[str, Any]:
    """The settings of a command, by the names of its parameters; refuses unknown ones."""
    params = {each.opts[0].lstrip("-"): each.name for each in _command(name).params}
    own = {key: parameter for key, parameter in params.items() if parameter not in UNSET}
    shared = SHARED | {each.opts[0].lstrip("-") for each in _command("import").added}
    tables = {key: value for key, value in content.items() if isinstance(value, dict)}
    top = {key: value for key, value in content.items() if key not in tables}
    if unknown := next((key for key in tables if key not in MODULES), None):
        raise OptionError(f"{path}: no command {unknown!r}")
    table = tables.get(name, {})
    for where, given, known in (("", top, shared), (f" [{name}]", table, own)):
        if unknown := next((key for key in given if key not in known), None):
            from noisemodel.types import hint

            told = f"no setting {unknown!r}{hint(unknown, sorted(known))}"
            raise OptionError(f"{path}:{where} {told}")
    # In commands that open no log, options of these names mean something else.
    applied = shared if name in READ_LOGS or name == "live" else SHARED
    values = {key: value for key, value in top.items() if key in applied} | table
    return {own[key]: _meant(path, key, value) for key, value in values.items() if key in own}


def _meant(path: Path, key: str, value: Any) -> Any:
    """A value of a file of settings: a path from its folder."""
    if isinstance(value, list):
        return [_meant(path, key, each) for each in value]
    of_robot = key == "robot" and str(value).endswith((".urdf", ".xml"))
    if not isinstance(value, str) or not (key in PATHS or of_robot):
        return value
    there = path.parent / value
    return str(there) if there.exists() or key != "model" else value


# --- how the program runs and ends


def main() -> None:
    """Run the command line: expected errors end as one line with 2, 3 or 5, bugs with 70."""
    # Matrices are small here: more threads mostly wait, and waiting takes processor time.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ["MPLBACKEND"] = "agg"  # pictures are files: whatever is set may not be installed
    # Of a file or a viewer that takes nothing, rerun tells in several lines; we do in one.
    quiet = ("re_log_encoding", "re_sdk", "re_grpc_client", "re_quota_channel")
    os.environ.setdefault("RUST_LOG", ",".join(["warn", *(f"{each}=off" for each in quiet)]))
    output = _standard_output()
    for stream in (sys.stdout, sys.stderr):  # names of files need not be text in their encoding
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    odd = next((each for each in sys.argv[1:] if printable(each) != each), None)
    if odd is not None:
        typer.echo(f"inspector: {printable(odd)}: has control characters", err=True)
        sys.exit(2)
    status = 0
    try:
        app()
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else 0
    except Exception as error:
        if output is None or error is not output.lost:
            status = _failed(error)
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

    Libraries end a program whose reader is gone with 1, the exit status of a finding.
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
    else:
        watched = _StandardOutput(plain.fileno(), "w", closefd=False)
    encoding = "utf-8" if plain is None else plain.encoding
    sys.stdout = io.TextIOWrapper(io.BufferedWriter(watched), encoding=encoding)
    return watched


def _failed(error: Exception) -> int:
    """Print an expected error as one line, or the traceback of a bug; the exit status."""
    told, status = str(error), EXIT[Status.INTERNAL_ERROR]  # Python's own would be of a finding
    if isinstance(error, OptionError):  # needs none of the imports below
        status = 2
    elif isinstance(error, OSError) and error.filename and error.errno in UNUSABLE:
        told = f"{Path(os.fsdecode(error.filename))}: {error.strerror}"
        status = OUTPUT_LOST if error.errno in (errno.ENOSPC, errno.EROFS) else 3
    elif isinstance(error, ValueError):
        import noiseclassifier as nc
        import noisemodel
        from inspector.recording.viewer import DisplayError
        from inspector.verdict import EXPECTED
        from noiseclassifier.scenarios import ScenarioError

        if isinstance(error, (*EXPECTED, ScenarioError)):
            output = isinstance(error, (noisemodel.OutputError, nc.OutputError))
            lost = output and isinstance(error.__cause__, OSError)
            status = OUTPUT_LOST if lost or isinstance(error, DisplayError) else 3
            status = 2 if isinstance(error, noisemodel.UnknownKindError) else status
    if status == EXIT[Status.INTERNAL_ERROR]:
        import traceback

        traceback.print_exception(error)
    else:
        typer.echo(f"inspector: {printable(told)}", err=True)
    return status
