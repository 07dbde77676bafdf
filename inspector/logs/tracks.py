"""Tracks of a log: its columns assigned to signals of named joints or of the base."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from inspector.errors import LogError
from inspector.logs.floatingbase import WIDTHS, not_normalised, pose_of, velocity_of
from inspector.logs.log import Field, Log, Track
from inspector.logs.options import Entry, ReadOptions
from inspector.logs.signals import (
    BASE_SIGNALS,
    JOINT_SIGNALS,
    Naming,
    array_signal,
    column_signal,
    listed,
    number_of,
)
from inspector.wrongrobot import WrongRobotError
from noisemodel import Robot
from noisemodel.types import Real


@dataclass(frozen=True, eq=False)
class LogTracks:
    """Tracks of a log, and what is not read of it.

    Attributes:
        tracks: The signals.
        not_read: Names of what is not read.
        remarks: What was decided, a sentence each.
    """

    tracks: tuple[Track, ...]
    not_read: tuple[str, ...]
    remarks: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Assignment:
    """A column assigned to a signal of a joint, or columns assigned to one of the base.

    Attributes:
        field: The array.
        columns: Its columns.
        signal: The signal.
        joint: The joint's name, or the convention of a base.
        explicit: Whether it is from the mapping of the options.
    """

    field: Field
    columns: slice
    signal: str
    joint: str
    explicit: bool = False

    @property
    def label(self) -> str:
        """Its name in the log."""
        if self.field.joints and not self.field.stamps.rows:
            return f"{self.field.name} of {self.field.joints[self.columns.start]}"
        alone = self.field.values.shape[1] == 1
        return self.field.name if alone else f"{self.field.name}[{self.columns.start}]"

    @property
    def target(self) -> tuple[str, str]:
        """The signal and joint, for which one assignment is used."""
        return self.signal, "" if self.signal in BASE_SIGNALS else self.joint

    @property
    def precedence(self) -> tuple[bool, int]:
        """Of several assignments to the same target the one with the lowest value is used."""
        return not self.explicit, self.field.rank


def tracks_of(log: Log, options: ReadOptions, robot: Robot | None) -> LogTracks:
    """Tracks of a log; the mapping takes precedence over the names of columns.

    Args:
        log: The log.
        options: How to read it.
        robot: The robot, if known.

    Raises:
        LogError: If two columns hold the same signal, none is known to hold motion, or a mapping
            does not fit the arrays.
        UnknownJointError: If the robot has none of the joints, or lacks one of the mapping.
    """
    assignments, unknown = _of_robot(list(assignments_of(log, options, robot)), robot)
    kept = _unique(log, assignments)
    if not any(assignment.signal.startswith(("position", "velocity")) for assignment in kept):
        raise LogError(
            log.path,
            "no position or velocity of a joint; name columns JOINT.velocity or JOINT.position, or"
            " map them with --map velocity.JOINT=COLUMN or --map velocity=ARRAY; columns"
            f" are {listed([field.name for field in log.fields] + list(log.not_read))}",
        )
    read = {id(assignment.field) for assignment in kept}
    not_read = tuple(field.name for field in log.fields if id(field) not in read)
    remarks = [*_naming_remarks(log, kept, options, robot)]
    if unknown and robot:
        remarks.append(f"left out, not joints of {robot.name!r}: {listed(unknown)}")
    return LogTracks(tuple(_tracks(log, kept)), (*log.not_read, *not_read), tuple(remarks))


def _naming_remarks(
    log: Log, kept: Sequence[Assignment], options: ReadOptions, robot: Robot | None
) -> Iterator[str]:
    """What was decided about names that leave it open, a sentence each."""
    naming = _naming(log)
    numbered = {
        known[1]: each.joint
        for each in kept
        if (known := _column_signal(each.field, naming)) and known[1] != each.joint
    }
    found = {number_of(joint): name for joint, name in numbered.items()}
    lowest = min((number for number in found if number is not None), default=0)
    if lowest and (options.joints or robot):
        yield f"columns count joints from {naming.first}: {lowest} is {found[lowest]}"
    if naming.qd_is_desired:
        yield "qd is the desired position, since dq is the velocity (else --map)"


def _naming(log: Log) -> Naming:
    return Naming.of(field.name for field in log.fields if _is_column(field))


def _is_column(field: Field) -> bool:
    """Whether it is a column, which may name its joint."""
    return field.values.shape[1] == 1 and not field.signal


def _column_signal(field: Field, naming: Naming) -> tuple[str, str | int] | None:
    return column_signal(field.name, naming) if _is_column(field) else None


def _of_robot(
    assignments: list[Assignment], robot: Robot | None
) -> tuple[list[Assignment], tuple[str, ...]]:
    """Assignments to joints of the robot, and the names of the others."""
    if robot is None:
        return assignments, ()
    unknown = [
        assignment
        for assignment in assignments
        if assignment.signal in JOINT_SIGNALS and assignment.joint not in robot.joint_names
    ]
    others = [assignment for assignment in assignments if assignment not in unknown]
    if unknown and not any(assignment.signal in JOINT_SIGNALS for assignment in others):
        raise WrongRobotError(unknown[0].joint, robot.name, robot.joint_names)
    for assignment in unknown:
        if assignment.explicit:
            raise WrongRobotError(assignment.joint, robot.name, robot.joint_names)
    return others, tuple(dict.fromkeys(assignment.joint for assignment in unknown))


def _unique(log: Log, assignments: Sequence[Assignment]) -> list[Assignment]:
    """One assignment for each signal of each joint, by precedence."""
    found: dict[tuple[str, str], Assignment] = {}
    for assignment in assignments:
        other = found.setdefault(assignment.target, assignment)
        if assignment.precedence < other.precedence:
            found[assignment.target] = assignment
        elif other is not assignment and assignment.precedence == other.precedence:
            what = f"{assignment.signal} of " + (
                f"joint {assignment.target[1]!r}" if assignment.target[1] else "the base"
            )
            if assignment.field.source != other.field.source:
                raise LogError(
                    log.path,
                    f"{other.field.source} and {assignment.field.source} both hold {what};"
                    " choose with --topic",
                )
            if assignment.field.joints != other.field.joints:
                raise _changing(log, other, assignment)
            row = 1 if assignment.field.stamps.rows is not None else None
            raise LogError(
                log.path, f"{other.label!r} and {assignment.label!r} both hold {what}", row
            )
    return [assignment for assignment in assignments if found[assignment.target] is assignment]


def _changing(log: Log, before: Assignment, after: Assignment) -> LogError:
    old, new = before.field, after.field
    since = float(new.stamps.start - old.stamps.start)
    return LogError(
        log.path,
        f"{new.source}: the set of joints changes {since:.6g} s into the log, from"
        f" {listed(old.joints)} to {listed(new.joints)}; split the log there",
    )


def _tracks(log: Log, assignments: Sequence[Assignment]) -> Iterator[Track]:
    """Tracks, each of the columns of one signal that share their stamps."""
    yield from _base_tracks(log, {c.signal: c for c in assignments if c.signal in BASE_SIGNALS})
    together: dict[tuple[str, int], list[Assignment]] = {}
    for assignment in assignments:
        if assignment.signal in JOINT_SIGNALS:
            together.setdefault((assignment.signal, id(assignment.field.stamps)), []).append(
                assignment
            )
    for (signal, _), members in together.items():
        yield Track(
            signal,
            tuple(assignment.joint for assignment in members),
            tuple(assignment.label for assignment in members),
            members[0].field.stamps,
            _side_by_side(members),
        )


def _base_tracks(log: Log, assignments: Mapping[str, Assignment]) -> Iterator[Track]:
    pose = None
    if assignment := assignments.get("base_pose"):
        stamps = assignment.field.stamps
        pose = pose_of(assignment.field.values[:, assignment.columns], assignment.joint)
        track = Track("base_pose", (), (assignment.field.name,) * 7, stamps, pose)
        if (wrong := not_normalised(pose)).any():
            raise track.fault(
                log.path,
                f"{assignment.label}: a quaternion whose norm is not 1; expected x, y, z and the"
                " quaternion",
                int(np.argmax(wrong)),
            )
        yield track
    if assignment := assignments.get("base_velocity"):
        values = assignment.field.values[:, assignment.columns]
        if assignment.joint in ("world", "mujoco"):
            if pose is None or assignments["base_pose"].field.stamps is not assignment.field.stamps:
                raise LogError(
                    log.path,
                    f"{assignment.label}: a velocity in world axes needs a base_pose of the same"
                    " samples, and there is none (--map base_pose=ARRAY)",
                )
            values = velocity_of(values, assignment.joint, pose)
        yield Track(
            "base_velocity",
            (),
            (assignment.field.name,) * 6,
            assignment.field.stamps,
            np.asarray(values),
        )


def _side_by_side(assignments: Sequence[Assignment]) -> Real:
    first = assignments[0].field.values
    if all(assignment.field.values is first for assignment in assignments):
        columns = [assignment.columns.start for assignment in assignments]
        if columns == list(range(first.shape[1])):
            return first  # no copy: a long log has hundreds of megabytes
        return first[:, columns]
    return np.hstack([assignment.field.values[:, assignment.columns] for assignment in assignments])


def entries_of(log: Log, options: ReadOptions) -> tuple[Entry, ...]:
    """Mapping of a log's arrays, first that of the options, then that of the format."""
    targets = {entry.signal for entry in options.entries if not entry.joint}
    names = {entry.part()[0] for entry in options.entries}
    suggested = (
        entry
        for entry in log.suggested
        if entry.signal not in targets and entry.part()[0] not in names
    )
    return (*options.entries, *suggested)


def part_of(log: Log, entry: Entry) -> tuple[Field, slice] | None:
    """The field and the columns that an entry names; None if the log has no such field."""
    by_name = {field.name: field for field in log.fields}
    if field := by_name.get(entry.source):
        return field, slice(0, field.values.shape[1])
    name, part = entry.part()
    if name not in by_name:
        return None
    width = by_name[name].values.shape[1]
    start, stop, _ = part.indices(width)
    if start >= stop or (part.stop or 0) > width:
        raise LogError(log.path, f"{entry.source!r}: {name!r} has {width} columns")
    return by_name[name], slice(start, stop)


def assignments_of(log: Log, options: ReadOptions, robot: Robot | None) -> Iterator[Assignment]:
    """Assignments of all columns; the mapping takes precedence over their names.

    Raises:
        LogError: If the mapping does not fit the arrays.
    """
    mapped = set()
    for entry in entries_of(log, options):
        if found := part_of(log, entry):
            mapped.add(id(found[0]))
            yield from _by_mapping(log, *found, entry, options, robot)
    naming = _naming(log)
    numbered = _names_by_number(log, naming)
    for field in log.fields:
        if id(field) not in mapped and field.name != options.time:
            yield from _by_name(log, field, naming, numbered, options, robot)


def _names_by_number(log: Log, naming: Naming) -> dict[int, str]:
    """Names of joints that are numbers too, such as ``joint1``."""
    known = [_column_signal(field, naming) for field in log.fields]
    joints = [joint for _, joint in filter(None, known) if isinstance(joint, str)]
    found = ((number_of(joint), joint) for joint in reversed(joints))
    return {number: joint for number, joint in found if number is not None}


def _by_name(
    log: Log,
    field: Field,
    naming: Naming,
    numbered: Mapping[int, str],
    options: ReadOptions,
    robot: Robot | None,
) -> Iterator[Assignment]:
    """Assignments by the format or by the field's name."""
    whole = slice(0, field.values.shape[1])
    if known := _column_signal(field, naming):
        signal, joint = known
        number = number_of(joint)
        names = options.joints or (robot.joint_names if robot else ())
        if number is not None and names and joint not in names:
            joint = _numbered(log, field, number, naming.first, names)
        elif isinstance(joint, int):
            joint = numbered.get(joint, f"joint_{joint}")
        yield Assignment(field, whole, signal, joint)
    elif signal := field.signal or array_signal(field.name) or "":
        if signal in BASE_SIGNALS:
            yield _base(log, field, signal, "", whole, explicit=False)
        else:
            yield from _array(log, field, signal, whole, options, robot, explicit=False)


def _by_mapping(
    log: Log, field: Field, part: slice, entry: Entry, options: ReadOptions, robot: Robot | None
) -> Iterator[Assignment]:
    explicit = entry in options.entries
    if entry.signal in BASE_SIGNALS:
        yield _base(log, field, entry.signal, entry.joint, part, explicit=explicit)
    elif entry.signal != "time" and not entry.joint:
        yield from _array(log, field, entry.signal, part, options, robot, explicit=explicit)
    elif entry.signal != "time" and part.stop - part.start != 1:
        raise LogError(
            log.path,
            f"{entry.source!r} has {part.stop - part.start} columns, {entry.target} is one;"
            f" name it as {field.name}[0]",
        )
    elif entry.signal != "time":
        yield Assignment(field, part, entry.signal, entry.joint, explicit=explicit)


def _base(
    log: Log, field: Field, signal: str, convention: str, part: slice, *, explicit: bool
) -> Assignment:
    if part.stop - part.start != WIDTHS[signal]:
        raise LogError(
            log.path,
            f"{field.name!r} has {part.stop - part.start} columns, a {signal} has {WIDTHS[signal]}",
        )
    return Assignment(field, part, signal, convention, explicit)


def _array(
    log: Log,
    field: Field,
    signal: str,
    part: slice,
    options: ReadOptions,
    robot: Robot | None,
    *,
    explicit: bool,
) -> Iterator[Assignment]:
    """Assignments of the columns of an array, one by one."""
    width = part.stop - part.start
    names: Sequence[str] = field.joints[part]
    if not names or len(options.joints) == width:
        names = options.joints or (robot.joint_names if robot else ())
        other = options.joints and len(names) != width and not signal.endswith("_desired")
        if names and (len(names) < width or other):
            whose = "--joints names" if options.joints else f"robot {robot and robot.name!r} has"
            raise LogError(
                log.path,
                f"{field.name!r} has {width} columns, {whose} {len(names)}; take a part of it"
                f" (--map {signal}={field.name}[0:{len(names)}]) or name all (--joints)",
            )
    names = names or [f"joint_{number}" for number in range(width)]
    for column, joint in zip(range(part.start, part.stop), names[:width], strict=True):
        yield Assignment(field, slice(column, column + 1), signal, joint, explicit)


def _numbered(log: Log, field: Field, number: int, first: int, joints: Sequence[str]) -> str:
    if not first <= number < first + len(joints):
        raise LogError(
            log.path,
            f"column {field.name!r} has number {number}, the robot's joints are {first} to"
            f" {len(joints) - 1 + first} ({', '.join(joints)}); map it with --map",
        )
    return joints[number - first]
