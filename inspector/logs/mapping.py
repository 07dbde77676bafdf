"""Logs as written, and which of their columns and arrays hold which signal of which joint.

The options of reading a log tell it, with a mapping that can be saved as TOML; else its format, or
the names of columns. One column is chosen for each signal of each joint.
"""

import json
import re
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, replace
from decimal import Decimal
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np

from inspector.errors import InspectorError, LogError, OptionError
from inspector.logs.names import (
    BASE_SIGNALS,
    JOINT_SIGNALS,
    SIGNALS,
    Naming,
    array_signal,
    column_signal,
    factor_of,
    listed,
    number_of,
    time_column,
    without_unit,
)
from inspector.text import toml_shown
from noiseclassifier.jsontext import from_toml, text_of
from noisemodel import Robot, RobotError, Run, UnknownJointError, UnknownRobotError
from noisemodel.files import write_whole
from noisemodel.robot import Limits, joint_limits
from noisemodel.run import LONGEST, SHORTEST, unnamed
from noisemodel.runfile import ArchiveError, one_line
from noisemodel.types import Array, Mask, Real

# Logs


@contextmanager
def errors_of(
    path: Path, damage: tuple[type[Exception], ...] = (), what: str = "damaged or cut off"
) -> Iterator[None]:
    """Errors of reading a file as errors of a log; those that libraries raise for damage, too."""
    try:
        yield
    except InspectorError:
        raise
    except ArchiveError as error:
        raise LogError(path, str(error)) from error
    except damage as error:
        raise LogError(path, f"{what} ({one_line(error)})") from error
    except OSError as error:
        raise LogError(path, f"cannot be read ({error.strerror or error})") from error


SAMPLES = "samples"  # the unit of stamps that count samples, of a log whose rate is not known yet

ROUND = (1.0, 1.25, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)  # rates, times a power of ten
NEAR = 0.05  # largest relative difference of a nominal rate to the round one that replaces it
BETWEEN, VERY_NEAR = (1.2, 1.5, 2.4, 4.8, 9.6), 0.01  # the same for rates between these
SAME_RATE = 1.01  # ratio of two rates up to which no band is lost from one to the other
COVERS = 0.9  # least share of a signal's time for which another one is to be there
UNIFORM = 1e-3  # largest relative deviation of a uniform clock's steps from their median
GAP = 5.0  # length of a step, in nominal ones, above which it is a gap

PART = re.compile(r"(?P<name>.+)\[(?P<columns>\d*:?\d*)\]")
JOINT = "{joint}"  # what stands for the name of a joint in a pattern of a mapping


class Clock(NamedTuple):
    """Rate, jitter and gaps of timestamps."""

    nominal: float  # inverse of the mean step, without gaps and outliers, in [Hz]
    rate: float  # given; else the nominal one if stamps are uniform, or the nearest round one
    uniform: bool
    jitter_rms: float  # deviation of the steps from that rate's, without gaps, in [s]
    jitter_max: float  # in [s]
    gaps: tuple[tuple[float, float], ...]  # start and end of each, in [s]
    stretches: tuple[slice, ...]  # the samples between gaps


@dataclass(frozen=True, eq=False)
class Stamps:
    """Timestamps of samples; fields that were sampled together share them."""

    start: Decimal  # the first stamp, in [s], exact
    time: Array  # time since the first stamp, as logged, shape (samples,), in [s]
    rows: Sequence[int] | None = None  # line number of each sample, if the file has lines
    unit: str = "seconds"  # of the stamps in the log; `SAMPLES` until the rate is known
    remark: str = ""  # on their source, if it is not the expected one
    rate: float | None = None  # that the log is said to have, in [Hz]
    name: str = ""  # of their column
    stated: tuple[str, float | None] = ("", None)  # what else tells the rate, and that, in [Hz]

    @classmethod
    def counted(cls, samples: int) -> "Stamps":
        """Stamps of a log that has none, until its rate is known."""
        return cls(Decimal(0), np.arange(samples, dtype=np.float64), unit=SAMPLES)

    @cached_property
    def clock(self) -> Clock:
        """Rate, jitter and gaps of increasing stamps."""
        steps = np.diff(self.time)
        step = float(np.median(steps))
        if not SHORTEST <= step <= LONGEST:
            expected = f"{SHORTEST:g} s to {LONGEST:g} s"
            raise InspectorError(f"the stamps' median step is {step:g} s, expected {expected}")
        uniform = bool((np.abs(steps - step) <= UNIFORM * step).all())
        near = steps if uniform else steps[np.abs(steps - step) <= (0.5 + UNIFORM) * step]
        if len(near):  # what rounding makes of a single step would add up
            step = float(near.mean())
        nominal = float(f"{1 / step:.9g}")
        rate = self.rate or nominal
        if not self.rate and not uniform:
            power = 10.0 ** np.floor(np.log10(nominal))
            for digits, near_by in ((BETWEEN, VERY_NEAR), (ROUND, NEAR)):
                plain = float(power * min(digits, key=lambda one: abs(one * power / nominal - 1)))
                if abs(plain / nominal - 1) <= near_by:
                    rate = plain
                    break
        uniform = uniform and abs(rate * step - 1) <= UNIFORM
        wide = np.flatnonzero(steps > GAP / rate * (1 + UNIFORM))
        deviations = np.delete(steps, wide) - 1 / rate
        edges = [0, *(wide + 1), len(self.time)]
        jitter = float(np.sqrt(np.mean(deviations**2))), float(np.abs(deviations).max())
        gaps = tuple((float(self.time[at]), float(self.time[at + 1])) for at in wide)
        stretches = tuple(slice(start, stop) for start, stop in pairwise(edges))
        return Clock(nominal, rate, uniform, *jitter, gaps, stretches)


def fastest(clocks: Iterable[Stamps]) -> list[Stamps]:
    """Those as fast as the fastest of those that last as long as the longest, without gaps."""
    steps = {each: float(np.median(np.diff(each.time))) for each in clocks if len(each.time) > 1}
    lasts = {each: step * len(each.time) for each, step in steps.items()}
    long = [each for each in steps if lasts[each] >= COVERS * max(lasts.values())]
    step = min((steps[each] for each in long), default=0.0)
    return [each for each in long if steps[each] <= SAME_RATE * step]


@dataclass(frozen=True, eq=False)
class Field:
    """One array of a log, as logged."""

    name: str
    values: Real  # shape (samples, columns)
    stamps: Stamps
    joints: tuple[str, ...] = ()  # of the columns, if the log names them
    signal: str = ""  # if the format defines it
    source: str = ""  # the topic or file that it comes from
    rank: int = 0  # of several sources of one signal those with the lowest rank are taken


@dataclass(frozen=True, eq=False)
class Track:
    """One signal of some joints, or of the base."""

    signal: str  # one of `inspector.logs.names.SIGNALS`
    joints: tuple[str, ...]  # of the columns; empty for the base
    labels: tuple[str, ...]  # names of the columns in the log
    stamps: Stamps
    values: Real  # shape (samples, columns)
    missing: Mask | None = None  # samples without values, which are interpolated, shape (samples,)
    angles: Sequence[bool] = ()  # whether each column is an angle, which may wrap

    @property
    def is_desired(self) -> bool:
        """Whether it holds desired motion."""
        return self.signal.endswith("_desired")

    @property
    def quantity(self) -> str:
        """The signal, without saying whether it is desired."""
        return self.signal.removesuffix("_desired")

    def of(self, joints: Sequence[str]) -> Real:
        """Values of some of its joints, shape (samples, joints); no copy if these are all."""
        if tuple(joints) == self.joints:
            return self.values
        return self.values[:, [self.joints.index(joint) for joint in joints]]

    def fault(self, path: Path, problem: str, sample: int) -> LogError:
        """Error that names the place of a problem in the log."""
        if self.stamps.rows is not None:
            return LogError(path, problem, self.stamps.rows[sample])
        at = self.stamps.time[sample] - self.stamps.time[0]
        return LogError(path, f"{problem} (sample {sample + 1}, {at:.6g} s into the log)")


class Entry(NamedTuple):
    """Mapping of one column or array to a signal, or of many columns by a pattern."""

    signal: str  # one of `inspector.logs.names.SIGNALS`, or "time"
    joint: str  # of a single column; of a base its convention; empty for an array of all joints
    source: str  # the column or array, or a part of it: `qpos[7:]`, `qvel[6]`

    @property
    def target(self) -> str:
        """Text before the equals sign."""
        return f"{self.signal}.{self.joint}" if self.joint else self.signal

    @property
    def is_pattern(self) -> bool:
        """Whether it maps all columns that its source fits."""
        return JOINT in self.joint

    def part(self, whole: Container[str] = ()) -> tuple[str, slice]:
        """Name of the array in the source, and its columns; all of one that is ``whole``."""
        match = PART.fullmatch(self.source)
        if match is None or not match["columns"] or self.source in whole:
            return self.source, slice(None)
        first, colon, last = match["columns"].partition(":")
        start = int(first or 0)
        return match["name"], slice(start, (int(last) if last else None) if colon else start + 1)


@dataclass(frozen=True, eq=False)
class Log:
    """One recording, as logged, and once its signals are known."""

    path: Path
    fields: tuple[Field, ...]  # none once `tracks` are known
    not_read: tuple[str, ...] = ()  # names of what was not read
    remarks: tuple[str, ...] = ()  # what was lost or decided, a sentence each
    units: str = ""  # why the unit of angles is not known, if the format does not define it
    suggested: tuple[Entry, ...] = ()  # the format's mapping; the options' takes precedence
    meta: Mapping[str, Any] = field(default_factory=dict)
    time: str = ""  # name of the column or array with the stamps
    tracks: tuple[Track, ...] = ()  # its signals, in SI units, with increasing stamps
    names: tuple[str, ...] = ()  # of columns and arrays, which a mapping may refer to
    in_degrees: tuple[str, ...] = ()  # "position" and "velocity" if found to be in degrees
    in_radians: bool = False  # whether its format defines that angles are


class LogReader(NamedTuple):
    """A log of a known format: its episodes, and functions that read it."""

    kind: str  # name of the format
    episodes: tuple[str, ...]  # each becomes a run; a single "" for a log without episodes
    read: Callable[[str], Log]  # one episode, by its name
    listing: Callable[[], tuple[str, ...]]  # the contents, without reading all, a line each
    run: Callable[[], Run] | None = None  # of a run file


# Joints of a robot


class WrongRobotError(UnknownJointError):
    """A run names a joint that its robot does not have."""

    def __init__(self, joint: str, robot: str, known: Sequence[str]) -> None:
        super().__init__(joint, robot, known)
        self.args = (f"{self}; is it another robot? (--robot NAME; --robot none for no robot)",)


def known_limits(robot: str | None) -> tuple[Mapping[str, Limits], str]:
    """Limits of a robot's joints by name, or none, and why its file cannot be read."""
    try:
        return ({} if robot is None else joint_limits(robot)), ""
    except UnknownRobotError:  # a mere name, which tells runs apart
        return {}, ""
    except RobotError as error:
        return {}, str(error)


def check_joints(joints: Sequence[str], robot: str | None) -> tuple[str, ...]:
    """Joints of a robot that a run lacks, which are assumed stationary.

    Raises:
        WrongRobotError: If the run names a joint that the robot lacks; not if it cannot be read.
    """
    known, _ = known_limits(robot)
    names = _named(joints, known)
    if unknown := [name for name in names if known and name not in known]:
        raise WrongRobotError(unknown[0], str(robot), tuple(known))
    return tuple(name for name in known if name not in names)


def named(run: Run) -> Run:
    """Give joints that a run numbers, since its file does not name them, its robot's names."""
    names = _named(run.joint_names, known_limits(run.robot)[0])
    if names == run.joint_names:
        return run
    same = run.desired_joint_names == run.joint_names
    desired = names if same else run.desired_joint_names
    return replace(run, joint_names=names, desired_joint_names=desired)


def _named(joints: Sequence[str], known: Mapping[str, Limits]) -> tuple[str, ...]:
    """Names of joints; the robot's names replace mere numbers if it has as many joints."""
    earlier = tuple(f"joint{number + 1}" for number in range(len(joints)))  # version 0.6
    mere = tuple(joints) in (unnamed(len(joints)), earlier)
    if mere and len(joints) <= len(known) and not set(joints) & set(known):
        return tuple(known)[: len(joints)]
    return tuple(joints)


# Options

FORMAT = "noise-mapping/1"
COMMAND = "command"  # the signal of fields that may be desired positions: their values decide
FOLLOWS, SLOPES = 0.9, (0.5, 2.0)  # correlation and slopes of a position with its target
STILL, NEARBY = 1e-3, 0.1  # what moves less rests; largest mean distance of its target, in SI units
UNITS = ("radians", "degrees")  # of angles
RATES = (1e-3, 1e9)  # rates that a log may be said to have, in [Hz]
LISTS = {"joints", "topics", "columns"}  # options with any number of names

# Conventions of a base: the order of its quaternion; the axes of its velocity, which for MuJoCo are
# the world's for the linear part and the body's for the angular one. The first is the run's.
CONVENTIONS = {"base_pose": ("xyzw", "wxyz"), "base_velocity": ("body", "world", "mujoco")}
WIDTHS: Mapping[str, int] = {"base_pose": 7, "base_velocity": 6}

NO_MOTION = (
    "no position or velocity of a joint; name columns JOINT.velocity or JOINT.position, or map"
    " them with --map velocity.JOINT=COLUMN, --map velocity=ARRAY, or all of one form: --map"
    " 'position.{joint}=enc_{joint}'"
)


@dataclass(frozen=True)
class ReadOptions:
    """Options of reading a log; what is not specified is taken from the log."""

    robot: str = ""  # name, URDF or MJCF: joints are checked against it, numbered ones get its own
    rate: float | None = None  # the log's rate, if known, in [Hz]
    units: str = ""  # of angles: one of `UNITS`; empty for the log's own
    joints: tuple[str, ...] = ()  # names of the columns of arrays, in order
    topics: tuple[str, ...] = ()  # the topics to read, all unless given
    offset: float | None = None  # added to the desired motion's stamps, in [s]; else estimated
    columns: tuple[str, ...] = ()  # names in place of a CSV's header; "" for one that is not read
    force: bool = False  # whether a rate is taken that positions and velocities contradict
    entries: tuple[Entry, ...] = ()  # the mapping of columns and arrays

    def __post_init__(self) -> None:
        """Check the options."""
        if self.rate is not None and not RATES[0] <= self.rate <= RATES[1]:
            expected = f"{RATES[0]:g} to {RATES[1]:g} Hz"
            raise OptionError(f"the rate is {self.rate:g} Hz; expected {expected}")
        if self.offset is not None and not np.isfinite(self.offset):
            raise OptionError(f"the offset is {self.offset:g} s; expected a finite number")
        if self.units and self.units not in UNITS:
            raise OptionError(f"no units {self.units!r}; there are {', '.join(UNITS)}")

    @property
    def time(self) -> str:
        """The column that is mapped to the stamps, or empty."""
        return next((entry.source for entry in self.entries if entry.signal == "time"), "")

    @property
    def mapped(self) -> set[str]:
        """Names of the columns and arrays that are mapped, but for the stamps."""
        known = (entry for entry in self.entries if entry.signal != "time")
        return {name for entry in known for name in (entry.source, entry.part()[0])}

    def stamps_in(self, names: Sequence[str]) -> str:
        """Name of the stamps: the one that is mapped, or one of those that are not; or empty."""
        if self.time and self.time in names:
            return self.time
        return time_column([name for name in names if name not in self.mapped])

    @property
    def known_joints(self) -> tuple[str, ...]:
        """Names that a log's joints may have: the robot's."""
        return tuple(known_limits(self.robot or None)[0])

    def for_columns(self, path: Path, names: Sequence[str]) -> "ReadOptions":
        """Options whose patterns are replaced by the columns that they fit."""
        targets = {entry.target: entry for entry in self.entries if not entry.is_pattern}
        patterns = (entry for entry in self.entries if entry.is_pattern)
        # `{joint}_cmd` is more specific than `{joint}`, which fits all that is left.
        for entry in sorted(patterns, key=lambda each: -len(each.source)):
            before, _, after = entry.source.partition(JOINT)
            form = re.compile(f"{re.escape(before)}(.+){re.escape(after)}")
            taken = {each.source for each in targets.values()}
            free = {n: match[1] for n in names if n not in taken and (match := form.fullmatch(n))}
            if not free:
                problem = f"the pattern {entry.target}={entry.source} fits no column that is free"
                raise LogError(path, f"{problem}; columns are {listed(names)}")
            for name, joint in free.items():
                new = Entry(entry.signal, entry.joint.replace(JOINT, joint), name)
                if other := targets.get(new.target):
                    both = f"{other.source!r} and {name!r} are both mapped to {new.target}"
                    raise LogError(path, f"{both}; map one of them")
                targets[new.target] = new
        return replace(self, entries=tuple(targets.values()))

    @classmethod
    def load(cls, path: Path) -> Self:
        """Options from a saved mapping."""
        try:
            saved = from_toml(text_of(path))
            if saved.pop("format", None) != FORMAT:
                raise OptionError(f'not a mapping; expected format = "{FORMAT}"')
            entries = saved.pop("map", {})
            known = {each.name for each in fields(cls)} - {"entries"}
            if unknown := sorted(set(saved) - known):
                names = ", ".join(sorted(known))
                raise OptionError(f"unknown setting {unknown[0]!r}; there are {names}, map")
            texts = [f"{name}={_setting(name, each)}" for name, each in entries.items()]
            parsed = parse_mapping(texts)
            settings = {name: _setting(name, value) for name, value in saved.items()}
            return cls(**settings, entries=parsed)
        except OSError as error:
            raise InspectorError(f"{path}: cannot be read ({error.strerror})") from error
        except (InspectorError, AttributeError, TypeError) as error:
            raise InspectorError(f"{path}: {error}") from error
        except ValueError as error:
            raise InspectorError(f"{path}: not a mapping in TOML ({error})") from error

    def save(self, path: Path, *, overwrite: bool = False) -> None:
        """Write the options as TOML, to be loaded again."""

        def toml(value: Any) -> str:  # JSON's values are TOML's, but for one character
            return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")

        lines = [f'format = "{FORMAT}"']
        for each in fields(self):
            value = getattr(self, each.name)
            if each.name != "entries" and value != each.default:
                lines.append(f"{each.name} = {toml(value)}")
        if self.entries:
            lines += ["", "[map]"]
            lines += [f"{toml(each.target)} = {toml(each.source)}" for each in self.entries]
        write_whole(path, "\n".join(lines) + "\n", overwrite=overwrite)


def parse_mapping(entries: Iterable[str]) -> tuple[Entry, ...]:
    """Mapping of columns and arrays, parsed.

    Each is ``SIGNAL.JOINT=COLUMN``, ``SIGNAL=ARRAY`` or ``time=COLUMN``. The column may hold any
    character, the joint any but "="; of an array ``[3]``, ``[7:]`` or ``[:7]`` names a part.
    ``velocity.{joint}={joint}_actual`` maps all columns of that form. Signals of the base may name
    one of ``CONVENTIONS``: ``base_pose.wxyz=root_pose``.
    """
    parsed: list[Entry] = []
    for text in entries:
        target, _, source = text.partition("=")
        signal, dot, joint = target.partition(".")
        known = signal in SIGNALS or target == "time"
        patterns = joint.count(JOINT), source.count(JOINT)
        form, problem = f"'velocity.{JOINT}={JOINT}_actual'", ""
        if not source or not known or (dot and not joint):
            problem = (
                f"expected SIGNAL.JOINT=COLUMN, such as velocity.elbow=dq2 or {form}, SIGNAL=ARRAY,"
                f" such as position=qpos[7:], or time=COLUMN; signals are {', '.join(SIGNALS)}"
            )
        elif joint and joint not in CONVENTIONS.get(signal, (joint,)):
            problem = f"a {signal} is written as {' or '.join(CONVENTIONS[signal])}"
        elif any(patterns) and patterns != (1, 1):
            problem = f"a pattern has {JOINT} once on either side, such as {form}"
        elif any(entry.source == source for entry in parsed):
            problem = f"{source!r} is mapped twice"
        elif any(entry.target == target and not entry.is_pattern for entry in parsed):
            problem = f"{target!r} is mapped twice"
        if problem:
            raise OptionError(f"mapping {text!r}: {problem}")
        parsed.append(Entry(signal, joint, source))
    return tuple(parsed)


def read_options(
    mapping: Sequence[str] = (), *, saved: str | Path | None = None, **options: Any
) -> ReadOptions:
    """Options of reading a log, combined with a saved mapping."""
    before = ReadOptions.load(Path(saved)) if saved else ReadOptions()
    given = {name: value for name, value in options.items() if value is not None}
    for name in LISTS & {*given}:
        given[name] = tuple(given[name])
    if "robot" in given:
        given["robot"] = str(given["robot"])
    entries = parse_mapping(mapping)
    targets = {entry.target for entry in entries}
    kept = tuple(entry for entry in before.entries if entry.target not in targets)
    return replace(before, **given, entries=(*entries, *kept))


def _setting(name: str, value: Any) -> Any:
    """Setting of a saved mapping, its type checked."""
    numbers = dict.fromkeys(("rate", "offset"), (int, float))
    kinds = {"force": (bool,), **numbers, **dict.fromkeys(LISTS, (list,))}
    is_text = not isinstance(value, list) or all(isinstance(each, str) for each in value)
    if type(value) not in kinds.get(name, (str,)) or not is_text:
        raise InspectorError(f"{name} = {toml_shown(value)} is of another type than expected")
    return tuple(value) if name in LISTS else value


# Columns of signals


class _Choice(NamedTuple):
    """A column chosen for a signal of a joint, or the first of columns for one of the base."""

    field: Field
    column: int
    signal: str
    joint: str  # or the convention of a base
    source: str  # the entry of a mapping, or the name of the field
    by: str = "name"  # what chose it: "options", "format" or its "name"

    @property
    def label(self) -> str:
        """Its name in the log."""
        if self.field.joints and not self.field.stamps.rows:
            return f"{self.field.name} of {self.joint}"
        alone = self.field.values.shape[1] == 1
        return self.field.name if alone else f"{self.field.name}[{self.column}]"

    @property
    def values(self) -> Real:
        """Shape (samples, columns)."""
        return self.field.values[:, self.column : self.column + WIDTHS.get(self.signal, 1)]


def tracks_of(
    log: Log, options: ReadOptions, robot: Robot | None
) -> tuple[tuple[Track, ...], tuple[str, ...], tuple[str, ...]]:
    """Tracks of a log, what is not read, and remarks; the mapping goes before names of columns."""
    factors = {} if options.units else {each.name: factor_of(each.name) for each in log.fields}
    converted = {name: without_unit(name)[1] for name, factor in factors.items() if factor != 1.0}
    in_si = (
        replace(each, values=each.values * factors[each.name]) if each.name in converted else each
        for each in log.fields
    )
    log = replace(log, fields=tuple(in_si))
    names = [each.name for each in log.fields]
    options = options.for_columns(log.path, [name for name in names if name != log.time])
    joints = robot.joint_names if robot else ()
    naming = Naming.of((each.name for each in log.fields if _is_column(each)), joints)
    found, left_out = _of_robot([*_choices(log, options, naming, options.joints or joints)], robot)
    kept = _unique(log, found)
    if not any(choice.signal.startswith(("position", "velocity")) for choice in kept):
        raise no_motion(log.path, [*names, *log.not_read])
    targets, problem = _targets(log, kept)
    kept += targets
    remarks = [*_taken(log, kept), *problem]
    read = {choice.field for choice in kept}
    not_read = tuple(each.name for each in log.fields if each not in read)
    taken = {name: unit for name, unit in converted.items() if name not in not_read}
    for unit in dict.fromkeys(taken.values()):
        columns = listed([name for name, other in taken.items() if other == unit])
        remarks.append(f"{columns}: converted from {unit}, as their names say")
    if naming.qd_is_desired:
        remarks.append("qd is the desired position, since dq is the velocity (else --map)")
    if naming.remark and any(c.by == "name" and c.field.name in naming.bare for c in kept):
        remarks.append(naming.remark)
    tracks = (*_base_tracks(log, kept), *_joint_tracks(kept))
    return tracks, (*log.not_read, *not_read), (*remarks, *left_out)


def _is_column(each: Field) -> bool:
    """Whether it is a column, which may name its joint."""
    return each.values.shape[1] == 1 and not each.signal


def no_motion(path: Path, names: Sequence[str]) -> LogError:
    """Error of a log of which no column is known: what to type, and the columns that it has."""
    columns = listed([name for name in names if name])
    return LogError(path, f"{NO_MOTION}; columns are {columns}")


def _choices(
    log: Log, options: ReadOptions, naming: Naming, joints: Sequence[str]
) -> Iterator[_Choice]:
    """Columns and their signals: by the options, then by the format, then by their names."""
    by_name = {each.name: each for each in log.fields}
    signals = {entry.signal for entry in options.entries if not entry.joint}
    sources = {entry.part()[0] for entry in options.entries}
    suggested = [e for e in log.suggested if e.signal not in signals and e.part()[0] not in sources]
    mapped = set()
    for entry in (*options.entries, *suggested):
        name, part = entry.part(by_name)
        if (field := by_name.get(name)) is None:
            continue
        width = field.values.shape[1]
        columns = range(width)[part]
        if name != entry.source and (not columns or (part.stop or 0) > width):
            raise LogError(log.path, f"{entry.source!r}: {name!r} has {width} columns")
        mapped.add(field)
        if entry.joint and entry.signal in JOINT_SIGNALS and len(columns) != 1:
            problem = f"{entry.source!r} has {len(columns)} columns, {entry.target} is one"
            raise LogError(log.path, f"{problem}; name it as {name}[0]")
        if entry.signal != "time":
            by = "options" if entry in options.entries else "format"
            choice = _Choice(field, columns.start, *entry, by)
            yield from _columns(log, choice, len(columns), options, joints)
    unmapped = [each for each in log.fields if each not in mapped and each.name != options.time]
    for choice in _by_name(log, unmapped, naming, joints):
        yield from _columns(log, choice, choice.field.values.shape[1], options, joints)


def _by_name(
    log: Log, fields: Sequence[Field], naming: Naming, joints: Sequence[str]
) -> Iterator[_Choice]:
    """Fields whose signal the format or their names tell, and the joint of a column of one."""
    columns = {
        e: what for e in log.fields if _is_column(e) and (what := column_signal(e.name, naming))
    }
    named = [joint for _, joint in columns.values() if isinstance(joint, str)]
    numbered = {number_of(joint): joint for joint in reversed(named)}
    for each in fields:
        signal, joint = columns.get(each) or (each.signal or array_signal(each.name, naming), "")
        number = number_of(joint)
        if number is not None and joints and joint not in joints:
            joint = _joint_of(log.path, each.name, number, naming.first, joints) or joint
        if isinstance(joint, int):
            joint = numbered.get(joint, f"joint_{joint}")
        unnamed = not joint and _is_column(each) and signal in JOINT_SIGNALS and not naming.alone
        if signal and signal != COMMAND and not unnamed:
            yield _Choice(each, 0, signal, joint, each.name)


def _joint_of(path: Path, name: str, number: int, first: int, joints: Sequence[str]) -> str | None:
    """Joint of a robot that a number stands for: in order from 0 or 1 on, else by its own name."""
    if first < 2:
        return joints[number - first] if 0 <= number - first < len(joints) else None
    for joint in joints[number - 1 : number + 1]:
        if re.search(rf"(?<!\d){number}$", joint):
            return joint
    problem = f"the columns' numbers begin with {first}, so {name!r} may be any joint"
    raise LogError(path, f"{problem}; name it: --map SIGNAL.JOINT={name}, of {listed(joints)}")


def _columns(
    log: Log, first: _Choice, width: int, options: ReadOptions, joints: Sequence[str]
) -> Iterator[_Choice]:
    """Columns of a field: of one joint, of the base with its convention, or one for each joint."""
    field, signal = first.field, first.signal
    what = f"{field.name!r} has {width} columns"
    if signal in BASE_SIGNALS and width != WIDTHS[signal]:
        raise LogError(log.path, f"{what}, a {signal} has {WIDTHS[signal]}")
    if signal in BASE_SIGNALS or first.joint:
        yield first
        return
    names: Sequence[str] = field.joints if len(field.joints) == width else ()
    if not names and len(field.joints) == field.values.shape[1]:
        names = field.joints[first.column : first.column + width]
    if not names or len(options.joints) == width:
        names = joints
        other = options.joints and len(names) != width and not signal.endswith("_desired")
        if names and (len(names) < width or other):
            whose = "--joints names" if options.joints else f"robot {options.robot!r} has"
            part = f"--map {signal}={field.name}[0:{len(names)}]"
            how = f"take a part of it ({part}) or name all (--joints)"
            raise LogError(log.path, f"{what}, {whose} {len(names)}; {how}")
    names = names or unnamed(width)
    for column, name in enumerate(names[:width], start=first.column):
        yield first._replace(column=column, joint=name)


def _of_robot(choices: list[_Choice], robot: Robot | None) -> tuple[list[_Choice], list[str]]:
    """Columns of joints of the robot, and a remark on the others."""
    if robot is None:
        return choices, []
    known, unknown = list[_Choice](), list[_Choice]()
    for each in choices:
        foreign = each.signal in JOINT_SIGNALS and each.joint not in robot.joint_names
        (unknown if foreign else known).append(each)
    wrong = [each for each in unknown if each.by == "options"]
    if not any(each.signal in JOINT_SIGNALS for each in known):
        wrong = unknown
    if wrong:
        raise WrongRobotError(wrong[0].joint, robot.name, robot.joint_names)
    names = listed([*dict.fromkeys(each.joint for each in unknown)])
    return known, [f"left out, not joints of {robot.name!r}: {names}"] if unknown else []


def _unique(log: Log, choices: Sequence[_Choice]) -> list[_Choice]:
    """One column for each signal of each joint: by the options, else the fastest source's."""
    found: dict[tuple[str, str], _Choice] = {}
    for choice in choices:
        target = choice.signal, "" if choice.signal in BASE_SIGNALS else choice.joint
        other = found.setdefault(target, choice)
        ranked = choice.field.rank != other.field.rank
        fast = fastest(each.field.stamps for each in (choice, other)) if ranked else []
        rank, before = (
            (each.by != "options", ranked and each.field.stamps not in fast, each.field.rank)
            for each in (choice, other)
        )
        if rank < before:
            found[target] = choice
        elif rank == before and other is not choice:
            old, new, (signal, joint) = other.field, choice.field, target
            if new.source == old.source and new.joints != old.joints:
                problem = f"{new.source}: the set of joints changes within the log; split it there"
                raise LogError(log.path, problem)
            names = f"{other.label!r} and {choice.label!r}"
            how = f"--map '{Entry(signal, joint, '').target}={choice.label}'"
            if new.source != old.source:
                names, how = f"{old.source} and {new.source}", "--topic"
            what = f"{signal} of " + (f"joint {joint!r}" if joint else "the base")
            raise LogError(log.path, f"{names} both hold {what}; choose with {how}")
    kept = {id(choice) for choice in found.values()}
    return [choice for choice in choices if id(choice) in kept]


def _targets(log: Log, choices: Sequence[_Choice]) -> tuple[list[_Choice], list[str]]:
    """Columns of the first command that the positions follow, and a remark if there is none."""
    signals = {each.signal for each in choices}
    commands = [each for each in log.fields if each.signal == COMMAND]
    if not commands or "position" not in signals or "position_desired" in signals:
        return [], []
    position = next(t for t in _joint_tracks(choices) if t.signal == "position")
    for each in sorted(commands, key=lambda command: "processed" not in command.name):
        same = each.stamps is position.stamps
        if count := followed(each.values, position.values) if same else 0:
            part = "" if count == each.values.shape[1] else f"[0:{count}]"
            return [
                _Choice(each, column, "position_desired", joint, f"{each.name}{part}", "format")
                for column, joint in enumerate(position.joints[:count])
            ], []
    names = listed([each.name for each in commands])
    place = next(each.source for each in choices if each.signal == "position")
    why = f"{place} does not follow; --map position_desired={commands[0].name} takes it"
    return [], [f"{names} not taken as desired positions: {why}"]


def followed(command: Real, position: Real) -> int:
    """Number of leading columns of a command that are targets of the positions beside them."""
    count = moving = 0
    for wanted, actual in zip(command.T, position.T, strict=False):
        extent, asked = float(np.ptp(actual)), float(np.ptp(wanted))
        moves = min(extent, asked) > STILL
        if not moves and max(extent, asked) > NEARBY:
            break
        if abs(float(np.mean(wanted) - np.mean(actual))) > max(extent, NEARBY):
            break
        if moves:
            (own, common), (_, other) = np.cov(wanted, actual)
            follows = common >= FOLLOWS * (own * other) ** 0.5
            if not (follows and SLOPES[0] <= common / own <= SLOPES[1]):
                break
        count, moving = count + 1, moving + moves
    return count if moving and 2 * count >= position.shape[1] else 0


def _taken(log: Log, choices: Sequence[_Choice]) -> Iterator[str]:
    """Say which arrays of a file are taken for what, if the options do not say it."""
    found = set[tuple[int, str]]()
    for each in choices:
        field, why = each.field, each.joint if each.signal in BASE_SIGNALS else ""
        named = field.source == log.path.name and not (_is_column(field) or field.stamps.rows)
        if each.by == "format" or (each.by == "name" and named):
            why = "position follows it" if field.signal == COMMAND else why
            text = f"{each.signal} = {each.source}{f' ({why})' if why else ''}"
            found.add((SIGNALS.index(each.signal), text))
    if found:
        yield f"taken: {', '.join(text for _, text in sorted(found))}"


def _joint_tracks(choices: Sequence[_Choice]) -> Iterator[Track]:
    """Tracks, each of the columns of one signal that share their stamps."""
    together: dict[tuple[str, Stamps], list[_Choice]] = {}
    for choice in choices:
        if choice.signal in JOINT_SIGNALS:
            together.setdefault((choice.signal, choice.field.stamps), []).append(choice)
    for (signal, stamps), members in together.items():
        values = members[0].field.values
        columns = [each.column for each in members]
        if any(each.field.values is not values for each in members):
            values = np.hstack([each.values for each in members])
        elif columns != list(range(values.shape[1])):  # else no copy: a long log is large
            values = values[:, columns]
        labels = tuple(each.label for each in members)
        yield Track(signal, tuple(each.joint for each in members), labels, stamps, values)


def _base_tracks(log: Log, choices: Sequence[_Choice]) -> Iterator[Track]:
    by_signal = {choice.signal: choice for choice in choices if choice.signal in BASE_SIGNALS}
    pose = None
    if choice := by_signal.get("base_pose"):
        pose = pose_of(choice.values, choice.joint)
        track = Track("base_pose", (), (choice.field.name,) * 7, choice.field.stamps, pose)
        wrong = np.abs(np.linalg.norm(pose[:, 3:], axis=1) - 1) > 0.01
        if wrong.any():
            problem = "a quaternion whose norm is not 1; expected x, y, z and the quaternion"
            raise track.fault(log.path, f"{choice.label}: {problem}", int(np.argmax(wrong)))
        yield track
    if choice := by_signal.get("base_velocity"):
        stamps, values = choice.field.stamps, choice.values
        if choice.joint in ("world", "mujoco"):
            if pose is None or by_signal["base_pose"].field.stamps is not stamps:
                problem = "a velocity in world axes needs a base_pose of the same samples"
                how = "and there is none (--map base_pose=ARRAY)"
                raise LogError(log.path, f"{choice.label}: {problem}, {how}")
            values = velocity_of(values, choice.joint, pose)
        yield Track("base_velocity", (), (choice.field.name,) * 6, stamps, np.asarray(values))


def pose_of(values: Real, convention: str) -> Array:
    """Pose of a base as the run has it, x, y, z and the quaternion x, y, z, w, in `CONVENTIONS`."""
    order = [0, 1, 2, 4, 5, 6, 3] if convention == "wxyz" else slice(None)
    return np.asarray(values, dtype=np.float64)[:, order]


def velocity_of(values: Real, convention: str, pose: Array) -> Array:
    """Velocity of a base in body axes of one in `CONVENTIONS`, with its pose as the run has it."""
    parts = np.hsplit(np.asarray(values, dtype=np.float64), 2)
    axis, scalar = -pose[:, 3:6], pose[:, 6:]
    for place in {"world": (0, 1), "mujoco": (0,)}.get(convention, ()):  # v' = R(q)^T v
        cross = 2 * np.cross(axis, parts[place])
        parts[place] = parts[place] + scalar * cross + np.cross(axis, cross)
    return np.hstack(parts)
