"""`inspector view`: one run in the viewer, or several side by side."""

import hashlib
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from inspector.analysis.status import EXIT, Status
from inspector.commands.options import (
    Floor,
    Kind,
    ModelFiles,
    Overwrite,
    one_at_a_time,
    opened,
    reads_logs,
)
from inspector.commands.outputs import check_suffix

if TYPE_CHECKING:
    from inspector.library import Library
    from inspector.logs.opening import Opened, Reading


class Aligned(StrEnum):
    """The methods to align a second run with the first."""

    AUTO = "auto"
    START = "start"
    NONE = "none"


@reads_logs
def view(
    runs: Annotated[
        list[Path] | None,
        typer.Argument(
            help="A run file, or any log; by default the shipped demo. Two are before and after a"
            " change; more lie side by side."
        ),
    ] = None,
    save: Annotated[
        Path | None,
        typer.Option("--save", help="Write the recording to this .rrd file, open no viewer."),
    ] = None,
    model: ModelFiles = None,
    no_robot: Annotated[
        bool, typer.Option("--no-robot", help="Do not draw the robot and the noise of its links.")
    ] = False,
    kind: Kind = "normal",
    floor: Floor = None,
    terms: Annotated[
        bool, typer.Option("--terms", help="Show the terms A, B and C of the paper separately.")
    ] = False,
    web: Annotated[
        bool, typer.Option("--web", help="Serve it to a browser on this machine until Ctrl-C.")
    ] = False,
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, help="Port of --web; 0 takes a free one.")
    ] = 0,
    align: Annotated[
        Aligned | None,
        typer.Option(
            "--align",
            help="Align two runs by motion (auto), several by start, or not at all (none).",
        ),
    ] = None,
    overwrite: Overwrite = False,
    *,
    reading: "Reading",
) -> None:
    """Show a run, or several side by side, in the rerun viewer.

    The views: joints, noise, spectrogram, classes and the moving robot; of two runs, what is new,
    resolved and louder. Runs that cannot be read are named, and the others shown (exit status 3).
    """
    from inspector import assets
    from inspector.library import load_library
    from inspector.recording import viewer
    from noisemodel.atomic import refuse_existing

    if web and save:
        raise typer.BadParameter("name one of --web and --save")
    paths = runs or [assets.demo_run()]
    one_at_a_time(reading, len(paths))
    if align and len(paths) < 2:
        raise typer.BadParameter("--align takes two runs or more")
    if align is Aligned.AUTO and len(paths) > 2:
        raise typer.BadParameter("--align auto takes two runs; more lie side by side from start")
    if terms and len(paths) > 1:
        raise typer.BadParameter("--terms takes one run")
    if floor is not None and len(paths) > 1:
        raise typer.BadParameter("--floor takes one run")
    if port:
        from inspector.recording import viewer as browser

        browser.free_port(port)
    if save:
        check_suffix(save, ".rrd")
    target = save or viewer.scratch_path(_together(paths))
    overwrite = overwrite or save is None
    refuse_existing(target, overwrite=overwrite)
    library = load_library(assets.model_files(model))
    robot, unread, seconds = not no_robot, False, None
    if len(paths) == 1:
        found = [opened(paths[0], reading, said=False)]  # remarks say it
    else:
        found, unread = _read(paths, reading)
    if len(found) == 1:
        links = kind if robot else ""
        seconds = _one(
            found[0], target, library, links, terms=terms, floor=floor, overwrite=overwrite
        )
    elif len(paths) == 2:
        both, how = (found[0], found[1]), align or Aligned.AUTO
        _two(both, target, library, how, robot=robot, kind=kind, overwrite=overwrite)
    else:
        _several(found, target, library, from_start=align is not Aligned.NONE, overwrite=overwrite)
    _show(target, seconds, web=web, port=port, saved=save is not None)
    if unread:
        raise typer.Exit(EXIT[Status.BAD_INPUT])


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
        raise viewer.DisplayError(f"{problem}; --web shows it in a browser, --save FILE writes it")


def _together(paths: list[Path]) -> Path:
    """A name of several runs, the same for the same ones."""
    if len(paths) == 1:
        return paths[0]
    others = "\n".join(str(path.resolve()) for path in paths[1:])
    key = hashlib.sha256(others.encode()).hexdigest()[:8]
    return paths[0].with_name(f"{paths[0].stem}-and-{len(paths) - 1}-{key}")


def _read(paths: list[Path], reading: "Reading") -> tuple[list["Opened"], bool]:
    """Open the runs that can be read, and name the others; whether there are such."""
    from inspector.analysis.verdict import EXPECTED
    from inspector.errors import InspectorError

    found = []
    for path in paths:
        try:
            found.append(opened(path, reading, said=False))
        except EXPECTED as error:
            typer.echo(f"inspector: {error}", err=True)
    if not found:
        raise InspectorError(f"none of {len(paths)} runs can be read")
    return found, len(found) < len(paths)


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
    *,
    terms: bool,
    floor: float | None,
    overwrite: bool,
) -> float:
    """Write the recording of a run; returns the time of its worst moment, in [s]."""
    from inspector.analysis.analyse import analyse_file
    from inspector.recording.run import write
    from inspector.report.markdown import sentence
    from inspector.sound import of_recording, worst_time

    found = analyse_file(run, library, links=bool(kind), kind=kind, terms=terms)
    write(found, target, overwrite=overwrite, sound=of_recording(found), floor=floor)
    typer.echo(f"{run.source.shown}: {found.headline}")
    for event in found.findings:
        typer.echo(f"  {sentence(found, event)}")
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
    from inspector.compare.changes import changes, summary
    from inspector.compare.pair import compare
    from inspector.compare.recording import write
    from inspector.pair.alignment import Align

    pair = compare(*runs, library, how=Align(how), robot=robot, kind=kind)
    write(pair, target, overwrite=overwrite)
    typer.echo(f"{runs[0].source.shown} → {runs[1].source.shown}: {summary(pair)}")
    typer.echo(f"  aligned {pair.alignment}")
    for change in changes(pair):
        typer.echo(f"  {change}")
    for remark in pair.remarks:
        typer.echo(f"  {remark}")
