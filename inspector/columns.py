"""Which column of a log holds which signal of which joint."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from inspector.errors import InspectorError, LogError

TIMES = ("time", "timestamp", "t", "__time", "stamp")
"""Names of a time column, in any case; the first of these that a log has is taken."""

SIGNALS = ("position", "velocity", "effort", "position_desired", "velocity_desired")

NAMED = re.compile(
    r"(?:.*/)?(?P<joint>[^/]+)[./]"
    r"(?P<signal>(?:position|velocity)(?:_desired)?|effort)"
)
"""``elbow.velocity``, ``elbow/velocity``, and PlotJuggler's ``/joint_states/elbow/velocity``."""

NUMBERED = re.compile(
    r"(?:(?:.*/)?(?P<side>actual|feedback|desired|reference)/|.*/)?"
    r"(?P<signal>positions?|velocity|velocities|efforts?)[\[.](?P<number>\d+)\]?"
    r"|(?P<ur_side>actual|target)_(?P<ur_signal>qd?)_(?P<ur_number>\d+)"
)
"""PlotJuggler's ``/state/desired/velocities[0]``, and ur_rtde's ``target_qd_0``."""

WORDS = {"q": "position", "positions": "position", "qd": "velocity", "velocities": "velocity"}
COMMANDED = ("desired", "reference", "target")

Mapped: TypeAlias = Mapping[str, tuple[str, str]]
"""By column name, the signal ("time" among them) and the joint that a person said it holds."""


@dataclass(frozen=True)
class Column:
    """A column that holds a signal of a joint.

    Attributes:
        index: Its place in the file.
        name: Its name in the header.
        signal: One of ``SIGNALS``.
        joint: The joint's name.
    """

    index: int
    name: str
    signal: str
    joint: str

    @property
    def is_desired(self) -> bool:
        """Whether it holds desired motion."""
        return self.signal.endswith("_desired")


@dataclass(frozen=True)
class Layout:
    """What the columns of a log are.

    Attributes:
        time: Index of the time column.
        columns: The columns that hold signals.
        left: Names of the columns that are not read.
    """

    time: int
    columns: tuple[Column, ...]
    left: tuple[str, ...]


def parse_mapping(entries: Iterable[str]) -> Mapped:
    """Read what a person says of columns that have names of their own.

    Args:
        entries: ``SIGNAL.JOINT=COLUMN`` each, SIGNAL being one of ``SIGNALS``, or
            ``time=COLUMN``. The column may hold any character, the joint any but "=".

    Returns:
        Signal and joint by column.

    Raises:
        InspectorError: If an entry is not of that form, or a column is named twice.
    """
    mapped: dict[str, tuple[str, str]] = {}
    for entry in entries:
        target, _, column = entry.partition("=")
        signal, _, joint = target.partition(".")
        if not column or (target != "time" and not (signal in SIGNALS and joint)):
            raise InspectorError(
                f"mapping {entry!r}: expected SIGNAL.JOINT=COLUMN, such as velocity.elbow=dq2,"
                f" or time=COLUMN; signals are {', '.join(SIGNALS)}"
            )
        if column in mapped:
            raise InspectorError(f"mapping {entry!r}: column {column!r} is mapped twice")
        mapped[column] = (signal, joint)
    return mapped


def layout(
    path: Path, header: Sequence[str], *, mapped: Mapped, joints: Sequence[str] | None
) -> Layout:
    """Find out what each column holds; what a person said goes before what its name says.

    Args:
        path: The log, for errors.
        header: The names of its columns.
        mapped: What a person said of some columns; those that the log lacks are passed over.
        joints: The robot's joints in order, after which numbered columns are named. Unless
            given, these become ``joint_0``, ``joint_1``…

    Raises:
        LogError: If two columns have one name or hold the same, or there is no time column, no
            column of a joint, or a column whose number is above those of the robot's joints.
    """
    for index, name in enumerate(header):
        if name and name in header[:index]:
            raise LogError(path, f"two columns are named {name!r}", row=1)
    time = _time_column(path, header, mapped)
    found: dict[tuple[str, str], Column] = {}
    for index, name in enumerate(header):
        held = mapped.get(name) or (None if index == time else _held(path, name, joints))
        if held is None or held[0] == "time":
            continue
        twin = found.get(held)
        if twin is None or (name in mapped and twin.name not in mapped):
            found[held] = Column(index, name, *held)
        elif name in mapped or twin.name not in mapped:
            raise LogError(
                path, f"{twin.name!r} and {name!r} both hold {held[0]} of joint {held[1]!r}", row=1
            )
    columns = tuple(sorted(found.values(), key=lambda column: column.index))
    if not any(column.signal != "effort" for column in columns):
        raise LogError(
            path,
            "no position or velocity of a joint; name columns JOINT.velocity or JOINT.position, or"
            f" say what they hold with --map velocity.JOINT=COLUMN; columns are {listed(header)}",
        )
    read = {time, *(column.index for column in columns)}
    left = tuple(name for index, name in enumerate(header) if name and index not in read)
    return Layout(time, columns, left)


def _time_column(path: Path, header: Sequence[str], mapped: Mapped) -> int:
    said = [name for name in header if mapped.get(name, ("",))[0] == "time"]
    known = {name.lower(): name for name in reversed(header) if name not in mapped}
    candidates = said or [known[name] for name in TIMES if name in known]
    if not candidates or len(said) > 1:
        raise LogError(
            path,
            f"{'several time columns are' if said else 'no time column is'} named; expected one of"
            f" {', '.join(TIMES)}, or --map time=COLUMN; columns are {listed(header)}",
        )
    return header.index(candidates[0])


def _held(path: Path, name: str, joints: Sequence[str] | None) -> tuple[str, str] | None:
    """Say which signal of which joint a column holds, going by its name."""
    if named := NAMED.fullmatch(name):
        return named["signal"], named["joint"]
    numbered = NUMBERED.fullmatch(name)
    if numbered is None:
        return None
    number = int(numbered["number"] or numbered["ur_number"])
    word = numbered["signal"] or numbered["ur_signal"]
    signal = WORDS.get(word, word.removesuffix("s"))
    if (numbered["side"] or numbered["ur_side"]) in COMMANDED:
        if signal == "effort":
            return None
        signal += "_desired"
    if joints is None:
        return signal, f"joint_{number}"
    if number >= len(joints):
        raise LogError(
            path,
            f"column {name!r} has number {number}, the robot's joints are 0 to {len(joints) - 1}"
            f" ({', '.join(joints)}); say what it holds with --map",
        )
    return signal, joints[number]


def listed(names: Sequence[str]) -> str:
    """List names, not more than a line can take."""
    shown = ", ".join(names[:10])
    return shown + (f" and {len(names) - 10} more" if len(names) > 10 else "")
