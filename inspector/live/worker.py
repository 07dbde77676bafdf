"""What a live session does with a block of samples: noise, labels, drawings."""

import time as clocks
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

import noisemodel as nm
from inspector.library import Library
from inspector.live.block import Block
from inspector.live.clock import Clock
from inspector.live.drawing import Drawing
from inspector.live.labeller import Ear
from inspector.live.lane import Lane
from inspector.live.layout import Contents, layout
from inspector.live.norms import NOISY, Norms
from inspector.live.robot import Moving
from inspector.live.sink import Sink
from inspector.live.spectrogram import Strip
from inspector.live.warnings import Troubles
from noisemodel.types import Array, Mask

REMEMBERED = 100_000
"""Delays that are kept, of the latest labels."""


class Worker:
    """Works on blocks, one after the other.

    Args:
        sink: Where to draw.
        rate: Nominal samples per second, in [Hz].
        robot: The robot to draw; None draws none.
        joint_names: Names of the joints.
        widths: Columns of each signal.
        library: Models to choose from.
        troubles: Where to note what cannot be shown.

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
        troubles: Troubles,
    ) -> None:
        self.samples, self._now = 0, 0.0
        self._unsure = 0  # samples since the viewer was there for sure
        self._rate, self._sink, self._troubles = rate, sink, troubles
        self._noisy = [name for name in NOISY if name in widths]
        self._clock, self._strip = Clock(rate, troubles), Strip(rate)
        self._ear = Ear(library, rate, Norms(widths))
        self._lane = Lane(self._ear.hop, self._ear.length)
        self._heard: Counter[str] = Counter()
        self._delays: deque[float] = deque(maxlen=REMEMBERED)
        self._moving = None
        if robot is not None:
            floating = "base_pose" in widths
            self._moving = Moving(sink.recording, robot, joint_names, floating=floating)
        self._drawing = Drawing(
            sink.recording, joint_names, list(widths), self._ear.classes, self._strip.hertz
        )
        contents = Contents(
            joints=self._drawing.plots,
            root=self._moving.root if self._moving else None,
            classes=bool(self._ear.classes),
            rate=rate,
        )
        sink.recording.send_blueprint(layout(contents))
        if self._ear.remark:
            troubles.tell(self._ear.remark)

    @property
    def model(self) -> str:
        """Name of the model that labels; empty without one."""
        return self._ear.model

    @property
    def labels(self) -> Mapping[str, int]:
        """How many frames were labelled, by class."""
        return dict(self._heard)

    @property
    def delays(self) -> Sequence[float]:
        """From a frame's last sample to its label in the recording, in [s]."""
        return tuple(self._delays)

    def work(self, block: Block) -> None:
        """Show the samples that a block holds, and empty it."""
        held, block.held = block.held, 0
        if not held:
            return
        self.samples += held
        kept, lost = self._clock.take(block.time[:held])
        if not kept.any():
            return
        chosen = slice(held) if kept.all() else np.flatnonzero(kept)
        time, came = block.time[chosen], block.came[chosen]
        signals = {name: buffer[chosen] for name, buffer in block.signals.items()}
        self._now = float(time[-1])
        motion = np.hstack([signals[name] for name in self._noisy])
        valid = np.asarray(np.isfinite(motion).all(axis=1))
        self._note_unknown(time, valid)
        motion = np.where(valid[:, None], motion, 0.0)
        noise = nm.simplified(motion)  # of measured and desired velocities side by side
        edges = [0, *np.flatnonzero(lost[1:] > 0) + 1, len(time)]
        for first, stop in pairwise(edges):  # labels first: somebody waits for them
            piece = slice(first, stop)
            self._skip(int(lost[first]))
            self._hear(time[piece], came[piece], motion[piece], noise[piece], valid[piece])
        if self._sink.alive:
            self._drawing.changes(self._lane.silent(self._now))
            self._drawing.lines(time[valid], noise[valid], _rows(signals, valid), self._rate)
            self._move(self._now, signals)
        self._unsure += len(time)
        if self._sink.knock():
            self._unsure = 0
        if self._sink.gone:
            self.note_unseen()

    def note_unseen(self) -> None:
        """Count the samples since a viewer was last known to be there."""
        rest = "the file goes on" if self._sink.alive else "samples are only labelled and counted"
        line = f"the viewer is gone or hangs, noticed at {self._now:.3f} s: {rest}"
        self._troubles.note("samples that the viewer may not have shown", line, self._unsure)
        self._unsure = 0

    def remark(self, line: str) -> None:
        """Show a line among the events."""
        if self._sink.alive:
            self._drawing.event(self._now, line)

    def finish(self) -> None:
        """Show what waits."""
        if self._sink.alive:
            self._drawing.flush()
            self._drawing.changes(self._lane.end())
            if (columns := self._strip.flush()) is not None:
                self._drawing.spectrogram(columns)

    def _skip(self, samples: int) -> None:
        if samples:
            self._ear.skip(samples)
            self._strip.skip()

    def _hear(self, time: Array, came: Array, motion: Array, noise: Array, valid: Mask) -> None:
        """Label and draw a stretch without missing samples."""
        end = float(time[-1]) + 1.0 / self._rate
        labels = self._ear.hear(motion, valid)
        columns = self._strip.push(noise, valid, end)
        if labels is not None and len(labels):
            # How far back in the stretch frames end; a lower rate lags behind.
            back = np.rint((self._ear.elapsed - labels.stop) * self._rate).astype(int)
            shift = end - self._ear.elapsed
            labels = replace(
                labels,
                start=labels.start + shift,
                stop=labels.stop + shift,
                label=labels.raw,
            )
            self._heard.update(labels.label.tolist())
            changes = self._lane.take(labels)
            if self._sink.alive:
                self._drawing.labels(labels)
                self._drawing.changes(changes)
                last = len(came) - 1 - back
                before = np.minimum(last, 0) / self._rate
                delay = clocks.perf_counter() - came[np.maximum(last, 0)] - before
                self._delays.extend(delay.tolist())
        if columns is not None and self._sink.alive:
            self._drawing.spectrogram(columns)

    def _move(self, time: float, signals: Mapping[str, Array]) -> None:
        if self._moving is None:
            return
        position, pose = signals["position"][-1], signals.get("base_pose")
        last = None if pose is None else pose[-1]
        if np.isfinite(position).all() and (last is None or np.isfinite(last).all()):
            self._moving.show(time, position, last)

    def _note_unknown(self, time: Array, valid: Mask) -> None:
        if not valid.all():
            line = (
                f"{' or '.join(self._noisy)} is not known at {time[~valid][0]:.3f} s:"
                " such samples make no noise, frames with one have no label"
            )
            self._troubles.note("samples without noise", line, int((~valid).sum()))


def _rows(signals: Mapping[str, Array], chosen: Mask) -> dict[str, Array]:
    if chosen.all():
        return dict(signals)
    return {name: signal[chosen] for name, signal in signals.items()}
