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
    """Write comparisons as one recording, whole or not at all: heat maps, table, tabs of robots."""
    text = str(found)
    # The same comparison has the same id: opened again, it replaces itself in the viewer.
    identity = hashlib.sha256("\n".join([text, *(one.name for one in found)]).encode())
    with writing(path, identity.hexdigest(), overwrite=overwrite) as recording:
        maps = [(_log_map(recording, found, name), 1.0) for name in MAPS]
        begin, end = min(one.time[0] for one in found), max(one.time[-1] for one in found)
        axes.log_span(recording, float(begin), float(end))
        robots = [_log_robot(recording, one) for one in found]
        document = rr.TextDocument(f"```\n{text}\n```", media_type="text/markdown")
        recording.log("/report", document, static=True)
        recording.send_recording_name(f"noise models: {', '.join(one.name for one in found)}")
        # A map is as wide as half of the window: its cells are larger or smaller than drawn.
        grown = WIDE / (NAMED[0] + CELL[0] * len(found[0].kinds))
        share = min(grown * (max(len(found), 3) * CELL[1] + NAMED[1]) + 2 * TITLES, 520.0)
        table = (unstable.text("Table", "/report"), WHOLE - share)
        overview = unstable.above((unstable.beside(*maps), share), table, name="Robots")
        whole = unstable.tabs(overview, *robots)
        recording.send_blueprint(unstable.blueprint(whole))  # instead of an older layout


def levels(one: Comparison, pressure: Array) -> tuple[Array, Array]:
    """Centres of steps of 10 ms, and levels relative to the rms of each, shape (steps, kinds)."""
    size = max(1, round(STEP * one.rate))
    firsts = np.arange(0, len(one.time), size)
    counts = np.diff(np.append(firsts, len(one.time)))
    power = np.add.reduceat(pressure**2, firsts, axis=1) / counts
    mean = np.mean(pressure**2, axis=1)
    level = decibel(power.T / np.where(mean > 0.0, mean, 1.0))
    return one.time[firsts] + counts / 2 / one.rate, np.maximum(level, FLOOR_DB)


def cells(found: Comparisons, name: str) -> Array:
    """Correlations with the reference, or distances to it in [dB], shape (robots, kinds)."""
    return np.stack([getattr(one, name)[:, one.reference] for one in found])


def shades(numbers: Array, name: str) -> NDArray[np.uint8]:
    """Colour the numbers of a heat map: the farther from the reference, the lighter."""
    far = 1.0 - numbers if name == "correlation" else numbers / WORST_DB
    rgb = colors.heat(LIGHTEST * np.clip(np.nan_to_num(far), 0.0, 1.0))[..., :3]
    return np.where(
        np.isnan(numbers)[..., None], np.array(colors.BACKGROUNDS[0], dtype=np.uint8), rgb
    )


def _log_map(recording: rr.RecordingStream, found: Comparisons, name: str) -> Part:
    """Log a heat map, robots by kinds, with its numbers."""
    (width, height), kinds, numbers = CELL, found[0].kinds, cells(found, name)
    image = shades(numbers, name).repeat(height, axis=0).repeat(width, axis=1)
    for edge in (0, -1):  # so that cells stand apart
        image[edge % height :: height] = colors.BACKGROUNDS[0]
        image[:, edge % width :: width] = colors.BACKGROUNDS[0]
    path = f"/overview/{name}"
    recording.log(f"{path}/cells", rr.Image(image), static=True)
    written = []
    for row, one in enumerate(found):
        y = height * (row + 0.5)
        written.append((-NAMED[0] / 2, y, _short(one.name)))
        for column, number in enumerate(numbers[row].tolist()):
            if not np.isnan(number):
                text = f"{number:.2f}" if name == "correlation" else f"{number:.1f}"
                written.append((width * (column + 0.5), y, text))
    written += [(width * (i + 0.5), -NAMED[1] / 2, kind) for i, kind in enumerate(kinds)]
    places = [(x, y - axes.TEXT) for x, y, _ in written]
    labels = axes.texts(places, [text for *_, text in written], [axes.INK] * len(written))
    recording.log(f"{path}/numbers", labels, static=True)
    title = MAPS[name].format(f"\u2018{kinds[found[0].reference]}\u2019")
    across, down = (-NAMED[0], width * len(kinds)), (-NAMED[1], height * len(found))
    return unstable.picture(title, path, across, down)


def _short(name: str) -> str:
    """The name of a robot, or of the file of a run, that fits beside its row."""
    stem = Path(name).stem if "/" in name else name
    return stem if len(stem) <= 18 else f"\u2026{stem[-17:]}"


def _log_robot(recording: rr.RecordingStream, one: Comparison) -> Part:
    """Log the events, levels and spectrograms of a robot or run; its tab."""
    root = f"/{rr.escape_entity_path_part(one.name)}"
    labels = tuple(dict.fromkeys(event.label for event in one.events))
    panel = Panel(f"{root[1:]}/events", 20.0 * max(len(labels), 2) + axes.AXIS)
    states = colors.of_series(len(labels))
    for row, (label, state) in enumerate(zip(labels, states, strict=True)):
        own = [(event.start, event.stop) for event in one.events if event.label == label]
        path, place = f"{root}/events/{label}", (row, len(labels))
        axes.log_row(recording, path, label, own, state, place, (0.15, 0.85))
    left = axes.row_labels(labels) or [Label(0.5, "no events")]
    axes.log_beside(recording, panel, left, [Label(0.5, "events")])
    parts = [axes.timed(panel, title="")]
    height = (WHOLE - panel.height - HEIGHT - 2 * TITLES) / 2
    whole = np.ones(len(one.time), dtype=bool)
    pressures = {"vibration": vibrating(one.pressure.T, whole, one.rate).T, "level": one.pressure}
    shown = dict(zip(one.kinds, colors.of_series(len(one.kinds)), strict=True))
    named = [
        Label(1.0 - (row + 0.5) / max(len(shown), 6), kind, color=color)
        for row, (kind, color) in enumerate(shown.items())
    ]
    for part, pressure in pressures.items():
        time, level = levels(one, pressure)
        for index, (kind, color) in enumerate(shown.items()):
            path = f"{root}/{part}/{kind}"
            axes.log_line(recording, path, time, level[:, index], color, name=kind)
        panel, title = Panel(f"{root[1:]}/{part}", height), f"{PARTS[part]}\n[dB re its rms]"
        axes.log_beside(recording, panel, [Label(0.5, title)], named)
        parts.append(axes.timed(panel, title="", between=RANGE_DB))
    spectrograms = []
    for kind, pressure in zip(one.kinds, one.pressure, strict=True):
        spectrum = spectrogram(pressure, one.rate, start=float(one.time[0]), valid=whole)
        panel = Panel(f"{root[1:]}/spectrogram/{kind}", HEIGHT)
        log_panel(recording, panel, spectrum, SPECTRUM, kind)
        plot, _ = axes.timed(panel, title="", name=kind, paths=("$origin/**",))
        spectrograms.append(plot)
    details = (unstable.tabs(*spectrograms), HEIGHT + TITLES)
    return unstable.above(*parts, details, name=_short(one.name))


MOST = 8
"""Robots that a recording may hold; more make the viewer too slow."""


@dataclass(frozen=True)
class Outputs:
    """Which files to write; None is not written."""

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
