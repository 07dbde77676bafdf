"""`inspector view`: a run, or several side by side, in the viewer or as a file."""

import hashlib
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import typer

from inspector.commands.options import (
    Floor,
    Kind,
    ModelFiles,
    Overwrite,
    one_at_a_time,
    opened,
)
from inspector.errors import EXIT, Status

if TYPE_CHECKING:
    from inspector.analysis import Analysis
    from inspector.library import Library
    from inspector.logs.read import Opened, Reading
    from inspector.reference.judging import Comparison
    from inspector.verdict import Verdict

SUFFIXES = ("", ".rrd", ".png", ".html")
"""Of what is written; without a suffix a recording."""
SIZE = "1440x900"


class Aligned(StrEnum):
    """The methods to align a second run with the first."""

    AUTO = "auto"
    START = "start"
    NONE = "none"


Shown = Annotated[
    list[Path] | None,
    typer.Argument(help="Runs, logs, or a recording (.rrd) for a picture; else the demo."),
]
Target = Annotated[
    Path | None,
    typer.Option("--output", "-o", help="Write a recording .rrd, a picture .png or a .html."),
]
Save = Annotated[Path | None, typer.Option("--save", hidden=True)]
NoRobot = Annotated[
    bool, typer.Option("--no-robot", help="Do not draw the robot and the noise of its links.")
]
Terms = Annotated[
    bool, typer.Option("--terms", help="Show the terms A, B and C of the paper separately.")
]
At = Annotated[
    float | None, typer.Option("--at", help="Time of a picture, in s; else the worst finding.")
]
Size = Annotated[str, typer.Option("--size", help="Width and height of a picture.")]
Web = Annotated[
    bool, typer.Option("--web", help="Serve it to a browser on this machine until Ctrl-C.")
]
Port = Annotated[
    int, typer.Option("--port", min=0, max=65535, help="Port of --web; 0 takes a free one.")
]
Align = Annotated[
    Aligned | None,
    typer.Option("--align", help="Align two runs by motion (auto), or several by start."),
]
ReferenceFolder = Annotated[
    Path | None,
    typer.Option("--reference", help="Show where one run is louder than these good ones."),
]


@dataclass(frozen=True)
class Request:
    """What is shown of runs, and how.

    Attributes:
        links: Kind of the noise of the links; empty where no robot is drawn.
        at: Time of a picture, in [s]; None where that is the worst finding's.
    """

    reading: "Reading"
    library: "Library"
    links: str
    floor: float | None
    terms: bool
    at: float | None
    size: str
    align: Aligned | None
    reference: Path | None
    overwrite: bool


def view(
    ctx: typer.Context,
    runs: Shown = None,
    output: Target = None,
    save: Save = None,
    model: ModelFiles = None,
    no_robot: NoRobot = False,
    kind: Kind = "normal",
    floor: Floor = None,
    terms: Terms = False,
    at: At = None,
    size: Size = SIZE,
    web: Web = False,
    port: Port = 0,
    align: Align = None,
    reference: ReferenceFolder = None,
    overwrite: Overwrite = False,
) -> None:
    """Show a run, or several side by side.

    Two runs are before and after a change. A picture needs a Vulkan driver (Debian:
    mesa-vulkan-drivers libvulkan1), a page matplotlib.

    Runs that cannot be read are named, and the others shown (exit status 3).
    """
    from inspector.library import demo_run, load_library
    from inspector.recording import viewer
    from noisemodel.files import refuse_existing

    paths, output = runs or [demo_run()], output or save
    one_at_a_time(ctx.obj, len(paths))
    if web and output:
        raise typer.BadParameter("name one of --web and -o")
    if port:
        viewer.free_port(port)
    target = output or viewer.scratch_path(_together(paths))
    library = load_library(model)
    links, overwrite = "" if no_robot else kind, overwrite or output is None
    request = Request(ctx.obj, library, links, floor, terms, at, size, align, reference, overwrite)
    _check(paths, target, request)
    refuse_existing(target, overwrite=overwrite)
    if target.suffix.lower() in (".png", ".html"):
        write = _picture if target.suffix.lower() == ".png" else _page
        write(paths[0], target, request)
        return
    found = _read(paths, request.reading)
    write_recording = _one if len(found) == 1 else _two if len(paths) == 2 else _several
    seconds = write_recording(found, target, request)
    _show(target, seconds, web=web, port=port, saved=output is not None)
    if len(found) < len(paths):
        raise typer.Exit(EXIT[Status.BAD_INPUT])


def _check(paths: list[Path], target: Path, request: Request) -> None:
    """Refuse options that do not go together, and what cannot be written."""
    suffix, several = target.suffix.lower(), len(paths) > 1
    if suffix not in SUFFIXES:
        raise typer.BadParameter(f"{target}: name a .rrd, .png or .html file", param_hint="'-o'")
    if request.align and not several:
        raise typer.BadParameter("--align takes two runs or more")
    if request.align is Aligned.AUTO and len(paths) > 2:
        raise typer.BadParameter("--align auto takes two runs; more lie side by side from start")
    given = {
        "--reference": request.reference is not None,
        "--terms": request.terms,
        "--floor": request.floor is not None,
    }
    for option in (option for option, is_given in given.items() if is_given and several):
        raise typer.BadParameter(f"{option} takes one run")
    if suffix in (".png", ".html") and several:
        raise typer.BadParameter(f"{suffix} takes one run; several are written as .rrd")
    if (request.at is not None or request.size != SIZE) and suffix != ".png":
        raise typer.BadParameter("--at and --size take -o FILE.png")


def _picture(run: Path, output: Path, request: Request) -> None:
    """Write a PNG of what the viewer shows, without a display."""
    from inspector.export.sound import worst_time
    from inspector.recording import viewer
    from inspector.recording.run import write

    viewer.require_driver()
    points, at = viewer.parse_size(request.size), request.at
    with TemporaryDirectory() as folder:
        recording, seconds = run, at or 0.0
        if run.suffix != ".rrd":
            source = opened(run, request.reading)
            first, last = (float(source.run.time[place]) for place in (0, -1))
            if at is not None and not first <= at <= last:
                raise typer.BadParameter(
                    f"--at {at:g}: the run lasts from {first:.2f} s to {last:.2f} s"
                )
            found, _, beside = _analysed(source, request)
            recording = Path(folder) / "run.rrd"
            seconds = worst_time(found) if at is None else at
            write(found, recording, floor=request.floor, beside=beside)
        complaints = viewer.shoot(
            recording, output, seconds, size=points, overwrite=request.overwrite
        )
    typer.echo(f"{output}: {run} at {seconds:.2f} s")
    for complaint in complaints:
        typer.echo(f"  the viewer reports: {complaint}", err=True)


def _page(run: Path, output: Path, request: Request) -> None:
    """Write one HTML page about a run: pictures, tables, sound."""
    from inspector.audit.audit import text
    from inspector.report import html
    from inspector.report.picture import require

    require("a report")
    found, verdict, beside = _analysed(opened(run, request.reading), request)
    assert found.audit is not None
    html.write(
        found,
        output,
        audit=text(found.name, found.audit),
        verdict=verdict,
        beside=beside,
        overwrite=request.overwrite,
        floor=request.floor,
    )
    typer.echo(f"{output}: {found.headline} ({output.stat().st_size / 1e6:.1f} MB)")


def _show(target: Path, seconds: float | None, *, web: bool, port: int, saved: bool) -> None:
    """Open a recording, or say how it is opened."""
    from inspector.recording import viewer

    if web:
        viewer.serve(target, lambda url: typer.echo(f"open {url}"), port=port)
        return
    problem = ""
    if not saved and viewer.has_display():
        problem = viewer.open_window(target, seconds)
        if not problem:
            return
    typer.echo(f"recording: {target} ({target.stat().st_size / 1e6:.1f} MB)")
    typer.echo(viewer.how_to_open(target))
    if problem:
        raise viewer.DisplayError(f"{problem}; --web shows it in a browser, -o FILE.rrd writes it")


def _together(paths: list[Path]) -> Path:
    """A name of several runs, the same for the same ones."""
    if len(paths) == 1:
        return paths[0]
    others = "\n".join(str(path.resolve()) for path in paths[1:])
    key = hashlib.sha256(others.encode()).hexdigest()[:8]
    return paths[0].with_name(f"{paths[0].stem}-and-{len(paths) - 1}-{key}")


def _read(paths: list[Path], reading: "Reading") -> list["Opened"]:
    """Open the runs that can be read, and name the others; their remarks are printed later."""
    from inspector.errors import InspectorError
    from inspector.verdict import EXPECTED

    if len(paths) == 1:
        return [opened(paths[0], reading, said=False)]
    found = []
    for path in paths:
        try:
            found.append(opened(path, reading, said=False))
        except EXPECTED as error:
            typer.echo(f"inspector: {error}", err=True)
    if not found:
        raise InspectorError(f"none of {len(paths)} runs can be read")
    return found


def _analysed(
    run: "Opened", request: Request
) -> "tuple[Analysis, Verdict | None, Comparison | None]":
    """A run with what was found in it, beside its reference if there is one."""
    from datetime import date

    from inspector.analysis import analyse_file
    from inspector.reference.verdicts import References, seen
    from inspector.verdict import Verdict

    kind, path = request.links, run.source.shown
    found = analyse_file(run, request.library, links=bool(kind), kind=kind, terms=request.terms)
    if request.reference is None:
        return found, None, None
    references = References.found([path], request.reference, request.reading)
    verdict, beside = references(found, Verdict.of(path, found))
    verdict = references.judge(verdict, None, date.today())
    return seen(found, verdict), verdict, beside


def _one(runs: list["Opened"], target: Path, request: Request) -> float:
    """Write the recording of a run; returns the time of its worst moment, in [s]."""
    from inspector.export.sound import of_recording, worst_time
    from inspector.recording.run import write
    from inspector.report import findings

    (run,) = runs
    found, verdict, beside = _analysed(run, request)
    floor, overwrite, sound = request.floor, request.overwrite, of_recording(found)
    write(found, target, overwrite=overwrite, sound=sound, floor=floor, beside=beside)
    typer.echo(f"{run.source.shown}: {found.headline}")
    if verdict is None:
        lines = [findings.sentence(found, event) for event in found.findings]
    else:
        lines = [*findings.failing(verdict), *findings.excused(verdict)]
        lines += [f"beside {verdict.beside.path}: {verdict.beside.words}"] if verdict.beside else []
    for line in (*lines, *found.remarks):
        typer.echo(f"  {line}")
    return worst_time(found)


def _two(runs: list["Opened"], target: Path, request: Request) -> None:
    """Write the recording of a run before and after a change."""
    from inspector.compare.pair import Align, changes, compare, summary
    from inspector.compare.recording import write

    before, after = runs
    how, kind = Align(request.align or Aligned.AUTO), request.links
    pair = compare(before, after, request.library, how=how, robot=bool(kind), kind=kind)
    write(pair, target, overwrite=request.overwrite)
    typer.echo(f"{before.source.shown} → {after.source.shown}: {summary(pair)}")
    typer.echo(f"  aligned {pair.alignment}")
    for each in (*changes(pair), *pair.remarks):
        typer.echo(f"  {each}")


def _several(runs: list["Opened"], target: Path, request: Request) -> None:
    """Write the recording of several runs, side by side."""
    from inspector.compare.many import lay, write

    several = lay(runs, request.library, from_start=request.align is not Aligned.NONE)
    write(several, target, overwrite=request.overwrite)
    for index, (name, side) in enumerate(zip(several.names, several.sides, strict=True)):
        mark = " (worst)" if index == several.worst else ""
        typer.echo(f"{name}: {side.headline}{mark}")
