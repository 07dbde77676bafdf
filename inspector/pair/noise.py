"""Both runs' noise in a recording, its levels and spectra, and by how much they differ."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr

from inspector import colors
from inspector.levels import SPECTRUM, Scale
from inspector.pair.changes import Change
from inspector.pair.classes import log_shades
from inspector.pair.colors import CHANGE, SHADES, SIDES
from inspector.pair.levels import Spectra, spectra, steps
from inspector.pair.pair import Pair
from inspector.recording import axes, rows, series
from inspector.recording.axes import Label, Panel
from inspector.recording.noise import HIGH_DB, LOW_DB, scaled
from inspector.spectrogram import in_bands
from inspector.thinning import extremes
from noisemodel.noise import REFERENCE_POWER, decibel
from noisemodel.types import Array

POINTS = 60_000
"""Of each run's noise."""
LOWEST_POWER_DB = -20.0
"""Sound power below this is drawn at it, in [dB re 1 pW]."""
DETAILS = 184.0
"""Height of the panels that lie behind each other."""
LEVEL, CHANGED, NOISE = Panel("level", 118.0), Panel("change", 84.0), Panel("noise", DETAILS)
BANDS, WIDTH = 48, 5.0
"""Of a spectrogram, and the height of one in points."""
SPAN_DB = 24.0
"""Change of level at the upper end of its axis, in [dB], or a multiple where it is larger."""


@dataclass(frozen=True)
class Ends:
    """Lower and upper ends of axes.

    Attributes:
        noise: Of the noise.
        change: Of the change of level, in [dB].
    """

    noise: tuple[float, float]
    change: tuple[float, float]


def log(recording: rr.RecordingStream, pair: Pair, found: Sequence[Change]) -> Ends:
    """Log noises and their levels every 50 ms, with what changed shaded.

    Args:
        recording: Where to.
        pair: The two runs.
        found: What changed between them.

    Returns:
        Lower and upper ends of the axes.
    """
    between = _log_noise(recording, pair)
    time, level = steps(pair)
    log_shades(recording, "/level/change", found, (LOW_DB, HIGH_DB))
    for place, (name, _) in enumerate(pair.sides):
        _log(recording, f"/level/{name}", time, level[:, place], SIDES[name])
    span = HIGH_DB - LOW_DB
    marks = [(mark, (mark - LOW_DB) / span) for mark in (-60.0, -40.0, -20.0, 0.0)]
    title = Label(0.62, "above 10 Hz\n[dB re\n1 rad/s]", -22.0)
    axes.log_left(recording, LEVEL, [title, *_written(marks, 44.0)])
    axes.log_right(recording, LEVEL, _sides())
    change = level[:, 1] - level[:, 0]
    peak = float(change[np.abs(change).argmax()])
    reach = SPAN_DB * max(float(np.ceil(abs(peak) / SPAN_DB)), 1.0)
    _log(recording, "/change/noise", time, change, axes.INK)
    _log(recording, "/change/none", time[[0, -1]], np.zeros(2), colors.CLASSES["unknown"])
    log_shades(recording, "/change/finding", found, (-reach, reach))
    marks = [(mark, 0.5 + mark / reach / 2) for mark in (-reach / 2, 0.0, reach / 2)]
    axes.log_left(recording, CHANGED, [Label(0.6, "change\n[dB]", -22.0), *_written(marks, 44.0)])
    axes.log_right(recording, CHANGED, [Label(0.5, f"largest\n{_signed(peak)}")])
    return Ends(between, (-reach, reach))


def log_spectra(recording: rr.RecordingStream, pair: Pair) -> dict[str, Panel]:
    """Log both spectrograms and their difference, as rows of colours on a logarithmic axis.

    Args:
        recording: Where to.
        pair: The two runs.

    Returns:
        Their panels by what they show; none where no window fits.
    """
    found = spectra(pair)
    if not len(found.time):
        return {}
    low, high = float(found.frequency[0]), float(found.frequency[-1])
    edges = np.geomspace(low, max(high, 1.01 * low), BANDS + 1)
    level = [_level(found, side, edges) for side in (0, 1)]
    shown: dict[str, tuple[Array, Scale]] = {
        "change": (level[1] - level[0], CHANGE),
        "before": (level[0], SPECTRUM),
        "after": (level[1], SPECTRUM),
    }
    gap = np.diff(found.time)
    half = (float(gap.min()) if len(gap) else 0.05) / 2
    times = np.append(found.time - half, found.time[-1] + half)
    names = [f"{centre:.0f} Hz" for centre in np.sqrt(edges[:-1] * edges[1:])[::-1]]
    panels = {}
    for what, (values, scale) in shown.items():
        panel = panels[what] = Panel(f"spectrum_{what}", DETAILS)
        shades = SHADES if what == "change" else rows.SHADES
        rgba = scale.colours(values[::-1], shades=shades)
        rows.log(recording, f"/spectrogram/{what}", times, rgba, names=names, width=WIDTH)
        marks = [
            Label(float(np.log(tick / low) / np.log(edges[-1] / low)), axes.hertz(tick), 40.0)
            for tick in axes.ticks(low, float(edges[-1]), panel)
        ]
        axes.log_left(recording, panel, [Label(0.5, f"spectrum\n{what}", -22.0), *marks])
        axes.log_scale(recording, panel, scale)
    return panels


def _level(found: Spectra, side: int, edges: Array) -> Array:
    """Level of each band of a side, at least the lowest of the scale, shape (bands, columns)."""
    amplitude = in_bands(found.frequency, found.amplitude[side], edges)
    return np.asarray(np.maximum(2 * decibel(amplitude), SPECTRUM.low))


def _log_noise(recording: rr.RecordingStream, pair: Pair) -> tuple[float, float]:
    loudest = np.concatenate([side.noise[side.run.mask] for _, side in pair.sides])
    scale, unit = scaled(loudest)
    for name, side in pair.sides:
        mask = side.run.mask
        time, values = extremes(pair.time[mask], side.noise[mask, None] / scale, points=POINTS)
        _log(recording, f"/noise/{name}", time, values[:, 0], SIDES[name])
        if side.links is not None:
            level = np.maximum(decibel(side.links.total / REFERENCE_POWER), LOWEST_POWER_DB)
            _log(recording, f"/power/{name}", side.links.time, level, SIDES[name])
    axes.log_left(recording, NOISE, [Label(0.5, f"noise p\u0302\n[{unit}]")])
    axes.log_right(recording, NOISE, _sides())
    return 0.0, 1.08 * max(float(loudest.max(initial=0.0)) / scale, 0.01)


def _sides() -> list[Label]:
    return [
        Label(place, name, color=SIDES[name]) for place, name in ((0.75, "before"), (0.4, "after"))
    ]


def _written(marks: Sequence[tuple[float, float]], shift: float) -> list[Label]:
    return [Label(place, _signed(mark).lstrip("+"), shift) for mark, place in marks]


def _signed(value: float) -> str:
    return f"{value:+.0f}".replace("-", "\u2212").replace("+0", "0")


def _log(
    recording: rr.RecordingStream, path: str, time: Array, values: Array, color: colors.Color
) -> None:
    name = path.rpartition("/")[2]
    series.log_lines(recording, path, time, values[:, None], names=[name], colours=[color])
