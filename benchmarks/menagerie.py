"""Tables of robots from MJCF files: what loads, its noise in a fixed motion, what is drawn.

    python -m benchmarks.menagerie                     # all robots of MuJoCo Menagerie
    python -m benchmarks.menagerie robots/*/robot.xml  # other MJCFs
    python -m benchmarks.menagerie --pairs URDF=MJCF   # twists of one robot in both formats

MuJoCo Menagerie is downloaded by its package (253 MB in all), or taken from a checkout that
``MENAGERIE_ROOT`` names. The motion: for 1 s, at 200 Hz, each joint turns as 0.1 sin(2 pi t) rad or
slides as 0.01 sin(2 pi t) m about where the file has it at 0, the base at rest. The noise is the
mean sound power of the links' root-mean-square speed.
"""

import argparse
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun as rr
from rerun.chunk import RrdReader

import noisemodel as nm
from inspector.errors import InspectorError
from inspector.recording import robot as scene
from noisemodel.robot import menagerie_names
from noisemodel.surface import triangles
from noisemodel.types import Array

RATE = 200.0
PREFIXES = ("panda_", "robot0_")
"""What vendors put before the names of joints in one format and not in the other."""


@dataclass(frozen=True)
class Row:
    """What is measured of one robot; what was not is 0."""

    name: str
    problem: str = ""
    floating: bool = False
    joints: int = 0
    links: int = 0
    shaped: int = 0
    level: float = 0.0  # sound power in the fixed motion, in [dB re 1 pW]
    drawn: int = 0


def measured(name: str) -> Row:
    """Load, move and draw a robot."""
    try:
        robot = nm.Robot.load(name)
        drawing = triangles(robot, "auto")
        surface = nm.Surface.of_triangles(robot, drawing)
        power = nm.extended(robot, surface, *motion(robot), "rms").power.sum(axis=1).mean()
        shaped = len(surface.names) - len(surface.without_geometry)
        drawn = len(drawn_links(name))
    except (nm.NoiseModelError, InspectorError) as error:
        return Row(name, problem=str(error))
    with np.errstate(divide="ignore"):
        level = float(10 * np.log10(power / 1e-12))
    return Row(
        name=name,
        floating=robot.floating_base,
        joints=len(robot.joint_names),
        links=len(surface.names),
        shaped=shaped,
        level=level,
        drawn=drawn,
    )


def motion(robot: nm.Robot) -> tuple[Array, Array]:
    """The fixed motion of a robot.

    Returns:
        Configurations, shape (samples, nq), and velocities, shape (samples, nv).
    """
    time = np.arange(round(RATE)) / RATE
    turn, speed = 0.1 * np.sin(2 * np.pi * time), 0.2 * np.pi * np.cos(2 * np.pi * time)
    kinds = {joint.name: joint.kind for joint in robot.joints}
    scale = np.array([0.1 if kinds[name] == "prismatic" else 1.0 for name in robot.joint_names])
    return robot.configuration(
        nm.Run(
            time=time,
            position=turn[:, None] * scale,
            velocity=speed[:, None] * scale,
            joint_names=robot.joint_names,
        )
    )


def drawn_links(name: str) -> set[str]:
    """Links that have a mesh in a recording of a robot, saved and read back."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "robot.rrd"
        with rr.RecordingStream("menagerie") as recording:
            recording.save(file)
            scene.log_shapes(recording, scene.load(name, Path(folder)), coloured=False)
        chunks = RrdReader(file).stream().to_chunks()
        return {
            str(chunk.entity_path).rpartition("/")[0]
            for chunk in chunks
            if "Asset3D:blob" in chunk.to_record_batch().schema.names
        }


def agreement(first: nm.Robot, second: nm.Robot) -> tuple[tuple[str, ...], Array]:
    """Compare the twists of two descriptions of a robot in the same motion of its joints.

    Returns:
        The joints of one degree of freedom that both have, named as in the first, and for each the
        largest difference of any entry of its link's twist, shape (joints,), in [m/s] and [rad/s].
    """
    names = [{_short(name): name for name in robot.joint_names} for robot in (first, second)]
    common = [name for name in names[0] if name in names[1]]
    random = np.random.default_rng(0)
    position, velocity = random.normal(size=(2, 50, len(common))) * [[[0.3]], [[1.0]]]
    twists = []
    for robot, named in zip((first, second), names, strict=True):
        own = tuple(named[name] for name in common)
        run = nm.Run(
            time=np.arange(50) / RATE, position=position, velocity=velocity, joint_names=own
        )
        index = {joint.name: place for place, joint in enumerate(robot.joints, start=1)}
        twists.append(nm.link_twists(robot, *robot.configuration(run))[:, [index[n] for n in own]])
    difference: Array = np.abs(twists[0] - twists[1]).max(axis=(0, 2))
    return tuple(names[0][name] for name in common), difference


def _short(name: str) -> str:
    for prefix in PREFIXES:
        name = name.removeprefix(prefix)
    return name.removesuffix("_joint").lower()


def _table(rows: Sequence[Row]) -> str:
    lines = [
        "| robot | base | joints | links with geometry | noise [dB] | drawn |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        if row.problem:
            lines.append(f"| `{row.name}` | not supported: {row.problem} | | | | |")
            continue
        base = "floating" if row.floating else "fixed"
        level = f"{row.level:.1f}" if np.isfinite(row.level) else "none"
        lines.append(
            f"| `{row.name}` | {base} | {row.joints} | {row.shaped} of {row.links} | {level} |"
            f" {row.drawn} |"
        )
    whole = sum(not row.problem and row.shaped > 0 and row.drawn > 0 for row in rows)
    return "\n".join([*lines, "", f"{whole} of {len(rows)} load, make a noise and are drawn."])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("robots", nargs="*", help="MJCFs; all of MuJoCo Menagerie by default")
    parser.add_argument("--pairs", nargs="+", default=[], metavar="URDF=MJCF")
    arguments = parser.parse_args()
    for pair in arguments.pairs:
        urdf, mjcf = pair.split("=")
        names, difference = agreement(nm.Robot.load(urdf), nm.Robot.load(mjcf))
        worst = int(difference.argmax())
        print(
            f"| `{urdf}` | `{mjcf}` | {len(names)} | {difference[worst]:.1e} | `{names[worst]}` |"
        )
    if arguments.pairs:
        return
    robots = arguments.robots or list(menagerie_names())
    if not robots:
        parser.error("name MJCFs, or `pip install 'noise-inspector[menagerie]'`")
    print(_table([measured(robot) for robot in robots]))


if __name__ == "__main__":
    main()
