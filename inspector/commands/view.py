"""`inspector view`: a run, or several side by side, in the viewer or as a file."""

import hashlib
from collections.abc import Callable
from enum import StrEnum
from functools import partial
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
from inspector.status import EXIT, Status

if TYPE_CHECKING:
    from inspector.analysis import Analysis
    from inspector.library import Library
    from inspector.logs.read import Opened, Reading
    from inspector.reference.judging import Comparison

SUFFIXES = ("", ".rrd", ".png", ".html")
"""Of what is written; without a suffix a recording."""
SIZE = "1440x900"


class Aligned(StrEnum):
    """The methods to align a second run with the first."""

    AUTO = "auto"
    START = "start"
    NONE = "none"


def view(
    ctx: typer.Context,
    runs: Annotated[
        list[Path] | None,
        typer.Argument(help="Runs, logs, or a recording (.rrd) for a picture; else the demo."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Write a recording .rrd, a picture .png or a .html."),
    ] = None,
    save: Annotated[Path | None, typer.Option("--save", hidden=True)] = None,
    model: ModelFiles = None,
    no_robot: Annotated[
        bool, typer.Option("--no-robot", help="Do not draw the robot and the noise of its links.")
    ] = False,
    kind: Kind = "normal",
    floor: Floor = None,
    terms: Annotated[
        bool, typer.Option("--terms", help="Show the terms A, B and C of the paper separately.")
    ] = False,
    at: Annotated[
        float | None, typer.Option("--at", help="Time of a picture, in s; else the worst finding.")
    ] = None,
    size: Annotated[str, typer.Option("--size", help="Width and height of a picture.")] = SIZE,
    web: Annotated[
        bool, typer.Option("--web", help="Serve it to a browser on this machine until Ctrl-C.")
    ] = False,
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, help="Port of --web; 0 takes a free one.")
    ] = 0,
    align: Annotated[
        Aligned | None,
        typer.Option("--align", help="Align two runs by motion (auto), or several by start."),
    ] = None,
    reference: Annotated[
        Path | None,
        typer.Option("--reference", help="Show where one run is louder than these good ones."),
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Show a run, or several side by side.

    Two runs are before and after a change. A picture needs a Vulkan driver (Debian:
    mesa-vulkan-drivers libvulkan1), a page matplotlib.

    Runs that cannot be read are named, and the others shown (exit status 3).
    """
    from inspector import assets
    from inspector.library import load_library
    from inspector.recording import viewer
    from noisemodel.files import refuse_existing

    reading: Reading = ctx.obj
    output = output or save
    paths = runs or [assets.demo_run()]
    one_at_a_time(reading, len(paths))
    _check(paths, output, align, terms=terms, floor=floor, web=web, at=at, size=size)
    if port:
        from inspector.recording import viewer as browser

        browser.free_port(port)
    if reference and len(paths) > 1:
        raise typer.BadParameter("--reference takes one run")
    target = output or viewer.scratch_path(_together(paths))
    overwrite = overwrite or output is None
    refuse_existing(target, overwrite=overwrite)
    library = load_library(assets.model_files(model))
    if output and output.suffix.lower() in (".png", ".html"):
        write = _picture if output.suffix.lower() == ".png" else _page
        links = "" if no_robot else kind
        write(
            paths[0],
            output,
            reading,
            library,
            links,
            floor,
            at,
            size,
            reference,
            overwrite=overwrite,
        )
        return
    seconds, unread = None, False
    if len(paths) == 1:
        found = [opened(paths[0], reading, said=False)]  # remarks say it
    else:
        found, unread = _read(paths, reading)
    if len(found) == 1:
        links = "" if no_robot else kind
        beside = partial(_beside, found[0], reference, reading)
        seconds = _one(
            found[0], target, library, links, beside, terms=terms, floor=floor, overwrite=overwrite
        )
    elif len(paths) == 2:
        both, how = (found[0], found[1]), align or Aligned.AUTO
        _two(both, target, library, how, robot=not no_robot, kind=kind, overwrite=overwrite)
    else:
        _several(found, target, library, from_start=align is not Aligned.NONE, overwrite=overwrite)
    _show(target, seconds, web=web, port=port, saved=output is not None)
    if unread:
        raise typer.Exit(EXIT[Status.BAD_INPUT])


def _check(
    paths: list[Path],
    output: Path | None,
    align: Aligned | None,
    *,
    terms: bool,
    floor: float | None,
    web: bool,
    at: float | None,
    size: str,
) -> None:
    """Refuse options that do not go together, and what cannot be written."""
    suffix = "" if output is None else output.suffix.lower()
    if suffix not in SUFFIXES:
        raise typer.BadParameter(f"{output}: name a .rrd, .png or .html file", param_hint="'-o'")
    if web and output:
        raise typer.BadParameter("name one of --web and -o")
    if align and len(paths) < 2:
        raise typer.BadParameter("--align takes two runs or more")
    if align is Aligned.AUTO and len(paths) > 2:
        raise typer.BadParameter("--align auto takes two runs; more lie side by side from start")
    for option, given in (("--terms", terms), ("--floor", floor is not None)):
        if given and len(paths) > 1:
            raise typer.BadParameter(f"{option} takes one run")
    if suffix in (".png", ".html") and len(paths) > 1:
        raise typer.BadParameter(f"{suffix} takes one run; several are written as .rrd")
    if (at is not None or size != SIZE) and suffix != ".png":
        raise typer.BadParameter("--at and --size take -o FILE.png")


def _picture(
    run: Path,
    output: Path,
    reading: "Reading",
    library: "Library",
    kind: str,
    floor: float | None,
    at: float | None,
    size: str,
    reference: Path | None,
    *,
    overwrite: bool,
) -> None:
    """Write a PNG of what the viewer shows, without a display."""
    from inspector.analysis import analyse_file
    from inspector.recording import picture as screenshot
    from inspector.recording.run import write
    from inspector.sound import worst_time

    screenshot.require()
    points = screenshot.parse_size(size)
    with TemporaryDirectory() as folder:
        recording, seconds = run, at or 0.0
        if run.suffix != ".rrd":
            source = opened(run, reading)
            first, last = (float(source.run.time[place]) for place in (0, -1))
            if at is not None and not first <= at <= last:
                raise typer.BadParameter(
                    f"--at {at:g}: the run lasts from {first:.2f} s to {last:.2f} s"
                )
            found = analyse_file(source, library, links=bool(kind), kind=kind)
            recording = Path(folder) / "run.rrd"
            seconds = worst_time(found) if at is None else at
            beside = _beside(source, reference, reading, found)
            write(found, recording, floor=floor, beside=beside)
        complaints = screenshot.shoot(recording, output, seconds, size=points, overwrite=overwrite)
    typer.echo(f"{output}: {run} at {seconds:.2f} s")
    for complaint in complaints:
        typer.echo(f"  the viewer reports: {complaint}", err=True)


def _page(
    run: Path,
    output: Path,
    reading: "Reading",
    library: "Library",
    kind: str,
    floor: float | None,
    _at: float | None,
    _size: str,
    reference: Path | None,
    *,
    overwrite: bool,
) -> None:
    """Write one HTML page about a run: pictures, tables, sound."""
    from datetime import date

    from inspector.analysis import analyse_file, headline
    from inspector.audit import text
    from inspector.reference.verdicts import References
    from inspector.report import html
    from inspector.verdict import Verdict

    html.require()
    found = analyse_file(opened(run, reading), library, links=bool(kind), kind=kind)
    assert found.audit is not None
    seen, verdict, told = text(found.name, found.audit), None, found.headline
    if reference is not None:
        beside = References.found([run], reference, reading)
        verdict = beside.judge(beside(found, Verdict.of(run, found)), None, date.today())
        told = headline(verdict.status, verdict.failing, found.reason)
    html.write(found, output, audit=seen, verdict=verdict, overwrite=overwrite, floor=floor)
    typer.echo(f"{output}: {told} ({output.stat().st_size / 1e6:.1f} MB)")


def _show(target: Path, seconds: float | None, *, web: bool, port: int, saved: bool) -> None:
    """Open a recording, or say how it is opened."""
    from inspector.recording import viewer

    if web:
        from inspector.recording import viewer as browser

        browser.serve(target, lambda url: typer.echo(f"open {url}"), port=port)
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


def _read(paths: list[Path], reading: "Reading") -> tuple[list["Opened"], bool]:
    """Open the runs that can be read, and name the others; whether there are such."""
    from inspector.errors import InspectorError
    from inspector.verdict import EXPECTED

    found = []
    for path in paths:
        try:
            found.append(opened(path, reading, said=False))
        except EXPECTED as error:
            typer.echo(f"inspector: {error}", err=True)
    if not found:
        raise InspectorError(f"none of {len(paths)} runs can be read")
    return found, len(found) < len(paths)


def _beside(
    run: "Opened", reference: Path | None, reading: "Reading", found: "Analysis"
) -> "Comparison | None":
    """A run beside its reference; None without one."""
    if reference is None:
        return None
    from inspector.reference.judging import compare
    from inspector.reference.levels import levels
    from inspector.reference.store import Reference, scenario_of

    path = run.source.shown
    own = levels(found.run, name=scenario_of(found.run, path), file=str(path))
    return compare(own, Reference.load(reference, reading).scenarios)


def _several(
    runs: list["Opened"], target: Path, library: "Library", *, from_start: bool, overwrite: bool
) -> None:
    from inspector.compare.many import lay, write

    several = lay(runs, library, from_start=from_start)
    write(several, target, overwrite=overwrite)
    for index, (name, side) in enumerate(zip(several.names, several.sides, strict=True)):
        mark = " (worst)" if index == several.worst else ""
        typer.echo(f"{name}: {side.headline}{mark}")


def _one(
    run: "Opened",
    target: Path,
    library: "Library",
    kind: str,
    compared: Callable[["Analysis"], "Comparison | None"],
    *,
    terms: bool,
    floor: float | None,
    overwrite: bool,
) -> float:
    """Write the recording of a run; returns the time of its worst moment, in [s]."""
    from inspector.analysis import analyse_file
    from inspector.recording.run import write
    from inspector.report.markdown import sentence
    from inspector.sound import of_recording, worst_time

    found = analyse_file(run, library, links=bool(kind), kind=kind, terms=terms)
    beside, sound = compared(found), of_recording(found)
    write(found, target, overwrite=overwrite, sound=sound, floor=floor, beside=beside)
    typer.echo(f"{run.source.shown}: {found.headline}")
    for event in found.findings:
        typer.echo(f"  {sentence(found, event)}")
    if beside is not None:
        typer.echo(f"  beside the reference: {beside}")
        for each in (*beside.exceedances, *beside.remarks):
            typer.echo(f"  {each}")
    for remark in found.remarks:
        typer.echo(f"  {remark}")
    return worst_time(found)


def _two(
    runs: tuple["Opened", "Opened"],
    target: Path,
    library: "Library",
    how: Aligned,
    *,
    robot: bool,
    kind: str,
    overwrite: bool,
) -> None:
    from inspector.compare.alignment import Align
    from inspector.compare.changes import changes, summary
    from inspector.compare.pair import compare
    from inspector.compare.recording import write

    pair = compare(*runs, library, how=Align(how), robot=robot, kind=kind)
    write(pair, target, overwrite=overwrite)
    typer.echo(f"{runs[0].source.shown} → {runs[1].source.shown}: {summary(pair)}")
    typer.echo(f"  aligned {pair.alignment}")
    for change in changes(pair):
        typer.echo(f"  {change}")
    for remark in pair.remarks:
        typer.echo(f"  {remark}")
