"""What a live session does with a batch of samples: noise, labels, drawings."""

import time as clocks
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

import noisemodel as nm
from inspector.library import Library
from inspector.live.blueprint import SHOWN, Contents, layout
from inspector.live.buffer import SampleBuffer
from inspector.live.clock import Clock
from inspector.live.drawing import Drawing
from inspector.live.findings import SETTLED, Findings, News
from inspector.live.labeller import NOISY, Labeller
from inspector.live.lane import Lane
from inspector.live.links import LinkLevels
from inspector.live.robot import LiveRobot
from inspector.live.sink import Sink
from inspector.live.spectrogram import SpectrogramStream
from inspector.live.warnings import Warnings
from inspector.wrongrobot import LONG, LimitWatch
from noiseclassifier import Event
from noisemodel.types import Array, Mask

POSES = 40
"""Poses of the robot in a message to a file without a viewer: 2 s."""
MAX_DELAYS = 100_000
"""Delays that are kept, of the latest labels."""


class Worker:
    """Works on batches of samples, one after the other.

    Args:
        sink: Where to draw.
        rate: Nominal samples per second, in [Hz].
        robot: The robot to draw; None draws none.
        joint_names: Names of the joints.
        widths: Columns of each signal.
        library: Models to choose from.
        warnings: Where to count what cannot be shown.
        watch: The limits of the robot that the samples are said to be of; None checks none.
        on_finding: Called with each finding when it is there, and when it is over.

    Raises:
        RobotError: If the robot cannot be read.
        MeshError: If one of its meshes cannot be read.
        UnknownJointError: If the robot lacks a joint.
    """

    def __init__(
        self,
        sink: Sink,
        *,
        rate: float,
        robot: str | None,
        joint_names: Sequence[str],
        widths: Mapping[str, int],
        library: Library,
        warnings: Warnings,
        watch: LimitWatch | None = None,
        on_finding: Callable[[Event, bool], None] | None = None,
    ) -> None:
        self.samples, self._now = 0, 0.0
        self._unconfirmed = 0  # samples since the viewer was last known to be there
        self._rate, self._sink, self._warnings = rate, sink, warnings
        self._noisy = [name for name in NOISY if name in widths]
        self._clock, self._spectrogram = Clock(rate, warnings), SpectrogramStream(rate)
        self._labeller = Labeller(library, rate, widths)
        self._lane = Lane(self._labeller.hop, self._labeller.length)
        self._counts: Counter[str] = Counter()
        self._findings = Findings()
        wait = self._labeller.length + SETTLED * self._labeller.hop
        self._news, self._on_finding = News(self._tell, wait), on_finding
        self._delays: deque[float] = deque(maxlen=MAX_DELAYS)
        self._robot = None
        self._links: LinkLevels | None = None
        self._watch = watch
        if robot is not None:
            floating = "base_pose" in widths
            self._robot = LiveRobot(
                sink.recording,
                robot,
                joint_names,
                floating=floating,
                at_once=1 if sink.watched else POSES,
            )
            self._links = self._levels_of(robot, joint_names, floating=floating)
        self._drawing = Drawing(
            sink.recording,
            joint_names,
            list(widths),
            self._labeller.classes,
            self._spectrogram.edges,
            watched=sink.watched,
        )
        self._contents: Contents | None = None  # until the first sample
        if self._labeller.remark:
            warnings.emit(self._labeller.remark)

    @property
    def model(self) -> str:
        """Name of the model that labels; empty without one."""
        return self._labeller.model

    @property
    def reason(self) -> str:
        """Why there are no labels; empty if a model labels."""
        return "" if self._labeller.model else self._labeller.remark

    @property
    def frame(self) -> float:
        """Duration of a frame, in [s]; 0 without a model."""
        return self._labeller.length

    @property
    def labels(self) -> Mapping[str, int]:
        """How many frames were labelled, by class."""
        return dict(self._counts)

    @property
    def delays(self) -> Sequence[float]:
        """From a frame's last sample to its label in the recording, in [s]."""
        return tuple(self._delays)

    @property
    def findings(self) -> tuple[Event, ...]:
        """The findings so far, as if the signal ended here."""
        return self._findings.events

    @property
    def frames(self) -> int:
        """How many frames were labelled."""
        return self._findings.frames

    def work(self, buffer: SampleBuffer) -> None:
        """Show the samples that a buffer holds, and empty it."""
        time, received, signals = buffer.take()
        if not len(time):
            return
        self.samples += len(time)
        kept, lost = self._clock.take(time)
        if not kept.any():
            return
        if not kept.all():
            time, received, signals = time[kept], received[kept], _rows(signals, kept)
        self._now = float(time[-1])
        self._lay_out(float(time[0]), signals)
        motion = np.hstack([signals[name] for name in self._noisy])
        valid = np.asarray(np.isfinite(motion).all(axis=1))
        self._note_unknown(time, valid)
        motion = np.where(valid[:, None], motion, 0.0)
        noise = nm.simplified(motion)  # of measured and desired velocities side by side
        edges = [0, *np.flatnonzero(lost[1:] > 0) + 1, len(time)]
        for first, stop in pairwise(edges):  # labels first: their latency counts
            piece = slice(first, stop)
            self._skip(int(lost[first]))
            self._label(time[piece], received[piece], motion[piece], noise[piece], valid[piece])
            self._colour(time[piece], {name: rows[piece] for name, rows in signals.items()})
        if self._sink.alive:
            self._drawing.changes(self._lane.expire(self._now))
            self._drawing.lines(time[valid], noise[valid], _rows(signals, valid), self._rate)
            self._move(self._now, signals)
        self._check_limits(signals)
        self._unconfirmed += len(time)
        if self._sink.check_viewer():
            self._unconfirmed = 0
        if self._sink.gone:
            self.note_unseen()

    def note_unseen(self) -> None:
        """Count the samples since a viewer was last known to be there."""
        rest = "the file goes on" if self._sink.alive else "samples are only labelled and counted"
        line = f"the viewer is gone or hangs, noticed at {self._now:.3f} s: {rest}"
        self._warnings.note("samples that the viewer may not have shown", line, self._unconfirmed)
        self._unconfirmed = 0

    def remark(self, line: str) -> None:
        """Show a line among the events."""
        if self._sink.alive:
            self._drawing.event(self._now, line)

    def finish(self) -> None:
        """Show what waits, and tell of findings that last to the end."""
        self._news.update(self.findings, float("inf"))
        if self._sink.alive:
            self._drawing.changes(self._lane.end())
            if self._labeller.classes and self._contents is not None:
                self._drawing.findings(self._now, self.findings, ())
            if (columns := self._spectrogram.flush()) is not None:
                self._drawing.spectrogram(columns)
            self._drawing.flush()
            if self._robot is not None:
                self._robot.flush()

    def _levels_of(
        self, robot: str, joint_names: Sequence[str], *, floating: bool
    ) -> LinkLevels | None:
        """What colours the robot; nothing where its surface cannot be had."""
        try:
            return LinkLevels(robot, joint_names, self._rate, floating=floating)
        except nm.NoiseModelError as error:
            self._warnings.emit(f"The links are not coloured: {error}.")
            return None

    def _lay_out(self, time: float, signals: Mapping[str, Array]) -> None:
        """Send the layout with the first sample, whose pose places the camera, and at 10 s."""
        known = self._contents
        if known is None:
            camera = None
            if self._robot is not None:
                pose = signals.get("base_pose")
                first = None if pose is None else pose[0]
                camera = self._robot.camera(signals["position"][0], first)
                self._robot.colour(time, (), np.empty(0))
            self._contents = Contents(
                joints=self._drawing.plots,
                camera=camera,
                classes=self._drawing.classes,
                links=self._links is not None,
                rate=self._rate,
                start=time,
                full=False,
            )
            if self._labeller.classes:
                self._drawing.findings(time, (), ())
        elif not known.full and time >= known.start + SHOWN:
            self._contents = replace(known, full=True)
        if self._contents is not known and self._contents is not None:
            self._sink.recording.send_blueprint(layout(self._contents))

    def _skip(self, samples: int) -> None:
        if samples:
            self._labeller.skip(samples)
            self._spectrogram.skip()
            if self._links is not None:
                self._links.skip()

    def _label(
        self, time: Array, received: Array, motion: Array, noise: Array, valid: Mask
    ) -> None:
        """Label and draw a stretch without missing samples."""
        end = float(time[-1]) + 1.0 / self._rate
        labels = self._labeller.push(motion, valid)
        columns = self._spectrogram.push(noise, valid, end)
        if labels is not None and len(labels):
            # How far back in the stretch frames end; a lower rate lags behind.
            back = np.rint((self._labeller.elapsed - labels.stop) * self._rate).astype(int)
            shift = end - self._labeller.elapsed
            labels = replace(labels, start=labels.start + shift, stop=labels.stop + shift)
            self._findings.add(labels)
            told = self._findings.confirmed
            self._news.update(told, self._findings.decided, float(labels.stop[-1]))
            labels = replace(labels, label=labels.raw)
            self._counts.update(labels.label.tolist())
            changes = self._lane.take(labels)
            if self._sink.alive:
                self._drawing.labels(labels)
                self._drawing.changes(changes)
                last = len(received) - 1 - back
                before = np.minimum(last, 0) / self._rate
                delay = clocks.perf_counter() - received[np.maximum(last, 0)] - before
                self._delays.extend(delay.tolist())
                self._show_findings(end)
        if columns is not None and self._sink.alive:
            self._drawing.spectrogram(columns)

    def _tell(self, event: Event, over: bool) -> None:
        if self._sink.alive and not over:
            self._drawing.found(event)
        if self._on_finding is not None:
            self._on_finding(event, over)

    def _show_findings(self, end: float) -> None:
        """Show the findings so far; one that reaches the latest frame lasts."""
        found = self.findings
        latest = end - 2 * self._labeller.hop
        self._drawing.findings(end, found, [event for event in found if event.stop >= latest])

    def _check_limits(self, signals: Mapping[str, Array]) -> None:
        """Warn where the motion has been far beyond the limits of the robot for a second."""
        if self._watch is not None:
            self._watch.add(signals.get("position"), signals["velocity"])
            for line in self._watch.warnings(LONG * self._rate):
                self._warnings.note("joints beyond their limits", line)
                self._watch = None
                return

    def _move(self, time: float, signals: Mapping[str, Array]) -> None:
        if self._robot is None:
            return
        position, pose = signals["position"][-1], signals.get("base_pose")
        last = None if pose is None else pose[-1]
        if np.isfinite(position).all() and (last is None or np.isfinite(last).all()):
            self._robot.show(time, position, last)

    def _colour(self, time: Array, signals: Mapping[str, Array]) -> None:
        if self._links is not None and self._robot is not None and self._sink.alive:
            for step in self._links.push(time, signals):
                self._robot.colour(step.time, self._links.links, step.level)

    def _note_unknown(self, time: Array, valid: Mask) -> None:
        if not valid.all():
            line = (
                f"{' or '.join(self._noisy)} is not known at {time[~valid][0]:.3f} s:"
                " such samples make no noise, frames with one have no label"
            )
            self._warnings.note("samples without noise", line, int((~valid).sum()))


def _rows(signals: Mapping[str, Array], chosen: Mask) -> dict[str, Array]:
    if chosen.all():
        return dict(signals)
    return {name: signal[chosen] for name, signal in signals.items()}
