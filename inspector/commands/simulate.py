"""`inspector simulate`: one simulated run, or a data set of them."""

import json
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from inspector.commands import shared
from inspector.commands.shared import argument, names_in, option
from inspector.text import progress


class OneRunUnlessNamed(TyperGroup):
    """A group of commands that calls ``run`` if no command is named."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Insert ``run``, unless the first argument is a command or asks for help."""
        named = not args or args[0] in (*self.commands, "--help", "-h")
        return super().parse_args(ctx, args if named else ["run", *args])


app = typer.Typer(
    cls=OneRunUnlessNamed,
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    help="""Simulate labelled runs of robots with defects.

    Needs the extra `sim`. The default command is `run`.
    `inspector simulate --list` prints scenarios and robots.""",
)
List = Annotated[bool, option("Print what there is, simulate nothing.", "--list")]
To = Annotated[Path, option("The folder to write.", "--output", "-o")]
Jobs = Annotated[int, option("Parallel runs.", "--jobs", "-j", min=1)]
Seconds = Annotated[float | None, option("In seconds; by default the motion's.", min=3.0)]


@app.command(epilog="Example: inspector simulate run talos --scenario 7 --seed 1 -o run.npz")
def run(
    robot: Annotated[str, argument("A robot that --list prints.")] = "",
    scenario: Annotated[str, option("Name or number of a scenario.")] = "straight",
    seed: Annotated[int, option("Random seed.", min=0)] = 0,
    duration: Seconds = None,
    output: Annotated[Path, option("The file.", "--output", "-o")] = Path("run.npz"),
    list_: List = False,
    overwrite: shared.Overwrite = False,
) -> None:
    """Simulate one run, with its failures annotated."""
    from noiseclassifier import scenarios
    from noisemodel.files import refuse_existing

    if list_:
        for name, line in scenarios.SCENARIOS.items():
            families = ", ".join(line.cases)
            typer.echo(f"{line.number:>2} {name:23} {families:26} {line.description}")
    if list_ or not robot:
        typer.echo(f"robots: {', '.join(scenarios.ROBOTS)}", err=not list_)
        raise typer.Exit(0 if list_ else 2)
    refuse_existing(output, overwrite=overwrite)
    made = scenarios.simulate(robot, scenario, seed, duration=duration)
    made.save(output, overwrite=overwrite)
    typer.echo(f"{output}: {made.duration:.2f} s at {made.rate:g} Hz")
    for block in made.blocks:
        typer.echo(f"  {block.label} from {block.start:.2f} s to {block.stop:.2f} s")


@app.command(epilog="Example: inspector simulate dataset --robots talos,go2 --seeds 8 -o data/")
def dataset(
    robots: Annotated[str, option("Names of robots: talos,go2,panda.")],
    output: To,
    seeds: Annotated[int, option("Seeds per robot and scenario.", min=1)] = 8,
    first_seed: Annotated[int, option("The first random seed.", min=0)] = 0,
    scenarios: Annotated[str, option("Names or numbers; by default all.")] = "",
    rate: Annotated[
        float, option("At which runs are kept, in Hz.", min=1.0, max=10_000.0)
    ] = 10_000.0,
    duration: Seconds = None,
    jobs: Jobs = 1,
    dask: shared.Dask = "",
    as_json: shared.AsJson = False,
) -> None:
    """Simulate a data set; resumes if killed: only missing runs are made."""
    from noiseclassifier.scenarios.dataset import Folder, described, scenario_tasks

    where = shared.jobs_or_dask(jobs, dask)
    names, numbers = names_in(robots), names_in(scenarios)
    tasks = scenario_tasks(names, numbers, first=first_seed, seeds=seeds)
    found = _filled(Folder.opened(output, duration=duration, rate=rate), tasks, where)
    typer.echo(json.dumps(found, indent=2) if as_json else f"{output}: {described(found)}")


@app.command(epilog="Example: inspector simulate domains --seeds 8 -o data/ -j 2")
def domains(
    output: To = Path(),
    robots: Annotated[str, option("Names of robots, talos,go2,panda; by default all.")] = "",
    seeds: Annotated[int, option("Seeds per robot; each draws a domain.", min=1)] = 8,
    first_seed: Annotated[int, option("The first random seed.", min=10_000)] = 10_000,
    faults: Annotated[int, option("Faulty runs per robot and seed.", min=0)] = 2,
    throughout: Annotated[
        int, option("Faults of whole runs, per robot and seed.", min=0, max=6)
    ] = 0,
    jobs: Jobs = 1,
    list_: List = False,
) -> None:
    """Simulate wide domains: many robots, drives, controllers, motions; resumes if killed."""
    from noiseclassifier.scenarios.dataset import Folder, described, wide_tasks
    from noiseclassifier.scenarios.robots import TARGETS, WIDE

    if list_ or output == Path():
        sources = [robot for robot in WIDE if robot not in TARGETS]
        typer.echo(f"{len(sources)} robots to learn from: {', '.join(sources)}")
        typer.echo(f"{len(TARGETS)} to measure on only: {', '.join(TARGETS)}")
        return
    names = names_in(robots)
    tasks = wide_tasks(names, first=first_seed, seeds=seeds, faults=faults, throughout=throughout)
    found = _filled(Folder.opened(output, wide=True), tasks, jobs)
    typer.echo(f"{output}: {described(found)}")


def _filled(folder: Any, tasks: list[Any], jobs: Any) -> dict[str, Any]:
    """Simulate the runs that a folder lacks; statistics of all of it."""
    from noiseclassifier.scenarios.dataset import make, statistics

    missing = folder.missing(tasks)
    for _ in progress(make(folder, missing, jobs=jobs), "simulate", total=len(missing)):
        pass
    return statistics(folder)
