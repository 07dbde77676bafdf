"""Options that several commands share: each an alias, and those on reading logs in one function."""

import os
from collections.abc import Callable, Collection
from enum import StrEnum
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from inspector.errors import Unknown

if TYPE_CHECKING:
    from inspector.logs.read import Opened, Reading
    from noisemodel import Run
    from noisemodel.parallel import Jobs

KINDS = ("normal", "rms", "mean", "paper", "A", "B", "C")
"""Those of ``noisemodel``, which would take too long to import here."""
LIMITS = ("joints", "columns", "triangles", "bodies")
"""Those of ``noisemodel.files``, which would take too long to import here."""


class BadInput(StrEnum):
    """What becomes of files that cannot be read."""

    FAIL = "fail"
    IGNORE = "ignore"


# --- checks of values


def finite(value: float | None) -> float | None:
    """Refuse what no number can be compared with."""
    if value is not None and not isfinite(value):
        raise typer.BadParameter(f"{value} is no finite number")
    return value


def one_of(names: Collection[str]) -> Callable[[str], str]:
    """Refuse what is none of several names."""

    def checked(value: str) -> str:
        if value not in names:
            raise typer.BadParameter(f"{value!r} is none of {', '.join(names)}")
        return value

    return checked


def _allow(folder: Path | None) -> Path | None:
    if folder is not None:
        os.environ["NOISE_PACKAGE_ROOT"] = str(folder)  # for the workers of this process too
    return folder


def _raise_limit(gigabytes: float | None) -> float | None:
    if gigabytes is not None:
        finite(gigabytes)
        os.environ["NOISE_MAX_UNPACKED"] = str(int(gigabytes * 1e9))
    return gigabytes


def _raise_limits(limits: list[str] | None) -> list[str] | None:
    for each in limits or ():
        name, _, number = each.partition("=")
        if name not in LIMITS or not number.isdecimal():
            raise typer.BadParameter(f"{each!r} is none of {', '.join(f'{n}=N' for n in LIMITS)}")
        os.environ[f"NOISE_LIMIT_{name.upper()}"] = number
    return limits


# --- what several commands take


def _of_log(*names: str, **settings: Any) -> Any:
    return typer.Option(*names, rich_help_panel="Reading logs", **settings)


RunFile = Annotated[
    Path, typer.Argument(help="A run file, or any log: CSV, bag, ...", show_default=False)
]
Runs = Annotated[
    list[Path],
    typer.Argument(help="Run files, logs, folders of them.", show_default=False),
]
Inputs = Annotated[
    list[Path],
    typer.Argument(help="Annotated runs, samples, folders of them, or NoisyTest folders."),
]
Output = Annotated[Path, typer.Option("--output", "-o", help="The file to write.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace a file that exists.")]
NumberOfJobs = Annotated[int, typer.Option("--jobs", "-j", min=1, help="Parallel processes.")]
Dask = Annotated[
    str,
    typer.Option(
        "--dask",
        metavar="ADDRESS",
        help="Work on this Dask scheduler, tcp://HOST:PORT, instead of --jobs.",
        show_default=False,
    ),
]
ModelFiles = Annotated[
    list[Path] | None,
    typer.Option("--model", help="A model file, or the name of a shipped one; repeatable."),
]
Kind = Annotated[
    str,
    typer.Option(
        "--kind", callback=one_of(KINDS), help=f"Extended noise, one of {', '.join(KINDS)}."
    ),
]
Floor = Annotated[
    float | None,
    typer.Option("--floor", help="Darkest level of spectrograms, in dB re 1 rad/s.", max=0.0),
]
PARTS = ("all", "training", "test")
"""Those of ``inspector.training.train``, which would take too long to import here."""
InPart = Annotated[
    str,
    typer.Option(
        "--part",
        callback=one_of(PARTS),
        help=f"Which runs, one of {', '.join(PARTS)}; test are those held out as the test set.",
    ),
]
UnknownFrames = Annotated[
    Unknown, typer.Option("--unknown", help="What to do with frames out of distribution.")
]
OnBadInput = Annotated[
    BadInput, typer.Option("--on-bad-input", help="What to do with unreadable files.")
]
Write = Annotated[
    list[str] | None,
    typer.Option("--write", help="FORMAT=FILE: write another format as well; repeatable."),
]
ReportUrl = Annotated[
    str, typer.Option("--report-url", help="Where the report's folder is published.")
]
Limits = Annotated[
    list[str] | None,
    _of_log(
        "--limit",
        callback=_raise_limits,
        metavar="NAME=N",
        help=f"Raise a size limit: {', '.join(LIMITS)}; repeatable.",
    ),
]
MaxUnpacked = Annotated[
    float | None,
    _of_log(
        "--max-unpacked",
        callback=_raise_limit,
        help="Refuse compressed files that expand beyond this many GB.",
    ),
]
PackageRoot = Annotated[
    Path | None,
    _of_log(
        "--package-root", callback=_allow, help="A further folder of packages, for robots' meshes."
    ),
]


Robot = Annotated[
    str | None,
    _of_log("--robot", help='Robot name (see `inspector robots`), URDF or MJCF, or "none".'),
]
Rate = Annotated[
    float | None, _of_log("--rate", min=1.0, help="Rate of the log in [Hz], if it is known.")
]
Force = Annotated[
    bool, _of_log("--force", help="Take --rate even if positions and velocities contradict it.")
]
Map = Annotated[
    list[str] | None,
    _of_log("--map", help="velocity.JOINT=COLUMN or position=ARRAY[7:]; repeatable."),
]
Mapping = Annotated[Path | None, _of_log("--mapping", help="A saved mapping (TOML).")]
Joints = Annotated[str | None, _of_log("--joints", help="Names of the columns of arrays: a,b,c.")]
Columns = Annotated[
    str | None,
    _of_log("--columns", help="Names of a CSV's columns, without a header: time,q1,q2."),
]
Units = Annotated[
    str | None, _of_log("--units", help="Unit of angles: radians, degrees or normalised.")
]
Degrees = Annotated[bool, _of_log("--degrees", help="Angles are in degrees.")]
Topic = Annotated[
    list[str] | None, _of_log("--topic", help="Read this topic of a bag; repeatable.")
]
Episode = Annotated[
    list[str] | None, _of_log("--episode", help="Read this episode of a data set; repeatable.")
]
Desired = Annotated[
    Path | None,
    _of_log("--desired", help="Another log, with the desired motion on its own clock."),
]
Offset = Annotated[
    float | None,
    _of_log("--offset", help="Add to the timestamps of --desired, in seconds; else estimated."),
]


def log_options(
    robot: Robot = None,
    package_root: PackageRoot = None,
    max_unpacked: MaxUnpacked = None,
    limit: Limits = None,
    rate: Rate = None,
    force: Force = False,
    map_: Map = None,
    mapping: Mapping = None,
    joints: Joints = None,
    columns: Columns = None,
    units: Units = None,
    degrees: Degrees = False,
    topic: Topic = None,
    episode: Episode = None,
    desired: Desired = None,
    offset: Offset = None,
) -> Any:
    """Options on reading logs, the same in all commands that read logs.

    They are in the help of `import` only; the others take them as well (`inspector.cli`). Returns
    an ``inspector.logs.read.Reading``.
    """
    from inspector.logs.mapping import read_options
    from inspector.logs.read import Reading

    del package_root, max_unpacked, limit  # have been set
    options = read_options(
        map_ or (),
        saved=mapping,
        robot=None if robot == "none" else robot,
        rate=rate,
        units="degrees" if degrees else units,
        joints=joints.split(",") if joints else None,
        columns=columns.split(",") if columns else None,
        topics=topic,
        offset=offset,
        force=force or None,
    )
    return Reading(options, desired, tuple(episode or ()), without_robot=robot == "none")


# --- what several commands do with them


def jobs_or_dask(jobs: int, dask: str) -> "Jobs":
    """Where to work: the number of processes, or the address of a Dask scheduler."""
    if dask and jobs > 1:
        raise typer.BadParameter("--jobs and --dask exclude each other")
    return dask or jobs


def opened(path: Path, reading: "Reading", *, said: bool = True) -> "Opened":
    """Open a run or a log for a command, and say on standard error what was assumed."""
    from inspector.logs.read import open_run

    found = open_run(path, reading)
    if said:
        say_assumed({str(path): found.assumed})
    return found


def one_at_a_time(reading: "Reading", runs: int) -> None:
    """Refuse a log with the desired motion, which belongs to one run, for several."""
    if reading.desired and runs > 1:
        raise typer.BadParameter(f"belongs to one log, {runs} are given", param_hint="'--desired'")


def say_warnings(run: "Run") -> None:
    """Print what hints at another robot than the run names on standard error."""
    from inspector.logs.plausibility import check_joints, limit_warnings

    check_joints(run.joint_names, run.robot)
    for warning in limit_warnings(run):
        typer.echo(f"  {warning}", err=True)


ASSUMED = 100
"""Most characters of what was assumed of a log, unless all is asked for."""


def say_assumed(lines: dict[str, str], *, verbose: bool = True) -> None:
    """Print what was assumed of logs on standard error, once for those with one line."""
    together: dict[str, list[str]] = {}
    for name, line in lines.items():
        if line:
            together.setdefault(line, []).append(name)
    for line, names in together.items():
        told = line
        if len(line) > ASSUMED and not verbose:
            begin = line[: ASSUMED - 10]
            told = f"{begin.rpartition('; ')[0] or begin}; ... (-v)"
        others = f" and {len(names) - 1} more" if len(names) > 1 else ""
        typer.echo(f"{names[0]}{others}: {told}", err=True)
