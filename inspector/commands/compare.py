"""`inspector compare`: compare noise models on runs and robots."""

from pathlib import Path
from typing import Annotated

import typer

from inspector.commands.options import Overwrite


def compare(
    runs: Annotated[
        list[Path] | None, typer.Argument(help="Run files with robot and positions.")
    ] = None,
    robots: Annotated[
        str, typer.Option(help="Robots to move by a motion of our own: talos,go2 or all.")
    ] = "",
    kinds: Annotated[
        str, typer.Option(help="Of simplified, paper, A, B, C, mean, rms, normal.")
    ] = "simplified,C,paper,mean,rms,normal",
    geometry: Annotated[str, typer.Option(help="visual, collision, hull or auto.")] = "auto",
    seed: Annotated[int, typer.Option(min=0, help="Makes our own motion another one.")] = 0,
    csv: Annotated[Path | None, typer.Option(help="Write all numbers here.")] = None,
    save: Annotated[Path | None, typer.Option(help="Write a recording (.rrd) here.")] = None,
    picture: Annotated[
        Path | None, typer.Option(help="Write a PNG here (needs the extra `report`).")
    ] = None,
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, help="Robots at once.")] = 1,
    overwrite: Overwrite = False,
) -> None:
    """Compare the noise models; exit 3 if nothing could be compared."""
    from inspector.comparison import comparing, output
    from inspector.comparison.table import table
    from inspector.progress import progress

    sources = comparing.sources_of(runs or (), robots)
    if not sources:
        raise typer.BadParameter("name run files, or robots with --robots")
    settings = comparing.Settings(tuple(kinds.split(",")), geometry, seed)
    outputs = output.Outputs(csv, save, picture, overwrite=overwrite)
    outputs.check(len(sources))
    results = comparing.compare_all(sources, settings, jobs=jobs)
    found, failed = comparing.sorted_out(progress(results, "compare", total=len(sources)))
    for bad in failed:
        typer.echo(f"inspector: {bad.name}: {bad.message}", err=True)
    if not found:
        raise typer.Exit(3)
    outputs.write(found)
    typer.echo(table(found))
