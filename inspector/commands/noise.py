"""`inspector noise`: noise levels of a run by joints and links; noise models side by side."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from inspector.commands.options import NumberOfJobs, Overwrite, one_of, opened, say_warnings

if TYPE_CHECKING:
    from inspector.logs.read import Reading

GEOMETRIES = ("visual", "collision", "hull", "auto")
"""Those of ``noisemodel.surface``, which would take too long to import here."""
COMPARED = ("simplified", "C", "paper", "mean", "rms", "normal")


def _of_models(*names: str, **settings: object) -> object:
    return typer.Option(*names, rich_help_panel="Comparing noise models", **settings)  # type: ignore[arg-type]


Runs = Annotated[
    list[Path] | None,
    typer.Argument(help="A run file or log; with --compare several.", show_default=False),
]
Kind = Annotated[
    list[str] | None,
    typer.Option("--kind", help="simplified, paper, A, B, C, mean, rms, normal; repeatable."),
]
Csv = Annotated[
    Path | None, typer.Option("--csv", help="Write the noise over time, or all numbers.")
]
Compare = Annotated[
    bool, _of_models("--compare", help="Compare noise models on run files with positions.")
]
Robots = Annotated[
    str, _of_models("--robots", help="Compare them on robots that move: talos,go2 or all.")
]
Geometry = Annotated[
    str,
    _of_models("--geometry", callback=one_of(GEOMETRIES), help="visual, collision, hull or auto."),
]
Seed = Annotated[int, _of_models("--seed", min=0, help="Random seed of the generated motion.")]
Save = Annotated[Path | None, _of_models("--save", help="Write a recording (.rrd).")]
Picture = Annotated[
    Path | None, _of_models("--picture", help="Write a PNG (needs the extra `report`).")
]


def noise(
    ctx: typer.Context,
    runs: Runs = None,
    kind: Kind = None,
    csv: Csv = None,
    compare: Compare = False,
    robots: Robots = "",
    geometry: Geometry = "auto",
    seed: Seed = 0,
    save: Save = None,
    picture: Picture = None,
    jobs: NumberOfJobs = 1,
    overwrite: Overwrite = False,
) -> None:
    """Print noise levels by joint and link.

    With --compare or --robots, noise models are compared; the exit status is 3 if nothing could be.
    """
    reading: Reading = ctx.obj
    kinds = [name for each in kind or () for name in each.split(",")]
    if not compare and not robots:
        if len(runs or ()) != 1:
            raise typer.BadParameter("name one run; --compare takes several")
        if save or picture:
            raise typer.BadParameter("--save and --picture take --compare")
        _print_levels((runs or [])[0], reading, kinds, csv, overwrite=overwrite)
        return
    import noisemodel as nm
    from inspector.compare.models import Outputs
    from inspector.text import progress

    names = list(nm.ROBOTS) if robots == "all" else [name.strip() for name in robots.split(",")]
    sources = list(dict.fromkeys([*(runs or ()), *filter(None, names)]))
    if not sources:
        raise typer.BadParameter("name run files, or robots with --robots")
    outputs = Outputs(csv, save, picture, overwrite=overwrite)
    outputs.check(len(sources))
    found = nm.compare(
        sources,
        kinds=kinds or COMPARED,
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


def _print_levels(
    run: Path, reading: "Reading", kinds: list[str], csv: Path | None, *, overwrite: bool
) -> None:
    """Print the noise levels of a run, and write the noise over time."""
    from inspector.analysis import default_kinds, estimate, noise_level, write_csv

    recorded = opened(run, reading).run
    say_warnings(recorded)
    estimates = tuple(estimate(recorded, each) for each in kinds or default_kinds(recorded))
    if csv:
        write_csv(recorded, estimates, csv, overwrite=overwrite)
    typer.echo(f"{run}: {recorded.duration:.2f} s at {recorded.rate:g} Hz")
    for each in estimates:
        typer.echo(str(noise_level(recorded, each)))
