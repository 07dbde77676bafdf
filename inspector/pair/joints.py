"""The joints of both runs in a recording, limb by limb: over each other, and their difference."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import rerun as rr

from inspector.pair.pair import Pair
from inspector.recording.joints import Plot, Signal, log_signal, signals

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
    before, after = (
        {_name(signal): signal for signal in signals(side.run)} for _, side in pair.sides
    )
    found = []
    for name in dict.fromkeys([*after, *before]):
        shown = {"before": before.get(name), "after": after.get(name)}
        shown["change"] = _difference(shown["before"], shown["after"])
        masks = (pair.before.run.mask, pair.after.run.mask, pair.valid)
        paths = {
            what: log_signal(
                recording,
                f"/joints/{name.replace(' ', '_')}/{what}",
                replace(signal, values=signal.values[mask]),
                pair.time[mask],
                limbs,
                suffix="" if what == "change" else f" {what}",
                dim=what == "before",
                points=POINTS,
            )
            for (what, signal), mask in zip(shown.items(), masks, strict=True)
            if signal is not None and mask.any()
        }
        unit = next(signal.unit for signal in shown.values() if signal is not None)
        for limb in limbs:
            both = [paths[what].get(limb) for what in ("before", "after") if what in paths]
            change = paths.get("change", {}).get(limb)
            if over := tuple(path for path in both if path):
                found.append(Plot(limb, f"{name} [{unit}]", over))
            if change:
                found.append(Plot(limb, f"change of {name} [{unit}]", (change,)))
    return found


def _name(signal: Signal) -> str:
    return f"desired {signal.kind}" if signal.desired else signal.kind


def _difference(before: Signal | None, after: Signal | None) -> Signal | None:
    """A signal after less before, of the joints that are in both."""
    if before is None or after is None:
        return None
    joints = tuple(name for name in after.joints if name in before.joints)
    was, now = (
        np.asarray(each.values[:, [each.joints.index(name) for name in joints]], dtype=np.float64)
        for each in (before, after)
    )
    return replace(after, values=now - was, joints=joints)
