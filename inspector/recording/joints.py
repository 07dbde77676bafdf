"""The joints' signals in a recording, limb by limb, desired beside measured."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
import rerun as rr

from inspector import colors
from inspector.recording import series
from inspector.thinning import extremes
from noisemodel.run import Run
from noisemodel.types import Array, Real

POINTS = 4000
"""Of a line, so that a long run has no more than a short one."""
UNITS = {"velocity": "rad/s", "position": "rad", "effort": "N m"}


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
class Signal:
    """A signal of joints.

    Attributes:
        kind: Such as "velocity" or "stage planned".
        desired: Whether it is the desired one.
        values: Shape (samples, joints), in the unit of its kind.
        joints: Names of its joints.
    """

    kind: str
    desired: bool
    values: Real
    joints: tuple[str, ...]

    @property
    def unit(self) -> str:
        """Of its values; stages are velocities."""
        return UNITS.get(self.kind, UNITS["velocity"])


def signals(run: Run) -> list[Signal]:
    """The signals of a run's joints: velocity, position, effort, stages; desired after measured."""
    names, desired = run.joint_names, run.desired_joint_names
    every: list[tuple[str, bool, Real | None, tuple[str, ...]]] = [
        ("velocity", False, run.velocity, names),
        ("velocity", True, run.velocity_desired, desired),
        ("position", False, run.position, names),
        ("position", True, run.position_desired, desired),
        ("effort", False, run.effort, names),
        *((f"stage {name}", False, stage, names) for name, stage in run.stages.items()),
    ]
    return [
        Signal(kind, wanted, values, joints)
        for kind, wanted, values, joints in every
        if values is not None
    ]


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
    whole = bool(run.mask.all())  # then a signal can stay in its file
    for kind, group in groupby(signals(run), key=lambda signal: signal.kind):
        both = list(group)[::-1]  # the first is drawn below the other
        paths = [
            log_signal(
                recording,
                f"/joints/{kind.replace(' ', '_')}{'_desired' * signal.desired}",
                signal if whole else replace(signal, values=signal.values[run.mask]),
                run.time[run.mask],
                limbs,
                suffix=" desired" * signal.desired,
                dim=signal.desired,
                points=POINTS,
            )
            for signal in both
        ]
        found += [
            Plot(limb, f"{kind} [{both[0].unit}]", tuple(p[limb] for p in paths if limb in p))
            for limb in limbs
        ]
    return found


def log_signal(
    recording: rr.RecordingStream,
    path: str,
    signal: Signal,
    time: Array,
    limbs: Mapping[str, tuple[str, ...]],
    *,
    suffix: str,
    dim: bool,
    points: int,
) -> dict[str, str]:
    """Log a signal, each limb as one entity.

    Args:
        recording: Where to.
        path: Entity path below which the limbs are numbered.
        signal: Of joints that are in a limb.
        time: Shape (samples,), in [s].
        limbs: The joints of each limb, which have the same colours in all signals.
        suffix: Of the joints' names.
        dim: Whether the colours are paler.
        points: How many each line may have at most.

    Returns:
        Entity path of each limb that has a joint with that signal.
    """
    shown, values = extremes(time, signal.values, points=points)
    paths = {}
    for number, (limb, joints) in enumerate(limbs.items()):
        colours = dict(zip(joints, colors.of_series(len(joints), dim=dim), strict=True))
        own = [name for name in joints if name in signal.joints]
        if own:
            paths[limb] = f"{path}/{number}"
            series.log_lines(
                recording,
                paths[limb],
                shown,
                np.ascontiguousarray(values[:, [signal.joints.index(name) for name in own]]),
                names=[name + suffix for name in own],
                colours=[colours[name] for name in own],
            )
    return paths
