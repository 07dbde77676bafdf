"""Several runs as one rerun recording: a row for each, of classes and of level; curves; a table."""

import hashlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import rerun as rr

from inspector import colors, levels
from inspector.analysis import Analysis, analyse
from inspector.errors import Status
from inspector.levels import FLOOR_DB
from inspector.library import Library
from inspector.logs.read import Opened
from inspector.recording import panels, views
from inspector.recording.panels import HIGH_DB, LOW_DB
from inspector.recording.run import log_report, writing
from inspector.recording.views import Label, Panel, Timed
from inspector.report import spoken
from noiseclassifier import Event
from noisemodel import Block


@dataclass(frozen=True, eq=False)
class Several:
    """Runs that are laid side by side, by the names of their files."""

    names: tuple[str, ...]
    sides: tuple[Analysis, ...]

    @cached_property
    def peaks(self) -> tuple[float, ...]:
        """Highest level of each run, in [dB re 1 rad/s]."""
        levels = [side.vibration_level[1] for side in self.sides]
        return tuple(float(np.nanmax(level, initial=FLOOR_DB)) for level in levels)

    @cached_property
    def order(self) -> tuple[int, ...]:
        """Indices of the runs: those with findings for longest first, then the loudest."""
        return tuple(sorted(range(len(self.sides)), key=lambda i: (-self.found(i), -self.peaks[i])))

    def found(self, index: int) -> float:
        """How long a run has findings, in [s]."""
        return sum(event.stop - event.start for event in self.sides[index].findings)

    @property
    def longest(self) -> Event | None:
        """The longest finding of the worst run."""
        found = () if self.worst is None else self.sides[self.worst].findings
        return max(found, key=lambda event: event.stop - event.start, default=None)

    @property
    def worst(self) -> int | None:
        """Index of the run that is worst; None if none has a finding."""
        return self.order[0] if self.found(self.order[0]) > 0.0 else None


def lay(runs: Sequence[Opened], library: Library, *, from_start: bool = True) -> Several:
    """Lay runs side by side, and analyse each."""
    shown = [opened.source.shown for opened in runs]
    unique = len({path.stem for path in shown}) == len(shown)
    names = [path.stem if unique else str(path) for path in shown]
    sides = []
    for opened, name in zip(runs, names, strict=True):
        run = opened.run
        if from_start and (start := float(run.time[0])):
            blocks = tuple(Block(b.start - start, b.stop - start, b.label) for b in run.blocks)
            run = replace(run, time=run.time - start, blocks=blocks)
        found = analyse(run, library, name=name, sha256=opened.sha256)
        sides.append(replace(found, assumed=opened.assumed))
    return Several(tuple(names), tuple(sides))


CURVES = 8  # runs whose level is drawn as a curve, the worst; more lines cannot be told apart
COLUMNS = 1500  # columns of the levels; of long runs, the highest level in each is shown
# Height of all parts, of the table with the verdict at least, of the curves, and of a row of tabs,
# in points, at 1440 x 900.
WHOLE, TABLE, CURVE, TITLES = 832.0, 200.0, 190.0, 28.0
# Height of a run's row; below it, classes and levels lie behind each other in tabs.
LOWEST, HIGHEST = 20.0, 36.0
NAMED = 16.0  # least distance of two names
# Most height of a line, in points: thick ones have round ends, so a row is several of them.
LINE = 8.0
LETTERS = 16  # most letters of a name beside a row
SIGNS = "\u25c6\u25a0\u25b2\u25cf\u2716\u271a\u25bc*"  # the markers of `panels.MARKERS` as text


def write(several: Several, path: Path, *, overwrite: bool = False) -> None:
    """Write the recording of several runs, whole or not at all."""
    identity = " ".join(f"{side.name} {side.sha256}" for side in several.sides)
    key = hashlib.sha256(identity.encode()).hexdigest()
    with writing(path, key, overwrite=overwrite) as recording:
        begin = min(float(side.run.time[0]) for side in several.sides)
        end = max(float(side.run.time[-1]) for side in several.sides)
        views.log_span(recording, begin, end)
        count, told = len(several.names), (Status.OK, "PASS   no finding")
        if unknown := sum(side.status is Status.CANNOT_TELL for side in several.sides):
            told = (Status.CANNOT_TELL, f"CANNOT TELL   {unknown} of {count} runs")
        if failing := sum(bool(side.findings) for side in several.sides):
            told = (Status.FINDINGS, f"FAIL   {failing} of {count} runs")
        verdict = views.log_verdict(recording, *told)
        room = WHOLE - TABLE - CURVE
        row = min((room / 2 - views.AXIS) / count, HIGHEST)
        apart = row >= LOWEST
        tall = row * count + views.AXIS if apart else room - TITLES
        rows = [
            _log_classes(recording, several, Panel("class", tall)),
            _log_levels(recording, several, Panel("levels", tall), (begin, end)),
        ]
        if not apart:
            rows = [(views.tabs(*(part for part, _ in rows)), tall + TITLES)]
        rows.append(_log_curves(recording, several, Panel("curves", CURVE)))
        properties = {"runs": len(several.names), "model": several.sides[0].model}
        title = f"{several.names[0]} and {len(several.names) - 1} more"
        log_report(recording, title, report(several), properties)
        rest = WHOLE - views.VERDICT - sum(size for _, size in rows)
        table = (views.text("Runs", titled=False), rest)
        whole = views.above(verdict, table, *rows)
        event = several.longest
        loop = None if event is None else (event.start, event.stop)
        recording.send_blueprint(views.blueprint(whole, loop))


def report(several: Several) -> str:
    """Write the table of several runs in Markdown, in the order given, the worst marked."""
    failing = sum(bool(side.findings) for side in several.sides)
    lines = [f"### {len(several.names)} runs, {failing} with findings"]
    if several.worst is not None and (event := several.longest) is not None:
        when = f"{spoken(event.label)} from {event.start:.2f} s to {event.stop:.2f} s"
        lines += ["", f"Worst: **{several.names[several.worst]}**, {when}"]
    lines += ["", "| run | findings | peak [dB] |", "|---|---|---|"]
    for index, (name, side) in enumerate(zip(several.names, several.sides, strict=True)):
        shown = f"**{name}** (worst)" if index == several.worst else name
        count = Counter(spoken(event.label) for event in side.findings)
        found = ", ".join(f"{number} {label}" for label, number in count.items())
        lines.append(f"| {shown} | {found or side.status} | {several.peaks[index]:z.0f} |")
    lines += ["", "Peak of the level above 10 Hz, in dB re 1 rad/s."]
    remarks: dict[str, list[str]] = {}
    for name, side in zip(several.names, several.sides, strict=True):
        for remark in dict.fromkeys(map(spoken, side.remarks)):
            remarks.setdefault(remark, []).append(name)
    lines += ["", "**Remarks**", ""] if remarks else []
    for remark, who in remarks.items():
        lines.append(f"- {remark} ({f'{len(who)} runs' if len(who) > 1 else who[0]})")
    return "\n".join(lines) + "\n"


def _lines(several: Several, panel: Panel) -> tuple[float, int]:
    """Width and number of the lines that make a run's row."""
    height = (panel.height - views.AXIS) / len(several.names)
    lines = max(1, int(height / LINE))
    return 0.8 * height if lines == 1 else height / (lines + 1) + 1.0, lines


def _names(several: Several, panel: Panel) -> list[Label]:
    """Names of the rows, as long and as many as there is room for; the worst is marked."""
    step = int(np.ceil(NAMED * len(several.names) / (panel.height - views.AXIS)))
    short = [
        name if len(name) <= LETTERS else f"\u2026{name[1 - LETTERS :]}" for name in several.names
    ]
    labels = []
    for index, label in enumerate(views.row_labels(short)):
        worst = index == several.worst
        if index % step == 0 or worst:
            text = f"{label.text}\nworst" if worst and step == 1 else label.text
            color = panels.readable(colors.CLASSES["impact"]) if worst else views.INK
            labels.append(Label(label.place, text, color=color))
    return labels


def _log_classes(recording: rr.RecordingStream, several: Several, panel: Panel) -> Timed:
    colours = panels.colours_of(*several.sides)
    lanes = [side.lane for side in several.sides]
    times = [time for lane in lanes for each in lane for time in each[:2]]
    edges = np.unique([0.0, *(times or [1.0])])
    rgba = np.tile(np.array(views.EMPTY, dtype=np.uint8), (len(lanes), len(edges) - 1, 1))
    for row, lane in enumerate(lanes):
        for start, stop, name in lane:
            first, last = np.searchsorted(edges, (start, stop))
            rgba[row, first:last] = (*colours[name], 255)
    width, lines = _lines(several, panel)
    path, names = "/class/found", several.names
    views.log_rows(recording, path, edges, rgba, names=names, width=width, lines=lines)
    failing = list(dict.fromkeys(e.label for side in several.sides for e in side.findings))
    places = views.middles(len(lanes))
    for number, name in enumerate(failing):
        marks = [
            (event.start, places[row])
            for row, side in enumerate(several.sides)
            for event in side.findings
            if event.label == name
        ]
        panels.log_marks(recording, name, number, views.INK, sorted(marks))
    key = []
    for row, name in enumerate([*failing, "ok"]):
        sign = "" if name == "ok" else f"{SIGNS[row % len(SIGNS)]} "
        text = f"{sign}{spoken(name)}".replace("high ", "high\n")
        place = 1.0 - (row + 0.5) / max(len(failing) + 1, 3)
        color = panels.readable(colours.get(name, colors.CLASSES["ok"]))
        key.append(Label(place, text, color=color))
    views.log_beside(recording, panel, _names(several, panel), key)
    return views.timed(panel, name="Classes")


def _log_levels(
    recording: rr.RecordingStream, several: Several, panel: Panel, span: tuple[float, float]
) -> Timed:
    step = max(levels.STEP, (span[1] - span[0]) / COLUMNS)
    columns = int(np.ceil((span[1] - span[0]) / step))
    edges = span[0] + step * np.arange(columns + 1, dtype=np.float64)
    found = np.full((len(several.sides), columns), np.nan)
    for row, side in zip(found, several.sides, strict=True):
        time, level = side.vibration_level
        column = np.searchsorted(edges, time + 1e-9, side="right") - 1
        np.fmax.at(row, np.clip(column, 0, columns - 1), level[:, 0])  # NaN where there is none
    scale = levels.JOINTS.following(found)
    width, lines = _lines(several, panel)
    rgba, names = views.shades(scale, found), [f"{name} [{scale.unit}]" for name in several.names]
    views.log_rows(recording, "/levels", edges, rgba, names=names, width=width, lines=lines)
    views.log_beside(recording, panel, _names(several, panel), scale)
    return views.timed(panel, name="Level above 10 Hz")


def _log_curves(recording: rr.RecordingStream, several: Several, panel: Panel) -> Timed:
    chosen: Sequence[int] = sorted(several.order[:CURVES])
    for index, color in zip(chosen, colors.of_series(len(chosen)), strict=True):
        line, path = {several.names[index]: color}, f"/curves/{index:03d}"
        views.log_lines(recording, path, *several.sides[index].vibration_level, line)
    told = f"the worst\n{CURVES} runs" if len(several.names) > len(chosen) else "all runs"
    views.log_beside(recording, panel, panels.level_axis(), [Label(0.5, told)])
    paths, ends = ("$origin/**",), (LOW_DB, HIGH_DB)
    return views.timed(panel, title="", between=ends, paths=paths, legend=True)
