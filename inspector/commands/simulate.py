"""The commands that make runs: one, or a data set of them."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from inspector.commands.options import Overwrite

if TYPE_CHECKING:
    from collections.abc import Mapping

    from scenarios import Scenario


class OneRunUnlessNamed(TyperGroup):
    """A group of commands that takes ``run`` for meant when none of them is named."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put ``run`` in front, unless a command is named or help is asked for."""
        named = not args or args[0] in (*self.commands, "--help")
        return super().parse_args(ctx, args if named else ["run", *args])


app = typer.Typer(
    cls=OneRunUnlessNamed,
    no_args_is_help=True,
    help="""Simulate robots with defects, labelled by construction (needs the extra `sim`).

    `inspector simulate talos --scenario 7 --seed 1 -o run.npz` makes one run (`run` may be left
    out), `inspector simulate dataset --robots talos,go2,panda --seeds 8 -o data/` makes many,
    `inspector simulate --list` says which scenarios there are.""",
)


class Only(StrEnum):
    """Which scenarios are kept."""

    OK = "ok"


class Form(StrEnum):
    """In which form a data set keeps its runs."""

    SAMPLES = "samples"
    NOISYTEST = "noisytest"


@app.command()
def run(
    robot: Annotated[
        str | None, typer.Argument(help="The robot, as --list has it.", show_default=False)
    ] = None,
    scenario: Annotated[str, typer.Option(help="What happens: its name or number.")] = "straight",
    seed: Annotated[int, typer.Option(help="Makes each run another one; at least 0.")] = 0,
    duration: Annotated[
        float | None, typer.Option(help="In seconds; as long as the motion is unless given.")
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="The file to write.")] = Path(
        "run.npz"
    ),
    list_: Annotated[bool, typer.Option("--list", help="Print the scenarios, do nothing.")] = False,
    overwrite: Overwrite = False,
) -> None:
    """Simulate one run."""
    import scenarios
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


@app.command()
def dataset(
    robots: Annotated[str, typer.Option(help="Robots: talos,go2,panda.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="The folder to write.")],
    seeds: Annotated[
        int | None,
        typer.Option(help="Runs of each robot in each scenario; 8 unless --hours is given."),
    ] = None,
    first_seed: Annotated[int, typer.Option(help="The first seed; at least 0.")] = 0,
    hours: Annotated[
        float | None,
        typer.Option(help="Instead of --seeds: time to fill with runs, evenly over the robots."),
    ] = None,
    scenarios: Annotated[
        str, typer.Option(help="Names or numbers: 1,7,obstacle-toe; all unless given.")
    ] = "",
    only: Annotated[
        Only | None, typer.Option(help="Only scenarios in which nothing goes wrong.")
    ] = None,
    form: Annotated[
        Form, typer.Option("--format", help="Samples of our own, or NoisyTest's files.")
    ] = Form.SAMPLES,
    duration: Annotated[
        float | None, typer.Option(help="Of each run, in seconds; as its motion is unless given.")
    ] = None,
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, help="Runs at once.")] = 1,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Make damaged files again; whole ones stay.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Simulate a data set; started again, it makes what is missing and redoes nothing."""
    from json import dumps

    from inspector.progress import progress
    from scenarios import noisytest
    from scenarios.balance import Balance
    from scenarios.dataset import make
    from scenarios.folder import Folder
    from scenarios.tasks import Wish, choose

    choice = choose(_listed(robots), _listed(scenarios), healthy=only is Only.OK)
    wish = Wish(choice=choice, first=first_seed, seeds=seeds, hours=hours)
    folder = Folder.opened(output, form=form, duration=duration)
    folder.clear(overwrite=overwrite)
    while missing := folder.missing(wish.tasks(duration=duration, fallen=folder.fallen())):
        for _ in progress(make(folder, missing, jobs=jobs), "simulate", total=len(missing)):
            pass
    if form is Form.NOISYTEST:
        noisytest.write_config(output)
        if lacking := noisytest.lacking(output):
            typer.echo(f"NoisyTest cannot train without blocks of {', '.join(lacking)}", err=True)
    balance = Balance.of(folder)
    typer.echo(dumps(balance.as_dict(), indent=2) if as_json else f"{output}: {balance}")


def _listed(names: str) -> list[str]:
    return [name.strip() for name in names.split(",") if name.strip()]


def _table(scenarios: "Mapping[str, Scenario]") -> str:
    return "\n".join(
        f"{line.number:>2} {name:23} {', '.join(line.families):26} {line.description}"
        for name, line in scenarios.items()
    )
