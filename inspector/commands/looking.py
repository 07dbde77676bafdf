"""Commands that look at one run."""

from pathlib import Path
from typing import Annotated

import typer

from inspector.commands.options import Kind, ModelFiles, Overwrite, RunFile


def view(
    run: Annotated[
        Path | None, typer.Argument(help="A run file; without one, the demo that ships.")
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
    overwrite: Overwrite = False,
) -> None:
    """Show a run in rerun: joints, noise, spectrogram, classes, the moving robot."""
    from inspector import assets, viewer, webview
    from inspector.inspection import inspect
    from inspector.labelling import load_library
    from inspector.recording import write
    from inspector.report import sentence, verdict
    from inspector.sound.clip import of_recording
    from noisemodel.atomic import refuse_existing

    if web and save:
        raise typer.BadParameter("name one of --web and --save")
    if port:
        webview.free_port(port)
    path = run or assets.demo_run()
    target = save or viewer.scratch_path(path)
    overwrite = overwrite or save is None
    refuse_existing(target, overwrite=overwrite)
    library = load_library(model or assets.model_files())
    found = inspect(path, library, robot=robot, kind=kind, terms=terms)
    write(found, target, overwrite=overwrite, sound=of_recording(found))
    typer.echo(f"{path}: {verdict(found)}")
    for event in found.events:
        typer.echo(f"  {sentence(found, event)}")
    for remark in found.remarks:
        typer.echo(f"  {remark}")
    if web:
        webview.serve(target, lambda url: typer.echo(f"open {url}"), port=port)
        return
    if save is None and viewer.has_display():
        problem = viewer.open_window(target)
        if not problem:
            return
        typer.echo(problem, err=True)
    typer.echo(f"recording: {target} ({target.stat().st_size / 1e6:.1f} MB)")
    typer.echo(viewer.how_to_open(target))


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
