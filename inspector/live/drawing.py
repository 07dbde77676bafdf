"""Where a live session is drawn, what, the robot included, and how it is laid out."""

import re
import time
import uuid
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from threading import Event as Signal
from threading import Thread
from typing import Any, TypeAlias, cast

import numpy as np
import rerun as rr
from numpy.typing import NDArray

import noisemodel as nm
from inspector import colors
from inspector.errors import InspectorError, Status
from inspector.levels import SPECTRUM, amplitudes, extremes, in_bands, window_length
from inspector.live.labels import Labeller
from inspector.recording import panels, viewer, views
from inspector.recording import robot as scene
from inspector.recording.run import writing
from inspector.recording.viewer import HOST
from inspector.recording.views import (
    TIMELINE,
    Camera,
    Label,
    Panel,
    log_events,
    scalars,
    style_lines,
)
from inspector.reference.verdicts import LOUDER
from inspector.report import spoken
from noiseclassifier import UNKNOWN, Event, Labels
from noiseclassifier.labels import interval
from noisemodel.noise import decibel
from noisemodel.types import Array, Mask

# Another than recordings of whole runs have: the viewer keeps a layout for each application.
APPLICATION = "inspector-live"
PORT = int(viewer.PORT)
ADDRESS = re.compile(r"(?:rerun\+http://)?(?:(?P<host>[^:/]+):)?(?P<port>\d{1,5})(?:/proxy)?")
CHECK_INTERVAL = 1.0  # time between checks that the viewer is still there, in [s]
LATE = 10.0  # how far behind the stream a viewer may be before it is sent no more, in [s]
FLUSH_TIMEOUT = 5.0  # how long the last messages may take, in [s]
MEMORY = "2GB"  # what a viewer that is opened here may keep; then it drops the oldest


class SinkError(InspectorError):
    """A viewer or a file that nothing can be drawn into."""


class Sink:
    """A recording with its sinks: a file, which is whole once it is closed, a viewer, or both."""

    def __init__(
        self, save: Path | None = None, connect: str | None = None, *, overwrite: bool = False
    ) -> None:
        self.saved, self.gone = save is not None, False  # gone: there was a viewer, or it is late
        self._checked = time.monotonic()
        self._asked: float | None = None  # since when the viewer lacks what had been sent by then
        self._ended = Signal()
        # What takes what is logged: of one identity, but two, since a viewer that is late or hangs
        # would hold the file up.
        self.open: list[rr.RecordingStream] = []
        self._viewer: rr.RecordingStream | None = None
        identity = uuid.uuid4().hex
        places = []
        with ExitStack() as stack:
            if save is not None:
                file = writing(save, identity, application=APPLICATION, overwrite=overwrite)
                self.open.append(stack.enter_context(file))
                places.append(f"written to {save}")
            if connect is not None or save is None:
                self._address = host, port = _viewer(connect)
                self._viewer = rr.RecordingStream(APPLICATION, recording_id=identity)
                self._viewer.set_sinks(rr.GrpcSink(f"rerun+http://{host}:{port}/proxy"))
                self.open.append(self._viewer)
                places.append(f"shown by the viewer at {host}:{port}")
                Thread(target=self._follow, args=(self._viewer,), daemon=True).start()
            self._stack = stack.pop_all()
        self.where = " and ".join(places)
        self.recording: rr.RecordingStream = cast(Any, _Tee(self.open))

    @property
    def watched(self) -> bool:
        """Whether there is, or was, a viewer."""
        return self._viewer is not None

    def check_viewer(self) -> bool:
        """Check once in a second that the viewer is there and keeps up."""
        if self._viewer is None or self.gone or time.monotonic() - self._checked < CHECK_INTERVAL:
            return False
        self._checked = time.monotonic()
        behind = 0.0 if self._asked is None else self._checked - self._asked
        self.gone = behind > LATE or not viewer.listens(*self._address)
        if self.gone:
            self.open.remove(self._viewer)
        return not self.gone

    def _follow(self, shown: rr.RecordingStream) -> None:
        """Note since when the viewer is behind, until the recording ends."""
        while not self._ended.wait(CHECK_INTERVAL):
            self._asked = self._asked or time.monotonic()
            with suppress(RuntimeError):  # it takes longer, or is gone
                shown.flush(timeout_sec=CHECK_INTERVAL)
                self._asked = None

    def discard(self) -> None:
        """End a recording in which there is nothing, and leave no file."""
        self._leave()
        with suppress(SinkError), self._stack:
            raise SinkError("nothing was recorded")  # ends the context that writes the file

    def close(self) -> bool:
        """Send what waits, and put the file in its place if it is whole."""
        if self._viewer is not None and not self.gone:
            try:
                self._viewer.flush(timeout_sec=FLUSH_TIMEOUT)
            except RuntimeError:
                self.gone = True
        self._leave()
        self._stack.close()
        return not self.gone

    def _leave(self) -> None:
        """Leave the viewer; of one that hangs or is late rerun waits without end."""
        self._ended.set()
        if self._viewer is not None:
            ending = Thread(target=self._viewer.disconnect, daemon=True)
            ending.start()
            ending.join(FLUSH_TIMEOUT)
            if ending.is_alive():
                views.abandon(self._viewer)


class _Tee:
    """Logs into every recording that is open, by the methods of one."""

    def __init__(self, recordings: Sequence[rr.RecordingStream]) -> None:
        self._recordings = recordings

    def __getattr__(self, name: str) -> Callable[..., None]:
        def log(*args: Any, **options: Any) -> None:
            for each in self._recordings:
                getattr(each, name)(*args, **options)

        return log


def _viewer(connect: str | None) -> tuple[str, int]:
    """Find the viewer at an address, or find or open one on this machine."""
    host, port = HOST, PORT
    if connect is not None:
        match = ADDRESS.fullmatch(connect)
        if match is None or not 0 < int(match["port"]) < 65536:
            expected = "expected PORT, HOST:PORT or rerun+http://HOST:PORT/proxy"
            raise SinkError(f"{connect!r} is no address of a viewer; {expected}")
        host, port = match["host"] or HOST, int(match["port"])
    if viewer.listens(host, port):
        return host, port
    problem = "nothing listens there; `rerun` starts one"
    if connect is None and viewer.has_display():
        problem = viewer.launch(str(port), "--expect-data-soon", "--memory-limit", MEMORY)
    elif connect is None:
        problem = "there is no display to open one on"
    if problem:
        advice = "use --connect HOST:PORT or --save FILE.rrd"
        raise SinkError(f"no viewer at {host}:{port}, {problem}; {advice}")
    return host, port


# Lines are drawn at once for this time, in [s]: a message costs more than the points in it.
SEND_INTERVAL = 0.1
# The same for a file without a viewer, in [s]: rerun keeps some hundred bytes of each message until
# the end.
FILE_INTERVAL = 10.0


Columns: TypeAlias = Callable[[Any], Iterable[Any]]
Times: TypeAlias = NDArray[np.timedelta64]


class Messages:
    """Holds rows of entities back until a message has enough of them."""

    def __init__(self, recording: rr.RecordingStream, *, watched: bool = True) -> None:
        self.recording, self._watched = recording, watched
        self._interval = SEND_INTERVAL if watched else FILE_INTERVAL
        self._held = 0.0  # time that waits, in [s]
        self._waiting: dict[str, tuple[Columns, list[tuple[Times, Any]]]] = {}

    def add(
        self,
        path: str,
        time: Times,
        values: Any,
        columns: Columns = scalars,
        *,
        urgent: bool = False,
    ) -> None:
        """Let rows wait; `columns` makes rerun's columns of all that waited."""
        if len(time):
            self._waiting.setdefault(path, (columns, []))[1].append((time, values))
            if urgent and self._watched:
                self._send(path)

    def passed(self, seconds: float) -> None:
        """Send what waits if enough time has passed."""
        self._held += seconds
        if self._held >= self._interval:
            self.flush()

    def flush(self) -> None:
        """Send what waits."""
        for path in list(self._waiting):
            self._send(path)
        self._held = 0.0

    def _send(self, path: str) -> None:
        columns, pieces = self._waiting.pop(path)
        time, values = (np.concatenate(each) for each in zip(*pieces, strict=True))
        index = rr.TimeColumn(TIMELINE, duration=time)
        self.recording.send_columns(path, indexes=[index], columns=columns(values))


def nanoseconds(time: Array) -> Times:
    """Times in [s] as rerun counts them."""
    return np.round(1e9 * time).astype("timedelta64[ns]")


class SpectrogramStream:
    """Levels of the loudest joint in bands of a logarithmic axis, on a fixed scale."""

    def __init__(self, rate: float) -> None:
        self._rate, self._length = rate, window_length(rate)
        self._hop = max(1, self._length // 4)
        self._frequency = rate / self._length * np.arange(1.0, self._length // 2 + 1)
        self.edges = np.geomspace(self._frequency[0], self._frequency[-1], panels.BANDS + 1)
        # Joint by joint those that wait for others, NaN where not valid.
        self._samples = np.empty((1, 0))

    def skip(self) -> None:
        """Begin anew after a gap, with a window that touches it and is dark."""
        self._samples = np.full((1, self._hop), np.nan)

    def push(self, velocity: Array, valid: Mask, end: float) -> tuple[Array, Array]:
        """Take samples; centres of windows in [s], and levels, shape (columns, bands)."""
        length, hop = self._length, self._hop
        held = np.broadcast_to(self._samples, (velocity.shape[1], self._samples.shape[1]))
        samples = np.concatenate((held, np.where(valid, velocity.T, np.nan)), axis=1)
        count = max(0, (samples.shape[1] - length) // hop + 1)
        self._samples = samples[:, count * hop :]
        if not count:
            return np.empty(0), np.empty((0, panels.BANDS))
        # Shape (joints, windows, length).
        windows = np.lib.stride_tricks.sliding_window_view(samples, length, axis=1)[:, ::hop]
        # In a window, slow motion is a line all but: what is left of it is below 10 Hz.
        ramp = np.arange(length) - (length - 1) / 2
        slope = windows @ ramp / (ramp @ ramp)
        level_windows = (windows - slope[..., None] * ramp).reshape(-1, length)
        amplitude = amplitudes(level_windows).reshape(*windows.shape[:2], -1).max(axis=0)
        level = 2 * decibel(in_bands(self._frequency, amplitude.T, self.edges))
        level = np.fmin(np.fmax(SPECTRUM.place(level), 0.0), 1.0).T  # 0 where one is NaN
        since = samples.shape[1] - hop * np.arange(count)  # samples from starts to the end
        return np.asarray(end - (since - length / 2) / self._rate), level


ROOM = 1.6  # what the camera sees, by the size of the robot as it stands at first
# How far the floor of a robot that moves its base reaches from the first pose, in [m].
AROUND = np.array([[-20.0, -20.0], [20.0, 20.0]])
ROBOT: colors.Color = (190, 192, 198)


class LiveRobot:
    """A robot in a live recording."""

    def __init__(
        self, messages: Messages, robot: str, joint_names: Sequence[str], *, moves: bool
    ) -> None:
        self._messages, self._names = messages, joint_names
        recording = messages.recording
        self._drawn = scene.log_robot(recording, robot, joint_names, moves=moves, color=ROBOT)

    def _poses(self, signals: Mapping[str, Array], row: int) -> Array | None:
        """Poses of all links in a sample; None if one is not known."""
        position, base = signals["position"][row], signals.get("base_pose")
        if not np.isfinite(position).all():
            return None
        if base is not None and not (np.isfinite(base[row]).all() and base[row, 3:].any()):
            return None
        columns = dict(zip(self._names, position[:, None], strict=True))
        return self._drawn.poses(1, columns, None if base is None else base[[row]])

    def camera(self, signals: Mapping[str, Array]) -> Camera:
        """Place the camera by the first pose, before it is known what will come."""
        poses = self._poses(signals, 0)
        poses = self._drawn.poses(1, {}, None) if poses is None else poses
        parts = scene.reached(self._drawn, poses)
        seen = scene.standing(scene.fitted(parts, room=ROOM), self._drawn)
        if self._drawn.moves:
            around = poses[0, -1, :2] + AROUND
            scene.log_floor(self._messages.recording, self._drawn, seen, around)
        return seen

    def show(self, time: float, signals: Mapping[str, Array]) -> None:
        """Move the robot to the last pose, if it is known, at a time in [s]."""
        if (poses := self._poses(signals, -1)) is not None:
            index = nanoseconds(np.full(poses.shape[1], time))
            self._messages.add("/robot/motion", index, poses[0], self._drawn.columns, urgent=True)


JOINT_POINTS = 400.0  # points of a joint's line in a second, as a recording of ten seconds has
NOISE_POINTS = 4000.0
SHOWN = 10.0  # time that plots reach back, in [s]
NOISE, BANDS_PATH, SCORES = "/noise/simplified", "/spectrogram/bands", "/score"
NOISE_PANEL = Panel("noise", 130.0)
SPECTROGRAM_PANEL, SIGNALS_PANEL = Panel("spectrogram", 150.0), Panel("signals", 390.0)


class Drawing:
    """Draws into a recording."""

    def __init__(
        self,
        sink: Sink,
        rate: float,
        robot: str | None,
        joint_names: Sequence[str],
        widths: Mapping[str, int],
        labeller: Labeller,
    ) -> None:
        self._sink, self._recording, self._rate = sink, sink.recording, rate
        self._messages = Messages(sink.recording, watched=sink.watched)
        self._spectrogram = SpectrogramStream(rate)
        moves, self._robot = "base_pose" in widths, None
        if robot is not None:
            self._robot = LiveRobot(self._messages, robot, joint_names, moves=moves)
        self._hop, classes = labeller.hop, labeller.classes
        self._colours = colors.of_classes((*classes, UNKNOWN, LOUDER))
        self._rows = (*(name for name in classes if name != "ok"), UNKNOWN, "ok")
        height = panels.ROW * len(self._rows) + views.AXIS
        self._classes = Panel("class", height) if classes else None
        self._told = ""  # verdict that is drawn
        self._plots: dict[str, dict[str, slice]] = {}  # columns of each entity, by signal
        self._titles: dict[str, list[str]] = {}  # entities of each plot
        size = panels.JOINTS_PER_PLOT
        for kind in widths:
            measured, desired, _ = kind.partition("_desired")
            if measured not in panels.UNITS:
                continue
            for number, first in enumerate(range(0, len(joint_names), size)):
                path, columns = f"/joints/{measured}/{number}{desired}", slice(first, first + size)
                which = f" {number + 1}" if len(joint_names) > size else ""
                title = f"{measured}{which} [{panels.UNITS[measured]}]"
                self._plots.setdefault(kind, {})[path] = columns
                self._titles.setdefault(title, []).append(path)
                names = [f"{name} desired" if desired else name for name in joint_names[columns]]
                shades = colors.of_series(len(names), dim=bool(desired))
                style_lines(self._recording, path, names=names, colours=shades)
        self._style(classes)

    def _style(self, classes: tuple[str, ...]) -> None:
        """Log how everything but the joints' signals is drawn, and what stands beside it."""
        recording, nothing = self._recording, [Label(0.5, "")]  # else the viewer says: no data
        style_lines(recording, NOISE, names=["simplified [rad/s]"], colours=[colors.NOISE])
        noise = Label(0.5, "noise p\u0302\n[rad/s]")
        views.log_beside(recording, NOISE_PANEL, [noise], nothing)
        views.log_beside(recording, SIGNALS_PANEL, nothing, nothing)
        # A line of one entity each: an entity each would cost a message each.
        edges = self._spectrogram.edges
        bands = rr.SeriesLines(
            names=[f"{centre:.0f} Hz" for centre in np.sqrt(edges[:-1] * edges[1:]).tolist()],
            widths=[panels.LINE_WIDTH] * panels.BANDS,
            aggregation_policy="Off",
            interpolation_mode="StepAfter",
        )
        recording.log(BANDS_PATH, bands, static=True)
        left = panels.band_axis(SPECTROGRAM_PANEL, edges, "spectrum,\nloudest\njoint")
        views.log_beside(recording, SPECTROGRAM_PANEL, left, SPECTRUM)
        if self._classes is None:
            return
        own = [self._colours[name] for name in classes]
        style_lines(recording, SCORES, names=classes, colours=own)
        self._titles["Scores"] = [SCORES]
        shades = [self._colours[name] for name in self._rows]
        names = [spoken(name) for name in self._rows]
        found = dict(zip(names, shades, strict=True))
        views.style_bands(recording, "/class/found", found, views.COPIES)
        named = views.row_labels(names, list(map(panels.readable, shades)))
        views.log_beside(recording, self._classes, named, nothing)

    def begin(self, signals: Mapping[str, Array]) -> None:
        """Send the layout with the first sample, whose pose places the camera.

        Every plot shows the last ten seconds.
        """
        over_time = [
            views.timed(NOISE_PANEL, title="Noise", between=None, last=SHOWN),
            views.timed(SPECTROGRAM_PANEL, title="Spectrum", last=SHOWN),
        ]
        left = [(views.events("Events"), 2.4)]
        if self._classes is not None:  # otherwise there is no verdict
            over_time.insert(0, views.timed(self._classes, title="Classes", last=SHOWN))
            left.insert(0, (views.drawing("/verdict"), 0.32))
        if self._robot is not None:
            left.insert(-1, (views.robot("Robot", "/robot", self._robot.camera(signals)), 4.4))
        plots = [
            views.timed(
                SIGNALS_PANEL, "/joints", title=title, name=title, between=None, paths=paths,
                legend=True, last=SHOWN,
            )
            for title, paths in self._titles.items()
        ]  # fmt: skip
        over_time.append((views.tabs(*(part for part, _ in plots)), SIGNALS_PANEL.height))
        whole = views.beside((views.above(*left), 36.0), (views.above(*over_time), 64.0))
        self._recording.send_blueprint(views.blueprint(whole, following=True))

    def piece(self, velocity: Array, valid: Mask, end: float, *, after_gap: bool) -> None:
        """Draw the spectrogram of a stretch without missing samples that ends at a time in [s]."""
        if after_gap:
            self._spectrogram.skip()
        centres, level = self._spectrogram.push(velocity, valid, end)
        if self._sink.open:
            self._messages.add(BANDS_PATH, nanoseconds(centres), level, _heat_map)

    def batch(self, time: Array, motion: Array, valid: Mask, signals: Mapping[str, Array]) -> None:
        """Draw the noise, the joints' signals and the robot of the next stretch, where valid."""
        seconds = len(valid) / self._rate
        noise = nm.simplified(motion)[:, None]
        self._lines(time[valid], noise[valid], {NOISE: slice(None)}, seconds * NOISE_POINTS)
        for kind, plots in self._plots.items():
            known = valid & np.isfinite(signals[kind]).all(axis=1)
            self._lines(time[known], signals[kind][known], plots, seconds * JOINT_POINTS)
        if self._robot is not None:
            self._robot.show(float(time[-1]), signals)
        self._messages.passed(seconds)

    def _lines(self, time: Array, values: Array, plots: Mapping[str, slice], points: float) -> None:
        shown, thin = extremes(time, values, points=max(2, round(points)))
        index = nanoseconds(shown)
        for path, columns in plots.items():
            self._messages.add(path, index, thin[:, columns])

    def labels(self, labels: Labels) -> None:
        """Draw the scores of frames at their centres, and their raw classes around these.

        Each frame has the time around its centre, as in the recording of a whole run.
        """
        centres = (labels.start + labels.stop) / 2
        self._messages.add(SCORES, nanoseconds(centres), labels.scores, urgent=True)
        begins, ends = (nanoseconds(centres + sign * self._hop / 2) for sign in (-1, 1))
        # A value that is none before each: where frames are missing, nothing is drawn.
        times = np.stack((begins - 1, begins, ends - 3), axis=1)
        shown = labels.raw[:, None] == np.array(self._rows)
        states = np.stack((np.zeros_like(shown), shown, shown), axis=1)
        points = states.reshape(-1, len(self._rows))
        self._messages.add("/class/found", times.ravel(), points, _found, urgent=True)

    def verdict(self, time: float, status: Status, found: Sequence[Event]) -> None:
        """Show the verdict on the stream so far, where it changes."""
        count = Counter(spoken(event.label) for event in found)
        kinds = ", ".join(f"{number} {label}" for label, number in count.items())
        told = {Status.OK: "PASS so far", Status.CANNOT_TELL: "CANNOT TELL"}
        words = told.get(status, f"FAIL   {kinds}".strip())
        if self._classes is not None and words != self._told:
            self._told = words
            views.log_verdict(self._recording, status, words, time)

    def found(self, event: Event, over: bool) -> None:
        """Add a finding that begins or is over to the list of events."""
        time, line = event.start, f"found: {spoken(event.label)} from {event.start:.2f} s"
        if over:
            span = interval(event.start, event.stop)
            time, line = event.stop, f"over: {spoken(event.label)}, {span}, score {event.score:.2f}"
        self.event(time, line, self._colours[event.label])

    def event(self, time: float, text: str, colour: colors.Color = colors.CLASSES[UNKNOWN]) -> None:
        """Add a line to the list of events."""
        log_events(self._recording, [(time, text, colour)])

    def finish(self, time: float, status: Status, found: Sequence[Event]) -> None:
        """Show what waits, and the verdict on the whole stream."""
        self.verdict(time, status, found)
        self._messages.flush()


def _heat_map(level: Array) -> list[Any]:
    """Columns of lines that are bands, in colours of their levels, shape (columns, bands)."""
    return views.shaded(np.array(views.middles(level.shape[1])[::-1]), colors.heat(level))


def _found(shown: Mask) -> Iterable[Any]:
    """Columns of bands in rows of classes, drawn where a class is shown, shape (points, rows)."""
    count, (upper, lower) = shown.shape[1], panels.FOUND
    middles = views.TOP * (1.0 - (np.arange(count) + (upper + lower) / 2) / count)
    bands = np.where(shown, middles, np.nan).repeat(views.COPIES, axis=1)
    return views.band_columns(bands, views.TOP * (lower - upper) / 2 / count)
