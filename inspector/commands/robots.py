"""`inspector robots`: the robots that are available by name."""

import typer


def robots() -> None:
    """List the robots that are available by name."""
    from noisemodel import ROBOTS

    for name, robot in ROBOTS.items():
        base = "floating" if robot.floating_base else "fixed"
        typer.echo(f"{name:28} {base:10} {robot.urdf}")
