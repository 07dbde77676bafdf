"""A live session: samples in, a viewer that follows."""

import time as clocks
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from inspector.analysis.analyse import headline, status_of
from inspector.analysis.status import Status
from inspector.library import Library, for_robot, load_library
from inspector.live.buffer import SampleBuffer, rows_of, widths_of
from inspector.live.errors import LiveError
from inspector.live.sink import Sink
from inspector.live.warnings import Warnings
from inspector.live.worker import Worker
from inspector.wrongrobot import LimitWatch, check_joints
from noiseclassifier import Event
from noisemodel.bounds import beyond, limit
from noisemodel.limits import joint_limits
from noisemodel.types import Array

BATCH = 0.05
"""Samples are worked on in batches of this duration, in [s]."""


@dataclass(frozen=True)
class Summary:
    """What became of the samples of a session.

    Attributes:
        samples: That were received.
        rate: Nominal samples per second, in [Hz].
        model: Name of the model that labelled, empty without.
        labels: Frames that were labelled, by class.
        warnings: What could not be shown, by kind.
        delays: From a frame's last sample to its label in the recording, of the latest labels,
            in [s].
        where: Where it was shown.
        status: The same as that of `inspector classify` for these labels.
        findings: From the start of the first frame of each to the end of its last.
        reason: Why nothing can be told; empty otherwise.
        frame: Duration of a frame, by which findings may begin too early, in [s].
    """

    samples: int
    rate: float
    model: str
    labels: Mapping[str, int]
    warnings: Mapping[str, int]
    delays: Sequence[float]
    where: str
    status: Status = Status.CANNOT_TELL
    findings: Sequence[Event] = ()
    reason: str = "no frame was labelled"
    frame: float = 0.0

    def __str__(self) -> str:
        counts = ", ".join(f"{count} {label}" for label, count in self.labels.items())
        lines = [
            f"{self.samples} samples, {self.samples / self.rate:.2f} s at {self.rate:g} Hz,"
            f" {self.where}",
            headline(self.status, self.findings, self.reason),
            *(f"  {finding}" for finding in self.findings),
            f"labels by {self.model}: {counts}" if counts else "no labels",
        ]
        if self.delays:
            median, late = (1e3 * delay for delay in np.percentile(self.delays, [50, 99]))
            lines.append(
                f"delay from a sample to its label: median {median:.1f} ms,"
                f" 99 % within {late:.1f} ms"
            )
        lines += [f"{count} {kind}" for kind, count in self.warnings.items()]
        return "\n".join(lines)


class LiveSession:
    """Takes samples while they are measured, and shows them with noise and labels.

    Samples are worked on in batches of 50 ms: `push` returns at once for most, and takes some
    milliseconds for one that completes a batch. A viewer that cannot keep up makes it wait.

    Args:
        rate: Nominal samples per second, in [Hz].
        robot: A robot's name, or the path of a URDF or an MJCF, to be drawn as it moves.
        joint_names: Names of the joints, in the order of their columns; by default those of the
            robot, the first ones if it has more: the others are assumed stationary.
        library: Models to choose from; by default those that ship.
        save: File to write the recording to, whole when the session is closed.
        connect: Address of a viewer that runs. Unless given, and without a file, the viewer on
            this machine is used, and one is opened if none runs.
        overwrite: Whether a file that exists may be replaced.
        on_warning: Called with a line for what cannot be shown, once per kind.
        on_finding: Called with each finding as soon as it is confirmed, and False; and with it and
            True when it is over. The latter are those of the summary.

    Raises:
        LiveError: If the rate is none.
        SinkError: If there is no viewer and none can be opened.
        OutputError: If the file exists or cannot be written.
    """

    def __init__(
        self,
        rate: float,
        *,
        robot: str | None = None,
        joint_names: Sequence[str] = (),
        library: Library | None = None,
        save: str | Path | None = None,
        connect: str | None = None,
        overwrite: bool = False,
        on_warning: Callable[[str], None] = lambda line: None,
        on_finding: Callable[[Event, bool], None] | None = None,
    ) -> None:
        if not 1.0 <= rate < np.inf:
            raise LiveError(f"a rate of {rate:g} Hz; expected 1 or more")
        self._rate, self._robot, self._names = rate, robot, tuple(joint_names)
        self._library = load_library() if library is None else library
        self._on_warning, self._warnings = on_warning, Warnings(self._emit)
        self._on_finding = on_finding
        self._latest = -1.0 / rate
        self._buffer: SampleBuffer | None = None
        self._worker: Worker | None = None
        self._closed = False
        self._sink = Sink(Path(save) if save else None, connect, overwrite=overwrite)

    def push(
        self,
        *,
        velocity: ArrayLike,
        velocity_desired: ArrayLike | None = None,
        position: ArrayLike | None = None,
        base_velocity: ArrayLike | None = None,
        base_pose: ArrayLike | None = None,
        time: ArrayLike | None = None,
        received: float | None = None,
    ) -> None:
        """Take one sample, or a chunk of them.

        The first call says which signals there are. NaN is what is not known: such samples make
        no noise, and frames with one have no label.

        Args:
            velocity: Joint velocities, shape (joints,) or (samples, joints), in [rad/s] or [m/s].
            velocity_desired: Desired joint velocities, of the same shape.
            position: Joint positions, of the same shape, in [rad] or [m].
            base_velocity: Linear, then angular velocity of a floating base in its own axes, shape
                (6,) or (samples, 6), in [m/s] and [rad/s].
            base_pose: x, y, z and quaternion x, y, z, w of it, shape (7,) or (samples, 7).
            time: Timestamps, shape () or (samples,), in [s]; by default samples follow each other.
            received: Reading of ``time.perf_counter()`` when they were, by which the delay of
                labels is measured; by default now.

        Raises:
            LiveError: If shapes do not fit together, or the session is closed.
            UnknownJointError: If the robot lacks a joint.
        """
        received = clocks.perf_counter() if received is None else received
        if self._closed:
            raise LiveError("the session is closed; begin another one")
        given = {
            "velocity": velocity,
            "velocity_desired": velocity_desired,
            "position": position,
            "base_velocity": base_velocity,
            "base_pose": base_pose,
        }
        rows = rows_of({name: value for name, value in given.items() if value is not None})
        stamps = self._stamps(time, len(rows["velocity"]))
        if not len(stamps):
            return
        if self._buffer is None or self._worker is None:
            self._buffer, self._worker = self._begin(rows)
        taken = 0
        while taken < len(stamps):
            rest = {name: array[taken:] for name, array in rows.items()} if taken else rows
            taken += self._buffer.put(rest, stamps[taken:], received)
            if self._buffer.full:
                self._worker.work(self._buffer)

    def note(self, kind: str, line: str, count: int = 1) -> None:
        """Count what could not be pushed, and warn if it is the first of its kind.

        Args:
            kind: What the summary calls it.
            line: What happened.
            count: How often.
        """
        self._warnings.note(kind, line, count)

    @property
    def summary(self) -> Summary:
        """What became of the samples so far."""
        worker, buffer = self._worker, self._buffer
        findings = worker.findings if worker else ()
        frames = worker.frames if worker else 0
        return Summary(
            samples=worker.samples + buffer.held if worker and buffer else 0,
            rate=self._rate,
            model=worker.model if worker else "",
            labels=worker.labels if worker else {},
            warnings=self._warnings.counts,
            delays=worker.delays if worker else (),
            where=self._sink.where,
            status=status_of(frames, findings),
            findings=findings,
            reason=(worker.reason if worker else "") or "no frame was labelled",
            frame=worker.frame if worker else 0.0,
        )

    def close(self) -> Summary:
        """Show what waits, and end the recording.

        Returns:
            What became of the samples.
        """
        if self._closed:
            return self.summary
        self._closed = True
        if self._worker is None or self._buffer is None:
            self._sink.discard()
            return self.summary
        try:
            self._worker.work(self._buffer)
            self._worker.finish()
        finally:
            if not self._sink.close():
                self._worker.note_unseen()
        return self.summary

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _emit(self, line: str) -> None:
        """Warn the program that began the session, and among the events of the recording."""
        self._on_warning(line)
        if self._worker is not None:
            self._worker.remark(line)

    def _begin(self, rows: Mapping[str, Array]) -> tuple[SampleBuffer, Worker]:
        """Fix signals and names by the first samples."""
        widths = widths_of(rows, self._names)
        if widths["velocity"] > limit("joints"):
            raise LiveError(f"{widths['velocity']} joints, {beyond('joints')}")
        names = _names(self._names, self._robot, widths["velocity"])
        absent = check_joints(names, self._robot)
        size = max(1, round(BATCH * self._rate))
        worker = Worker(
            self._sink,
            rate=self._rate,
            robot=self._robot if "position" in widths else None,
            joint_names=names,
            widths=widths,
            library=for_robot(self._library, self._robot),
            warnings=self._warnings,
            watch=LimitWatch(names, self._robot) if self._robot else None,
            on_finding=self._on_finding,
        )
        if self._robot and "position" not in widths:
            self.note("missing signals", "no positions: the robot is not drawn")
        elif absent:
            line = f"not in the log, assumed stationary: {', '.join(absent)}"
            if self._names:
                worker.remark(line)
            else:  # which columns are which joints was assumed
                line = f"taken for {', '.join(names)}; {line} (--names says otherwise)"
                self.note("joints assumed stationary", line, len(absent))
        return SampleBuffer(size, widths, self._warnings), worker

    def _stamps(self, time: ArrayLike | None, samples: int) -> Array:
        if time is None:
            stamps = self._latest + np.arange(1, samples + 1) / self._rate
        else:
            stamps = np.asarray(time, dtype=np.float64).reshape(-1)
            if stamps.shape != (samples,):
                raise LiveError(f"time: shape {stamps.shape}, expected ({samples},)")
        if samples:
            self._latest = float(stamps[-1])
        return stamps


def _names(given: Sequence[str], robot: str | None, joints: int) -> tuple[str, ...]:
    """Name the joints: as they were named, as the robot names them, or by numbers."""
    if given:
        return tuple(given)
    if robot is None:
        return tuple(f"joint{number + 1}" for number in range(joints))
    names = tuple(joint_limits(robot))
    if len(names) < joints:
        raise LiveError(
            f"{joints} velocities, and {robot} has {len(names)} joints: {', '.join(names)};"
            " name those of the samples (--names)"
        )
    return names[:joints]
