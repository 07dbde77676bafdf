"""The joints of both runs in a recording, limb by limb: over each other, and their difference."""

from collections.abc import Iterator, Mapping

import numpy as np
import rerun as rr

from inspector import colors
from inspector.pair.pair import Pair
from inspector.recording import series
from inspector.recording.joints import Plot
from inspector.thinning import extremes
from noisemodel import Run
from noisemodel.types import Real

POINTS = 2000
"""Of a line: there are three for each signal of a joint."""


def log(
    recording: rr.RecordingStream, pair: Pair, limbs: Mapping[str, tuple[str, ...]]
) -> list[Plot]:
    """Log the joints' signals of both runs, paler before, and after less before.

    Args:
        recording: Where to.
        pair: The two runs.
        limbs: The joints of each limb, of either run.

    Returns:
        Two plots of each signal and limb; no difference where no joint is in both runs.
    """
    found = []
    after = _signals(pair.after.run)
    before = _signals(pair.before.run)
    for kind in dict.fromkeys([*after, *before]):
        columns: dict[str, dict[str, Real]] = {
            "before": before.get(kind, {}),
            "after": after.get(kind, {}),
        }
        shared = [joint for joint in columns["after"] if joint in columns["before"]]
        columns["change"] = {j: columns["after"][j] - columns["before"][j] for j in shared}
        masks = (pair.before.run.mask, pair.after.run.mask, pair.valid)
        for number, (limb, joints) in enumerate(limbs.items()):
            paths = {}
            for (what, signals), mask in zip(columns.items(), masks, strict=True):
                own = [joint for joint in joints if joint in signals]
                if not own or not mask.any():
                    continue
                paths[what] = f"/joints/{kind.split(' [')[0].replace(' ', '_')}/{what}/{number}"
                values = np.stack([signals[joint][mask] for joint in own], axis=1)
                every = colors.of_series(len(joints), dim=what == "before")
                series.log_lines(
                    recording,
                    paths[what],
                    *extremes(pair.time[mask], values, points=POINTS),
                    names=[joint if what == "change" else f"{joint} {what}" for joint in own],
                    colours=[c for joint, c in zip(joints, every, strict=True) if joint in own],
                )
            found += list(_plots(limb, kind, paths))
    return found


def _plots(limb: str, kind: str, paths: Mapping[str, str]) -> Iterator[Plot]:
    over = tuple(paths[what] for what in ("before", "after") if what in paths)
    if over:
        yield Plot(limb, kind, over)
    if "change" in paths:
        yield Plot(limb, f"change of {kind}", (paths["change"],))


def _signals(run: Run) -> dict[str, dict[str, Real]]:
    """Take a run apart: kind with its unit, joint, values."""
    wanted = run.desired_joint_names
    signals = [
        ("velocity [rad/s]", run.velocity, run.joint_names),
        ("desired velocity [rad/s]", run.velocity_desired, wanted),
        ("position [rad]", run.position, run.joint_names),
        ("desired position [rad]", run.position_desired, wanted),
        ("effort [N m]", run.effort, run.joint_names),
        *((f"stage {name} [rad/s]", stage, run.joint_names) for name, stage in run.stages.items()),
    ]
    return {
        kind: dict(zip(joints, np.asarray(values, dtype=np.float64).T, strict=True))
        for kind, values, joints in signals
        if values is not None
    }
