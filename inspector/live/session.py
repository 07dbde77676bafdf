"""A live session: samples in, checked by a clock and counted where lost; a viewer that follows."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import inf
from pathlib import Path
from statistics import median
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from inspector.analysis import LEAST_LABELLED, headline
from inspector.errors import InspectorError, Status
from inspector.library import Library, load_library
from inspector.live.drawing import Drawing, Sink
from inspector.live.labels import NOISY, SETTLED, Findings, Labeller, News
from inspector.logs.clocks import UNITS
from inspector.logs.mapping import check_joints
from inspector.logs.motion import ABSURD, LONG, LimitWatch
from inspector.recording.views import FARTHEST
from inspector.reference.levels import LONGEST, Levels, LevelStream
from noiseclassifier import Event, Labels, merged
from noiseclassifier.lasting import SHORTEST
from noisemodel.files import beyond, limit
from noisemodel.robot import joint_limits
from noisemodel.run import LARGEST, unnamed
from noisemodel.types import Array, Mask


class LiveError(InspectorError):
    """Samples that cannot be taken at all."""


class Warnings:
    """Counts warnings by kind, and emits the first of each."""

    def __init__(self, emit: Callable[[str], None]) -> None:
        self.emit = emit
        self.counts: Counter[str] = Counter()

    def note(self, kind: str, line: str, count: int = 1) -> None:
        """Count a warning, and emit it if it is the first of its kind."""
        if count > 0:
            if kind not in self.counts:
                self.emit(line)
            self.counts[kind] += count


# What a session takes, besides the time; as the run file names it.
SIGNALS = ("velocity", "velocity_desired", "position", "base_velocity", "base_pose")


class SampleBuffer:
    """Collects a batch of samples, beside some that wait for those that follow."""

    def __init__(self, size: int, widths: Mapping[str, int], warnings: Warnings) -> None:
        self._size, self._widths, self._warnings = size, widths, warnings
        none = {name: np.empty((0, width)) for name, width in widths.items()}
        self._pieces: list[dict[str, Array]] = [{"time": np.empty(0), **none}]
        self.room = size  # samples that are missing from a batch

    def put(self, rows: Mapping[str, Array], time: Array) -> None:
        """Take samples; missing signals, or of other widths, are unknown."""
        piece = {"time": time}
        for name in sorted(rows.keys() | self._widths.keys()):
            first = self._widths.get(name, 0)
            given = rows.get(name, np.empty((len(time), 0)))
            if (now := given.shape[1]) != first:
                line = f"{name} has {now} columns from {time[0]:.3f} s on, and had {first} at first"
                line += ": not shown, and not labelled where it makes noise"
                self._warnings.note(f"samples with another width of {name}", line, len(time))
                given = np.full((len(time), first), np.nan)
            if name in self._widths:
                piece[name] = given
        self._pieces.append(piece)
        self.room -= len(time)

    @property
    def whole(self) -> dict[str, Array]:
        """All samples that are held: their timestamps and signals."""
        first, *others = self._pieces
        if others:
            first = {name: np.concatenate([p[name] for p in self._pieces]) for name in first}
            self._pieces = [first]
        return first

    def take(self, kept: Mask) -> dict[str, Array]:
        """Take out the signals of the samples that are kept; those after them wait."""
        whole, count, signals = self.whole, len(kept), {}
        for name in self._widths:
            values = whole[name][:count]
            values = values if kept.all() else values[kept]
            # As in a file; places may be far, but their squares must not overflow.
            usable = np.abs(values) < (LARGEST if name == "base_pose" else ABSURD)
            signals[name] = values if usable.all() else np.where(usable, values, np.nan)
        self._pieces = [{name: values[count:] for name, values in whole.items()}]
        self.room = self._size
        return signals


def rows_of(given: Mapping[str, ArrayLike]) -> dict[str, Array]:
    """Bring one sample or a chunk of them into rows, each of shape (samples, columns)."""
    rows: dict[str, Array] = {}
    for name, values in given.items():
        try:
            array = np.array(values, dtype=np.float64)  # a copy: a caller may use his again
        except (TypeError, ValueError) as error:
            raise LiveError(f"{name}: holds no numbers ({error})") from error
        if array.ndim not in (1, 2):
            expected = "expected (joints,) for one sample or (samples, joints)"
            raise LiveError(f"{name}: shape {array.shape}, {expected}")
        rows[name] = np.atleast_2d(array)
        if len(rows[name]) != len(rows["velocity"]):
            listed = ", ".join(f"{len(array)} of {name}" for name, array in rows.items())
            raise LiveError(f"samples differ in number: {listed}")
    return rows


GAP_STEPS = 1.5  # steps after which a sample may be missing; timestamps may jitter by less
MISSING = 0.75  # steps by which a sample is late after the others, if one before it is missing
FEW = 4  # samples in a row that are interpolated if they are missing; more are a gap, as in a file
JUMP_STEPS = 20.0  # steps beyond which a timestamp is believed only once others agree with it
AGREE = 5  # timestamps in a row that make a jump a new segment, and no outlier
# Jump ahead up to which samples are missing, in [s]; beyond, the clock was set.
LONGEST_GAP = 3600.0
RATE_TOLERANCE = 0.05  # share by which the rate of the timestamps may differ from the nominal one
RATE_STEPS = 40  # steps from which a rate is estimated
BACKWARDS, TIMELESS = "samples out of order", "samples without time"
OUTLYING = "outlying timestamps"
# Kinds of warnings of samples that are left out.
DROPPED = (BACKWARDS, TIMELESS, OUTLYING, "malformed rows")


class Clock:
    """Decides by its timestamp what becomes of each sample.

    A sample that follows the one before within 20 steps is taken. A timestamp that lies elsewhere
    is an outlier, unless the next ones agree with it: then the clock has jumped. Up to an hour
    ahead that is a gap; anything else is a new segment, whose times go on from the last one. The
    cost does not depend on how far the clock jumps.
    """

    def __init__(self, rate: float, warnings: Warnings) -> None:
        self._rate, self._warnings = rate, warnings
        self._unit = 0.0  # until it is known
        self._last = self._shift = 0.0  # timestamp of the last sample taken; from there to its time
        self._before: float | None = None  # its time
        self._first_steps: Array | None = np.empty(0)  # until the rate is checked by them
        self._late = 0.0  # steps by which the last sample came later than those before it

    def take(self, stamps: Array, *, ended: bool = False) -> tuple[Mask, Array, Array]:
        """Decide about samples, those that waited before first; if the stream ended, about all.

        Tells which of the decided ones are kept; how many are missing before each that is kept; and
        their times, always increasing, in [s].
        """
        stamps = np.where(np.abs(stamps) < 1e100, stamps, np.nan)  # differences would overflow
        begun = self._unit or self._begin(stamps, ended=ended)
        place, decided = 0, len(stamps) if begun else 0
        known = stamps * self._unit
        time = np.full(len(known), np.nan)  # of those that are left out
        while place < decided:
            follows = self._follows(np.append(self._last, known[place:-1]), known[place:])
            first, place = place, place + int(np.append(follows, False).argmin())
            if first < place:
                time[first:place] = known[first:place] + self._shift
                self._last = float(known[place - 1])
            if place < decided:
                stop, found = self._ahead(known, place)
                if found == "open":
                    stop = decided = decided if ended else stop
                self._note_dropped(known[place:stop])
                if found == "jump":
                    self._jump(float(known[stop]))
                place = stop
        kept = np.isfinite(time[:decided])
        time = time[:decided][kept]
        return kept, self._lost(time), time

    def _begin(self, stamps: Array, *, ended: bool) -> bool:
        """Take the unit of timestamps from the first ones, if there are enough."""
        finite = stamps[np.isfinite(stamps)]
        if len(finite) < AGREE and len(stamps) < 2 * AGREE and not ended:
            return False
        steps = np.diff(finite[:RATE_STEPS])
        step = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 1.0 / self._rate
        fit = [unit for unit in UNITS if 0.5 < step * self._rate * float(UNITS[unit]) < 2.0]
        unit = fit[0] if fit else "seconds"
        self._unit = float(UNITS[unit])
        if unit != "seconds":
            self._warnings.emit(f"timestamps count {unit} at {self._rate:g} Hz: read as such")
        first = float(finite[0]) * self._unit if len(finite) else 0.0
        self._last = first - 1.0 / self._rate
        self._shift = -first if abs(first) > FARTHEST else 0.0
        return True

    def _follows(self, before: Array | float, after: Array | float) -> Mask:
        # Of times, not of stamps: tiny steps vanish in the sum, and times have to increase.
        steps = self._rate * ((after + self._shift) - (before + self._shift))
        return np.asarray((steps > 0.0) & (steps <= JUMP_STEPS))

    def _ahead(self, stamps: Array, place: int) -> tuple[int, str]:
        """Where to go on after a sample that does not follow the last one, and why.

        "old": that sample follows; "jump": from there on enough follow each other; "open": those
        from there on do, but are too few yet.
        """
        chain: list[int] = []  # places of stamps that follow each other
        for index in (place + np.flatnonzero(np.isfinite(stamps[place:]))).tolist():
            if self._follows(self._last, stamps[index]):
                return index, "old"
            if chain and not self._follows(stamps[chain[-1]], stamps[index]):
                chain = []
            chain.append(index)
            if len(chain) == AGREE:
                return chain[0], "jump"
        return chain[0] if chain else len(stamps), "open"

    def _jump(self, stamp: float) -> None:
        """Go on at a timestamp that lies elsewhere."""
        ahead = stamp - self._last
        if not JUMP_STEPS < ahead * self._rate <= LONGEST_GAP * self._rate:
            now = self._last + self._shift
            line = f"the clock jumps by {ahead:+.6g} s at {now:.3f} s: times go on from there"
            self._warnings.note("clock jumps", line)
            self._shift = now + 2.0 / self._rate - stamp  # one sample, at least, is missing
        self._last = stamp - 1.0 / self._rate

    def _lost(self, time: Array) -> Array:
        """Samples that are missing before each time; warns of them, and once of a wrong rate."""
        if not len(time):
            return np.empty(0)
        before = time[0] - 1.0 / self._rate if self._before is None else self._before
        steps = self._rate * np.diff(time, prepend=before)
        self._before = float(time[-1])
        lost = self._missing(steps)
        if lost.any():
            first = int(np.argmax(lost > 0))
            line = f"gap at {time[first]:.3f} s: {lost[first]:.0f} samples are missing"
            self._warnings.note("missing samples", line, int(lost.sum()))
        if self._first_steps is None:
            return lost
        self._first_steps = np.concatenate((self._first_steps, steps))
        if len(self._first_steps) > RATE_STEPS:
            known, self._first_steps = self._first_steps[1:], None
            # Where stamps are rounded, the median is wrong; where samples are missing, the mean.
            step, usual = float(known.mean()), median(known.tolist())
            if min(abs(step - 1.0), abs(usual - 1.0)) > RATE_TOLERANCE:
                rates = f"{self._rate / step:.4g} Hz, the nominal rate is {self._rate:g} Hz"
                line = f"timestamps have {rates}: labels and spectrogram are wrong, set --rate"
                self._warnings.note("wrong rate", line)
        return lost

    def _missing(self, steps: Array) -> Array:
        """Samples that are missing before each: a late one after an early one tells of none."""
        lost = np.zeros(len(steps))
        near = steps[steps < GAP_STEPS]
        usual = float(near.mean()) if len(near) else 1.0
        usual = usual if abs(usual - 1.0) <= RATE_TOLERANCE else 1.0  # as where stamps are rounded
        late, done = self._late, 0
        for place in [*np.flatnonzero(steps >= GAP_STEPS).tolist(), len(steps)]:
            late += float((steps[done : place + 1] - usual).sum())
            if place < len(steps) and late >= MISSING:
                lost[place] = round(late)
                late -= lost[place]
            done = place + 1
        self._late = 0.5 * min(max(late, -0.5), 0.5)  # errors must not add up
        return lost

    def _note_dropped(self, stamps: Array) -> None:
        before, after = stamps[stamps <= self._last], stamps[stamps > self._last]
        if len(before):
            line = f"time stands still or runs backwards at {before[0]:.6g} s: left out"
            self._warnings.note(BACKWARDS, line, len(before))
        if len(after):
            line = f"a timestamp of {after[0]:.6g} s after {self._last:.6g} s: left out"
            self._warnings.note(OUTLYING, line, len(after))
        unknown = len(stamps) - len(before) - len(after)
        self._warnings.note(TIMELESS, "a time is no number: left out", unknown)


BATCH = 0.05  # samples are worked on in batches of this duration, in [s]
FASTEST = 1e6  # highest rate, in [Hz]
MOST_DROPPED = 0.05  # share of the samples that may be left out for a verdict of `ok`
MOST_ADDED = 0.2  # share of the samples that may be missing and interpolated in such a verdict


@dataclass(frozen=True)
class Summary:
    """What became of the samples of a session."""

    samples: int  # that were received
    rate: float  # nominal, in [Hz]
    model: str  # that labelled, empty without
    labels: Mapping[str, int]  # frames by class
    warnings: Mapping[str, int]  # what could not be shown, by kind
    where: str  # it was shown
    status: Status = Status.CANNOT_TELL  # that `inspector classify` gives these labels
    findings: Sequence[Event] = ()  # each from the start of its first frame to the end of its last
    reason: str = "no frame was labelled"  # why nothing can be told
    levels: Levels | None = None  # of the whole session once it is closed, if they were kept
    frames: Labels | None = None  # labels of its frames, if levels were kept
    duration: float = 0.0  # by the timestamps, in [s]

    def __str__(self) -> str:
        counts = ", ".join(f"{count} {label}" for label, count in self.labels.items())
        lines = [
            f"{self.samples} samples, {self.duration:.2f} s at {self.rate:g} Hz, {self.where}",
            headline(self.status, self.findings, self.reason),
            *(f"  {finding}" for finding in self.findings),
            f"labels by {self.model}: {counts}" if counts else "no labels",
        ]
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
        keep_levels: Whether octave levels are kept, of an hour at most, 8 kB a second of 7 joints
            at 1 kHz, which `Reference.compare` takes at the end.
        on_levels: Called every 3 s with the levels of the last 6 s, a second after these came, and
            the labels of all frames. The findings that it returns are drawn instead of those of the
            model.
        on_end: Called with the summary before the recording ends. What it returns is drawn.
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
        keep_levels: bool = False,
        on_levels: Callable[[Levels, Labels | None], Sequence[Event]] | None = None,
        on_end: Callable[[Summary], Summary] = lambda summary: summary,
        on_warning: Callable[[str], None] = lambda line: None,
        on_finding: Callable[[Event, bool], None] | None = None,
    ) -> None:
        if not 1.0 <= rate <= FASTEST:
            raise LiveError(f"a rate of {rate:g} Hz; expected 1 to {FASTEST:.0f}")
        self._rate, self._robot, self._names = rate, robot, tuple(joint_names)
        self._library = load_library() if library is None else library
        self._on_warning, self._warnings = on_warning, Warnings(self._emit)
        self._on_finding, self._on_levels, self._on_end = on_finding, on_levels, on_end
        self._keep_levels = keep_levels or on_levels is not None
        self._latest = -1.0 / rate  # timestamp that came
        self._first = self._now = 0.0  # time of the first sample, time that was worked on
        self._buffer: SampleBuffer | None = None  # what follows is there once there are samples
        self._samples = self._unconfirmed = 0  # since the viewer was last known to be there
        self._added = 0  # that were missing and are interpolated
        self._last: tuple[Array, dict[str, Array]] | None = None  # time and signals of a sample
        self._counts: Counter[str] = Counter()  # frames that were labelled, by class
        self._levels: Levels | None = None
        self._frames: list[Labels] = []  # if levels are kept
        self._judged: Sequence[Event] = ()  # what `on_levels` found
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

        Raises:
            LiveError: If shapes do not fit together, or the session is closed.
            UnknownJointError: If the robot lacks a joint.
        """
        if self._closed:
            raise LiveError("the session is closed; begin another one")
        given = (velocity, velocity_desired, position, base_velocity, base_pose)
        named = zip(SIGNALS, given, strict=True)
        rows = rows_of({name: values for name, values in named if values is not None})
        samples = len(rows["velocity"])
        stamps = self._latest + np.arange(1, samples + 1) / self._rate
        if time is not None:
            stamps = np.asarray(time, dtype=np.float64).reshape(-1)
        if stamps.shape != (samples,):
            raise LiveError(f"time: shape {stamps.shape}, expected ({samples},)")
        if not samples:
            return
        self._latest = float(stamps[-1])
        buffer = self._buffer = self._buffer or self._begin(rows)
        taken = 0
        while taken < len(stamps):
            piece = slice(taken, taken + buffer.room)
            buffer.put({name: array[piece] for name, array in rows.items()}, stamps[piece])
            taken = piece.stop
            if buffer.room <= 0:
                self._work(buffer)

    def note(self, kind: str, line: str, count: int = 1) -> None:
        """Count what could not be pushed, and warn if it is the first of its kind."""
        self._warnings.note(kind, line, count)

    @property
    def summary(self) -> Summary:
        """What became of the samples so far."""
        counts = dict(self._warnings.counts)
        if self._buffer is None:
            return Summary(0, self._rate, "", {}, counts, self._sink.where)
        labeller, findings = self._labeller, self._found
        samples = self._samples + len(self._buffer.whole["time"])
        status = Status.FINDINGS if findings else Status.OK
        if not self._counts.total():
            status = Status.CANNOT_TELL
        reason = labeller.remark or "no frame was labelled"
        if status is Status.OK and (reason := self._doubt(samples)):
            status = Status.CANNOT_TELL
        return Summary(
            samples=samples,
            rate=self._rate,
            model=labeller.model,
            labels=dict(self._counts),
            warnings=counts,
            where=self._sink.where,
            status=status,
            findings=findings,
            reason=reason,
            levels=self._levels,
            frames=self._kept,
            duration=self._now - self._first + 1.0 / self._rate,
        )

    def _doubt(self, samples: int) -> str:
        """Why a stream of so many samples without findings is not `ok`; empty if it is."""
        dropped = [(n, kind) for kind in DROPPED if (n := self._warnings.counts[kind])]
        if sum(n for n, _ in dropped) > MOST_DROPPED * samples:
            told = ", ".join(f"{n} {kind}" for n, kind in dropped)
            return f"more than {MOST_DROPPED:.0%} of the samples were left out ({told})"
        seconds, labeller, count = samples / self._rate, self._labeller, self._counts.total()
        if seconds < SHORTEST:
            return f"{seconds:.3g} s of samples; it takes {SHORTEST:g} s to tell what lasts"
        if self._added > MOST_ADDED * self._samples:
            return f"{self._added} samples are missing beside {self._samples}: is the rate right?"
        share = count / max(1.0, (seconds - labeller.length) / labeller.hop)
        return f"gaps leave labels to {share:.0%} of the stream" if share < LEAST_LABELLED else ""

    def close(self) -> Summary:
        """Show what waits, tell of findings that last to the end, and end the recording."""
        if self._closed:
            return self.summary
        self._closed = True
        if self._buffer is None:
            self._sink.discard()
            return self.summary
        try:
            self._work(self._buffer, ended=True)
            self._labeller.finish()
            self._news.update(self._found, inf)
            if self._stream is not None:
                self._levels = self._stream.finish()
                if self._stream.too_long:
                    line = f"more than {LONGEST / 60:.0f} minutes are not compared as a whole"
                    self.note("streams too long for a reference", line)
            summary = self._on_end(self.summary)
            self._drawing.finish(self._now, summary.status, summary.findings)
        finally:
            if not self._sink.close():
                self._note_unseen()
        return self.summary

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        self.close()

    def _emit(self, line: str) -> None:
        """Warn the program that began the session, and among the events of the recording."""
        self._on_warning(line)
        if self._buffer is not None:
            self._drawing.event(self._now, line)

    def _begin(self, rows: Mapping[str, Array]) -> SampleBuffer:
        """Fix signals and names by the first samples."""
        widths, robot = {name: array.shape[1] for name, array in rows.items()}, self._robot
        joints = len(self._names) or widths["velocity"]
        for name, width in widths.items():
            expected = {"base_velocity": 6, "base_pose": 7}.get(name, joints)
            if width != expected:
                raise LiveError(f"{name}: {width} columns in the first sample, expected {expected}")
        if joints > limit("joints"):
            raise LiveError(f"{joints} joints, {beyond('joints')}")
        names = self._names or unnamed(joints)
        if not self._names and robot is not None:
            known = tuple(joint_limits(robot))
            if len(known) < joints:
                there = f"{robot} has {len(known)} joints: {', '.join(known)}"
                advice = "name those of the samples (--names)"
                raise LiveError(f"{joints} velocities, and {there}; {advice}")
            names = known[:joints]
        absent = check_joints(names, robot)
        self._stream: LevelStream | None = None
        if self._keep_levels:
            # A file's name is none that a reference knows.
            named = "" if robot is None or Path(robot).suffix else robot
            tell = None if self._on_levels is None else self._compare
            self._stream = LevelStream(names, self._rate, named, tell)
        self._noisy = [name for name in NOISY if name in widths]
        self._clock = Clock(self._rate, self._warnings)
        self._labeller = Labeller(self._library, self._rate, widths)
        self._findings = Findings()
        self._news = News(self._tell, self._labeller.length + SETTLED * self._labeller.hop)
        self._watch = LimitWatch(names, robot) if robot else None
        drawn = robot if "position" in widths else None
        self._drawing = Drawing(self._sink, self._rate, drawn, names, widths, self._labeller)
        if self._labeller.remark:
            self._on_warning(self._labeller.remark)
        if robot and drawn is None:
            self.note("missing signals", "no positions: the robot is not drawn")
        elif absent:
            line = f"not in the log, assumed stationary: {', '.join(absent)}"
            if self._names:
                self._drawing.event(self._now, line)
            else:  # which columns are which joints was assumed
                line = f"taken for {', '.join(names)}; {line} (--names says otherwise)"
                self.note("joints assumed stationary", line, len(absent))
        return SampleBuffer(max(1, round(BATCH * self._rate)), widths, self._warnings)

    @property
    def _found(self) -> tuple[Event, ...]:
        """The findings so far, as if the signal ended here."""
        return merged(*self._findings.events, *self._labeller.lasting)

    @property
    def _kept(self) -> Labels | None:
        """Labels of the frames so far, if levels are kept."""
        self._frames = [Labels.concatenated(self._frames)] if self._frames else []
        return next(iter(self._frames), None)

    def _compare(self, latest: Levels) -> None:
        """Have what came lately judged, and draw what was found."""
        assert self._on_levels is not None
        frames, told = self._kept, len(self._judged)
        if frames is not None and self._stream is not None and self._stream.too_long:
            first = int(np.searchsorted(frames.stop, latest.start))
            self._frames = [frames.part(slice(first, None))]
        self._judged = self._on_levels(latest, frames)
        for event in self._judged[told:]:
            self._drawing.found(event, False)

    def _tell(self, event: Event, over: bool) -> None:
        if self._on_levels is None:
            self._drawing.found(event, over)
        if self._on_finding is not None:
            self._on_finding(event, over)

    def _work(self, buffer: SampleBuffer, *, ended: bool = False) -> None:
        """Show the samples that a buffer holds, and empty it; few may have to wait for others."""
        kept, lost, time = self._clock.take(buffer.whole["time"], ended=ended)
        signals = buffer.take(kept)
        self._samples += len(kept)
        if not len(time):
            return
        if self._last is None:
            self._drawing.begin(signals)
            self._first = float(time[0])
        time, signals, lost = self._filled(time, signals, lost)
        self._now = float(time[-1])
        motion = np.hstack([signals[name] for name in self._noisy])
        valid = np.asarray(np.isfinite(motion).all(axis=1))
        if not valid.all():
            line = f"{' or '.join(self._noisy)} is not known at {time[~valid][0]:.3f} s"
            line += ": such samples make no noise, frames with one have no label"
            self.note("samples without noise", line, int((~valid).sum()))
            motion[~valid] = 0.0
        if self._stream is not None:
            self._stream.push(time, signals, valid, lost)
        edges = [0, *np.flatnonzero(lost[1:] > 0) + 1, len(time)]
        for first, stop in pairwise(edges):
            piece = slice(first, stop)
            if lost[first]:
                self._labeller.skip(int(lost[first]))
            end, velocity = float(time[stop - 1]) + 1.0 / self._rate, signals["velocity"][piece]
            self._label(motion[piece], valid[piece], end)
            self._drawing.piece(velocity, valid[piece], end, after_gap=bool(lost[first]))
        if self._sink.open:
            self._drawing.batch(time, motion, valid, signals)
        if self._watch is not None:
            self._watch.add(signals.get("position"), signals["velocity"])
            if line := next(self._watch.warnings(LONG * self._rate), ""):
                self.note("joints beyond their limits", line)
                self._watch = None
        # Until the viewer is known to be there, it may not have shown what it was sent.
        self._unconfirmed = 0 if self._sink.check_viewer() else self._unconfirmed + len(time)
        if self._sink.gone:
            self._note_unseen()

    def _filled(
        self, time: Array, signals: dict[str, Array], lost: Array
    ) -> tuple[Array, dict[str, Array], Array]:
        """Samples with the few that are missing, interpolated as they are in a file."""
        before, last = self._last, {name: values[-1:] for name, values in signals.items()}
        self._last = (time[-1:], last)
        few = (lost > 0) & (lost <= FEW)
        if before is None or not few.any():
            return time, signals, lost
        place = np.cumsum(1 + np.where(few, lost, 0.0))
        every, known = np.arange(1, place[-1] + 1), np.append(0.0, place)
        found = {}
        for name, values in signals.items():
            whole = np.vstack((before[1][name], values))
            columns = [np.interp(every, known, column) for column in whole.T]
            found[name] = np.reshape(columns, (whole.shape[1], len(every))).T
        self._added += len(every) - len(time)
        left = np.zeros(len(every))
        left[place.astype(int) - 1] = np.where(few, 0.0, lost)
        return np.interp(every, known, np.append(before[0], time)), found, left

    def _label(self, motion: Array, valid: Mask, end: float) -> None:
        """Label and draw a stretch without missing samples that ends at a time in [s]."""
        labels = self._labeller.push(motion, valid, end)
        if labels is None:
            return
        self._findings.add(labels)
        told = merged(*self._findings.confirmed, *self._labeller.lasting)
        decided = min(self._findings.decided, self._labeller.decided)
        self._news.update(told, decided, float(labels.stop[-1]))
        self._counts.update(labels.raw.tolist())
        self._drawing.labels(labels)
        self._frames += [labels] if self._keep_levels else []
        if self._sink.open:
            found = self._found if self._on_levels is None else self._judged
            self._drawing.verdict(end, Status.FINDINGS if found else Status.OK, found)

    def _note_unseen(self) -> None:
        """Count the samples since the viewer was last known to be there and to keep up."""
        rest = "the file goes on" if self._sink.saved else "samples are only labelled and counted"
        line = f"the viewer is gone or hangs, noticed at {self._now:.3f} s: {rest}"
        self.note("samples that the viewer may not have shown", line, self._unconfirmed)
        self._unconfirmed = 0
