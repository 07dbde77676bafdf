"""A run over time as a picture on paper, as a recording shows it."""

import io
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np

from inspector import colors, levels
from inspector.analysis import SHOWN, Analysis, chosen, gaps, worst_joint, worst_signal
from inspector.errors import InspectorError
from inspector.levels import Scale, Spectrogram, extremes, spectrogram
from inspector.reference.judging import Comparison
from inspector.report import classes_of, spoken
from noisemodel.noise import decibel
from noisemodel.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import QuadMesh
    from matplotlib.figure import Figure

WIDTH, DPI = 9.6, 120
INK, LINE = "#24292f", "#0072b2"
POINTS = 4000
ORDERS = 3  # most orders that are written
ROW = 0.24  # height of a class, a joint or a link, in [inch]
# Between panels, above one with a title, below and at the right of all, in [inch].
GAP, TITLE, BELOW, RIGHT = 0.14, 0.22, 0.55, 0.95
# Width of a letter and least width of labels, in [inch], and letters of a name that are shown.
LETTER, LABELS, LONGEST = 0.085, 1.2, 32
SHADE = 0.35  # opacity of a finding behind a curve
MOST_OVER_DB = 12.0  # largest level over the reference that has a colour of its own


def require(what: str = "a picture") -> None:
    """Refuse a picture, or what it is for, before long work is done for it."""
    if find_spec("matplotlib") is None:
        raise InspectorError(f'{what} needs matplotlib; `pip install "noise-inspector[report]"`')


def picture(analysis: Analysis, beside: Comparison | None = None) -> bytes:
    """Draw a run; how it compares with a reference takes the place of the probability."""
    run, links = analysis.run, analysis.links
    names = classes_of(analysis)
    strips = {"joints": (levels.JOINTS, _strip(analysis, *analysis.joint_levels, run.joint_names))}
    if links is not None:
        strip = _strip(analysis, *levels.link_levels(links), links.links)
        strips["links"] = levels.LINKS, strip
    beside = None if beside is None or beside.empty else beside
    over = [] if beside is None else beside.loudest(SHOWN)
    alarmed = analysis.labels is not None and analysis.alarm is not None and beside is None
    told = _told(analysis)
    panels = {
        "classes": (ROW * len(names), TITLE * len(told)),
        "noise": (1.2, 0.0),
        "level": (1.1, 0.0),
        "probability": (0.8 * alarmed, 0.0),
        "over": (ROW * len(over), TITLE),
        "spectrogram": (2.0, 0.0),
        **{name: (ROW * len(rows), TITLE) for name, (_, (*_, rows)) in strips.items()},
    }
    figure, axes = _panels(
        panels, (*names, *(n for _, (*_, rows) in strips.values() for n in rows))
    )
    if "classes" in axes:
        _classes(axes["classes"], analysis, names, told)
    _noise(axes["noise"], analysis)
    _level(axes["level"], analysis, beside)
    if alarmed:
        _probability(axes["probability"], analysis)
    if beside is not None:
        _over(axes["over"], beside)
    worst = worst_joint(analysis)
    fast = worst_signal(analysis, worst)
    spectrum = spectrogram(fast, run.rate, start=float(run.time[0]), valid=run.mask)
    scale = levels.SPECTRUM.following(spectrum.decibel)
    title = f"{'noise' if worst is None else _short(run.joint_names[worst])}\n[Hz]"
    _spectrum(axes["spectrogram"], spectrum, scale, title)
    for name, (own, (time, level, rows)) in strips.items():
        if name not in axes:
            continue
        scale = own.following(level)
        _heat(axes[name], time, range(len(rows)), np.maximum(level, scale.low), scale)
        _rows(axes[name], rows, f"{name} above 10 Hz")
    for name, panel in axes.items():
        _gaps(panel, analysis, named=name == "noise")
    axes["noise"].set_xlim(run.time[0], run.time[-1])
    return _png(figure)


def over_reference(beside: Comparison, title: str) -> bytes:
    """Draw how much louder a run is than its reference, by joint and time."""
    joints = [beside.joints[place] for place in beside.loudest(SHOWN)]
    panels = {"level": (1.1, TITLE), "over": (ROW * len(joints), TITLE)}
    figure, axes = _panels(panels, joints)
    _band(axes["level"], beside)
    axes["level"].set_title(title, fontsize=9, loc="left", parse_math=False)
    _over(axes["over"], beside)
    axes["level"].set_xlim(beside.time[0], beside.time[-1])
    return _png(figure)


def _panels(
    heights: Mapping[str, tuple[float, float]], names: Sequence[str]
) -> "tuple[Figure, dict[str, Axes]]":
    """A figure with panels over time below each other, those that have a height.

    Args:
        heights: Of each panel and of its title, in [inch].
        names: What stands at the left of rows.
    """
    from matplotlib.figure import Figure

    # Placing panels by hand takes half the time of matplotlib's layout.
    longest = max((len(_short(name)) for name in names), default=0)
    left = max(LABELS, LETTER * longest + 0.15)
    shown = {name: each for name, each in heights.items() if each[0]}
    height = sum(sum(each) + GAP for each in shown.values()) + BELOW
    figure = Figure(figsize=(WIDTH, height), dpi=DPI)
    axes: dict[str, Axes] = {}
    first, bottom = None, height
    for name, (own, above) in shown.items():
        bottom -= own + above + GAP
        place = (left / WIDTH, bottom / height, (WIDTH - left - RIGHT) / WIDTH, own / height)
        axes[name] = figure.add_axes(place, sharex=first)
        axes[name].tick_params(labelbottom=False)
        first = first or axes[name]
    last = axes[name]
    last.tick_params(labelbottom=True)
    last.set_xlabel("time [s]")
    return figure, axes


def _png(figure: "Figure") -> bytes:
    file = io.BytesIO()
    figure.savefig(file, format="png", metadata={"Software": None})
    return file.getvalue()


def _short(name: str) -> str:
    """A name that has room."""
    name = spoken(name)
    return name if len(name) <= LONGEST else f"{name[: LONGEST - 1]}…"


def _shade(color: colors.Color) -> tuple[float, float, float]:
    red, green, blue = (channel / 255 for channel in color)
    return red, green, blue


def _classes(axes: "Axes", analysis: Analysis, names: Sequence[str], told: Sequence[str]) -> None:
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
    axes.set_yticks(range(len(names)), list(map(_short, names)), parse_math=False)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.grid(axis="x", alpha=0.3)
    axes.set_title("\n".join(told), fontsize=9, loc="left", parse_math=False)


def _told(analysis: Analysis) -> list[str]:
    """What is drawn, and what goes with the speed of a joint: a line for each order."""
    lines = [f"at {event.start:.2f} s: {order}" for event, order in analysis.orders.items()]
    hatched = "; hatched: annotated" if analysis.run.blocks else ""
    return [f"filled: found{hatched}", *lines[:ORDERS], *["…"] * (len(lines) > ORDERS)]


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


def _level(axes: "Axes", analysis: Analysis, beside: Comparison | None) -> None:
    if beside is not None:
        _band(axes, beside)
    else:
        time, level = analysis.noise_level
        axes.plot(time, level[:, 0], color=LINE, linewidth=0.9)
        axes.set_ylim(levels.FLOOR_DB + 20.0, 20.0)
        axes.set_ylabel("level above\n10 Hz [dB re\n1 rad/s]")
    _shaded(axes, analysis)


def _band(axes: "Axes", beside: Comparison) -> None:
    """Draw the level of the noise, and the repetitions' level behind it."""
    low, high = beside.band.T
    axes.fill_between(beside.time, low, high, color=INK, alpha=0.25, linewidth=0)
    axes.plot(beside.time, high, color=INK, alpha=0.5, linewidth=0.6)
    axes.plot(beside.time, beside.noise, color=LINE, linewidth=0.9)
    axes.set_ylabel(f"level above\n{beside.octaves[0][0]:g} Hz [dB re\n1 rad/s]")
    axes.margins(y=0.15)
    told = "grey: repetitions" if np.isfinite(high).any() else "no repetitions"
    axes.text(1.01, 0.5, told.replace(": ", ":\n"), transform=axes.transAxes, fontsize=8)


def _over(axes: "Axes", beside: Comparison) -> None:
    """Draw by how much each joint is louder than the reference: those that are most."""
    which = beside.loudest(SHOWN)
    joints = [beside.joints[place] for place in which]
    over, rows, most = beside.by_joint[:, which].T, range(len(joints)), MOST_OVER_DB
    image = axes.pcolormesh(
        beside.time, rows, over, cmap="RdBu_r", shading="nearest", vmin=-most, vmax=most
    )
    for start, stop, evidence in beside.exceedances:
        if evidence.joint in joints and evidence.peak is not None:
            row = joints.index(evidence.joint)
            axes.plot([start, stop], [row, row], color=INK, linewidth=1.5)
            axes.plot(evidence.peak, row, "o", color=INK, markersize=4)
    _rows(axes, joints, "joints over the reference")
    _bar(axes, image, "[dB]")


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


def _spectrum(axes: "Axes", spectrum: Spectrogram, scale: Scale, title: str) -> None:
    """Draw a spectrogram on a logarithmic axis; what is not known stays white."""
    level = np.where(spectrum.valid, 2 * decibel(spectrum.amplitude), np.nan)
    _heat(axes, spectrum.time, spectrum.frequency, level, scale)
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


def _rows(axes: "Axes", names: Sequence[str], title: str) -> None:
    """Name rows at the left, the first above."""
    axes.set_yticks(range(len(names)), list(map(_short, names)), parse_math=False)
    axes.invert_yaxis()
    axes.set_title(title, fontsize=9, loc="left")


def _heat(axes: "Axes", time: Array, rows: Array | range, level: Array, scale: Scale) -> None:
    from matplotlib.colors import LinearSegmentedColormap

    shades = LinearSegmentedColormap.from_list("heat", list(colors.HEAT / 255))
    image = axes.pcolormesh(
        time, rows, level, cmap=shades, shading="nearest", vmin=scale.low, vmax=scale.high
    )
    _bar(axes, image, f"[{scale.unit}]")


def _bar(axes: "Axes", image: "QuadMesh", label: str) -> None:
    """Draw the scale of colours at the right."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    figure.colorbar(image, cax=axes.inset_axes((1.01, 0.0, 0.015, 1.0)), label=label)


def _gaps(axes: "Axes", analysis: Analysis, *, named: bool) -> None:
    """Hatch the gaps of a run, and name the first."""
    for place, (start, stop) in enumerate(gaps(analysis.run)):
        axes.axvspan(start, stop, facecolor="white", edgecolor=INK, linewidth=0.4, hatch="xxxx")
        if named and place == 0:
            above, middle = axes.get_xaxis_transform(), (start + stop) / 2
            axes.text(middle, 1.0, "gap", transform=above, fontsize=8, ha="center", va="bottom")
