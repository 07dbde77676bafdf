"""Commands that inspect runs: `view`, `noise`, `listen`, `live` and `robots`."""

import io
import sys
from contextlib import suppress
from csv import DictWriter
from dataclasses import dataclass
from datetime import date
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Literal

import typer

import noisemodel as nm
from inspector.analysis import (
    Analysis,
    analyse_file,
    default_kinds,
    estimate,
    noise_level,
    write_csv,
)
from inspector.audit import text
from inspector.commands import shared
from inspector.commands.shared import argument, names_in, opened, option
from inspector.errors import EXIT, InspectorError, Status
from inspector.export import sound as sonification
from inspector.library import Library, demo_run, load_library
from inspector.logs.read import Opened, Reading
from inspector.reference.judging import Comparison
from inspector.reference.store import Reference
from inspector.reference.verdicts import References, seen
from inspector.report import sentence
from inspector.report.formats import case_of
from inspector.report.picture import require
from inspector.text import cell, progress
from inspector.verdict import EXPECTED, Verdict
from noisemodel.compare import COMPARED
from noisemodel.files import refuse_existing, write_whole

# --- view

SUFFIXES = ("", ".rrd", ".png", ".html")  # of what is written; without a suffix a recording
OF_ONE = (".png", ".html")  # what is of one run


@dataclass(frozen=True)
class Request:
    """What is shown of runs, and how."""

    reading: Reading
    library: Library
    kind: str  # of the noise of the links
    at: float | None  # time of a picture, in [s]; None where that is the worst finding's
    align: str | None
    reference: Path | None
    overwrite: bool


def view(
    ctx: typer.Context,
    runs: Annotated[list[Path] | None, argument("Run files or logs; else the demo.")] = None,
    output: Annotated[
        Path | None, option("Write a recording .rrd, a picture .png or a .html.", "--output", "-o")
    ] = None,
    model: shared.ModelFiles = None,
    kind: shared.Kind = "normal",
    at: Annotated[float | None, option("Time of a picture, in s; else the worst finding.")] = None,
    web: Annotated[
        bool, option("Serve it to a browser on this machine until Ctrl-C.", "--web")
    ] = False,
    port: Annotated[int, option("Port of --web; 0 takes a free one.", min=0, max=65535)] = 0,
    align: Annotated[
        Literal["auto", "start", "none"] | None,
        option("Align two runs by motion (auto), or several by start."),
    ] = None,
    reference: Annotated[
        Path | None, option("Show where one run is louder than these good ones.", "--reference")
    ] = None,
    overwrite: shared.Overwrite = False,
) -> None:
    """Show a run, or several side by side.

    Two runs are before and after a change. A picture needs a Vulkan driver (Debian:
    mesa-vulkan-drivers libvulkan1), a page matplotlib.

    Runs that cannot be read are named, and the others shown (exit status 3).
    """
    from inspector.recording import viewer

    paths = runs or [demo_run()]
    shared.one_at_a_time(ctx.obj, len(paths))
    if web and output:
        raise typer.BadParameter("name one of --web and -o")
    together = f"{paths[0].stem}-and-{len(paths) - 1}" if len(paths) > 1 else paths[0].stem
    target = output or viewer.scratch_path(paths[0].with_name(f"{together}.npz"))
    library, overwrite = load_library(model), overwrite or output is None
    request = Request(ctx.obj, library, kind, at, align, reference, overwrite)
    _check(paths, target, request)
    suffix = target.suffix.lower()
    found = _read(paths, ctx.obj, said=suffix in OF_ONE)
    if suffix == ".png":
        _picture(paths[0], found[0], target, request)
    elif suffix == ".html":
        _page(found[0], target, request)
    else:
        write = _one if len(found) == 1 else _two if len(paths) == 2 else _several
        write(found, target, request)
        _show(target, web=web, port=port, saved=output is not None)
    if len(found) < len(paths):
        raise typer.Exit(EXIT[Status.BAD_INPUT])


def _check(paths: list[Path], target: Path, asked: Request) -> None:
    """Refuse options that do not go together, and what cannot be written."""
    from inspector.recording import viewer

    suffix, several = target.suffix.lower(), len(paths) > 1
    if suffix not in SUFFIXES:
        raise typer.BadParameter(f"{target}: name a .rrd, .png or .html file", param_hint="'-o'")
    of_one = "--reference" if asked.reference else suffix if suffix in OF_ONE else ""
    if of_one and several:
        raise typer.BadParameter(f"{of_one} takes one run")
    if asked.align and (not several or (asked.align == "auto" and len(paths) > 2)):
        raise typer.BadParameter("--align takes two runs or more, --align auto two")
    if suffix != ".png" and asked.at is not None:
        raise typer.BadParameter("--at takes -o FILE.png")
    refuse_existing(target, overwrite=asked.overwrite)
    if suffix == ".png":
        viewer.require_driver()
    if suffix == ".html":
        require("a report")


def _read(paths: list[Path], reading: Reading, *, said: bool) -> list[Opened]:
    """Open the runs that can be read, and name the others; remarks are ``said``, or come later."""
    found = []
    for path in paths:
        try:
            found.append(opened(path, reading, said=said))
        except EXPECTED as error:
            if len(paths) == 1:
                raise
            typer.echo(f"inspector: {error}", err=True)
    if not found:
        raise InspectorError(f"none of {len(paths)} runs can be read")
    return found


def _analysed(run: Opened, request: Request) -> tuple[Analysis, Verdict | None, Comparison | None]:
    """A run with what was found in it, beside its reference if there is one."""
    path = run.source.shown
    found = analyse_file(run, request.library, kind=request.kind)
    if request.reference is None:
        return found, None, None
    references = References.found([path], request.reference, request.reading)
    verdict, beside = references(found, Verdict.of(path, found))
    verdict = references.judge(verdict, None, date.today())
    return seen(found, verdict), verdict, beside


def _picture(path: Path, run: Opened, output: Path, request: Request) -> None:
    """Write a PNG of what the viewer shows, without a display."""
    from inspector.recording import viewer
    from inspector.recording.run import write

    at = request.at
    first, last = (float(run.run.time[place]) for place in (0, -1))
    if at is not None and not first <= at <= last:
        raise typer.BadParameter(f"--at {at:g}: the samples are from {first:g} s to {last:g} s")
    found, _, beside = _analysed(run, request)
    seconds = sonification.worst_time(found) if at is None else at
    with TemporaryDirectory() as folder:
        recording = Path(folder) / "run.rrd"
        write(found, recording, beside=beside)
        viewer.shoot(recording, output, seconds, overwrite=request.overwrite)
    typer.echo(f"{output}: {path} at {seconds:.2f} s")


def _page(run: Opened, output: Path, request: Request) -> None:
    """Write one HTML page about a run: findings, picture, sound."""
    from inspector.report import html

    found, verdict, beside = _analysed(run, request)
    audit = text(found.name, found.audit)
    page = html.page(found, audit=audit, verdict=verdict, beside=beside)
    write_whole(output, page, overwrite=request.overwrite)
    typer.echo(f"{output}: {found.headline} ({output.stat().st_size / 1e6:.1f} MB)")


def _one(runs: list[Opened], target: Path, request: Request) -> None:
    """Write the recording of a run."""
    from inspector.recording.run import write

    (run,) = runs
    found, verdict, beside = _analysed(run, request)
    write(found, target, overwrite=request.overwrite, beside=beside)
    typer.echo(f"{run.source.shown}: {found.headline}")
    if verdict is None:
        lines = [sentence(found, event) for event in found.findings]
    else:
        case = case_of([verdict])
        lines = [*case.sentences, *case.notes]
        lines += [f"beside {verdict.beside.path}: {verdict.beside.words}"] if verdict.beside else []
    for line in (*lines, *found.remarks):
        typer.echo(f"  {line}")


def _two(runs: list[Opened], target: Path, request: Request) -> None:
    """Write the recording of a run before and after a change."""
    from inspector.compare import Align, changes, compare, summary, write

    before, after = runs
    pair = compare(before, after, request.library, how=Align(request.align or "auto"))
    write(pair, target, overwrite=request.overwrite)
    typer.echo(f"{before.source.shown} → {after.source.shown}: {summary(pair)}")
    typer.echo(f"  aligned {pair.alignment}")
    for each in (*changes(pair), *pair.remarks):
        typer.echo(f"  {each}")


def _several(runs: list[Opened], target: Path, request: Request) -> None:
    """Write the recording of several runs, side by side."""
    from inspector.compare.many import lay, write

    several = lay(runs, request.library, from_start=request.align != "none")
    write(several, target, overwrite=request.overwrite)
    for index, (name, side) in enumerate(zip(several.names, several.sides, strict=True)):
        mark = " (worst)" if index == several.worst else ""
        typer.echo(f"{name}: {side.headline}{mark}")


def _show(target: Path, *, web: bool, port: int, saved: bool) -> None:
    """Open a recording, or say how it is opened."""
    from inspector.recording import viewer

    if web:
        viewer.serve(target, lambda url: typer.echo(f"open {url}"), port=port)
        return
    opens = not saved and viewer.has_display()
    problem = viewer.open_window(target) if opens else ""
    if opens and not problem:
        return
    typer.echo(f"recording: {target} ({target.stat().st_size / 1e6:.1f} MB)")
    typer.echo(viewer.how_to_open(target))
    if problem:
        raise viewer.DisplayError(f"{problem}; --web shows it in a browser, -o FILE.rrd writes it")


# --- noise


def noise(
    ctx: typer.Context,
    runs: Annotated[
        list[Path] | None, argument("A run file or log; with --compare several.")
    ] = None,
    kind: Annotated[
        list[str] | None, option("simplified, paper, A, B, C, mean, rms, normal; repeatable.")
    ] = None,
    csv: Annotated[Path | None, option("Write the noise over time, or all numbers.")] = None,
    compare: Annotated[
        bool, option("Compare noise models on run files with positions.", "--compare")
    ] = False,
    robots: Annotated[str, option("Compare them on robots that move: talos,go2 or all.")] = "",
    jobs: shared.NumberOfJobs = 1,
    overwrite: shared.Overwrite = False,
) -> None:
    """Print noise levels by joint and link.

    With --compare or --robots, noise models are compared; the exit status is 3 if nothing could be.
    """
    kinds = [name for each in kind or () for name in each.split(",")]
    if not compare and not robots:
        if not runs or len(runs) > 1:
            raise typer.BadParameter("name one run; --compare takes several")
        recorded = opened(runs[0], ctx.obj).run
        shared.say_warnings(recorded)
        estimates = tuple(estimate(recorded, each) for each in kinds or default_kinds(recorded))
        if csv:
            write_csv(recorded, estimates, csv, overwrite=overwrite)
        typer.echo(f"{runs[0]}: {recorded.duration:.2f} s at {recorded.rate:g} Hz")
        for each in estimates:
            typer.echo(noise_level(recorded, each))
        return
    names = list(nm.ROBOTS) if robots == "all" else names_in(robots)
    sources = list(dict.fromkeys([*(runs or ()), *names]))
    if not sources:
        raise typer.BadParameter("name run files, or robots with --robots")
    if len(set(kinds)) == 1:
        raise typer.BadParameter(f"--kind names {kinds[0]} alone; name two kinds to compare")
    if csv:  # before long work is done for it
        refuse_existing(csv, overwrite=overwrite)
    found = nm.compare(
        sources, kinds=kinds or COMPARED, jobs=jobs, progress=partial(progress, what="compare")
    )
    for left_out in found.left_out:
        typer.echo(f"inspector: {left_out.name}: {left_out.reason}", err=True)
    if not found:
        raise typer.Exit(3)
    if csv:
        write_numbers(found, csv, overwrite=overwrite)
    typer.echo(found)


def write_numbers(found: nm.Comparisons, path: Path, *, overwrite: bool = False) -> None:
    """Write a row for each robot and kind as CSV, with the columns of ``Comparisons.to_arrow``."""
    rows = found.to_arrow()

    def shown(name: str, value: str | bool | int | float) -> str | int:
        if isinstance(value, float):
            return f"{value:g}" if name == "rate_hz" else f"{value:.4f}"
        return cell(value) if isinstance(value, str) else int(value)

    told = io.StringIO(newline="")
    writer = DictWriter(told, rows.column_names, lineterminator="\n")
    writer.writeheader()
    for row in rows.to_pylist():
        writer.writerow({name: shown(name, value) for name, value in row.items()})
    write_whole(path, told.getvalue(), overwrite=overwrite)


# --- listen


def listen(
    ctx: typer.Context,
    runs: Annotated[list[Path], argument("Run files or logs; several are written at one gain.")],
    output: Annotated[
        Path, option("WAV file; several get .a, .b ... in its name.", "--output", "-o")
    ],
    joint: Annotated[str, option("The noise of this joint only.")] = "",
    speed: Annotated[float, option("Playback speed; the pitch changes by the same factor.")] = 1.0,
    overwrite: shared.Overwrite = False,
) -> None:
    """Write the noise of runs as sound, one WAV file per run."""
    shared.one_at_a_time(ctx.obj, len(runs))
    shared.check_suffix(output, ".wav")
    paths = sonification.output_paths(output, len(runs), overwrite=overwrite)
    recorded = [opened(run, ctx.obj).run for run in runs]
    for each in recorded:
        shared.say_warnings(each)
    sounds = [sonification.sonify(each, joint=joint, speed=speed) for each in recorded]
    level = sonification.common_gain(sounds)
    for path, sound in zip(paths, sounds, strict=True):
        write_whole(path, sound.file(level), overwrite=overwrite)
    for run, each, path, sound in zip(runs, recorded, paths, sounds, strict=True):
        typer.echo(f"{run}: {sound}")
        for remark in sonification.remarks(each, speed):
            typer.echo(f"  {remark}")
        typer.echo(f"{path}: {sound.description(level)}")


# --- live

LiveRobot = Annotated[
    str | None,
    option("The robot to draw: a name that `robots` lists, a URDF or an MJCF (robot.xml)."),
]
Connect = Annotated[
    str | None, option("Send to the viewer at PORT or HOST:PORT; by default one is opened.")
]
LiveReference = Annotated[
    Path | None,
    option(
        "Compare the stream with these accepted runs, or a folder of good ones: every 3 s the"
        " last 6 s, and all of it at the end. A finding is reported at most 4.3 s late."
    ),
]


def live(
    rate: Annotated[float, option("Sampling rate in [Hz].", min=1.0, show_default=False)],
    robot: LiveRobot = None,
    package_root: shared.PackageRoot = None,
    limit: shared.Limits = None,
    names: Annotated[str, option("Joints in the order of the columns: elbow,wrist,...")] = "",
    save: Annotated[
        Path | None, option("Write the recording to this file, open no viewer.")
    ] = None,
    connect: Connect = None,
    format: Annotated[  # noqa: A002
        Literal["text", "json"], option("Of findings: lines of text, or JSON lines.")
    ] = "text",
    fail_fast: Annotated[
        bool, option("End at the first finding that counts.", "--fail-fast")
    ] = False,
    reference: LiveReference = None,
    model: shared.ModelFiles = None,
    overwrite: shared.Overwrite = False,
) -> None:
    """Show samples from standard input as they arrive.

    Findings are printed as they come. Ctrl-C ends the recording.

    CSV has a header: time,elbow.velocity,elbow.velocity_desired,elbow.position

    JSON lines have one object each: {"time": 0.1, "velocity": [0.2]}

    Exit status: 0 ok, 1 findings, 2 wrong usage, 3 bad input, 4 cannot tell, 5 output lost, 70 bug.
    """
    from inspector.live import LiveError, LiveSession
    from inspector.live.pipe import Gate, follow

    del package_root, limit  # have been set
    if sys.stdin.isatty():
        how = "pipe them in: robot | inspector live"
        raise LiveError(f"samples are read from standard input; {how}")
    known = None if reference is None else Reference.load(reference)
    gate = Gate(_tell, as_json=format == "json", reference=known)
    session = partial(
        LiveSession,
        rate,
        robot=robot,
        library=load_library(model),
        save=save,
        connect=connect,
        overwrite=overwrite,
        on_warning=partial(typer.echo, err=True),
        on_finding=gate.take,
        on_levels=None if known is None else gate.compare,
        on_end=gate.judge,
    )
    summary = follow(
        sys.stdin.buffer,
        tuple(names_in(names)),
        lambda found: session(joint_names=found),
        enough=lambda: fail_fast and gate.failed,
    )
    raise typer.Exit(gate.end(summary))


def _tell(line: str) -> None:
    with suppress(OSError):  # the recording goes on; the command line says what is lost
        typer.echo(line)


# --- robots


def robots() -> None:
    """List the robots that are available by name.

    Others are given by the path of a URDF or of an MJCF (robot.xml). Robots of MuJoCo Menagerie are
    listed if mujoco-menagerie is installed, which downloads each at its first use.
    """
    from noisemodel.robot import menagerie_names

    for name, robot in nm.ROBOTS.items():
        base = "floating" if robot.floating_base else "fixed"
        typer.echo(f"{name:28} {base:10} {robot.urdf}")
    for name, category in menagerie_names().items():
        typer.echo(f"{name:40} {category}")
