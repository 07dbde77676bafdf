"""Details in a recording: raw samples around the worst moments."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr

from inspector import colors
from inspector.analysis.analyse import Analysis
from inspector.analysis.moments import Moment
from inspector.recording import series
from inspector.report.markdown import spoken
from inspector.thinning import extremes
from noisemodel.links import vibrating

SPAN = 0.5
"""Duration of a detail, in [s]."""
JOINTS = 5
POINTS = 10_000
"""Samples of a line; a run at 20 kHz or less is shown whole."""


@dataclass(frozen=True)
class Detail:
    """A moment as it was logged.

    Attributes:
        title: What it is, and when.
        path: Entity path under which ``noise`` and ``velocity`` lie.
        during: Start and stop, in [s].
    """

    title: str
    path: str
    during: tuple[float, float]


def log(
    recording: rr.RecordingStream, analysis: Analysis, moments: Sequence[Moment]
) -> list[Detail]:
    """Log noise, and the velocities of the joints that vibrate most, sample by sample.

    Args:
        recording: Where to.
        analysis: The run.
        moments: When.

    Returns:
        What was logged, in the order of the moments.
    """
    run, found = analysis.run, []
    for number, moment in enumerate(moments):
        edges = (moment.peak - SPAN / 2, moment.peak + SPAN / 2)
        first, last = np.searchsorted(run.time, edges)
        part = slice(int(first), int(last))
        valid = run.mask[part]
        velocity = run.velocity[part].astype(np.float64)
        energy = (vibrating(velocity, valid, run.rate) ** 2).sum(axis=0)
        joints = np.sort(np.argsort(-energy, kind="stable")[:JOINTS])
        path = f"/detail/{number}"
        time = run.time[part][valid]
        names = {"noise": ["simplified"], "velocity": [run.joint_names[i] for i in joints]}
        values = {"noise": analysis.noise[part, None], "velocity": velocity[:, joints]}
        for kind, lines in names.items():
            one = [colors.NOISE] if kind == "noise" else colors.of_series(len(lines))
            thin = extremes(time, values[kind][valid], points=POINTS)
            series.log_lines(recording, f"{path}/{kind}", *thin, names=lines, colours=one)
        found.append(Detail(f"{spoken(moment.label)} at {moment.peak:.2f} s", path, edges))
    return found
