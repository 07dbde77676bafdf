"""`inspector view`: one run in the viewer, or two side by side."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from inspector.commands.options import (
    Floor,
    Kind,
    ModelFiles,
    Overwrite,
    one_at_a_time,
    opened,
    reads_logs,
)

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
    run: Annotated[
        Path | None, typer.Argument(help="A run file, or any log; by default the shipped demo.")
    ] = None,
    after: Annotated[
        Path | None, typer.Argument(help="A second run, after a change: new, resolved, louder.")
    ] = None,
    save: Annotated[
        Path | None,
        typer.Option("--save", help="Write the recording to this file, open no viewer."),
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
            "--align", help="Align two runs by motion (auto), start, or not at all (none)."
        ),
    ] = None,
    overwrite: Overwrite = False,
    *,
    reading: "Reading",
) -> None:
    """Show a run, or two side by side, in the rerun viewer.

    The views: joints, noise, spectrogram, classes and the moving robot.
    """
    from inspector import assets
    from inspector.library import load_library
    from inspector.recording import viewer
    from noisemodel.atomic import refuse_existing

    if web and save:
        raise typer.BadParameter("name one of --web and --save")
    one_at_a_time(reading, 1 if after is None else 2)
    if align and not after:
        raise typer.BadParameter("--align takes two runs")
    if terms and after:
        raise typer.BadParameter("--terms takes one run")
    if floor is not None and after:
        raise typer.BadParameter("--floor takes one run")
    if port:
        from inspector.recording import web as browser

        browser.free_port(port)
    path = run or assets.demo_run()
    both = path if after is None else path.joinpath(*after.resolve().parts[1:])
    target = save or viewer.scratch_path(both)
    overwrite = overwrite or save is None
    refuse_existing(target, overwrite=overwrite)
    library = load_library(assets.model_files(model))
    robot = not no_robot
    run_of = opened(path, reading, said=False)  # the remarks say it
    seconds = None
    if after is None:
        links = kind if robot else ""
        seconds = _one(
            run_of, target, library, links, terms=terms, floor=floor, overwrite=overwrite
        )
    else:
        both_runs, how = (run_of, opened(after, reading, said=False)), align or Aligned.AUTO
        _two(both_runs, target, library, how, robot=robot, kind=kind, overwrite=overwrite)
    if web:
        from inspector.recording import web as browser

        browser.serve(target, lambda url: typer.echo(f"open {url}"), port=port)
        return
    if save is None and viewer.has_display():
        problem = viewer.open_window(target, seconds)
        if not problem:
            return
        typer.echo(problem, err=True)
    typer.echo(f"recording: {target} ({target.stat().st_size / 1e6:.1f} MB)")
    typer.echo(viewer.how_to_open(target))


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
    from inspector.recording.recording import write
    from inspector.report.markdown import sentence
    from inspector.sound.clip import of_recording, worst_time

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
    from inspector.pair import Align, changes, compare, summary
    from inspector.pair.recording import write

    pair = compare(*runs, library, how=Align(how), robot=robot, kind=kind)
    write(pair, target, overwrite=overwrite)
    typer.echo(f"{runs[0].source.shown} → {runs[1].source.shown}: {summary(pair)}")
    typer.echo(f"  aligned {pair.alignment}")
    for change in changes(pair):
        typer.echo(f"  {change}")
    for remark in pair.remarks:
        typer.echo(f"  {remark}")
