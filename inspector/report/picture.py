"""A run over time as a picture on paper, as a recording shows it."""

import io
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from importlib.util import find_spec
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from inspector import colors, levels
from inspector.analysis import SHOWN, Analysis, chosen, gaps, worst_joint, worst_signal
from inspector.errors import InspectorError
from inspector.levels import Scale, extremes, spectrogram
from inspector.reference.judging import Comparison
from inspector.report import classes_of, spoken
from noisemodel.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import QuadMesh

WIDTH, DPI = 9.6, 120
INK, LINE = "#24292f", "#0072b2"
POINTS = 4000
# Labels of curves, and the levels that are shown, in [dB].
NOISE, FAILURE = "noise p\u0302\n[rad/s]", "probability\nof a failure"
LEVEL, LIMITS = "level above\n10 Hz [dB re\n1 rad/s]", (levels.FLOOR_DB + 20.0, 20.0)
ORDERS = 3  # most orders that are written
ROW = 0.24  # height of a class, a joint or a link, in [inch]
# Above a panel, for each more line of its title, below and at the right of all, in [inch].
GAP, TITLE, BELOW, RIGHT = 0.32, 0.22, 0.55, 0.95
# Width of a letter and least width of labels, in [inch], and letters of a name that are shown.
LETTER, LABELS, LONGEST = 0.085, 1.2, 32
SHADE = 0.35  # opacity of a finding behind a curve
# Height in [inch] of a panel over time, and what draws it.
Panel: TypeAlias = "tuple[float, Callable[[Axes], None]]"
MOST_OVER_DB = 12.0  # largest level over the reference that has a colour of its own


def require(what: str = "a picture") -> None:
    """Refuse a picture, or what it is for, before long work is done for it."""
    if find_spec("matplotlib") is None:
        raise InspectorError(f'{what} needs matplotlib; `pip install "noise-inspector[report]"`')


def picture(analysis: Analysis, beside: Comparison | None = None) -> bytes:
    """Draw a run; how it compares with a reference takes the place of the probability."""
    run, links, names = analysis.run, analysis.links, classes_of(analysis)
    beside = None if beside is None or beside.empty else beside
    told, labels, alarm = _told(analysis), analysis.labels, analysis.alarm
    noise = np.where(run.mask, analysis.noise, np.nan)[:, None]
    curve = partial(_curve, analysis=analysis)
    panels: list[Panel] = [
        (ROW * len(names), lambda axes: _classes(axes, analysis, names, told)),
        (1.2, partial(curve, of=extremes(run.time, noise, points=POINTS), label=NOISE)),
    ]
    if beside is not None:
        panels.append((1.1, partial(_band, beside=beside, analysis=analysis)))
        panels.append((ROW * len(beside.loudest(SHOWN)), partial(_over, beside=beside)))
    else:
        vibration = analysis.vibration_level
        panels.append((1.1, partial(curve, of=vibration, label=LEVEL, limits=LIMITS)))
    if beside is None and labels is not None and alarm is not None:
        failure = (labels.start + labels.stop) / 2, 1.0 - labels.scores[:, 0]
        shown = partial(curve, of=failure, label=FAILURE, limits=(0.0, 1.05), alarm=alarm)
        panels.append((0.8, shown))
    panels.append((2.0, lambda axes: _spectrum(axes, analysis)))
    left = list(names)
    strips = [("joints", levels.JOINTS, *analysis.joint_levels, run.joint_names)]
    if links is not None:
        strips.append(("links", levels.LINKS, *levels.link_levels(links), links.links))
    for what, scale, time, level, every in strips:
        which = chosen(analysis, time, level)  # those that vibrate most
        rows, level = [every[index] for index in which], level[:, which].T
        strip = partial(_strip, time=time, level=level, rows=rows, what=what, scale=scale)
        panels.append((ROW * len(rows), strip))
        left += rows
    return _drawn(panels, left, (run.time[0], run.time[-1]), gaps(run), lines=len(told))


def over_reference(beside: Comparison, title: str) -> bytes:
    """Draw how much louder a run is than its reference, by joint and time."""
    joints = [beside.joints[place] for place in beside.loudest(SHOWN)]
    panels: list[Panel] = [(1.1, partial(_band, beside=beside, title=title))]
    panels.append((ROW * len(joints), partial(_over, beside=beside)))
    return _drawn(panels, joints, (beside.time[0], beside.time[-1]))


def _drawn(
    panels: Sequence[Panel],
    labels: Sequence[str],
    span: tuple[float, float],
    missing: Sequence[tuple[float, float]] = (),
    lines: int = 1,
) -> bytes:
    """Draw panels over time below each other, those that have a height, as a PNG file.

    Args:
        labels: What stands at the left of rows.
        missing: Gaps of the run, which are hatched in each panel.
        lines: Of the title of the first panel.
    """
    from matplotlib.figure import Figure

    # Placing panels by hand takes half the time of matplotlib's layout.
    left = max(LABELS, LETTER * max((len(_short(name)) for name in labels), default=0) + 0.15)
    heights, draw = zip(*(each for each in panels if each[0]), strict=True)
    above, count, total = TITLE * (lines - 1) + GAP, len(heights), sum(heights)
    height = above + total + GAP * (count - 1) + BELOW
    figure = Figure(figsize=(WIDTH, height), dpi=DPI)
    place = {"left": left / WIDTH, "right": 1.0 - RIGHT / WIDTH, "bottom": BELOW / height}
    place |= {"top": 1.0 - above / height, "hspace": GAP * count / total}
    every = figure.subplots(
        count, sharex=True, squeeze=False, height_ratios=heights, gridspec_kw=place
    )[:, 0]
    for axes, one in zip(every, draw, strict=True):
        one(axes)
        for start, stop in missing:
            axes.axvspan(start, stop, facecolor="white", edgecolor=INK, linewidth=0.4, hatch="xxxx")
    every[0].set_xlim(*span)
    every[-1].set_xlabel("time [s]")
    file = io.BytesIO()
    figure.savefig(file, format="png", metadata={"Software": None})
    return file.getvalue()


def _short(name: str) -> str:
    """A name that has room."""
    name = spoken(name)
    return name if len(name) <= LONGEST else f"{name[: LONGEST - 1]}…"


def _shades(names: Iterable[str]) -> dict[str, tuple[float, float, float]]:
    """Colours of classes, as matplotlib takes them."""
    found = colors.of_classes(tuple(dict.fromkeys(names)))
    return {
        name: (red / 255, green / 255, blue / 255) for name, (red, green, blue) in found.items()
    }


def _classes(axes: "Axes", analysis: Analysis, names: Sequence[str], told: Sequence[str]) -> None:
    """Draw a row for each class: findings filled, annotations hatched."""
    shades = _shades(names)
    for row, name in enumerate(names):
        events = [(e.start, e.stop - e.start) for e in analysis.findings if e.label == name]
        others = [(start, stop - start) for start, stop, label in analysis.lane if label == name]
        axes.broken_barh(
            events or others, (row - 0.4, 0.45), facecolor=shades[name], edgecolor="none"
        )
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
    shades = _shades(event.label for event in analysis.findings)
    for event in analysis.findings:
        shade = shades[event.label]
        axes.axvspan(event.start, event.stop, facecolor=shade, alpha=SHADE, linewidth=0)
    axes.grid(alpha=0.3)


def _curve(
    axes: "Axes",
    of: tuple[Array, Array],
    label: str,
    analysis: Analysis,
    limits: tuple[float, float | None] = (0.0, None),
    alarm: float | None = None,
) -> None:
    """Draw values over time before the findings, with the threshold above which they alarm."""
    axes.plot(*of, color=LINE, linewidth=0.8)
    if alarm is not None:
        axes.axhline(alarm, color=INK, linewidth=0.8, linestyle="--")
        right, told = axes.get_yaxis_transform(), f"alarm above {alarm:g} "
        axes.text(1.0, alarm, told, transform=right, fontsize=8, ha="right", va="top")
    axes.set_ylim(*limits)
    axes.set_ylabel(label)
    _shaded(axes, analysis)


def _band(
    axes: "Axes", beside: Comparison, analysis: Analysis | None = None, title: str = ""
) -> None:
    """Draw the level of the noise, and the repetitions' level behind it."""
    low, high = beside.band.T
    axes.fill_between(beside.time, low, high, color=INK, alpha=0.25, linewidth=0)
    axes.plot(beside.time, high, color=INK, alpha=0.5, linewidth=0.6)
    axes.plot(beside.time, beside.noise, color=LINE, linewidth=0.9)
    axes.set_ylabel(f"level above\n{beside.octaves[0][0]:g} Hz [dB re\n1 rad/s]")
    axes.margins(y=0.15)
    told = "grey: repetitions" if np.isfinite(high).any() else "no repetitions"
    axes.text(1.01, 0.5, told.replace(": ", ":\n"), transform=axes.transAxes, fontsize=8)
    axes.set_title(title, fontsize=9, loc="left", parse_math=False)
    if analysis is not None:
        _shaded(axes, analysis)


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


def _spectrum(axes: "Axes", analysis: Analysis) -> None:
    """Draw the spectrogram of the worst joint; what is not known stays white."""
    run, worst = analysis.run, worst_joint(analysis)
    fast = worst_signal(analysis, worst)
    spectrum = spectrogram(fast, run.rate, start=float(run.time[0]), valid=run.mask)
    level = np.where(spectrum.valid, spectrum.decibel, np.nan)
    scale = levels.SPECTRUM.following(spectrum.decibel)
    _heat(axes, spectrum.time, spectrum.frequency, level, scale)
    if len(spectrum.frequency) > 1:
        axes.set_yscale("log")
        axes.set_ylim(spectrum.frequency[0], spectrum.frequency[-1])
        axes.yaxis.set_major_formatter("{x:g}")
    name = "noise" if worst is None else _short(run.joint_names[worst])
    axes.set_ylabel(f"{name}\n[Hz]", parse_math=False)


def _strip(
    axes: "Axes", time: Array, level: Array, rows: Sequence[str], what: str, scale: Scale
) -> None:
    """Draw the levels of joints or links, a row each."""
    scale = scale.following(level)
    _heat(axes, time + levels.STEP / 2, range(len(rows)), np.maximum(level, scale.low), scale)
    _rows(axes, rows, f"{what} above 10 Hz")


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
