"""`inspector simulate`: one simulated run, or a data set of them."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from inspector.commands.options import Dask, Overwrite, jobs_or_dask

if TYPE_CHECKING:
    from collections.abc import Mapping

    from noiseclassifier.scenarios import Scenario


class OneRunUnlessNamed(TyperGroup):
    """A group of commands that calls ``run`` if no command is named."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Insert ``run``, unless the first argument is a command or ``--help``."""
        named = not args or args[0] in (*self.commands, "--help")
        return super().parse_args(ctx, args if named else ["run", *args])


app = typer.Typer(
    cls=OneRunUnlessNamed,
    no_args_is_help=True,
    help="""Simulate labelled runs of robots with defects.

    Needs the extra `sim`. The default command is `run`.
    `inspector simulate --list` prints scenarios and robots.""",
    epilog="Example: inspector simulate talos --scenario 7 --seed 1 -o run.npz",
)


class Only(StrEnum):
    """The scenarios to keep."""

    OK = "ok"


class Form(StrEnum):
    """The file formats of a data set."""

    SAMPLES = "samples"
    NOISYTEST = "noisytest"


class Side(StrEnum):
    """Domains by what they are for."""

    ALL = "all"
    SOURCE = "source"
    TARGET = "target"
    LOGGER = "logger"


@app.command(epilog="Example: inspector simulate run talos --scenario 7 --seed 1 -o run.npz")
def run(
    robot: Annotated[
        str | None, typer.Argument(help="A robot that --list prints.", show_default=False)
    ] = None,
    scenario: Annotated[str, typer.Option(help="Name or number of a scenario.")] = "straight",
    seed: Annotated[int, typer.Option(help="Random seed, at least 0.")] = 0,
    duration: Annotated[
        float | None, typer.Option(help="In seconds; by default that of the motion.")
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="The file to write.")] = Path(
        "run.npz"
    ),
    list_: Annotated[
        bool, typer.Option("--list", help="Print scenarios and robots, simulate nothing.")
    ] = False,
    overwrite: Overwrite = False,
) -> None:
    """Simulate one run, with its failures annotated."""
    from noiseclassifier import scenarios
    from noisemodel.atomic import refuse_existing

    if list_:
        typer.echo(_table(scenarios.SCENARIOS))
        typer.echo(f"robots: {', '.join(scenarios.ROBOTS)}")
        return
    if robot is None:
        raise typer.BadParameter(f"name a robot: {', '.join(scenarios.ROBOTS)}")
    refuse_existing(output, overwrite=overwrite)
    made = scenarios.simulate(robot, scenario, seed, duration=duration)
    made.save(output, overwrite=overwrite)
    typer.echo(f"{output}: {made.duration:.2f} s at {made.rate:g} Hz")
    for block in made.blocks:
        typer.echo(f"  {block.label} from {block.start:.2f} s to {block.stop:.2f} s")


@app.command(epilog="Example: inspector simulate dataset --robots talos,go2 --seeds 8 -o data/")
def dataset(
    robots: Annotated[str, typer.Option(help="Names of robots: talos,go2,panda.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="The folder to write.")],
    seeds: Annotated[
        int | None,
        typer.Option(help="Seeds per robot and scenario; 8 by default."),
    ] = None,
    first_seed: Annotated[int, typer.Option(help="The first random seed, at least 0.")] = 0,
    hours: Annotated[
        float | None,
        typer.Option(
            help="Instead of --seeds: total duration in hours, divided evenly between the robots."
        ),
    ] = None,
    scenarios: Annotated[
        str, typer.Option(help="Names or numbers: 1,7,obstacle-toe; by default all.")
    ] = "",
    only: Annotated[Only | None, typer.Option(help="Only scenarios without a failure.")] = None,
    form: Annotated[
        Form, typer.Option("--format", help="Samples (.npz), or the files of NoisyTest.")
    ] = Form.SAMPLES,
    duration: Annotated[
        float | None, typer.Option(help="Of each run, in seconds; by default that of its motion.")
    ] = None,
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, help="Parallel runs.")] = 1,
    dask: Dask = "",
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace damaged files; intact files stay.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Simulate a data set; resumes if killed: only missing runs are made."""
    from json import dumps

    from inspector.progress import progress
    from noiseclassifier.scenarios import noisytest
    from noiseclassifier.scenarios.dataset import make
    from noiseclassifier.scenarios.folder import Folder
    from noiseclassifier.scenarios.statistics import Statistics
    from noiseclassifier.scenarios.tasks import DatasetSpec, choose

    where = jobs_or_dask(jobs, dask)
    choice = choose(_listed(robots), _listed(scenarios), healthy=only is Only.OK)
    spec = DatasetSpec(choice=choice, first=first_seed, seeds=seeds, hours=hours)
    folder = Folder.opened(output, format_name=form, duration=duration)
    folder.clear(overwrite=overwrite)
    while missing := folder.missing(spec.tasks(duration=duration, fallen=folder.fallen())):
        for _ in progress(make(folder, missing, jobs=where), "simulate", total=len(missing)):
            pass
    if form is Form.NOISYTEST:
        noisytest.write_config(output)
        if lacking := noisytest.missing_classes(output):
            typer.echo(f"NoisyTest cannot train without blocks of {', '.join(lacking)}", err=True)
    statistics = Statistics.of(folder)
    typer.echo(dumps(statistics.as_dict(), indent=2) if as_json else f"{output}: {statistics}")


@app.command(epilog="Example: inspector simulate domains --seeds 8 -o data/ -j 2")
def domains(
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="The folder to write.")
    ] = None,
    robots: Annotated[str, typer.Option(help="Names of robots; by default all.")] = "",
    seeds: Annotated[int, typer.Option(help="Seeds per robot; each draws a domain.")] = 8,
    first_seed: Annotated[int, typer.Option(help="The first random seed.")] = 10_000,
    faults: Annotated[int, typer.Option(help="Faulty runs per robot and seed.")] = 2,
    always: Annotated[
        str, typer.Option(help="Faults of each robot and seed besides, where they can act: push.")
    ] = "",
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, help="Parallel runs.")] = 1,
    list_: Annotated[
        bool, typer.Option("--list", help="Print robots and distribution, simulate nothing.")
    ] = False,
) -> None:
    """Simulate wide domains: many robots, drives, controllers, motions; resumes if killed."""
    from inspector.progress import progress
    from noiseclassifier.scenarios.dataset import make
    from noiseclassifier.scenarios.domains import DISTRIBUTION
    from noiseclassifier.scenarios.domainset import tasks
    from noiseclassifier.scenarios.folder import Folder
    from noiseclassifier.scenarios.robots import TARGETS, WIDE
    from noiseclassifier.scenarios.statistics import Statistics

    if list_ or output is None:
        sources = [robot for robot in WIDE if robot not in TARGETS]
        typer.echo(f"{len(sources)} robots to learn from: {', '.join(sources)}")
        typer.echo(f"{len(TARGETS)} to measure on only: {', '.join(TARGETS)}\n\n{DISTRIBUTION}")
        return
    chosen = tasks(
        _listed(robots), first=first_seed, seeds=seeds, faults=faults, always=_listed(always)
    )
    folder = Folder.opened(output, format_name="domains")
    missing = folder.missing(chosen)
    for _ in progress(make(folder, missing, jobs=jobs), "simulate", total=len(missing)):
        pass
    typer.echo(f"{output}: {Statistics.of(folder)}")


@app.command(epilog="Example: inspector simulate logs data/ -o logs/ --copies 2")
def logs(
    data: Annotated[Path, typer.Argument(help="A folder of `inspector simulate domains`.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="The folder to write.")],
    copies: Annotated[int, typer.Option(min=1, help="Logs of each run.")] = 1,
    rate: Annotated[
        float | None, typer.Option(help="Of all logs, in Hz; drawn by default.")
    ] = None,
    side: Annotated[
        Side,
        typer.Option(
            help="All logs; those to learn from; robots and domains to measure on only; loggers to"
            " measure on only."
        ),
    ] = Side.ALL,
) -> None:
    """Write logs of wide domains: ripple, sensing and sampling, with labels decided anew."""
    from collections import Counter

    from noiseclassifier.scenarios.domainset import logs as logs_of
    from noiseclassifier.scenarios.domainset import write
    from noiseclassifier.scenarios.folder import Folder

    if not data.is_dir():
        raise typer.BadParameter(f"{data}: there is no such folder")
    folder = Folder.opened(data, format_name="domains", any_recipe=True)
    rates, labelled, lost = Counter[float](), 0, 0
    for _, run in write(logs_of(folder, copies=copies, rate=rate, side=side.value), output):
        rates[run.rate] += 1
        for event in run.meta["events"]:
            labelled += event["labelled"] > 0
            lost += not event["labelled"]
    counts = ", ".join(f"{count} at {rate:g} Hz" for rate, count in sorted(rates.items()))
    typer.echo(
        f"{output}: {rates.total()} logs ({counts}); {labelled} events with a label, {lost} that"
        " cannot be seen"
    )


def _listed(names: str) -> list[str]:
    return [name.strip() for name in names.split(",") if name.strip()]


def _table(scenarios: "Mapping[str, Scenario]") -> str:
    return "\n".join(
        f"{line.number:>2} {name:23} {', '.join(line.families):26} {line.description}"
        for name, line in scenarios.items()
    )
