"""What a live session draws and how it is laid out; in columns, thinned."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from rerun.blueprint import Blueprint

from inspector import colors
from inspector.levels import SPECTRUM, amplitudes, extremes, in_bands, window_length
from inspector.live.robot import KEY
from inspector.recording import axes, unstable
from inspector.recording.axes import Label, Panel, log_events, scalars, style_lines
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
from inspector.recording.unstable import TIMELINE, Camera, Part
from inspector.report.findings import spoken
from noiseclassifier import UNKNOWN, Event, Labels
from noiseclassifier.labels import interval
from noisemodel.noise import decibel
from noisemodel.types import Array, Mask

Change: TypeAlias = tuple[float, str]
"""When a class begins, in [s], or until when it lasts so far; it is empty where none is known."""


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
                changes.append((begin, label))
            self._state, self._end = label, begin + self._hop
        return [*changes, (self._end, self._state)] if len(labels) else changes

    def expire(self, now: float) -> list[Change]:
        """End the lane if its next frame is overdue.

        Args:
            now: Time of the latest sample, in [s].
        """
        return self.end() if now > self._end + self._length + self._hop else []

    def end(self) -> list[Change]:
        """End what the lane shows."""
        changes = [(self._end, "")] if self._state else []
        self._state = ""
        return changes


class SpectrogramStream:
    """Levels of the loudest joint in each band of a logarithmic axis, on a fixed scale.

    Which joint will be the worst is not known while samples come in.

    Args:
        rate: Samples per second, in [Hz].

    Attributes:
        edges: Of the bands, shape (bands + 1,), in [Hz].
    """

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._length = window_length(rate)
        self._hop = max(1, self._length // 4)
        self._frequency = rate / self._length * np.arange(1.0, self._length // 2 + 1)
        self.edges = np.geomspace(self._frequency[0], self._frequency[-1], BANDS + 1)
        self._samples = np.empty((0, 0))
        self._valid = np.empty(0, dtype=bool)
        self._gap = False

    def push(self, velocity: Array, valid: Mask, end: float) -> tuple[Array, Array]:
        """Take samples.

        Args:
            velocity: Shape (samples, joints), in [rad/s] or [m/s].
            valid: False in gaps, shape (samples,); windows that touch one are dark.
            end: Time after the last sample, in [s].

        Returns:
            Centres of the windows that are complete now, shape (columns,), in [s], and levels from
            0 to 1, shape (columns, bands).
        """
        samples = np.concatenate((self._samples.reshape(-1, velocity.shape[1]), velocity))
        valid = np.concatenate((self._valid, valid))
        count = max(0, (len(samples) - self._length) // self._hop + 1)
        self._samples, self._valid = samples[count * self._hop :], valid[count * self._hop :]
        if not count:
            return np.empty(0), np.empty((0, BANDS))
        starts = self._hop * np.arange(-1 if self._gap else 0, count)  # a dark one ends a gap
        time = np.asarray(end - (len(samples) - starts - self._length / 2) / self._rate)
        level = np.zeros((len(starts), BANDS))
        level[-count:] = self._levels(samples, valid, count)
        self._gap = False
        return time, level

    def skip(self) -> None:
        """Begin anew after a gap, and leave it dark."""
        self._samples, self._valid = self._samples[:0], self._valid[:0]
        self._gap = True

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
        return np.clip(SPECTRUM.place(level), 0.0, 1.0).T


JOINT_POINTS = 400.0
"""Points of a joint's line in a second, as a recording of ten seconds has."""
NOISE_POINTS = 4000.0
SEND_INTERVAL = 0.1
"""Lines are drawn at once for this time, in [s]: a message costs more than the points in it."""
FILE_INTERVAL, FILE_LONGEST, FILE_SHARE = 2.0, 20.0, 0.05
"""The same for a file without a viewer: a twentieth of the time so far, within these ends, in [s].
For each message, rerun keeps some hundred bytes until the file is closed; longer messages take more
memory while they are written."""
SHOWN = 10.0
"""Time that plots reach back, in [s]."""
NOISE, BANDS_PATH, SCORES, FOUND_PATH = (
    "/noise/simplified",
    "/spectrogram/bands",
    "/score",
    "/class/found",
)
NOISE_PANEL = Panel("noise", 130.0)
SPECTROGRAM_PANEL, SIGNALS_PANEL = Panel("spectrogram", 150.0), Panel("signals", 390.0)
NEWEST = 8
"""Findings that are shown in words; the others are counted."""


class Drawing:
    """Draws into a recording: what is to be drawn waits until a message has enough of it.

    Args:
        signals: Names of the signals that there are.
        classes: What can be predicted; empty without a model.
        edges: Of the spectrogram's bands, shape (bands + 1,), in [Hz].
        watched: Whether there is a viewer: labels are drawn at once then.
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
        self._colours = colors.of_classes((*classes, UNKNOWN))
        self._rows = (*(name for name in classes if name != "ok"), UNKNOWN, "ok")
        self._classes = Panel("class", ROW * len(self._rows) + axes.AXIS) if classes else None
        self._state, self._told = "", ""
        self._waiting: dict[str, list[tuple[NDArray[np.int64], Array]]] = {}
        self._held = self._drawn = 0.0  # time that waits, and time so far, in [s]
        self._entities = {
            kind: _plots(kind, len(joint_names))
            for kind in signals
            if kind.removesuffix("_desired") in UNITS
        }
        for kind, plots in self._entities.items():
            desired = kind.endswith("_desired")
            for path, columns in plots.items():
                names = [f"{name} desired" if desired else name for name in joint_names[columns]]
                shades = colors.of_series(len(names), dim=desired)
                style_lines(recording, path, names=names, colours=shades)
        self._style(classes, edges)

    def _style(self, classes: tuple[str, ...], edges: Array) -> None:
        """Log how everything but the joints' signals is drawn, and what stands beside it."""
        recording, nothing = self._recording, [Label(0.5, "")]  # else the viewer says: no data
        style_lines(recording, NOISE, names=["simplified [rad/s]"], colours=[colors.NOISE])
        axes.log_left(recording, NOISE_PANEL, [Label(0.5, "noise p\u0302\n[rad/s]")])
        axes.log_right(recording, NOISE_PANEL, nothing)
        axes.log_left(recording, SIGNALS_PANEL, nothing)
        axes.log_right(recording, SIGNALS_PANEL, nothing)
        # A line of one entity each: an entity each would cost a message each.
        style_bands(recording, BANDS_PATH, np.sqrt(edges[:-1] * edges[1:]).tolist())
        title = Label(0.5, "spectrum,\nloudest\njoint", -22.0)
        ends = float(edges[0]), float(edges[-1])
        log_axis(recording, SPECTROGRAM_PANEL, *ends, title, axes.hertz)
        axes.log_scale(recording, SPECTROGRAM_PANEL, SPECTRUM)
        if self._classes is None:
            return
        style_lines(
            recording, SCORES, names=classes, colours=[self._colours[name] for name in classes]
        )
        shades = [self._colours[name] for name in self._rows]
        names = [spoken(name) for name in self._rows]
        copies = unstable.COPIES
        unstable.style_bands(
            recording,
            FOUND_PATH,
            [name for name in names for _ in range(copies)],
            [shade for shade in shades for _ in range(copies)],
        )
        rows = zip(axes.row_labels(names), shades, strict=True)
        named = [replace(row, color=readable(shade)) for row, shade in rows]
        axes.log_left(recording, self._classes, named)
        axes.log_right(recording, self._classes, nothing)

    def lines(
        self, time: Array, noise: Array, signals: Mapping[str, Array], seconds: float
    ) -> None:
        """Draw the next stretch of noise and joint signals, as soon as there are 0.1 s of them.

        Args:
            time: Shape (samples,), in [s].
            noise: Shape (samples,), in [rad/s].
            signals: Each of shape (samples, joints); rows that are not finite are left out.
            seconds: That the stretch lasts, in [s].
        """
        self._thin(time, noise[:, None], {NOISE: slice(None)}, seconds * NOISE_POINTS)
        for kind, plots in self._entities.items():
            finite = np.isfinite(signals[kind]).all(axis=1)
            self._thin(time[finite], signals[kind][finite], plots, seconds * JOINT_POINTS)
        self._held += seconds
        if self._held >= self._interval:
            self._drawn += self._held
            if not self._watched:
                longer = max(FILE_SHARE * self._drawn, FILE_INTERVAL)
                self._interval = min(longer, FILE_LONGEST)
            self.flush()

    def _thin(self, time: Array, values: Array, plots: Mapping[str, slice], points: float) -> None:
        shown, thin = extremes(time, values, points=max(2, round(points)))
        for path, columns in plots.items():
            self._wait(path, shown, thin[:, columns].copy())  # the array will be used again

    def spectrogram(self, time: Array, level: Array) -> None:
        """Draw columns of the spectrogram, see `SpectrogramStream.push`."""
        self._wait(BANDS_PATH, time, level)

    def labels(self, labels: Labels) -> None:
        """Draw the scores of frames, at their centres, at once if they are watched."""
        self._wait(SCORES, (labels.start + labels.stop) / 2, labels.scores)
        if self._watched:
            self._send(SCORES)

    def changes(self, changes: Sequence[Change]) -> None:
        """Draw the class where it changes and until when it lasts, at once if it is watched."""
        points: list[tuple[int, str]] = []
        for time, state in changes:
            begin = round(1e9 * time)
            if self._state not in ("", state):
                points.append((begin - 1, self._state))
            points.append((begin, state))
            self._state = state
        shown = [[state == name for name in self._rows] for _, state in points]
        times = np.array([time for time, _ in points], dtype=np.int64)
        self._wait_at(FOUND_PATH, times, np.array(shown, dtype=np.float64))
        if self._watched:
            self._send(FOUND_PATH)

    def _wait(self, path: str, time: Array, values: Array) -> None:
        """Let values wait, at times in [s]."""
        self._wait_at(path, np.round(1e9 * time).astype(np.int64), values)

    def _wait_at(self, path: str, time: NDArray[np.int64], values: Array) -> None:
        """Let values wait, at times in [ns]."""
        if len(time):
            self._waiting.setdefault(path, []).append((time, values))

    def flush(self) -> None:
        """Draw what waits."""
        for path in list(self._waiting):
            self._send(path)
        self._held = 0.0

    def _send(self, path: str) -> None:
        """Draw what waits of an entity in one message."""
        pieces = self._waiting.pop(path, None)
        if pieces is None:
            return
        time, values = (np.concatenate(each) for each in zip(*pieces, strict=True))
        count, width = values.shape
        columns: Any = scalars(values)
        if path == BANDS_PATH:
            shades = colors.heat(values).reshape(-1, 4)
            columns = [
                *scalars(np.tile(axes.middles(width)[::-1], (count, 1))),
                *rr.SeriesLines.columns(colors=shades).partition([width] * count),
            ]
        elif path == FOUND_PATH:
            upper, lower = FOUND
            middles = axes.TOP * (1.0 - (np.arange(width) + (upper + lower) / 2) / width)
            bands = np.where(values > 0.0, middles, np.nan).repeat(unstable.COPIES, axis=1)
            half = axes.TOP * (lower - upper) / 2 / width
            unstable.send_bands(self._recording, path, time, bands, half)
            return
        index = rr.TimeColumn(TIMELINE, duration=time.astype("timedelta64[ns]"))
        self._recording.send_columns(path, indexes=[index], columns=columns)

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
            index = [axes.at(np.array([time]))]
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

    def layout(self, start: float, camera: Camera | None, *, links: bool, full: bool) -> Blueprint:
        """Lay the recording out; every plot shows ten seconds: the first, and then the last.

        Args:
            start: Time of the first sample, in [s].
            camera: From where the robot is seen; None without one.
            links: Whether the links are coloured.
            full: Whether the last ten seconds all lie after the start; until then, plots show the
                first ten, so that no time is negative.
        """
        shown: dict[str, Any] = {"last": SHOWN} if full else {"during": (start, start + SHOWN)}
        shown |= {"fixed": True, "titled": False}
        rows = shown | {"between": (0.0, axes.TOP)}
        over_time = [
            (NOISE_PANEL, unstable.plot("Noise", "/noise", **shown)),
            (SPECTROGRAM_PANEL, unstable.plot("Spectrum", "/spectrogram", **rows)),
            (SIGNALS_PANEL, self._signals(shown)),
        ]
        left = [
            (unstable.text("Findings", "/report", titled=False), 2.0),
            (unstable.events("Events", "/events"), 1.4),
        ]
        if self._classes is not None:  # otherwise there is no verdict
            over_time.insert(0, (self._classes, unstable.plot("Classes", "/class", **rows)))
            left.insert(0, (unstable.drawing("/verdict"), 0.32))
        if camera is not None:
            title = "Robot, links coloured by level above 10 Hz" if links else "Robot"
            robot = unstable.robot(title, "/robot", camera)
            if links:
                key = unstable.drawing(f"/axis/{KEY.name}/right")
                robot = unstable.beside((robot, 88.0), (key, 12.0))
            left.insert(len(left) - 1, (robot, 3.4))
        right = [
            (part if panel is SIGNALS_PANEL else axes.part(panel, part), panel.height)
            for panel, part in over_time
        ]
        whole = unstable.beside((unstable.above(*left), 36.0), (unstable.above(*right), 64.0))
        return unstable.blueprint(whole, following=True)

    def _signals(self, shown: Mapping[str, Any]) -> Part:
        """Plots of joint signals and of scores, behind each other."""
        paths: dict[str, list[str]] = {}
        for kind, plots in self._entities.items():
            measured = kind.removesuffix("_desired")
            for number, path in enumerate(plots, start=1):
                which = f" {number}" if len(plots) > 1 else ""
                paths.setdefault(f"{measured}{which} [{UNITS[measured]}]", []).append(path)
        views = {
            title: unstable.plot(title, "/joints", own, legend=True, **shown)
            for title, own in paths.items()
        }
        if self._classes is not None:
            views["Scores"] = unstable.plot("Scores", SCORES, legend=True, **shown)
        return unstable.tabs(
            *(axes.part(SIGNALS_PANEL, plot, name=name) for name, plot in views.items())
        )


def _line(event: Event, *, lasts: bool) -> str:
    """A finding in a line of Markdown."""
    when = f"since {event.start:.2f} s" if lasts else interval(event.start, event.stop)
    return f"- **{spoken(event.label)}**, {when}, score {event.score:.2f}{event.novelty}"


def _plots(kind: str, joints: int) -> dict[str, slice]:
    """The entities of a signal, each with the columns of eight joints."""
    end = "_desired" if kind.endswith("_desired") else ""
    return {
        f"/joints/{kind.removesuffix('_desired')}/{first // JOINTS_PER_PLOT}{end}": slice(
            first, first + JOINTS_PER_PLOT
        )
        for first in range(0, joints, JOINTS_PER_PLOT)
    }
