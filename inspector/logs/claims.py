"""Which columns of a log claim to hold which signal of which joint."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from inspector.errors import LogError
from inspector.logs.columns import BASE_SIGNALS, array_signal, named
from inspector.logs.floatingbase import WIDTHS
from inspector.logs.log import Field, Log
from inspector.logs.reading import Entry, Reading
from noisemodel import Robot


@dataclass(frozen=True, eq=False)
class Claim:
    """A column that holds a signal of a joint, or columns that hold one of the base.

    Attributes:
        field: The array.
        columns: Its columns.
        signal: The signal.
        joint: The joint's name, or the convention that a base is written in.
        said: Whether a person said so.
    """

    field: Field
    columns: slice
    signal: str
    joint: str
    said: bool = False

    @property
    def label(self) -> str:
        """What the log calls it."""
        if self.field.joints and not self.field.stamps.rows:
            return f"{self.field.name} of {self.field.joints[self.columns.start]}"
        alone = self.field.values.shape[1] == 1
        return self.field.name if alone else f"{self.field.name}[{self.columns.start}]"

    @property
    def held(self) -> tuple[str, str]:
        """What only one claim can hold."""
        return self.signal, "" if self.signal in BASE_SIGNALS else self.joint

    @property
    def weight(self) -> tuple[bool, int]:
        """Of several claims to the same the one with the lowest weight is taken."""
        return not self.said, self.field.rank


def entries_of(log: Log, reading: Reading) -> tuple[Entry, ...]:
    """List what is said of a log's arrays, first by the person, then by the format."""
    targets = {entry.signal for entry in reading.entries if not entry.joint}
    names = {entry.part()[0] for entry in reading.entries}
    suggested = (
        entry
        for entry in log.suggested
        if entry.signal not in targets and entry.part()[0] not in names
    )
    return (*reading.entries, *suggested)


def part_of(log: Log, entry: Entry) -> tuple[Field, slice] | None:
    """Find the field that an entry names, and the columns of it; None if there is none."""
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


def claims_of(log: Log, reading: Reading, robot: Robot | None) -> Iterator[Claim]:
    """Go through what the columns hold; what is said goes before what their names say.

    Raises:
        LogError: If what is said does not fit the arrays.
    """
    told = set()
    for entry in entries_of(log, reading):
        if found := part_of(log, entry):
            told.add(id(found[0]))
            yield from _said(log, *found, entry, reading, robot)
    for field in log.fields:
        if id(field) not in told and field.name != reading.time:
            yield from _named(log, field, reading, robot)


def _named(log: Log, field: Field, reading: Reading, robot: Robot | None) -> Iterator[Claim]:
    """Claim what the format or a field's own name says."""
    whole = slice(0, field.values.shape[1])
    if known := named(field.name) if whole.stop == 1 and not field.signal else None:
        signal, joint = known
        if isinstance(joint, int):
            joint = _numbered(log, field, joint, reading, robot)
        yield Claim(field, whole, signal, joint)
    elif signal := field.signal or array_signal(field.name) or "":
        if signal in BASE_SIGNALS:
            yield _base(log, field, signal, "", whole, said=False)
        else:
            yield from _array(log, field, signal, whole, reading, robot, said=False)


def _said(
    log: Log, field: Field, part: slice, entry: Entry, reading: Reading, robot: Robot | None
) -> Iterator[Claim]:
    said = entry in reading.entries
    if entry.signal in BASE_SIGNALS:
        yield _base(log, field, entry.signal, entry.joint, part, said=said)
    elif entry.signal != "time" and not entry.joint:
        yield from _array(log, field, entry.signal, part, reading, robot, said=said)
    elif entry.signal != "time" and part.stop - part.start != 1:
        raise LogError(
            log.path,
            f"{entry.source!r} has {part.stop - part.start} columns, {entry.target} is one;"
            f" name it as {field.name}[0]",
        )
    elif entry.signal != "time":
        yield Claim(field, part, entry.signal, entry.joint, said=said)


def _base(
    log: Log, field: Field, signal: str, convention: str, part: slice, *, said: bool
) -> Claim:
    if part.stop - part.start != WIDTHS[signal]:
        raise LogError(
            log.path,
            f"{field.name!r} has {part.stop - part.start} columns, a {signal} has {WIDTHS[signal]}",
        )
    return Claim(field, part, signal, convention, said)


def _array(
    log: Log,
    field: Field,
    signal: str,
    part: slice,
    reading: Reading,
    robot: Robot | None,
    *,
    said: bool,
) -> Iterator[Claim]:
    """Claim the columns of an array, one by one."""
    width = part.stop - part.start
    names: Sequence[str] = field.joints[part]
    if not names or len(reading.joints) == width:
        names = reading.joints or (robot.joint_names if robot else ())
        if names and (len(names) < width or (reading.joints and len(names) != width)):
            whose = "--joints names" if reading.joints else f"robot {robot and robot.name!r} has"
            raise LogError(
                log.path,
                f"{field.name!r} has {width} columns, {whose} {len(names)}; take a part of it"
                f" (--map {signal}={field.name}[0:{len(names)}]) or name all (--joints)",
            )
    names = names or [f"joint_{number}" for number in range(width)]
    for column, joint in zip(range(part.start, part.stop), names[:width], strict=True):
        yield Claim(field, slice(column, column + 1), signal, joint, said)


def _numbered(log: Log, field: Field, number: int, reading: Reading, robot: Robot | None) -> str:
    joints = reading.joints or (robot.joint_names if robot else ())
    if not joints:
        return f"joint_{number}"
    if number >= len(joints):
        raise LogError(
            log.path,
            f"column {field.name!r} has number {number}, the robot's joints are 0 to"
            f" {len(joints) - 1} ({', '.join(joints)}); say what it holds with --map",
        )
    return joints[number]
