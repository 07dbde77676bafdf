"""The command that makes runs."""

from pathlib import Path
from typing import Annotated

import typer

from inspector.commands.options import Overwrite


def simulate(
    robot: Annotated[str, typer.Argument(help="The robot: panda.")] = "panda",
    scenario: Annotated[str, typer.Option(help="What happens to it.")] = "ok",
    seed: Annotated[int, typer.Option(min=0, help="Makes each run another one.")] = 0,
    duration: Annotated[
        float | None, typer.Option(min=0.5, help="In seconds; 7 unless given.")
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="The file to write.")] = Path(
        "run.npz"
    ),
    list_: Annotated[bool, typer.Option("--list", help="Print the scenarios, do nothing.")] = False,
    overwrite: Overwrite = False,
) -> None:
    """Simulate a robot with a defect, labelled by construction (needs the extra `sim`)."""
    import scenarios
    from noisemodel.atomic import refuse_existing

    if list_:
        for name, entry in scenarios.SCENARIOS.items():
            typer.echo(f"{name:12} {entry.description}")
        return
    refuse_existing(output, overwrite=overwrite)
    run = scenarios.simulate(robot, scenario, seed, duration=duration)
    run.save(output, overwrite=overwrite)
    typer.echo(f"{output}: {run.duration:.2f} s at {run.rate:g} Hz")
    for block in run.blocks:
        typer.echo(f"  {block.label} from {block.start:.2f} s to {block.stop:.2f} s")
