"""A run over time as a picture on paper: classes, noise, spectrogram, loudest links."""

import io
from collections import defaultdict
from typing import TYPE_CHECKING

import numpy as np

from inspector import colors
from inspector.analysis.analyse import Analysis
from inspector.spectrogram import spectrogram
from inspector.thinning import extremes
from noisemodel.links import LinkNoise
from noisemodel.noise import REFERENCE_POWER, decibel

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH, DPI = 9.6, 150
INK = "#24292f"
POINTS = 4000
TOP_HZ = 2000.0
LINKS = 12
ORDERS, TIMES = 3, 6
"""Most orders that are written, and most times of each."""
LINK_RANGE_DB = 50.0
ROW = 0.24
"""Height of a class or a link, in [inch]."""


def picture(analysis: Analysis) -> bytes:
    """Draw an inspected run.

    Args:
        analysis: A run with what was found in it.

    Returns:
        A PNG file.
    """
    from matplotlib.figure import Figure

    links = analysis.links
    rows = [_class_names(analysis), [], [], links.links[:LINKS] if links else []]
    heights = [ROW * len(rows[0]) + 0.3, 1.5, 2.4, ROW * len(rows[3]) + 0.3]
    shown = [0, 1, 2, 3] if links else [0, 1, 2]
    shown = shown if rows[0] else shown[1:]
    figure = Figure(
        figsize=(WIDTH, sum(heights[i] for i in shown) + 0.6), dpi=DPI, layout="constrained"
    )
    panels = figure.subplots(
        len(shown), 1, sharex=True, squeeze=False, height_ratios=[heights[i] for i in shown]
    )[:, 0]
    axes = dict(zip(shown, panels, strict=True))
    if 0 in axes:
        _classes(axes[0], analysis)
    _noise(axes[1], analysis)
    _spectrogram(figure, axes[2], analysis)
    if links:
        _links(figure, axes[3], links)
    run = analysis.run
    panels[-1].set_xlim(run.time[0], run.time[-1])
    panels[-1].set_xlabel("time [s]")
    file = io.BytesIO()
    figure.savefig(file, format="png", metadata={"Software": None})
    return file.getvalue()


def _class_names(analysis: Analysis) -> list[str]:
    labels = analysis.labels
    known = [] if labels is None else list(labels.classes)
    others = {event.label for event in analysis.findings}
    others |= {block.label for block in analysis.run.blocks}
    return [*known, *sorted(others - set(known))]


def _classes(axes: "Axes", analysis: Analysis) -> None:
    """Draw a row for each class: findings filled, annotations hatched."""
    names = _class_names(analysis)
    shades = colors.of_classes(tuple(names))
    for row, name in enumerate(names):
        shade = tuple(channel / 255 for channel in shades[name])
        found = [(e.start, e.stop - e.start) for e in analysis.findings if e.label == name]
        axes.broken_barh(found, (row - 0.4, 0.4), facecolor=shade, edgecolor=INK, linewidth=0.6)
        blocks = [(b.start, b.stop - b.start) for b in analysis.run.blocks if b.label == name]
        axes.broken_barh(
            blocks, (row + 0.0, 0.4), facecolor="white", edgecolor=INK, linewidth=0.6, hatch="////"
        )
    axes.set_yticks(range(len(names)), names, parse_math=False)
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


def _noise(axes: "Axes", analysis: Analysis) -> None:
    run = analysis.run
    time, noise = extremes(
        run.time, np.where(run.mask, analysis.noise, np.nan)[:, None], points=POINTS
    )
    axes.plot(time, noise[:, 0], color="#0072b2", linewidth=0.7)
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel("noise [rad/s]")
    axes.grid(alpha=0.3)


def _spectrogram(figure: "Figure", axes: "Axes", analysis: Analysis) -> None:
    run = analysis.run
    shown = spectrogram(analysis.noise, run.rate, start=float(run.time[0]), valid=run.mask)
    kept = shown.frequency <= max(TOP_HZ, shown.frequency[0])  # of a few samples there is one
    image = axes.pcolormesh(
        shown.time, shown.frequency[kept], shown.level[kept], cmap="inferno", shading="nearest"
    )
    axes.set_ylabel("frequency [Hz]")
    figure.colorbar(image, ax=axes, pad=0.01, aspect=15, label="noise [dB]")


def _links(figure: "Figure", axes: "Axes", links: LinkNoise) -> None:
    order = links.loudest[:LINKS]
    level = decibel(np.maximum(links.vibration[:, order].T, REFERENCE_POWER) / REFERENCE_POWER)
    top = float(level.max())
    image = axes.pcolormesh(
        links.time,
        np.arange(len(order)),
        level,
        cmap="inferno",
        shading="nearest",
        vmin=top - LINK_RANGE_DB,
        vmax=top,
    )
    axes.set_yticks(range(len(order)), [links.links[i] for i in order], parse_math=False)
    axes.invert_yaxis()
    axes.set_title("loudest links, above 10 Hz", fontsize=9, loc="left")
    figure.colorbar(image, ax=axes, pad=0.01, aspect=15, label="[dB re 1 pW]")
