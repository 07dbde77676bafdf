"""`inspector compare`: compare noise models on runs and robots."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from inspector.commands.options import Limits, Overwrite, PackageRoot, one_of

GEOMETRIES = ("visual", "collision", "hull", "auto")
"""Those of ``noisemodel.compare``, which would take too long to import here."""


def compare(
    runs: Annotated[
        list[Path] | None, typer.Argument(help="Run files with robot and positions.")
    ] = None,
    robots: Annotated[
        str, typer.Option(help="Robots to move by a generated motion: talos,go2 or all.")
    ] = "",
    package_root: PackageRoot = None,
    limit: Limits = None,
    kinds: Annotated[
        str, typer.Option(help="Some of simplified, paper, A, B, C, mean, rms, normal.")
    ] = "simplified,C,paper,mean,rms,normal",
    geometry: Annotated[
        str, typer.Option(callback=one_of(GEOMETRIES), help="visual, collision, hull or auto.")
    ] = "auto",
    seed: Annotated[int, typer.Option(min=0, help="Random seed of the generated motion.")] = 0,
    csv: Annotated[Path | None, typer.Option(help="Write all numbers to this file.")] = None,
    save: Annotated[Path | None, typer.Option(help="Write a recording (.rrd).")] = None,
    picture: Annotated[
        Path | None, typer.Option(help="Write a PNG (needs the extra `report`).")
    ] = None,
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, help="Parallel runs or robots.")] = 1,
    overwrite: Overwrite = False,
) -> None:
    """Compare noise models on runs or on robots.

    The exit status is 3 if nothing could be compared.
    """
    import noisemodel as nm
    from inspector.compare.models import Outputs
    from inspector.progress import progress

    del package_root, limit  # have been set
    names = list(nm.ROBOTS) if robots == "all" else [name.strip() for name in robots.split(",")]
    sources = list(dict.fromkeys([*(runs or ()), *filter(None, names)]))
    if not sources:
        raise typer.BadParameter("name run files, or robots with --robots")
    outputs = Outputs(csv, save, picture, overwrite=overwrite)
    outputs.check(len(sources))
    found = nm.compare(
        sources,
        kinds=kinds.split(","),
        surface=geometry,
        seed=seed,
        jobs=jobs,
        progress=partial(progress, what="compare"),
    )
    for left_out in found.left_out:
        typer.echo(f"inspector: {left_out.name}: {left_out.reason}", err=True)
    if not found:
        raise typer.Exit(3)
    outputs.write(found)
    typer.echo(found)
