"""What a live session draws and how it is laid out; in columns, thinned."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import rerun as rr
from rerun.blueprint import Blueprint

from inspector import colors
from inspector.levels import SPECTRUM
from inspector.live.robot import KEY
from inspector.recording import axes, unstable
from inspector.recording.axes import TIMELINE, Label, Panel, at, log_events, scalars, style_lines
from inspector.recording.camera import Camera
from inspector.recording.panels import (
    BANDS,
    FOUND,
    JOINTS_PER_PLOT,
    ROW,
    UNITS,
    log_axis,
    readable,
    style_bands,
)
from inspector.recording.unstable import Part
from inspector.report.markdown import spoken
from inspector.spectrogram import amplitudes, in_bands, window_length
from inspector.thinning import extremes
from noiseclassifier import UNKNOWN, Event, Labels
from noiseclassifier.labels import interval
from noisemodel.noise import decibel
from noisemodel.types import Array, Mask


class Change(NamedTuple):
    """A class that begins, or lasts."""

    time: float
    """When, in [s]."""
    state: str
    """The class; empty where nothing is known."""


class Lane:
    """Gives each frame the time around its centre, as the recording of a whole run does.

    Args:
        hop: Time from one frame to the next, in [s].
        length: Duration of a frame, in [s].
    """

    def __init__(self, hop: float, length: float) -> None:
        self._hop, self._length = hop, length
        self._state, self._end = "", 0.0

    def take(self, labels: Labels) -> list[Change]:
        """Where the class changes, and the end of the last frame."""
        changes = []
        for index, label in enumerate(labels.label.tolist()):
            begin = float(labels.start[index] + labels.stop[index]) / 2 - self._hop / 2
            if begin > self._end + self._hop / 2:
                changes += self.end()
            if label != self._state:
                changes.append(Change(begin, label))
            self._state, self._end = label, begin + self._hop
        return [*changes, Change(self._end, self._state)] if len(labels) else changes

    def expire(self, now: float) -> list[Change]:
        """End the lane if its next frame is overdue.

        Args:
            now: Time of the latest sample, in [s].
        """
        return self.end() if now > self._end + self._length + self._hop else []

    def end(self) -> list[Change]:
        """End what the lane shows."""
        changes = [Change(self._end, "")] if self._state else []
        self._state = ""
        return changes


COLUMNS_AT_ONCE = 4
"""Columns that are handed out at once, every tenth of a second."""


class Columns(NamedTuple):
    """Columns of a spectrogram."""

    time: Array
    """Centres of the windows, shape (columns,), in [s]."""
    level: Array
    """From 0 to 1, shape (bands, columns)."""


class SpectrogramStream:
    """Levels of the loudest joint in each band of a logarithmic axis, on a fixed scale.

    Which joint will be the worst is not known while samples come in.

    Args:
        rate: Samples per second, in [Hz].

    Attributes:
        edges: Of the bands, shape (bands + 1,), in [Hz].
        centres: Of the bands, shape (bands,), in [Hz].
    """

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._length = window_length(rate)
        self._hop = max(1, self._length // 4)
        self._frequency = rate / self._length * np.arange(1.0, self._length // 2 + 1)
        self.edges = np.geomspace(self._frequency[0], self._frequency[-1], BANDS + 1)
        self.centres = np.sqrt(self.edges[:-1] * self.edges[1:])
        self._samples = np.empty((0, 0))
        self._valid = np.empty(0, dtype=bool)
        self._gap = False
        self._waiting: list[Columns] = []

    def push(self, velocity: Array, valid: Mask, end: float) -> Columns | None:
        """Take samples.

        Args:
            velocity: Shape (samples, joints), in [rad/s] or [m/s].
            valid: False in gaps, shape (samples,); windows that touch one are dark.
            end: Time after the last sample, in [s].
        """
        samples = np.concatenate((self._samples.reshape(-1, velocity.shape[1]), velocity))
        valid = np.concatenate((self._valid, valid))
        count = max(0, (len(samples) - self._length) // self._hop + 1)
        used = count * self._hop
        if count:
            if self._gap:
                before = end - (len(samples) - self._length / 2 + self._hop) / self._rate
                dark = np.zeros((len(self.centres), 1))
                self._waiting.append(Columns(np.array([before]), dark))
                self._gap = False
            starts = self._hop * np.arange(count)
            times = np.asarray(end - (len(samples) - starts - self._length / 2) / self._rate)
            self._waiting.append(Columns(times, self._levels(samples, valid, count)))
        self._samples, self._valid = samples[used:], valid[used:]
        if sum(len(columns.time) for columns in self._waiting) < COLUMNS_AT_ONCE:
            return None
        return self.flush()

    def skip(self) -> None:
        """Begin anew after a gap, and leave it dark."""
        self._samples, self._valid = self._samples[:0], self._valid[:0]
        self._gap = True

    def flush(self) -> Columns | None:
        """Hand out what waits."""
        if not self._waiting:
            return None
        time = np.concatenate([columns.time for columns in self._waiting])
        level = np.concatenate([columns.level for columns in self._waiting], axis=1)
        self._waiting = []
        return Columns(time, level)

    def _levels(self, samples: Array, valid: Mask, count: int) -> Array:
        view = np.lib.stride_tricks.sliding_window_view
        windows = view(samples, self._length, axis=0)[:: self._hop][:count]
        whole = np.asarray(view(valid, self._length)[:: self._hop][:count].all(axis=1))
        # In a window, slow motion is a line all but: what is left of it is below 10 Hz.
        ramp = np.arange(self._length) - (self._length - 1) / 2
        slope = windows @ ramp / (ramp @ ramp)
        level_windows = (windows - slope[..., None] * ramp).reshape(-1, self._length)
        every = amplitudes(level_windows).reshape(count, windows.shape[1], -1)
        amplitude = every.max(axis=1).T * whole
        level = 2 * decibel(in_bands(self._frequency, amplitude, self.edges))
        return np.clip(SPECTRUM.place(level), 0.0, 1.0)


JOINT_POINTS = 400.0
"""Points of a joint's line in a second, as a recording of ten seconds has."""
NOISE_POINTS = 4000.0
SEND_INTERVAL = 0.1
"""Lines are drawn at once for this time, in [s]: a message costs more than the points in it."""
FILE_INTERVAL = 2.0
"""The same for a file without a viewer: for each message, rerun keeps some hundred bytes until the
file is closed."""
NOISE, FOUND_PATH = "noise", "/class/found"
NOISE_PANEL = Panel("noise", 130.0)
SPECTROGRAM_PANEL, SIGNALS_PANEL = Panel("spectrogram", 150.0), Panel("signals", 390.0)
NEWEST = 8
"""Findings that are shown in words; the others are counted."""


class Drawing:
    """Draws into a recording.

    Args:
        classes: What can be predicted; empty without a model. `Drawing.classes` is their panel.
        edges: Of the spectrogram's bands, shape (bands + 1,), in [Hz].
    """

    def __init__(
        self,
        recording: rr.RecordingStream,
        joint_names: Sequence[str],
        signals: Sequence[str],
        classes: tuple[str, ...],
        edges: Array,
        *,
        watched: bool = True,
    ) -> None:
        self._recording, self._watched = recording, watched
        self._interval = SEND_INTERVAL if watched else FILE_INTERVAL
        self._columns: list[Columns] = []
        self._scores: list[tuple[Array, Array]] = []
        self._colours = colors.of_classes((*classes, UNKNOWN))
        self._rows = (*(name for name in classes if name != "ok"), UNKNOWN, "ok")
        self._state, self._changes = "", list[Change]()
        self._signals = [name for name in signals if name.removesuffix("_desired") in UNITS]
        self._slices = [
            slice(first, min(first + JOINTS_PER_PLOT, len(joint_names)))
            for first in range(0, len(joint_names), JOINTS_PER_PLOT)
        ]
        self._entities = {
            kind: [(_joints(kind, plot), columns) for plot, columns in enumerate(self._slices)]
            for kind in self._signals
        }
        self._told = ""
        self._waiting: dict[str, list[tuple[Array, Array]]] = {}
        self._held = 0.0  # time that waits, in [s]
        for kind in self._signals:
            for plot, columns in enumerate(self._slices):
                self._style_joints(kind, plot, joint_names[columns])
        self._entities[NOISE] = [("/noise/simplified", slice(None))]
        style_lines(
            recording, "/noise/simplified", names=["simplified [rad/s]"], colours=[colors.NOISE]
        )
        # A line of one entity each: an entity each would cost a message each.
        style_bands(recording, "/spectrogram/bands", np.sqrt(edges[:-1] * edges[1:]).tolist())
        title = Label(0.5, "spectrum,\nloudest\njoint", -22.0)
        ends = float(edges[0]), float(edges[-1])
        log_axis(recording, SPECTROGRAM_PANEL, *ends, title, axes.hertz)
        axes.log_scale(recording, SPECTROGRAM_PANEL, SPECTRUM)
        axes.log_left(recording, NOISE_PANEL, [Label(0.5, "noise p\u0302\n[rad/s]")])
        nothing = [Label(0.5, "")]  # else the viewer says that there is no data
        self.classes = Panel("class", ROW * len(self._rows) + axes.AXIS) if classes else None
        for panel in filter(None, (self.classes, NOISE_PANEL, SIGNALS_PANEL)):
            axes.log_right(recording, panel, nothing)
        axes.log_left(recording, SIGNALS_PANEL, nothing)
        if self.classes is not None:
            shown = [self._colours[name] for name in classes]
            style_lines(recording, "/score", names=classes, colours=shown)
            self._style_classes(self.classes)

    @property
    def plots(self) -> list[tuple[str, list[str]]]:
        """Title and entity paths of each plot of joint signals."""
        found: dict[str, list[str]] = {}
        for kind in self._signals:
            measured = kind.removesuffix("_desired")
            for plot in range(len(self._slices)):
                number = f" {plot + 1}" if len(self._slices) > 1 else ""
                title = f"{measured}{number} [{UNITS[measured]}]"
                found.setdefault(title, []).append(_joints(kind, plot))
        return list(found.items())

    def lines(self, time: Array, noise: Array, signals: Mapping[str, Array], rate: float) -> None:
        """Draw the next stretch of noise and joint signals, as soon as there are 0.1 s of them.

        Args:
            time: Shape (samples,), in [s].
            noise: Shape (samples,), in [rad/s].
            signals: Each of shape (samples, joints); rows that are not finite are left out.
            rate: Samples per second, in [Hz].
        """
        if not len(time):
            return
        seconds = len(time) / rate
        self._keep(NOISE, time, noise[:, None], seconds * NOISE_POINTS)
        for kind in self._signals:
            finite = np.isfinite(signals[kind]).all(axis=1)
            if not finite.any():
                continue
            rows = slice(None) if finite.all() else finite
            self._keep(kind, time[rows], signals[kind][rows], seconds * JOINT_POINTS)
        self._held += seconds
        if self._held >= self._interval:
            self.flush()

    def flush(self) -> None:
        """Draw what waits."""
        for kind, pieces in self._waiting.items():
            index = [at(np.concatenate([time for time, _ in pieces]))]
            values = np.concatenate([part for _, part in pieces])
            for path, columns in self._entities[kind]:
                self._send(path, index, values[:, columns])
        self._waiting, self._held = {}, 0.0
        self._send_spectrogram()
        self._send_scores()
        self._send_changes()

    def spectrogram(self, columns: Columns) -> None:
        """Draw columns of the spectrogram, at once if they are watched."""
        self._columns.append(columns)
        if self._watched:
            self._send_spectrogram()

    def _send_spectrogram(self) -> None:
        if not self._columns:
            return
        time = np.concatenate([columns.time for columns in self._columns])
        level = np.concatenate([columns.level for columns in self._columns], axis=1)
        self._columns = []
        bands, count = level.shape
        rgba = colors.heat(level.T).reshape(-1, 4)
        self._recording.send_columns(
            "/spectrogram/bands",
            indexes=[at(time)],
            columns=[
                *scalars(np.tile(axes.middles(bands)[::-1], (count, 1))),
                *rr.SeriesLines.columns(colors=rgba).partition([bands] * count),
            ],
        )

    def labels(self, labels: Labels) -> None:
        """Draw the scores of frames, at their centres, at once if they are watched."""
        self._scores.append(((labels.start + labels.stop) / 2, labels.scores))
        if self._watched:
            self._send_scores()

    def _send_scores(self) -> None:
        if self._scores:
            time, scores = (np.concatenate(each) for each in zip(*self._scores, strict=True))
            self._send("/score", [at(time)], scores)
            self._scores = []

    def changes(self, changes: Sequence[Change]) -> None:
        """Draw the class where it changes and until when it lasts, at once if it is watched."""
        self._changes += changes
        if self._watched:
            self._send_changes()

    def _send_changes(self) -> None:
        points: list[tuple[int, str]] = []
        for change in self._changes:
            begin = round(1e9 * change.time)
            if self._state not in ("", change.state):
                points.append((begin - 1, self._state))
            points.append((begin, change.state))
            self._state = change.state
        self._changes = []
        if points:
            middle, half = self._places()
            shown = np.array([[state == name for name in self._rows] for _, state in points])
            values = np.where(shown, middle, np.nan).repeat(unstable.COPIES, axis=1)
            times = np.array([time for time, _ in points])
            unstable.send_bands(self._recording, FOUND_PATH, TIMELINE, times, values, half)

    def _places(self) -> tuple[Array, float]:
        """Middles of the classes' bands on their axis, from above, and half of their width."""
        count, (upper, lower) = len(self._rows), FOUND
        middles = 1.0 - (np.arange(count) + (upper + lower) / 2) / count
        return axes.TOP * middles, axes.TOP * (lower - upper) / 2 / count

    def findings(self, time: float, found: Sequence[Event], lasting: Sequence[Event]) -> None:
        """Show the findings so far in a document.

        Args:
            time: Of the latest sample, in [s].
        """
        lines = [_line(event, lasts=event in lasting) for event in reversed(found)]
        count = Counter(spoken(event.label) for event in found)
        title = ", ".join(f"{number} {label}" for label, number in count.items())
        head = f"### findings: {title}" if title else "### ok so far"
        rest = [f"- {len(lines) - NEWEST} more before"] if len(lines) > NEWEST else []
        text = "\n".join([head, "", *lines[:NEWEST], *rest]) + "\n"
        if text != self._told:
            self._told = text
            document = rr.TextDocument.columns(text=[text], media_type=["text/markdown"])
            index = [at(np.array([time]))]
            self._recording.send_columns("/report", indexes=index, columns=document)
            verdict = ("findings", f"FAIL   {title}") if title else ("ok", "PASS so far")
            axes.log_verdict(self._recording, *verdict, time)

    def found(self, event: Event) -> None:
        """Add a finding to the list of events."""
        line = f"found: {spoken(event.label)} from {event.start:.2f} s"
        self.event(event.start, line, self._colours[event.label])

    def event(self, time: float, text: str, colour: colors.Color = colors.CLASSES[UNKNOWN]) -> None:
        """Add a line to the list of events."""
        log_events(self._recording, [time], [text], [colour])

    def _keep(self, kind: str, time: Array, values: Array, points: float) -> None:
        """Thin a stretch, and let it wait; the arrays that it is in will be used again."""
        shown, thin = extremes(time, values, points=max(2, round(points)))
        self._waiting.setdefault(kind, []).append((shown.copy(), thin.copy()))

    def _send(self, path: str, index: list[rr.TimeColumn], values: Array) -> None:
        self._recording.send_columns(path, indexes=index, columns=scalars(values))

    def _style_classes(self, panel: Panel) -> None:
        shades = [self._colours[name] for name in self._rows]
        copies = [name for name in map(spoken, self._rows) for _ in range(unstable.COPIES)]
        every = [shade for shade in shades for _ in range(unstable.COPIES)]
        unstable.style_bands(self._recording, FOUND_PATH, copies, every)
        rows = axes.row_labels([spoken(name) for name in self._rows])
        named = [replace(at, color=readable(c)) for at, c in zip(rows, shades, strict=True)]
        axes.log_left(self._recording, panel, named)

    def _style_joints(self, kind: str, plot: int, names: Sequence[str]) -> None:
        desired = kind.endswith("_desired")
        labels = [f"{name} desired" if desired else name for name in names]
        shades = colors.of_series(len(names), dim=desired)
        style_lines(self._recording, _joints(kind, plot), names=labels, colours=shades)


def _line(event: Event, *, lasts: bool) -> str:
    """A finding in a line of Markdown."""
    when = f"since {event.start:.2f} s" if lasts else interval(event.start, event.stop)
    return f"- **{spoken(event.label)}**, {when}, score {event.score:.2f}{event.novelty}"


def _joints(kind: str, plot: int) -> str:
    end = "_desired" if kind.endswith("_desired") else ""
    return f"/joints/{kind.removesuffix('_desired')}/{plot}{end}"


SHOWN = 10.0
"""Time that plots reach back, in [s]."""


@dataclass(frozen=True)
class Contents:
    """What there is to show.

    Attributes:
        joints: Title and entity paths of each plot of joint signals.
        camera: From where the robot is seen; None without one.
        classes: Where the classes are drawn; None without any.
        links: Whether the links are coloured.
        rate: Samples per second, in [Hz].
        start: Time of the first sample, in [s].
        full: Whether the last ten seconds are all after that.
    """

    joints: Sequence[tuple[str, Sequence[str]]]
    camera: Camera | None
    classes: Panel | None
    links: bool
    rate: float
    start: float
    full: bool


def layout(contents: Contents) -> Blueprint:
    """Lay a live recording out; every plot shows ten seconds: the first, and then the last."""
    noise = _plot(contents, "/noise", "Noise", titled=False)
    bands = _plot(contents, "/spectrogram", "Spectrum", between=(0.0, axes.TOP), titled=False)
    over_time = [
        (axes.part(NOISE_PANEL, noise), NOISE_PANEL.height),
        (axes.part(SPECTROGRAM_PANEL, bands), SPECTROGRAM_PANEL.height),
        (_signals(contents), SIGNALS_PANEL.height),
    ]
    if contents.classes is not None:
        rows = _plot(contents, "/class", "Classes", between=(0.0, axes.TOP), titled=False)
        over_time.insert(0, (axes.part(contents.classes, rows), contents.classes.height))
    findings = unstable.text("Findings", "/report", titled=False)
    left = [(findings, 2.0), (unstable.events("Events", "/events"), 1.4)]
    if contents.classes is not None:  # otherwise there is no verdict
        left.insert(0, (unstable.drawing("/verdict"), 0.32))
    if contents.camera is not None:
        title = "Robot, links coloured by level above 10 Hz" if contents.links else "Robot"
        robot = unstable.robot(title, "/robot", contents.camera)
        if contents.links:
            key = unstable.drawing(f"/axis/{KEY.name}/right")
            robot = unstable.beside((robot, 88.0), (key, 12.0))
        left.insert(len(left) - 1, (robot, 3.4))
    whole = unstable.beside((unstable.above(*left), 36.0), (unstable.above(*over_time), 64.0))
    return unstable.blueprint(whole, TIMELINE, following=True)


def _shown(contents: Contents) -> tuple[tuple[float, float] | None, float | None]:
    """What plots show: a stretch of time at first, so that it begins with the samples, or a last.

    Before ten seconds are over, the last ten begin before the first sample.
    """
    if contents.full:
        return None, SHOWN
    return (contents.start, contents.start + SHOWN), None


def _plot(
    contents: Contents,
    origin: str,
    name: str,
    paths: Sequence[str] = ("$origin/**",),
    *,
    legend: bool = False,
    between: tuple[float, float] | None = None,
    titled: bool = True,
) -> Part:
    during, last = _shown(contents)
    return unstable.plot(
        name,
        origin,
        paths,
        legend=legend,
        between=between,
        fixed=True,
        during=during,
        last=last,
        titled=titled,
    )


def _signals(contents: Contents) -> Part:
    plots = {
        title: _plot(contents, "/joints", title, paths, legend=True, titled=False)
        for title, paths in contents.joints
    }
    if contents.classes is not None:
        plots["Scores"] = _plot(contents, "/score", "Scores", legend=True, titled=False)
    return unstable.tabs(
        *(axes.part(SIGNALS_PANEL, plot, name=name) for name, plot in plots.items())
    )
