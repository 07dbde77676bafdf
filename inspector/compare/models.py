"""Comparisons of noise models: CSV, a recording of heat maps, a table and curves, and a picture.

The picture shows terms, correlation, and distance by frequency.
"""

import csv
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from rerun.blueprint import Blueprint

from inspector import colors
from inspector.errors import InspectorError
from inspector.levels import Scale, spectrogram
from inspector.recording import axes, unstable
from inspector.recording.axes import Label, Panel
from inspector.recording.panels import HEIGHT, log_panel
from inspector.recording.run import writing
from inspector.recording.unstable import Part
from inspector.report.picture import require
from inspector.text import cell
from noisemodel import Comparison, Comparisons
from noisemodel.compare import TERMS, medians
from noisemodel.files import refuse_existing, replacing
from noisemodel.noise import decibel, vibrating
from noisemodel.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STEP = 0.01
"""Time over which a level is taken, in [s]."""
FLOOR_DB = -60.0
"""Levels below this are drawn at it, in [dB]."""
RANGE_DB = (-25.0, 20.0)
"""What is drawn: the same for all, so that heights compare, in [dB]."""
SPECTRUM = Scale(-60.0, 10.0, "dB re its own rms")
PARTS = {"vibration": "above 10 Hz", "level": "whole motion"}
CELL = (96, 44)
"""Width and height of a cell of the heat maps, in points."""
NAMED = (150, 40)
"""Width of the names of robots, and height of the names of kinds."""
MAPS = {
    "correlation": "Correlation of the envelope with {}: 1 is dark",
    "distance": "Distance of the spectrum to {} [dB]: 0 is dark",
}
WORST_DB = 10.0
"""Distance with the lightest colour, in [dB]: independent noises are about as far apart."""
LIGHTEST = 0.75
"""Place on the palette of what is farthest: numbers have to be read on it."""
WHOLE, WIDE, TITLES = 832.0, 720.0, 28.0
"""Height of all parts, width of half of them, height of tabs, in points, at 1440 x 900."""


def write(found: Comparisons, path: Path, *, overwrite: bool = False) -> None:
    """Write comparisons as one recording, whole or not at all."""
    text = str(found)
    # The same comparison has the same id: opened again, it replaces itself in the viewer.
    identity = hashlib.sha256("\n".join([text, *(one.name for one in found)]).encode())
    with writing(path, identity.hexdigest(), overwrite=overwrite) as recording:
        recording.send_blueprint(layout(found))  # takes the place of an older layout
        for name in MAPS:
            _log_map(recording, found, name)
        begin, end = min(one.time[0] for one in found), max(one.time[-1] for one in found)
        axes.log_span(recording, float(begin), float(end))
        for one in found:
            _log(recording, one)
        document = rr.TextDocument(f"```\n{text}\n```", media_type="text/markdown")
        recording.log("/report", document, static=True)
        recording.send_recording_name(f"noise models: {', '.join(one.name for one in found)}")


def levels(one: Comparison, pressure: Array) -> tuple[Array, Array]:
    """Level of each estimate every 10 ms, relative to its own root mean square.

    Args:
        pressure: Its pressures, or a part of them, shape (kinds, samples).

    Returns:
        Centres of the steps, shape (steps,), in [s], and levels, shape (steps, kinds), in [dB].
    """
    size = max(1, round(STEP * one.rate))
    firsts = np.arange(0, len(one.time), size)
    counts = np.diff(np.append(firsts, len(one.time)))
    power = np.add.reduceat(pressure**2, firsts, axis=1) / counts
    mean = np.mean(pressure**2, axis=1)
    level = decibel(power.T / np.where(mean > 0.0, mean, 1.0))
    return one.time[firsts] + counts / 2 / one.rate, np.maximum(level, FLOOR_DB)


def layout(found: Comparisons) -> Blueprint:
    """Lay out a recording: heat maps and table first, then one tab per robot."""
    reference = found[0].kinds[found[0].reference]
    columns, rows = len(found[0].kinds), len(found)
    across, down = (-NAMED[0], CELL[0] * columns), (-NAMED[1], CELL[1] * rows)
    maps: list[tuple[Part, float]] = [
        (
            unstable.picture(
                title.format(f"\u2018{reference}\u2019"), f"/overview/{name}", across, down
            ),
            1.0,
        )
        for name, title in MAPS.items()
    ]
    table = unstable.text("Table", "/report")
    # A map is as wide as half of the window: its cells are larger or smaller than drawn.
    grown = WIDE / (NAMED[0] + CELL[0] * columns)
    share = min(grown * (max(rows, 3) * CELL[1] + NAMED[1]) + 2 * TITLES, 520.0)
    overview = unstable.above(
        (unstable.beside(*maps), share), (table, WHOLE - share), name="Robots"
    )
    return unstable.blueprint(unstable.tabs(overview, *map(_robot, found)))


def cells(found: Comparisons, name: str) -> Array:
    """The numbers of a heat map.

    Args:
        name: "correlation" of the envelopes or "distance" of the spectra in [dB], to the reference.
    """
    return np.stack([getattr(one, name)[:, one.reference] for one in found])


def shades(numbers: Array, name: str) -> NDArray[np.uint8]:
    """Colour the numbers of a heat map: the farther from the reference, the lighter.

    Returns:
        Red, green and blue, shape (robots, kinds, 3); NaN has the background's.
    """
    far = 1.0 - numbers if name == "correlation" else numbers / WORST_DB
    rgb = colors.heat(LIGHTEST * np.clip(np.nan_to_num(far), 0.0, 1.0))[..., :3]
    return np.where(
        np.isnan(numbers)[..., None], np.array(colors.BACKGROUNDS[0], dtype=np.uint8), rgb
    )


def _log_map(recording: rr.RecordingStream, found: Comparisons, name: str) -> None:
    """Log a heat map, robots by kinds, with its numbers."""
    numbers = cells(found, name)
    image = shades(numbers, name).repeat(CELL[1] - 2, axis=0).repeat(CELL[0] - 2, axis=1)
    framed = np.zeros((len(found), CELL[1], len(found[0].kinds), CELL[0], 3), dtype=np.uint8)
    framed[:] = colors.BACKGROUNDS[0]
    shape = (len(found), CELL[1] - 2, len(found[0].kinds), CELL[0] - 2, 3)
    framed[:, 1:-1, :, 1:-1] = image.reshape(shape)
    size = (len(found) * CELL[1], len(found[0].kinds) * CELL[0], 3)
    path = f"/overview/{name}"
    recording.log(f"{path}/cells", rr.Image(framed.reshape(size)), static=True)
    texts, places = [], []
    for row, one in enumerate(found):
        y = CELL[1] * (row + 0.5)
        texts.append(_short(one.name))
        places.append((-NAMED[0] / 2, y))
        for column, number in enumerate(numbers[row].tolist()):
            if not np.isnan(number):
                texts.append(f"{number:.2f}" if name == "correlation" else f"{number:.1f}")
                places.append((CELL[0] * (column + 0.5), y))
    for column, kind in enumerate(found[0].kinds):
        texts.append(kind)
        places.append((CELL[0] * (column + 0.5), -NAMED[1] / 2))
    labels = rr.Points2D(
        [(x, y - axes.TEXT) for x, y in places],
        labels=texts,
        colors=[axes.INK] * len(texts),
        radii=rr.Radius.ui_points(0.0),
        show_labels=True,
    )
    recording.log(f"{path}/numbers", labels, static=True)


def _short(name: str) -> str:
    """The name of a robot, or of the file of a run, that fits beside its row."""
    stem = Path(name).stem if "/" in name else name
    return stem if len(stem) <= 18 else f"\u2026{stem[-17:]}"


def _log(recording: rr.RecordingStream, one: Comparison) -> None:
    whole = np.ones(len(one.time), dtype=bool)
    pressures = {"vibration": vibrating(one.pressure.T, whole, one.rate).T, "level": one.pressure}
    shown = dict(zip(one.kinds, colors.of_series(len(one.kinds)), strict=True))
    for part, pressure in pressures.items():
        time, level = levels(one, pressure)
        for index, (kind, color) in enumerate(shown.items()):
            axes.log_line(
                recording, f"{_root(one)}/{part}/{kind}", time, level[:, index], color, name=kind
            )
        panel = _panel(one, part)
        axes.log_left(recording, panel, [Label(0.5, f"{PARTS[part]}\n[dB re its rms]")])
        named = [
            Label(1.0 - (row + 0.5) / max(len(shown), 6), kind, color=color)
            for row, (kind, color) in enumerate(shown.items())
        ]
        axes.log_right(recording, panel, named)
    for kind, pressure in zip(one.kinds, one.pressure, strict=True):
        spectrum = spectrogram(pressure, one.rate, start=float(one.time[0]), valid=whole)
        log_panel(recording, _panel(one, f"spectrogram/{kind}"), spectrum, SPECTRUM, kind)
    labels = tuple(dict.fromkeys(event.label for event in one.events))
    states = dict(zip(labels, colors.of_series(len(labels)), strict=True))
    panel = _panel(one, "events")
    for row, label in enumerate(labels):
        own = [(event.start, event.stop) for event in one.events if event.label == label]
        path, place = f"{_root(one)}/events/{label}", (row, len(labels))
        axes.log_row(recording, path, label, own, states[label], place, (0.15, 0.85))
    axes.log_left(recording, panel, axes.row_labels(labels) or [Label(0.5, "no events")])
    axes.log_right(recording, panel, [Label(0.5, "events")])


def _panel(one: Comparison, part: str) -> Panel:
    """A panel of a robot, by what lies below the robot's entity."""
    labels = len(dict.fromkeys(event.label for event in one.events))
    events = 20.0 * max(labels, 2) + axes.AXIS
    curves = (WHOLE - events - HEIGHT - 2 * TITLES) / 2
    height = {"events": events, "vibration": curves, "level": curves}
    return Panel(f"{_root(one)[1:]}/{part}", height.get(part, HEIGHT))


def _robot(one: Comparison) -> Part:
    """The tab of a robot or run: events, levels and spectrograms."""
    ends = {"events": (0.0, axes.TOP), "vibration": RANGE_DB, "level": RANGE_DB}
    parts = [
        axes.timed(_panel(one, part), title="", between=between) for part, between in ends.items()
    ]
    spectrograms = [
        axes.timed(_panel(one, f"spectrogram/{kind}"), title="", name=kind, paths=("$origin/**",))[
            0
        ]
        for kind in one.kinds
    ]
    details = (unstable.tabs(*spectrograms), HEIGHT + TITLES)
    return unstable.above(*parts, details, name=_short(one.name))


def _root(one: Comparison) -> str:
    return f"/{rr.escape_entity_path_part(one.name)}"


MOST = 8
"""Robots that a recording may hold; more make the viewer too slow."""


@dataclass(frozen=True)
class Outputs:
    """What to write; None is not written.

    Attributes:
        csv: All numbers.
        recording: For the viewer.
        picture: A PNG file.
        overwrite: Whether files that exist may be replaced.
    """

    csv: Path | None = None
    recording: Path | None = None
    picture: Path | None = None
    overwrite: bool = False

    def check(self, count: int) -> None:
        """Refuse what cannot be written before long work is done for it."""
        for path in filter(None, (self.csv, self.recording, self.picture)):
            refuse_existing(path, overwrite=self.overwrite)
        if self.recording and count > MOST:
            raise InspectorError(
                f"{self.recording}: a recording holds {MOST} robots and runs at most, not {count};"
                " name some of them, or write --csv and --picture alone"
            )
        if self.picture:
            require()

    def write(self, found: Comparisons) -> None:
        """Write the files."""
        if self.csv:
            write_csv(found, self.csv, overwrite=self.overwrite)
        if self.recording:
            write(found, self.recording, overwrite=self.overwrite)
        if self.picture:
            draw(found, self.picture, overwrite=self.overwrite)


def write_csv(found: Comparisons, path: Path, *, overwrite: bool = False) -> None:
    """Write a row for each robot and kind, with the columns of ``Comparisons.to_arrow``."""
    table = found.to_arrow()
    with (
        replacing(path, overwrite=overwrite) as temporary,
        temporary.open("w", newline="", encoding="utf-8") as file,
    ):
        writer = csv.DictWriter(file, table.column_names, lineterminator="\n")
        writer.writeheader()
        for row in table.to_pylist():
            writer.writerow({name: _cell(name, value) for name, value in row.items()})


def _cell(name: str, value: str | bool | int | float) -> str | int:
    """Print a number as the CSV of earlier versions did."""
    if isinstance(value, float):
        return f"{value:g}" if name == "rate_hz" else f"{value:.4f}"
    if isinstance(value, str):
        return cell(value)
    return int(value) if isinstance(value, bool) else value


TERM_COLORS = ("#3b3b6d", "#d98c4a", "#f2e3c4")
"""Of A, B and C: dark, middle and light, so that they differ in grey too."""
CURVES = ("#d55e00", "#0072b2", "#000000", "#009e73", "#cc79a7", "#56b4e9", "#e69f00")
MARKERS = "ovs^DPX"
LINES = ("-", "--", "-", ":", "-.", (0, (1, 1)), (0, (5, 1)))
ROBOT = 0.17
"""Height of a robot, in [inch]."""
INDEPENDENT_DB = 10.0 / np.log(10.0) * np.pi / np.sqrt(3.0)
"""Distance of two independent noises with the same mean spectrum, in [dB]."""
THIRDS = 20.0 * 2.0 ** (np.arange(25) / 3.0)
"""Centres of thirds of octaves, from 20 to 5120 Hz, in [Hz]."""
ACROSS, MARGIN, BELOW = 10.0, 1.3, 3.0
DPI = 100


def draw(found: Comparisons, path: Path, *, overwrite: bool = False) -> None:
    """Draw what was found as a PNG file."""
    require()
    from matplotlib.figure import Figure

    # Robots with a fixed base first, those on top for which A and B count least.
    order = sorted(found, key=lambda one: (one.floating_base, -_terms(one)[2]))
    rows = ROBOT * max(len(order), 6)
    figure = Figure(figsize=(ACROSS, rows + MARGIN + BELOW), dpi=DPI, layout="constrained")
    parts = figure.subfigures(2, 1, squeeze=False, height_ratios=[rows + MARGIN, BELOW])
    upper, lower = parts[:, 0]
    left, right = upper.subplots(1, 2, sharey=True)
    _shares(left, order)
    _correlations(right, order)
    _spectra(lower, order)
    with replacing(path, overwrite=overwrite) as temporary:
        figure.savefig(temporary, format="png")


def _shares(panel: "Axes", found: Sequence[Comparison]) -> None:
    terms = np.array([_terms(one) for one in found])
    starts = np.cumsum(terms, axis=1) - terms
    for index, (term, color) in enumerate(zip(TERMS, TERM_COLORS, strict=True)):
        panel.barh(
            np.arange(len(found)),
            terms[:, index],
            left=starts[:, index],
            color=color,
            edgecolor="black",
            linewidth=0.3,
            label=term,
        )
    names = [f"{one.name} (floating)" if one.floating_base else one.name for one in found]
    panel.set_yticks(np.arange(len(found)), names, fontsize=7)
    panel.set_ylim(len(found) - 0.4, -0.6)
    panel.set_xlim(0.0, 1.0)
    panel.set_xlabel("share of the paper's terms A, B, C in its power")
    _legend(panel)


def _correlations(panel: "Axes", found: Sequence[Comparison]) -> None:
    kinds, reference = found[0].kinds, found[0].reference
    for number, index in enumerate(_others(found)):
        panel.plot(
            [one.correlation[index, reference] for one in found],
            np.arange(len(found)),
            MARKERS[number],
            color=CURVES[number],
            markerfacecolor="none" if number % 2 else CURVES[number],
            markersize=4.5,
            label=kinds[index],
        )
    panel.set_xlim(right=1.05)
    panel.grid(alpha=0.4)
    panel.set_xlabel(f"correlation of the envelope with {kinds[reference]!r}")
    _legend(panel)


def _spectra(figure: "Figure", found: Sequence[Comparison]) -> None:
    """Draw distance over frequency, fixed and floating bases side by side where there are both."""
    groups = [[one for one in found if one.floating_base == floating] for floating in (False, True)]
    groups = [group for group in groups if group]
    panels = figure.subplots(1, len(groups), sharey=True, squeeze=False)[0]
    kinds, reference = found[0].kinds, found[0].reference
    for panel, group in zip(panels, groups, strict=True):
        for number, index in enumerate(_others(found)):
            distance = medians([_by_third(one, index) for one in group])
            panel.plot(THIRDS, distance, color=CURVES[number], ls=LINES[number], label=kinds[index])
        base = "floating base" if group[0].floating_base else "fixed base"
        panel.set_title(f"{base}, median of {len(group)}", fontsize=9)
        panel.set_xscale("log")
        panel.axhline(INDEPENDENT_DB, color="grey", lw=0.8, label="independent noises")
        panel.grid(alpha=0.4)
        panel.set_xlabel("frequency [Hz]")
    panels[0].set_ylabel(f"distance to {kinds[reference]!r} [dB]")
    panels[0].set_ylim(0.0, 1.35 * panels[0].get_ylim()[1])
    for panel in panels:
        panel.legend(loc="upper center", ncols=3, frameon=False, fontsize=8)


def _legend(panel: "Axes") -> None:
    panel.legend(
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
        ncols=7,
        frameon=False,
        fontsize=8,
        handlelength=1.2,
        columnspacing=1.0,
    )


def _by_third(one: Comparison, kind: int) -> Array:
    """Distance to the reference in each third of an octave, in [dB]; nan where there is none."""
    squares = one.distance_by_frequency[kind, one.reference] ** 2
    third = np.rint(3.0 * np.log2(np.maximum(one.frequency, 1.0) / THIRDS[0]))
    inside = [third == index for index in range(len(THIRDS))]
    return np.array([np.sqrt(squares[at].mean()) if at.any() else np.nan for at in inside])


def _others(found: Sequence[Comparison]) -> list[int]:
    return [index for index in range(len(found[0].kinds)) if index != found[0].reference]


def _terms(one: Comparison) -> Array:
    return np.asarray(one.terms.sum(axis=0))
