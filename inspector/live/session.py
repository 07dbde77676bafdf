"""A live session: samples in, a viewer that follows."""

import time as clocks
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from inspector.library import Library, for_robot, load_library
from inspector.live.block import Block, rows_of, widths_of
from inspector.live.errors import LiveError
from inspector.live.sink import Sink
from inspector.live.summary import Summary
from inspector.live.warnings import Troubles
from inspector.live.worker import Worker
from noisemodel import Robot
from noisemodel.types import Array

BLOCK = 0.05
"""Samples are worked on in blocks of this duration, in [s]."""


class LiveSession:
    """Takes samples while they are made, and shows them with noise and labels.

    Samples are worked on in blocks of 50 ms: `push` returns at once for most, and takes some
    milliseconds for one that completes a block. A viewer that cannot keep up makes it wait.

    Args:
        rate: Nominal samples per second, in [Hz].
        robot: A listed robot or the path of a URDF, to be drawn as it moves.
        joint_names: Names of the joints, in the order of their columns; by default those of the
            robot.
        library: Models to choose from; by default those that ship.
        save: File to write the recording to, whole when the session is closed.
        connect: Address of a viewer that runs. Unless given, and without a file, the viewer on
            this machine is used, and one is opened if none runs.
        overwrite: Whether a file that exists may be replaced.
        tell: Is given what cannot be shown, a line each, once per kind.

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
        tell: Callable[[str], None] = lambda line: None,
    ) -> None:
        if not 1.0 <= rate < np.inf:
            raise LiveError(f"a rate of {rate:g} Hz; expected 1 or more")
        self._rate, self._robot, self._names = rate, robot, tuple(joint_names)
        self._library = load_library() if library is None else library
        self._tell, self._troubles = tell, Troubles(self._say)
        self._latest = -1.0 / rate
        self._block: Block | None = None
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
        came: float | None = None,
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
            time: Stamps, shape () or (samples,), in [s]; by default samples follow each other.
            came: Reading of ``time.perf_counter()`` when they came, by which the delay of labels
                is measured; by default now.

        Raises:
            LiveError: If shapes do not fit together, or the session is closed.
            UnknownJointError: If the robot lacks a joint.
        """
        came = clocks.perf_counter() if came is None else came
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
        if self._block is None or self._worker is None:
            self._block, self._worker = self._begin(rows)
        taken = 0
        while taken < len(stamps):
            rest = {name: array[taken:] for name, array in rows.items()} if taken else rows
            taken += self._block.put(rest, stamps[taken:], came)
            if self._block.full:
                self._worker.work(self._block)

    def note(self, kind: str, line: str, count: int = 1) -> None:
        """Count something that could not be pushed, and say it if it is the first of its kind.

        Args:
            kind: What the summary calls it.
            line: What happened.
            count: How often.
        """
        self._troubles.note(kind, line, count)

    @property
    def summary(self) -> Summary:
        """What became of the samples so far."""
        worker, block = self._worker, self._block
        return Summary(
            samples=worker.samples + block.held if worker and block else 0,
            rate=self._rate,
            model=worker.model if worker else "",
            labels=worker.labels if worker else {},
            troubles=self._troubles.counts,
            delays=worker.delays if worker else (),
            where=self._sink.where,
        )

    def close(self) -> Summary:
        """Show what waits, and end the recording.

        Returns:
            What became of the samples.
        """
        if self._closed:
            return self.summary
        self._closed = True
        if self._worker is None or self._block is None:
            self._sink.discard()
            return self.summary
        try:
            self._worker.work(self._block)
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

    def _say(self, line: str) -> None:
        """Tell whoever began the session, and whoever looks at it."""
        self._tell(line)
        if self._worker is not None:
            self._worker.remark(line)

    def _begin(self, rows: Mapping[str, Array]) -> tuple[Block, Worker]:
        """Fix signals and names by the first samples."""
        widths = widths_of(rows, self._names)
        names = _names(self._names, self._robot, widths["velocity"])
        size = max(1, round(BLOCK * self._rate))
        worker = Worker(
            self._sink,
            rate=self._rate,
            robot=self._robot if "position" in widths else None,
            joint_names=names,
            widths=widths,
            library=for_robot(self._library, self._robot),
            troubles=self._troubles,
        )
        if self._robot and "position" not in widths:
            self.note("missing signals", "no positions: the robot is not drawn")
        return Block(size, widths, self._troubles), worker

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
    names = Robot.load(robot).joint_names
    if len(names) != joints:
        raise LiveError(
            f"{joints} velocities, and {robot} has {len(names)} joints: {', '.join(names)};"
            " name those of the samples (--names)"
        )
    return names
