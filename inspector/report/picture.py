"""A run over time as a picture on paper, as a recording shows it."""

import io
from collections import defaultdict
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from inspector import colors, levels
from inspector.analysis import Analysis, chosen, gaps, worst_joint, worst_signal
from inspector.levels import Scale
from inspector.orders import orders
from inspector.report.markdown import classes_of, spoken
from inspector.spectrogram import Spectrogram, spectrogram
from inspector.thinning import extremes
from noisemodel.noise import decibel
from noisemodel.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH, DPI = 9.6, 150
INK, LINE = "#24292f", "#0072b2"
POINTS = 4000
ORDERS, TIMES = 3, 6
"""Most orders that are written, and most times of each."""
ROW = 0.24
"""Height of a class, a joint or a link, in [inch]."""
SHADE = 0.35
"""Opacity of a finding behind a curve."""


def picture(analysis: Analysis, *, floor: float | None = None) -> bytes:
    """Draw an inspected run.

    Args:
        analysis: A run with what was found in it.
        floor: Level of the darkest colour of spectrograms, in [dB re 1 rad/s]; by the run if None.
    """
    from matplotlib.figure import Figure

    run, links = analysis.run, analysis.links
    names, ordered = classes_of(analysis), orders(analysis)
    strips = [_strip(analysis, *analysis.joint_levels, run.joint_names)]
    if links is not None:
        strips.append(_strip(analysis, *levels.link_levels(links), links.links))
    heights = {
        "classes": ROW * len(names) + 0.3 if names else 0.0,
        "noise": 1.3,
        "level": 1.2,
        "probability": 0.9 if _alarmed(analysis) else 0.0,
        "spectrogram": 2.2,
        "orders": 1.6 if ordered else 0.0,
        "joints": ROW * len(strips[0][2]) + 0.3 if run.joint_names else 0.0,
        "links": ROW * len(strips[1][2]) + 0.3 if links is not None else 0.0,
    }
    shown = {name: height for name, height in heights.items() if height}
    size = (WIDTH, sum(shown.values()) + 0.6)
    figure = Figure(figsize=size, dpi=DPI, layout="constrained")
    panels = figure.subplots(
        len(shown), 1, sharex=True, squeeze=False, height_ratios=list(shown.values())
    )[:, 0]
    axes: dict[str, Axes] = dict(zip(shown, panels, strict=True))
    if "classes" in axes:
        _classes(axes["classes"], analysis, names)
    _noise(axes["noise"], analysis)
    _level(axes["level"], analysis)
    if "probability" in axes:
        _probability(axes["probability"], analysis)
    worst = worst_joint(analysis)
    fast = worst_signal(analysis, worst)
    spectrum = spectrogram(fast, run.rate, start=float(run.time[0]), valid=run.mask)
    scale = levels.SPECTRUM.following(spectrum.decibel).down_to(floor)
    title = f"{'noise' if worst is None else run.joint_names[worst]}\n[Hz]"
    _spectrum(figure, axes["spectrogram"], spectrum, scale, title)
    if ordered is not None:
        joint, spectrum = ordered
        _spectrum(figure, axes["orders"], spectrum, scale, f"periods per turn\nof {joint}")
    if "joints" in axes:
        _strips(figure, axes["joints"], strips[0], levels.JOINTS.following(strips[0][1]), "joints")
    if links is not None:
        _strips(figure, axes["links"], strips[1], levels.LINKS.following(strips[1][1]), "links")
    for name, panel in axes.items():
        _gaps(panel, analysis, named=name == "noise")
    panels[-1].set_xlim(run.time[0], run.time[-1])
    panels[-1].set_xlabel("time [s]")
    file = io.BytesIO()
    figure.savefig(file, format="png", metadata={"Software": None})
    return file.getvalue()


def _alarmed(analysis: Analysis) -> bool:
    return analysis.labels is not None and analysis.alarm is not None


def _shade(color: colors.Color) -> tuple[float, float, float]:
    red, green, blue = (channel / 255 for channel in color)
    return red, green, blue


def _classes(axes: "Axes", analysis: Analysis, names: Sequence[str]) -> None:
    """Draw a row for each class: findings filled, annotations hatched."""
    shades = colors.of_classes(tuple(names))
    for row, name in enumerate(names):
        shade = _shade(shades[name])
        events = [(e.start, e.stop - e.start) for e in analysis.findings if e.label == name]
        others = [(start, stop - start) for start, stop, label in analysis.lane if label == name]
        axes.broken_barh(events or others, (row - 0.4, 0.45), facecolor=shade, edgecolor="none")
        blocks = [(b.start, b.stop - b.start) for b in analysis.run.blocks if b.label == name]
        axes.broken_barh(
            blocks, (row + 0.1, 0.3), facecolor="white", edgecolor=INK, linewidth=0.6, hatch="////"
        )
    axes.set_yticks(range(len(names)), list(map(spoken, names)), parse_math=False)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.grid(axis="x", alpha=0.3)
    hatched = "; hatched: annotated" if analysis.run.blocks else ""
    lines = [f"filled: found{hatched}", *_orders(analysis)]
    axes.set_title("\n".join(lines), fontsize=9, loc="left", parse_math=False)


def _orders(analysis: Analysis) -> list[str]:
    """List what goes with the speed of a joint, and when: a line for each order."""
    when: dict[str, list[str]] = defaultdict(list)
    for event, order in analysis.orders.items():
        when[str(order)].append(f"{event.start:.2f}")
    lines = [
        f"at {', '.join(times[:TIMES])}{', …' * (len(times) > TIMES)} s: {order}"
        for order, times in when.items()
    ]
    return [*lines[:ORDERS], *["…"] * (len(lines) > ORDERS)]


def _shaded(axes: "Axes", analysis: Analysis) -> None:
    """Shade the findings behind a curve."""
    shades = colors.of_classes(tuple(dict.fromkeys(event.label for event in analysis.findings)))
    for event in analysis.findings:
        shade = _shade(shades[event.label])
        axes.axvspan(event.start, event.stop, facecolor=shade, alpha=SHADE, linewidth=0)
    axes.grid(alpha=0.3)


def _noise(axes: "Axes", analysis: Analysis) -> None:
    run = analysis.run
    noise = np.where(run.mask, analysis.noise, np.nan)[:, None]
    time, values = extremes(run.time, noise, points=POINTS)
    axes.plot(time, values[:, 0], color=LINE, linewidth=0.7)
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel("noise p\u0302\n[rad/s]")
    _shaded(axes, analysis)


def _level(axes: "Axes", analysis: Analysis) -> None:
    time, level = analysis.noise_level
    axes.plot(time, level[:, 0], color=LINE, linewidth=0.9)
    axes.set_ylim(levels.FLOOR_DB + 20.0, 20.0)
    axes.set_ylabel("level above\n10 Hz [dB re\n1 rad/s]")
    _shaded(axes, analysis)


def _probability(axes: "Axes", analysis: Analysis) -> None:
    labels, alarm = analysis.labels, analysis.alarm
    assert labels is not None
    assert alarm is not None
    middles = (labels.start + labels.stop) / 2
    axes.plot(middles, 1.0 - labels.scores[:, 0], color=LINE, linewidth=0.9)
    axes.axhline(alarm, color=INK, linewidth=0.8, linestyle="--")
    right = axes.get_yaxis_transform()
    told = f"alarm above {alarm:g} "
    axes.text(1.0, alarm, told, transform=right, fontsize=8, ha="right", va="top")
    axes.set_ylim(0.0, 1.05)
    axes.set_ylabel("probability\nof a failure")
    _shaded(axes, analysis)


def _spectrum(
    figure: "Figure", axes: "Axes", spectrum: Spectrogram, scale: Scale, title: str
) -> None:
    """Draw a spectrogram on a logarithmic axis; what is not known stays white."""
    level = np.where(spectrum.valid, 2 * decibel(spectrum.amplitude), np.nan)
    _heat(figure, axes, spectrum.time, spectrum.frequency, level, scale)
    if len(spectrum.frequency) > 1:
        axes.set_yscale("log")
        axes.set_ylim(spectrum.frequency[0], spectrum.frequency[-1])
        axes.yaxis.set_major_formatter("{x:g}")
    axes.set_ylabel(title, parse_math=False)


def _strip(
    analysis: Analysis, time: Array, level: Array, names: Sequence[str]
) -> tuple[Array, Array, list[str]]:
    """Times, levels and names of the rows of those that vibrate most."""
    which = chosen(analysis, time, level)
    return time + levels.STEP / 2, level[:, which].T, [names[index] for index in which]


def _strips(
    figure: "Figure",
    axes: "Axes",
    strip: tuple[Array, Array, list[str]],
    scale: Scale,
    title: str,
) -> None:
    time, level, names = strip
    rows = np.arange(len(names), dtype=np.float64)
    _heat(figure, axes, time, rows, np.maximum(level, scale.low), scale)
    axes.set_yticks(range(len(names)), names, parse_math=False)
    axes.invert_yaxis()
    axes.set_title(f"{title} above 10 Hz", fontsize=9, loc="left")


def _heat(
    figure: "Figure", axes: "Axes", time: Array, rows: Array, level: Array, scale: Scale
) -> None:
    from matplotlib.colors import LinearSegmentedColormap

    shades = LinearSegmentedColormap.from_list("heat", list(colors.HEAT / 255))
    image = axes.pcolormesh(
        time, rows, level, cmap=shades, shading="nearest", vmin=scale.low, vmax=scale.high
    )
    figure.colorbar(image, ax=axes, pad=0.01, aspect=15, label=f"[{scale.unit}]")


def _gaps(axes: "Axes", analysis: Analysis, *, named: bool) -> None:
    """Hatch the gaps of a run, and name the first."""
    for place, (start, stop) in enumerate(gaps(analysis.run)):
        axes.axvspan(start, stop, facecolor="white", edgecolor=INK, linewidth=0.4, hatch="xxxx")
        if named and place == 0:
            above, middle = axes.get_xaxis_transform(), (start + stop) / 2
            axes.text(middle, 1.0, "gap", transform=above, fontsize=8, ha="center", va="bottom")
