"""`inspector robots`: the robots that are available by name."""

import typer


def robots() -> None:
    """List the robots that are available by name.

    Others are given by the path of a URDF or of an MJCF (robot.xml). Robots of MuJoCo Menagerie are
    listed if mujoco-menagerie is installed, which downloads each at its first use.
    """
    from noisemodel import ROBOTS
    from noisemodel.robot import menagerie_names

    for name, robot in ROBOTS.items():
        base = "floating" if robot.floating_base else "fixed"
        typer.echo(f"{name:28} {base:10} {robot.urdf}")
    for name, category in menagerie_names().items():
        typer.echo(f"{name:40} {category}")
