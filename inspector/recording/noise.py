"""Noise, its level, and the probability of a failure in a recording, with the findings shaded."""

from dataclasses import dataclass

import numpy as np
import rerun as rr

from inspector import colors
from inspector.analysis.analyse import Analysis
from inspector.recording import axes, classes, series
from inspector.recording.axes import Label, Panel
from inspector.recording.gaps import log_gaps
from inspector.thinning import extremes
from noisemodel import Run
from noisemodel.types import Array

POINTS = 100_000
NOISE, LEVEL = Panel("noise", 128.0), Panel("level", 120.0)
PROBABILITY = Panel("probability", 92.0)
LOW_DB, HIGH_DB = -80.0, 30.0
"""Ends of the level's axis, in [dB re 1 rad/s]."""


@dataclass(frozen=True)
class Curve:
    """A panel of a curve.

    Attributes:
        panel: The panel.
        path: Entity path below which its lines lie.
        between: Lower and upper end of its axis.
    """

    panel: Panel
    path: str
    between: tuple[float, float]


def log(recording: rr.RecordingStream, analysis: Analysis) -> list[Curve]:
    """Log the noise, its level above 10 Hz, and the probability of a failure if there is one.

    Args:
        recording: Where to.
        analysis: The run.

    Returns:
        Their panels, the first at the top.
    """
    curves = [_log_noise(recording, analysis), _log_level(recording, analysis)]
    if analysis.labels is not None and analysis.alarm is not None:
        curves.append(_log_probability(recording, analysis, analysis.alarm))
    for curve in curves:
        log_gaps(recording, curve.path, analysis.run, curve.between)
    return curves


def log_span(recording: rr.RecordingStream, run: Run) -> None:
    """Log that plots reach from the start of the run to its end, whatever they show."""
    ends = np.array([run.time[0], run.time[-1]])
    nothing = np.full((2, 1), np.nan)
    series.log_lines(recording, "/span", ends, nothing, names=[""], colours=[colors.THRESHOLD])


def scaled(values: Array) -> tuple[float, str]:
    """A power of ten by which the largest of some values has one digit, and the unit then.

    Args:
        values: In [rad/s].
    """
    largest = float(np.nanmax(values, initial=0.0))
    power = int(np.floor(np.log10(largest))) if largest > 0.0 else 0
    return 10.0**power, "rad/s" if power == 0 else f"{10.0**power:g} rad/s"


def _log_noise(recording: rr.RecordingStream, analysis: Analysis) -> Curve:
    run, noise = analysis.run, analysis.noise
    scale, unit = scaled(noise[run.mask])
    time, values = extremes(run.time[run.mask], noise[run.mask, None] / scale, points=POINTS)
    between = (0.0, 1.08 * max(float(values.max(initial=0.0)), 0.01))
    classes.log_shades(recording, "/noise/finding", analysis, between)
    names = [f"noise p\u0302 [{unit}]"]
    path = "/noise/simplified"
    series.log_lines(recording, path, time, values, names=names, colours=[colors.NOISE])
    axes.log_left(recording, NOISE, [Label(0.5, f"noise p\u0302\n[{unit}]")])
    peak = float(values.max(initial=0.0))
    axes.log_right(
        recording, NOISE, [Label(min(peak / between[1], 0.9), f"max\n{peak * scale:.3g}")]
    )
    return Curve(NOISE, "/noise", between)


def _log_level(recording: rr.RecordingStream, analysis: Analysis) -> Curve:
    between = (LOW_DB, HIGH_DB)
    time, level = analysis.noise_level
    classes.log_shades(recording, "/level/finding", analysis, between)
    names = ["noise above 10 Hz [dB re 1 rad/s]"]
    path = "/level/noise"
    series.log_lines(recording, path, time, level, names=names, colours=[colors.LEVEL])
    span = HIGH_DB - LOW_DB
    marks = [
        Label((mark - LOW_DB) / span, axes.written(mark), 44.0)
        for mark in (-60.0, -40.0, -20.0, 0.0)
    ]
    title = Label(0.62, "level above\n10 Hz [dB re\n1 rad/s]", -20.0)
    axes.log_left(recording, LEVEL, [title, *marks])
    peak = float(np.nanmax(level, initial=LOW_DB))
    place = min(max((peak - LOW_DB) / span, 0.05), 0.85)
    axes.log_right(recording, LEVEL, [Label(place, f"max\n{axes.written(peak)}")])
    return Curve(LEVEL, "/level", between)


def _log_probability(recording: rr.RecordingStream, analysis: Analysis, alarm: float) -> Curve:
    labels, run = analysis.labels, analysis.run
    assert labels is not None
    middles = (labels.start + labels.stop) / 2
    failure = 1.0 - labels.scores[:, :1]
    between = (0.0, 1.05)
    classes.log_shades(recording, "/probability/finding", analysis, between)
    # Between frames that a gap parts there is no line.
    apart = np.flatnonzero(labels.start[1:] > labels.stop[:-1] + 1.0 / run.rate) + 1
    middles = np.insert(middles, apart, labels.start[apart])
    failure = np.insert(failure, apart, np.nan, axis=0)
    path, shade = "/probability/failure", [colors.LEVEL]
    names = ["probability of a failure"]
    series.log_lines(recording, path, middles, failure, names=names, colours=shade)
    ends, path = np.array([run.time[0], run.time[-1]]), "/probability/alarm"
    names, shade = [f"alarm threshold {alarm:g}"], [colors.THRESHOLD]
    series.log_lines(recording, path, ends, np.full((2, 1), alarm), names=names, colours=shade)
    axes.log_left(recording, PROBABILITY, [Label(0.5, "probability\nof a failure")])
    axes.log_right(recording, PROBABILITY, [Label(alarm, f"alarm {alarm:g}")])
    return Curve(PROBABILITY, "/probability", between)
