"""Commands that look at a run, or at two beside each other."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from inspector.commands.options import Kind, ModelFiles, Overwrite, RunFile

if TYPE_CHECKING:
    from inspector.labelling import Library


class Aligned(StrEnum):
    """How a second run is laid beside the first."""

    AUTO = "auto"
    START = "start"
    NONE = "none"


def view(
    run: Annotated[
        Path | None, typer.Argument(help="A run file; without one, the demo that ships.")
    ] = None,
    after: Annotated[
        Path | None, typer.Argument(help="Another, after a change: what came, went, got louder.")
    ] = None,
    save: Annotated[
        Path | None, typer.Option("--save", help="Write the recording here, open nothing.")
    ] = None,
    model: ModelFiles = None,
    robot: Annotated[
        bool, typer.Option("--robot/--no-robot", help="Draw the robot, and hear its links.")
    ] = True,
    kind: Kind = "normal",
    terms: Annotated[
        bool, typer.Option("--terms", help="Show the paper's terms A, B and C one by one.")
    ] = False,
    web: Annotated[
        bool, typer.Option("--web", help="Show it in a browser on this machine, until Ctrl-C.")
    ] = False,
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, help="Of --web; 0 takes a free one.")
    ] = 0,
    align: Annotated[
        Aligned | None,
        typer.Option("--align", help="Two runs: by their motion (auto), starts, or clocks (none)."),
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Show a run in rerun: joints, noise, spectrogram, classes, the moving robot; or two."""
    from inspector import assets, viewer
    from inspector.labelling import load_library
    from noisemodel.atomic import refuse_existing

    if web and save:
        raise typer.BadParameter("name one of --web and --save")
    if align and not after:
        raise typer.BadParameter("--align takes two runs")
    if terms and after:
        raise typer.BadParameter("--terms takes one run")
    if port:
        from inspector import webview

        webview.free_port(port)
    path = run or assets.demo_run()
    both = path if after is None else path.joinpath(*after.resolve().parts[1:])
    target = save or viewer.scratch_path(both)
    overwrite = overwrite or save is None
    refuse_existing(target, overwrite=overwrite)
    library = load_library(model or assets.model_files())
    if after is None:
        _one(path, target, library, robot=robot, kind=kind, terms=terms, overwrite=overwrite)
    else:
        how = align or Aligned.AUTO
        _two((path, after), target, library, how, robot=robot, kind=kind, overwrite=overwrite)
    if web:
        from inspector import webview

        webview.serve(target, lambda url: typer.echo(f"open {url}"), port=port)
        return
    if save is None and viewer.has_display():
        problem = viewer.open_window(target)
        if not problem:
            return
        typer.echo(problem, err=True)
    typer.echo(f"recording: {target} ({target.stat().st_size / 1e6:.1f} MB)")
    typer.echo(viewer.how_to_open(target))


def _one(
    path: Path,
    target: Path,
    library: "Library",
    *,
    robot: bool,
    kind: str,
    terms: bool,
    overwrite: bool,
) -> None:
    from inspector.inspection import inspect
    from inspector.recording import write
    from inspector.report import sentence, verdict
    from inspector.sound.clip import of_recording

    found = inspect(path, library, robot=robot, kind=kind, terms=terms)
    write(found, target, overwrite=overwrite, sound=of_recording(found))
    typer.echo(f"{path}: {verdict(found)}")
    for event in found.events:
        typer.echo(f"  {sentence(found, event)}")
    for remark in found.remarks:
        typer.echo(f"  {remark}")


def _two(
    paths: tuple[Path, Path],
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

    pair = compare(*paths, library, how=Align(how), robot=robot, kind=kind)
    write(pair, target, overwrite=overwrite)
    typer.echo(f"{paths[0]} → {paths[1]}: {summary(pair)}")
    typer.echo(f"  aligned {pair.alignment}")
    for change in changes(pair):
        typer.echo(f"  {change}")
    for remark in pair.remarks:
        typer.echo(f"  {remark}")


def noise(
    run: RunFile,
    kind: Annotated[
        list[str] | None,
        typer.Option("--kind", help="simplified, paper, A, B, C, mean, rms, normal; repeatable."),
    ] = None,
    csv: Annotated[
        Path | None, typer.Option("--csv", help="Write the noises over time here.")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Print how loud a run is, when, and which joints and links make it so."""
    from inspector.loudness import default_kinds, estimate, loudness, write_csv
    from noisemodel import Run

    recorded = Run.load(run)
    estimates = tuple(estimate(recorded, each) for each in kind or default_kinds(recorded))
    if csv:
        write_csv(recorded, estimates, csv, overwrite=overwrite)
    typer.echo(f"{run}: {recorded.duration:.2f} s at {recorded.rate:g} Hz")
    for each in estimates:
        typer.echo(str(loudness(recorded, each)))
