"""The joints' signals in a recording, limb by limb, desired beside measured."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import rerun as rr

from inspector import colors
from inspector.recording import series
from inspector.thinning import extremes
from noisemodel.run import Run
from noisemodel.types import Array, Real

POINTS = 4000
"""Of a line, so that a long run has no more than a short one."""


@dataclass(frozen=True)
class Plot:
    """Lines that share a plot.

    Attributes:
        limb: Whose joints they are of.
        title: What they are, with the unit.
        paths: Their entities.
    """

    limb: str
    title: str
    paths: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Signal:
    """A signal of all joints, thinned for plotting."""

    path: str
    time: Array
    values: Array
    joints: tuple[str, ...]
    desired: bool


def log(
    recording: rr.RecordingStream, run: Run, limbs: Mapping[str, tuple[str, ...]]
) -> list[Plot]:
    """Log the joints' signals, at most 4000 points each.

    Args:
        recording: Where to.
        run: The run that they are of; its gaps are left out.
        limbs: The joints of each limb.

    Returns:
        Velocities, positions, efforts and stages of each limb.
    """
    found: list[Plot] = []
    for title, signals in _signals(run):
        for number, (limb, joints) in enumerate(limbs.items()):
            paths = (_log(recording, signal, joints, number) for signal in signals)
            found.append(Plot(limb, title, tuple(path for path in paths if path)))
    return found


def _signals(run: Run) -> Iterator[tuple[str, list[_Signal]]]:
    """Go through the kinds of signals: title, and desired and measured values."""
    pairs: list[tuple[str, str, Real | None, Real | None]] = [
        ("velocity", "rad/s", run.velocity, run.velocity_desired),
        ("position", "rad", run.position, run.position_desired),
        ("effort", "N m", run.effort, None),
        *((f"stage {name}", "rad/s", stage, None) for name, stage in run.stages.items()),
    ]
    for kind, unit, measured, desired in pairs:
        if measured is not None:
            path = f"/joints/{kind.replace(' ', '_')}"
            signals = [_thin(run, path, measured, run.joint_names, desired=False)]
            if desired is not None:
                names = run.desired_joint_names
                # The first is drawn below the others.
                signals.insert(0, _thin(run, f"{path}_desired", desired, names, desired=True))
            yield f"{kind} [{unit}]", signals


def _thin(run: Run, path: str, values: Real, joints: tuple[str, ...], *, desired: bool) -> _Signal:
    time = run.time
    if not run.mask.all():
        time, values = time[run.mask], values[run.mask]
    return _Signal(path, *extremes(time, values, points=POINTS), joints, desired)


def _log(
    recording: rr.RecordingStream, signal: _Signal, joints: tuple[str, ...], number: int
) -> str:
    """Log the lines of a limb as one entity; nothing where the signal has none of its joints."""
    columns = [signal.joints.index(name) for name in joints if name in signal.joints]
    if not columns:
        return ""
    path = f"{signal.path}/{number}"
    names = [signal.joints[i] + (" desired" if signal.desired else "") for i in columns]
    every = colors.of_series(len(joints), dim=signal.desired)
    series.log_lines(
        recording,
        path,
        signal.time,
        np.ascontiguousarray(signal.values[:, columns]),
        names=names,
        colours=[color for name, color in zip(joints, every, strict=True) if name in signal.joints],
    )
    return path
