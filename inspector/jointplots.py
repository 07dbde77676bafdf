"""The joints' signals in a recording, a few joints per plot, desired beside measured."""

from collections.abc import Iterator
from dataclasses import dataclass

import rerun as rr

from inspector import colors, series
from inspector.thinning import extremes
from noisemodel.run import Run
from noisemodel.types import Real

POINTS = 4000
JOINTS_PER_PLOT = 8


@dataclass(frozen=True)
class Line:
    """Some joints' signal, drawn as lines of one entity."""

    path: str
    values: Real
    names: tuple[str, ...]
    dim: bool


@dataclass(frozen=True)
class Plot:
    """Lines that share a plot."""

    title: str
    lines: tuple[Line, ...]


def plots(run: Run) -> Iterator[Plot]:
    """Go through the plots of a run's joint signals.

    Args:
        run: The run.

    Yields:
        Velocities, positions, efforts, stages, each for eight joints at most.
    """
    signals = [
        ("velocity", "rad/s", run.velocity, run.velocity_desired),
        ("position", "rad", run.position, run.position_desired),
        ("effort", "N m", run.effort, None),
        *((f"stage {name}", "rad/s", stage, None) for name, stage in run.stages.items()),
    ]
    for kind, unit, measured, desired in signals:
        if measured is None:
            continue
        for first in range(0, len(run.joint_names), JOINTS_PER_PLOT):
            names = run.joint_names[first : first + JOINTS_PER_PLOT]
            path = f"/joints/{kind.replace(' ', '_')}/{first // JOINTS_PER_PLOT}"
            lines = [Line(path, measured[:, first : first + len(names)], names, dim=False)]
            wanted = [name for name in names if name in run.desired_joint_names]
            if desired is not None and wanted:
                columns = [run.desired_joint_names.index(name) for name in wanted]
                labels = tuple(f"{name} desired" for name in wanted)
                lines.insert(0, Line(f"{path}_desired", desired[:, columns], labels, dim=True))
            few = len(run.joint_names) <= JOINTS_PER_PLOT
            span = "" if few else f" {names[0]} … {names[-1]}"
            yield Plot(f"{kind}{span} [{unit}]", tuple(lines))


def log(recording: rr.RecordingStream, run: Run, plot: Plot) -> None:
    """Log the lines of a plot, at most 4000 points each.

    Args:
        recording: Where to.
        run: The run that the lines are of; its gaps are left out.
        plot: What to log.
    """
    for line in plot.lines:
        time, values = extremes(run.time[run.mask], line.values[run.mask], points=POINTS)
        colours = colors.of_series(len(line.names), dim=line.dim)
        series.log_lines(recording, line.path, time, values, names=line.names, colours=colours)
