"""What commands share: options, those on reading logs, checks of values, and outputs."""

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Annotated, Any, Literal, NoReturn, TypeVar, get_args

import typer

from inspector.errors import OUTPUT_LOST, Unknown, worst
from inspector.logs.mapping import check_joints, read_options
from inspector.logs.motion import limit_warnings
from inspector.logs.read import Opened, Reading, open_run
from noisemodel import OutputError, Run
from noisemodel.files import LIMITS, refuse_existing, write_whole
from noisemodel.parallel import Jobs

Result = TypeVar("Result")

# Those of `noisemodel.KINDS`; a test compares them.
Kinds = Literal["normal", "rms", "mean", "paper", "A", "B", "C"]

ASSUMED = 100  # most characters of what was assumed of a log, unless all is asked for


def option(text: str, *names: str, **settings: Any) -> Any:
    """An option by its help, with its names where they are not the parameter's."""
    return typer.Option(*names, help=text, **settings)


def argument(text: str) -> Any:
    """An argument by its help."""
    return typer.Argument(help=text, show_default=False)


def names_in(text: str) -> list[str]:
    """Names between commas."""
    return [name.strip() for name in text.split(",") if name.strip()]


# --- checks of values


def finite(value: float | None) -> float | None:
    """Refuse what no number can be compared with."""
    if value is not None and not isfinite(value):
        raise typer.BadParameter(f"{value} is no finite number")
    return value


# These go to the environment, which the workers of this process have as well.


def _allow(folder: Path | None) -> Path | None:
    if folder is not None:
        os.environ["NOISE_PACKAGE_ROOT"] = str(folder)
    return folder


def _raise_limit(gigabytes: float | None) -> None:
    if (known := finite(gigabytes)) is not None:
        os.environ["NOISE_MAX_UNPACKED"] = str(int(known * 1e9))


def _raise_limits(limits: list[str] | None) -> None:
    for each in limits or ():
        name, _, number = each.partition("=")
        if name not in LIMITS or not number.isdecimal():
            raise typer.BadParameter(f"{each!r} is none of {', '.join(f'{n}=N' for n in LIMITS)}")
        os.environ[f"NOISE_LIMIT_{name.upper()}"] = number


# --- what several commands take

Runs = Annotated[list[Path], argument("Run files, logs, folders of them.")]
Inputs = Annotated[
    list[Path], argument("Annotated runs, samples, folders of them, or NoisyTest folders.")
]
Overwrite = Annotated[bool, option("Replace a file that exists.", "--overwrite")]
NumberOfJobs = Annotated[int, option("Parallel processes.", "--jobs", "-j", min=1)]
Dask = Annotated[
    str,
    option(
        "Work on this Dask scheduler, tcp://HOST:PORT, instead of --jobs.",
        metavar="ADDRESS",
        show_default=False,
    ),
]
ModelFiles = Annotated[
    list[Path] | None, option("A model file, or the name of a shipped one; repeatable.")
]
Kind = Annotated[Kinds, option(f"Extended noise, one of {', '.join(get_args(Kinds))}.")]
InPart = Annotated[
    Literal["all", "training", "test"],
    option("Which runs: all, training or test, those held out as the test set."),
]
TextOrJson = Annotated[Literal["text", "json"], option("Output format.")]
AsJson = Annotated[bool, option("Print JSON.", "--json")]
UnknownFrames = Annotated[Unknown, option("What to do with frames out of distribution.")]
OnBadInput = Annotated[Literal["fail", "ignore"], option("What to do with unreadable files.")]
Write = Annotated[
    list[str] | None, option("FORMAT=FILE: write another format as well; repeatable.")
]


# --- how logs are read

Limits = Annotated[
    list[str] | None,
    option(
        f"Raise a size limit: {', '.join(LIMITS)}; repeatable.",
        callback=_raise_limits,
        metavar="NAME=N",
    ),
]
PackageRoot = Annotated[
    Path | None, option("A further folder of packages, for robots' meshes.", callback=_allow)
]


def log_options(
    robot: Annotated[
        str | None, option('Robot name (see `inspector robots`), URDF or MJCF, or "none".')
    ] = None,
    package_root: PackageRoot = None,
    max_unpacked: Annotated[
        float | None,
        option("Refuse compressed files that expand beyond this many GB.", callback=_raise_limit),
    ] = None,
    limit: Limits = None,
    rate: Annotated[
        float | None, option("Rate of the log in [Hz], if it is known.", min=1.0)
    ] = None,
    force: Annotated[
        bool, option("Take --rate even if positions and velocities contradict it.", "--force")
    ] = False,
    map_: Annotated[
        list[str] | None,
        option("velocity.JOINT=COLUMN or position=ARRAY[7:]; repeatable.", "--map"),
    ] = None,
    mapping: Annotated[Path | None, option("A saved mapping (TOML).")] = None,
    joints: Annotated[str | None, option("Names of the columns of arrays: a,b,c.")] = None,
    columns: Annotated[
        str | None, option("Names of a CSV's columns, without a header: time,q1,q2.")
    ] = None,
    units: Annotated[str | None, option("Unit of angles: radians or degrees.")] = None,
    topic: Annotated[list[str] | None, option("Read this topic of a bag; repeatable.")] = None,
    episode: Annotated[
        list[str] | None, option("Read this episode of a data set; repeatable.")
    ] = None,
    desired: Annotated[
        Path | None, option("Another log, with the desired motion on its own clock.")
    ] = None,
    offset: Annotated[
        float | None, option("Add to the timestamps of --desired, in seconds; else estimated.")
    ] = None,
) -> Reading:
    """Options on reading logs: in the help of `import` only; others take them, too (`cli`)."""
    del package_root, max_unpacked, limit  # have been set
    options = read_options(
        map_ or (),
        saved=mapping,
        robot=None if robot == "none" else robot,
        rate=rate,
        units=units,
        joints=joints.split(",") if joints else None,
        columns=columns.split(",") if columns else None,
        topics=topic,
        offset=offset,
        force=force or None,
    )
    return Reading(options, desired, tuple(episode or ()), without_robot=robot == "none")


def opened(path: Path, reading: Reading, *, said: bool = True) -> Opened:
    """Open a run or a log for a command, and say on standard error what was assumed."""
    found = open_run(path, reading)
    if said:
        say_assumed({str(path): found.assumed})
    return found


def one_at_a_time(reading: Reading, runs: int) -> None:
    """Refuse a log with the desired motion, which belongs to one run, for several."""
    if reading.desired and runs > 1:
        raise typer.BadParameter(f"belongs to one log, {runs} are given", param_hint="'--desired'")


def say_warnings(run: Run) -> None:
    """Print what hints at another robot than the run names on standard error."""
    check_joints(run.joint_names, run.robot)
    for warning in limit_warnings(run):
        typer.echo(f"  {warning}", err=True)


def say_assumed(lines: dict[str, str], *, verbose: bool = True) -> None:
    """Print what was assumed of logs on standard error, once for those with one line."""
    for line in dict.fromkeys(filter(None, lines.values())):
        first, *others = [name for name, own in lines.items() if own == line]
        told = line
        if len(line) > ASSUMED and not verbose:
            begin = line[: ASSUMED - 10]
            told = f"{begin.rpartition('; ')[0] or begin}; ... (-v)"
        more = f" and {len(others)} more" if others else ""
        typer.echo(f"{first}{more}: {told}", err=True)


# --- where commands work, and what they write


def jobs_or_dask(jobs: int, dask: str) -> Jobs:
    """Where to work: the number of processes, or the address of a Dask scheduler."""
    if dask and jobs > 1:
        raise typer.BadParameter("--jobs and --dask exclude each other")
    return dask or jobs


def check_suffix(output: Path, suffix: str) -> None:
    """Refuse an output whose name says that it is of another format."""
    if output.suffix.lower() not in ("", suffix):
        problem = f"{output}: {suffix} is written, whatever its name"
        raise typer.BadParameter(f"{problem}; end it in {suffix}", param_hint="'--output'")


def prepare(folder: Path, *files: str, overwrite: bool) -> None:
    """Make the folder of a report before long work is done for it; it has none of the files."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be made a folder ({error.strerror})") from error
    for name in files:
        refuse_existing(folder / name, overwrite=overwrite)


def outputs_of(
    given: Sequence[str] | None, formats: Mapping[str, Callable[[Result], str]], *, overwrite: bool
) -> dict[Path, Callable[[Result], object]]:
    """What writes each file of `--write FORMAT=FILE`; none of them exists or is read."""
    outputs: dict[Path, Callable[[Result], object]] = {}
    for each in given or ():
        name, _, path = each.partition("=")
        if name not in formats or path in ("", "-") or Path(path) in outputs:
            told = f"expected FORMAT=FILE, with one of {', '.join(formats)}, each file once"
            raise typer.BadParameter(f"{each!r}: {told}", param_hint="'--write'")
        refuse_existing(path, overwrite=overwrite)

        def write(result: Result, path: str = path, name: str = name) -> None:
            write_whole(path, f"{formats[name](result)}\n", overwrite=overwrite)

        outputs[Path(path)] = write
    return outputs


def written(
    result: Result,
    printed: Callable[[Result], str],
    outputs: Mapping[Path, Callable[[Result], object]],
) -> list[str]:
    """Print a result, and write it to outputs; what is lost, a line each."""

    def show(result: Result) -> None:
        typer.echo(printed(result))
        sys.stdout.flush()

    lost = []
    for name, write in [("standard output", show), *outputs.items()]:
        try:
            write(result)
        except OutputError as error:
            lost.append(str(error))
        except OSError as error:
            lost.append(f"{name}: cannot be written ({error.strerror or error})")
    return lost


def end(status: int, lost: Sequence[str]) -> NoReturn:
    """End with the exit status of a result, or of outputs that were lost, each of them named."""
    for line in lost:
        typer.echo(f"inspector: output lost: {line}", err=True)
    raise typer.Exit(worst([status, OUTPUT_LOST]) if lost else status)
