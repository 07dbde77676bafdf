"""Which columns and arrays hold which signal of which joint: by options, by format, or by name.

The options of reading a log, with a mapping that can be saved as TOML, and the choice of one
column for each signal of each joint.
"""

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np

from inspector.errors import InspectorError, LogError, OptionError
from inspector.logs.log import JOINT, Entry, Field, Log, Track
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
    without_unit,
)
from inspector.logs.plausibility import WrongRobotError, known_limits
from inspector.text import toml_shown
from noiseclassifier.jsontext import from_toml, text_of
from noisemodel import Robot
from noisemodel.files import replacing
from noisemodel.types import Array, Real

FORMAT = "noise-mapping/1"
COMMAND = "command"  # the signal of fields that may be desired positions: their values decide
# Least correlation of a position with its target, and the range of its slope.
FOLLOWS, SLOPES = 0.9, (0.5, 2.0)
# What moves less does not move; largest mean distance of its target, both in [rad] or [m].
STILL, NEARBY = 1e-3, 0.1
UNITS = ("radians", "degrees")  # of angles
RATES = (1e-3, 1e9)  # rates that a log may be said to have, in [Hz]

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
            raise OptionError(
                f"the rate is {self.rate:g} Hz; expected {RATES[0]:g} to {RATES[1]:g} Hz"
            )
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
        known = [entry for entry in self.entries if entry.signal != "time"]
        return {name for entry in known for name in (entry.source, entry.part()[0])}

    @property
    def known_joints(self) -> tuple[str, ...]:
        """Names that a log's joints may have: the robot's."""
        return tuple(known_limits(self.robot or None)[0])

    def for_columns(self, path: Path, names: Sequence[str]) -> "ReadOptions":
        """Options whose patterns are replaced by the columns that they fit."""
        single = [entry for entry in self.entries if not entry.is_pattern]
        patterns = [entry for entry in self.entries if entry.is_pattern]
        taken = {entry.source for entry in single}
        targets = {entry.target: entry for entry in single}
        # `{joint}_cmd` is more specific than `{joint}`, which fits all that is left.
        for entry in sorted(patterns, key=lambda each: -len(each.source)):
            before, _, after = entry.source.partition(JOINT)
            form = re.compile(f"{re.escape(before)}(.+){re.escape(after)}")
            free = {n: match[1] for n in names if n not in taken and (match := form.fullmatch(n))}
            if not free:
                raise LogError(
                    path,
                    f"the pattern {entry.target}={entry.source} fits no column that is free;"
                    f" columns are {listed(names)}",
                )
            for name, joint in free.items():
                new = Entry(entry.signal, entry.joint.replace(JOINT, joint), name)
                if new.target in targets:
                    raise LogError(
                        path,
                        f"{targets[new.target].source!r} and {name!r} are both mapped to"
                        f" {new.target}; map one of them",
                    )
                targets[new.target] = new
                taken.add(name)
        return replace(self, entries=tuple(targets.values())) if patterns else self

    @classmethod
    def load(cls, path: Path) -> Self:
        """Options from a saved mapping."""
        try:
            saved = from_toml(text_of(path))
            if saved.pop("format", None) != FORMAT:
                raise OptionError(f'not a mapping; expected format = "{FORMAT}"')
            entries = saved.pop("map", {})
            known = {field.name for field in fields(cls)} - {"entries"}
            if unknown := sorted(set(saved) - known):
                names = ", ".join(sorted(known))
                raise OptionError(f"unknown setting {unknown[0]!r}; there are {names}, map")
            sources = {target: _setting(target, source) for target, source in entries.items()}
            parsed = parse_mapping(f"{target}={source}" for target, source in sources.items())
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
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name != "entries" and value is not False and value not in (None, "", ()):
                lines.append(f"{field.name} = {toml(value)}")
        if self.entries:
            lines += ["", "[map]"]
            lines += [f"{toml(each.target)} = {toml(each.source)}" for each in self.entries]
        with replacing(path, overwrite=overwrite) as temporary:
            temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


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
        known = signal in (*JOINT_SIGNALS, *BASE_SIGNALS) or target == "time"
        if not source or not known or (dot and not joint):
            raise OptionError(
                f"mapping {text!r}: expected SIGNAL.JOINT=COLUMN, such as velocity.elbow=dq2 or"
                f" 'velocity.{JOINT}={JOINT}_actual', SIGNAL=ARRAY, such as position=qpos[7:], or"
                f" time=COLUMN; signals are {', '.join((*JOINT_SIGNALS, *BASE_SIGNALS))}"
            )
        if joint and joint not in CONVENTIONS.get(signal, (joint,)):
            raise OptionError(
                f"mapping {text!r}: a {signal} is written as {' or '.join(CONVENTIONS[signal])}"
            )
        patterns = joint.count(JOINT), source.count(JOINT)
        if any(patterns) and patterns != (1, 1):
            raise OptionError(
                f"mapping {text!r}: a pattern has {JOINT} once on either side, such as"
                f" 'velocity.{JOINT}={JOINT}_actual'"
            )
        for entry in parsed:
            if entry.source == source or (entry.target == target and not entry.is_pattern):
                twice = source if entry.source == source else target
                raise OptionError(f"mapping {text!r}: {twice!r} is mapped twice")
        parsed.append(Entry(signal, joint, source))
    return tuple(parsed)


def read_options(
    mapping: Sequence[str] = (), *, saved: str | Path | None = None, **options: Any
) -> ReadOptions:
    """Options of reading a log, combined with a saved mapping."""
    before = ReadOptions.load(Path(saved)) if saved else ReadOptions()
    given = {name: value for name, value in options.items() if value is not None}
    for name in {"joints", "topics", "columns"} & set(given):
        given[name] = tuple(given[name])
    if "robot" in given:
        given["robot"] = str(given["robot"])
    entries = parse_mapping(mapping)
    targets = {entry.target for entry in entries}
    kept = tuple(entry for entry in before.entries if entry.target not in targets)
    return replace(before, **given, entries=(*entries, *kept))


def _setting(name: str, value: Any) -> Any:
    """Setting of a saved mapping, its type checked."""
    lists = name in ("joints", "topics", "columns")
    kinds: Mapping[str, tuple[type, ...]] = {"rate": (int, float), "offset": (int, float)}
    if name == "force":
        correct = isinstance(value, bool)
    else:
        wanted = kinds.get(name, (list,) if lists else (str,))
        correct = isinstance(value, wanted) and not isinstance(value, bool)
    if not correct or (lists and not all(isinstance(each, str) for each in value)):
        raise InspectorError(f"{name} = {toml_shown(value)} is of another type than expected")
    return tuple(value) if lists else value


class _Choice(NamedTuple):
    """A column chosen for a signal of a joint, or columns for one of the base."""

    field: Field
    columns: slice
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
        return self.field.name if alone else f"{self.field.name}[{self.columns.start}]"

    @property
    def values(self) -> Real:
        """Shape (samples, columns)."""
        return self.field.values[:, self.columns]


def tracks_of(
    log: Log, options: ReadOptions, robot: Robot | None
) -> tuple[tuple[Track, ...], tuple[str, ...], tuple[str, ...]]:
    """Tracks of a log, what is not read, and remarks; the mapping goes before names of columns."""
    log, converted = _without_units(log, options)
    names = [field.name for field in log.fields]
    options = options.for_columns(log.path, [name for name in names if name != log.time])
    joints = robot.joint_names if robot else ()
    naming = Naming.of((field.name for field in log.fields if _is_column(field)), joints)
    found, unknown = _of_robot([*_choices(log, options, naming, options.joints or joints)], robot)
    kept = _unique(log, found)
    if not any(choice.signal.startswith(("position", "velocity")) for choice in kept):
        raise no_motion(log.path, [*names, *log.not_read])
    targets, problem = _targets(log, kept)
    kept += targets
    remarks = [*_taken(log, kept), *problem]
    read = {id(choice.field) for choice in kept}
    not_read = tuple(field.name for field in log.fields if id(field) not in read)
    for unit, of_unit in converted.items():
        if taken := [name for name in of_unit if name not in not_read]:
            remarks.append(f"{listed(taken)}: converted from {unit}, as their names say")
    if naming.qd_is_desired:
        remarks.append("qd is the desired position, since dq is the velocity (else --map)")
    if naming.remark and any(c.by == "name" and c.field.name in naming.bare for c in kept):
        remarks.append(naming.remark)
    if unknown and robot:
        remarks.append(f"left out, not joints of {robot.name!r}: {listed(unknown)}")
    return (*_base_tracks(log, kept), *_joint_tracks(kept)), (*log.not_read, *not_read), (*remarks,)


def _targets(log: Log, choices: Sequence[_Choice]) -> tuple[list[_Choice], list[str]]:
    """Columns of the first command that the positions follow, and a remark if there is none."""
    signals = {each.signal for each in choices}
    commands = [each for each in log.fields if each.signal == COMMAND]
    if not commands or "position" not in signals or "position_desired" in signals:
        return [], []
    position = next(t for t in _joint_tracks(choices) if t.signal == "position")
    for each in sorted(commands, key=lambda field: "processed" not in field.name):
        count = 0
        if each.stamps is position.stamps:
            count = followed(each.values, position.values)
        if count:
            part = "" if count == each.values.shape[1] else f"[0:{count}]"
            return [
                _Choice(
                    each,
                    slice(column, column + 1),
                    "position_desired",
                    position.joints[column],
                    f"{each.name}{part}",
                    "format",
                )
                for column in range(count)
            ], []
    place = next(each.source for each in choices if each.signal == "position")
    return [], [
        f"{listed([each.name for each in commands])} not taken as desired positions: {place} does"
        f" not follow; --map position_desired={commands[0].name} takes it"
    ]


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
            deviation = float(np.std(wanted)), float(np.std(actual))
            common = float(np.mean((wanted - wanted.mean()) * (actual - actual.mean())))
            correlation, slope = common / (deviation[0] * deviation[1]), common / deviation[0] ** 2
            if correlation < FOLLOWS or not SLOPES[0] <= slope <= SLOPES[1]:
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


def _without_units(log: Log, options: ReadOptions) -> tuple[Log, dict[str, list[str]]]:
    """Log with columns in the units of a run, and the names of the others by their unit."""
    found: dict[str, list[str]] = {}
    fields = []
    for each in log.fields:
        factor = factor_of(each.name) if each.values.shape[1] == 1 else 1.0
        if factor != 1.0 and not options.units:
            found.setdefault(without_unit(each.name)[1], []).append(each.name)
            fields.append(replace(each, values=each.values * factor))
        else:
            fields.append(each)
    return replace(log, fields=tuple(fields)), found


def no_motion(path: Path, names: Sequence[str]) -> LogError:
    """Error of a log of which no column is known: what to type, and the columns that it has."""
    columns = listed([name for name in names if name])
    return LogError(path, f"{NO_MOTION}; columns are {columns}")


def _is_column(field: Field) -> bool:
    """Whether it is a column, which may name its joint."""
    return field.values.shape[1] == 1 and not field.signal


def _of_robot(choices: list[_Choice], robot: Robot | None) -> tuple[list[_Choice], list[str]]:
    """Columns of joints of the robot, and the names of the others."""
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
    return known, list(dict.fromkeys(each.joint for each in unknown))


def _unique(log: Log, choices: Sequence[_Choice]) -> list[_Choice]:
    """One column for each signal of each joint: by the options, else of the lowest rank."""
    found: dict[tuple[str, str], _Choice] = {}
    for choice in choices:
        target = choice.signal, "" if choice.signal in BASE_SIGNALS else choice.joint
        other = found.setdefault(target, choice)
        rank, before = ((each.by != "options", each.field.rank) for each in (choice, other))
        if rank < before:
            found[target] = choice
        elif rank == before and other is not choice:
            raise _both(log, target[1], other, choice)
    kept = {id(choice) for choice in found.values()}
    return [choice for choice in choices if id(choice) in kept]


def _both(log: Log, joint: str, before: _Choice, after: _Choice) -> LogError:
    """Error of two columns that hold the same signal."""
    old, new = before.field, after.field
    if new.source == old.source and new.joints != old.joints:
        problem = f"{new.source}: the set of joints changes within the log; split it there"
        return LogError(log.path, problem)
    target = Entry(after.signal, joint, "").target
    names, how = f"{before.label!r} and {after.label!r}", f"--map '{target}={after.label}'"
    if new.source != old.source:
        names, how = f"{old.source} and {new.source}", "--topic"
    what = f"{after.signal} of " + (f"joint {joint!r}" if joint else "the base")
    return LogError(log.path, f"{names} both hold {what}; choose with {how}")


def _joint_tracks(choices: Sequence[_Choice]) -> Iterator[Track]:
    """Tracks, each of the columns of one signal that share their stamps."""
    together: dict[tuple[str, int], list[_Choice]] = {}
    for choice in choices:
        if choice.signal in JOINT_SIGNALS:
            together.setdefault((choice.signal, id(choice.field.stamps)), []).append(choice)
    for (signal, _), members in together.items():
        values = members[0].field.values
        columns = [each.columns.start for each in members]
        if any(each.field.values is not values for each in members):
            values = np.hstack([each.values for each in members])
        elif columns != list(range(values.shape[1])):  # else no copy: a long log is large
            values = values[:, columns]
        yield Track(
            signal,
            tuple(each.joint for each in members),
            tuple(each.label for each in members),
            members[0].field.stamps,
            values,
        )


def _base_tracks(log: Log, choices: Sequence[_Choice]) -> Iterator[Track]:
    by_signal = {choice.signal: choice for choice in choices if choice.signal in BASE_SIGNALS}
    pose = None
    if choice := by_signal.get("base_pose"):
        pose = pose_of(choice.values, choice.joint)
        track = Track("base_pose", (), (choice.field.name,) * 7, choice.field.stamps, pose)
        wrong = np.abs(np.linalg.norm(pose[:, 3:], axis=1) - 1) > 0.01
        if wrong.any():
            raise track.fault(
                log.path,
                f"{choice.label}: a quaternion whose norm is not 1; expected x, y, z and the"
                " quaternion",
                int(np.argmax(wrong)),
            )
        yield track
    if choice := by_signal.get("base_velocity"):
        stamps, values = choice.field.stamps, choice.values
        if choice.joint in ("world", "mujoco"):
            if pose is None or by_signal["base_pose"].field.stamps is not stamps:
                raise LogError(
                    log.path,
                    f"{choice.label}: a velocity in world axes needs a base_pose of the same"
                    " samples, and there is none (--map base_pose=ARRAY)",
                )
            values = velocity_of(values, choice.joint, pose)
        yield Track("base_velocity", (), (choice.field.name,) * 6, stamps, np.asarray(values))


def pose_of(values: Real, convention: str) -> Array:
    """Pose of a base as the run has it, x, y, z and the quaternion x, y, z, w, in `CONVENTIONS`."""
    order = [0, 1, 2, 4, 5, 6, 3] if convention == "wxyz" else slice(None)
    return np.asarray(values, dtype=np.float64)[:, order]


def velocity_of(values: Real, convention: str, pose: Array) -> Array:
    """Velocity of a base in body axes, linear, then angular, of one in `CONVENTIONS`.

    ``pose`` is that of the same samples, as the run has it, shape (samples, 7).
    """
    linear, angular = np.hsplit(np.asarray(values, dtype=np.float64), 2)
    if convention in ("world", "mujoco"):
        linear = _into_body(linear, pose)
    if convention == "world":
        angular = _into_body(angular, pose)
    return np.hstack((linear, angular))


def _into_body(vectors: Array, pose: Array) -> Array:
    """Vectors rotated from world to body axes: v' = R(q)^T v."""
    axis, scalar = -pose[:, 3:6], pose[:, 6:]
    cross = 2 * np.cross(axis, vectors)
    rotated: Array = vectors + scalar * cross + np.cross(axis, cross)
    return rotated


def _choices(
    log: Log, options: ReadOptions, naming: Naming, joints: Sequence[str]
) -> Iterator[_Choice]:
    """Columns and their signals: by the options, then by the format, then by their names."""
    by_name = {field.name: field for field in log.fields}
    signals = {entry.signal for entry in options.entries if not entry.joint}
    sources = {entry.part()[0] for entry in options.entries}
    suggested = [
        entry
        for entry in log.suggested
        if entry.signal not in signals and entry.part()[0] not in sources
    ]
    mapped = set()
    for entry in (*options.entries, *suggested):
        name, part = (entry.source, slice(None)) if entry.source in by_name else entry.part()
        if name not in by_name:
            continue
        field = by_name[name]
        width = field.values.shape[1]
        start, stop, _ = part.indices(width)
        if name != entry.source and (start >= stop or (part.stop or 0) > width):
            raise LogError(log.path, f"{entry.source!r}: {name!r} has {width} columns")
        mapped.add(id(field))
        if entry.joint and entry.signal in JOINT_SIGNALS and stop - start != 1:
            raise LogError(
                log.path,
                f"{entry.source!r} has {stop - start} columns, {entry.target} is one; name it as"
                f" {name}[0]",
            )
        if entry.signal != "time":
            by = "options" if entry in options.entries else "format"
            choice = _Choice(field, slice(start, stop), entry.signal, entry.joint, entry.source, by)
            yield from _columns(log, choice, options, joints)
    known = [column_signal(each.name, naming) for each in log.fields if _is_column(each)]
    named = [joint for _, joint in filter(None, known) if isinstance(joint, str)]
    numbered = {number_of(joint): joint for joint in reversed(named)}
    for each in log.fields:
        if id(each) not in mapped and each.name != options.time:
            signal, joint = _meaning(log, each, naming, numbered, joints)
            if signal and signal != COMMAND:
                whole = slice(0, each.values.shape[1])
                choice = _Choice(each, whole, signal, joint, each.name)
                yield from _columns(log, choice, options, joints)


def _meaning(
    log: Log,
    field: Field,
    naming: Naming,
    numbered: Mapping[int | None, str],
    joints: Sequence[str],
) -> tuple[str, str]:
    """Signal of a field by the format or by its name, and the joint if it is a column of one."""
    known = column_signal(field.name, naming) if _is_column(field) else None
    signal = field.signal or array_signal(field.name) or ""
    if known is None:
        unnamed = _is_column(field) and signal in JOINT_SIGNALS and not naming.alone
        return "" if unnamed else signal, ""
    signal, joint = known
    number, first = number_of(joint), naming.first
    if number is not None and joint not in joints and first <= number < first + len(joints):
        return signal, joints[number - first]
    if isinstance(joint, int):
        return signal, numbered.get(joint, f"joint_{joint}")
    return signal, joint


def _columns(
    log: Log, whole: _Choice, options: ReadOptions, joints: Sequence[str]
) -> Iterator[_Choice]:
    """Columns of a field: of one joint, of the base with its convention, or one for each joint."""
    field, part, signal = whole.field, whole.columns, whole.signal
    width = part.stop - part.start
    if signal in BASE_SIGNALS and width != WIDTHS[signal]:
        raise LogError(
            log.path, f"{field.name!r} has {width} columns, a {signal} has {WIDTHS[signal]}"
        )
    if signal in BASE_SIGNALS or whole.joint:
        yield whole
        return
    names: Sequence[str] = ()
    if len(field.joints) in (width, field.values.shape[1]):
        names = field.joints if len(field.joints) == width else field.joints[part]
    if not names or len(options.joints) == width:
        names = joints
        other = options.joints and len(names) != width and not signal.endswith("_desired")
        if names and (len(names) < width or other):
            whose = "--joints names" if options.joints else f"robot {options.robot!r} has"
            raise LogError(
                log.path,
                f"{field.name!r} has {width} columns, {whose} {len(names)}; take a part of it"
                f" (--map {signal}={field.name}[0:{len(names)}]) or name all (--joints)",
            )
    names = names or [f"joint_{number}" for number in range(width)]
    for column, name in zip(range(part.start, part.stop), names[:width], strict=True):
        yield whole._replace(columns=slice(column, column + 1), joint=name)
