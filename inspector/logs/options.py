"""Options of reading a log, with a mapping of its columns, that can be saved as TOML."""

import json
import re
from collections.abc import Iterable
from dataclasses import dataclass, fields
from math import isfinite
from pathlib import Path
from typing import Any, Self

from inspector.errors import InspectorError, OptionError
from inspector.logs.signals import BASE_SIGNALS, JOINT_SIGNALS
from noiseclassifier.jsontext import from_toml, text_of, toml_shown
from noisemodel.atomic import replacing

FORMAT = "noise-mapping/1"
UNITS = ("radians", "degrees", "normalised")

CONVENTIONS = {
    "base_pose": ("xyzw", "wxyz"),
    "base_velocity": ("body", "world", "mujoco"),
}
"""Conventions of a base: the order of its quaternion; the axes of its velocity, which for MuJoCo
are the world's for the linear part and the body's for the angular one. The first is the run's."""

PART = re.compile(r"(?P<name>.+)\[(?P<first>\d*)(?P<colon>:?)(?P<last>\d*)\]")


@dataclass(frozen=True)
class Entry:
    """Mapping of one column or array to a signal.

    Attributes:
        signal: One of ``inspector.logs.signals.SIGNALS``, or "time".
        joint: The joint, for a single column; for a base its convention; empty for an
            array of all joints.
        source: The column or array, or a part of it: ``qpos[7:]``, ``qvel[6]``.
    """

    signal: str
    joint: str
    source: str

    @property
    def target(self) -> str:
        """Text before the equals sign."""
        return f"{self.signal}.{self.joint}" if self.joint else self.signal

    def part(self) -> tuple[str, slice]:
        """Name of the array in the source, and its columns."""
        match = PART.fullmatch(self.source)
        if match is None or not (match["first"] or match["colon"]):
            return self.source, slice(None)
        first = int(match["first"] or 0)
        if not match["colon"]:
            return match["name"], slice(first, first + 1)
        return match["name"], slice(first, int(match["last"]) if match["last"] else None)


@dataclass(frozen=True)
class ReadOptions:
    """Options of reading a log; what is not specified is taken from the log.

    Attributes:
        robot: Name, URDF or MJCF of the robot; joints are checked against it, and numbered
            columns get its joints in order.
        rate: The log's rate, if known, in [Hz].
        units: "radians", "degrees" or "normalised" (-100 to 100 of each joint's range, 0 to 100
            of a gripper's); empty for the log's own.
        joints: Names of the columns of arrays, in order.
        topics: The topics to read, all unless given.
        offset: Offset added to the desired motion's stamps, in [s]; estimated unless given.
        columns: Names of the columns of a CSV log, in order, in place of its header; "" for one
            that is not read.
        entries: The mapping of columns and arrays.
    """

    robot: str = ""
    rate: float | None = None
    units: str = ""
    joints: tuple[str, ...] = ()
    topics: tuple[str, ...] = ()
    offset: float | None = None
    columns: tuple[str, ...] = ()
    entries: tuple[Entry, ...] = ()

    def __post_init__(self) -> None:
        """Check the options."""
        if self.rate is not None and not (isfinite(self.rate) and self.rate > 0):
            raise OptionError(f"the rate is {self.rate:g} Hz; expected a number above 0")
        if self.offset is not None and not isfinite(self.offset):
            raise OptionError(f"the offset is {self.offset:g} s; expected a finite number")
        if self.units and self.units not in UNITS:
            raise OptionError(f"no units {self.units!r}; there are {', '.join(UNITS)}")

    @property
    def time(self) -> str:
        """The column that is mapped to the stamps, or empty."""
        return next((entry.source for entry in self.entries if entry.signal == "time"), "")

    @classmethod
    def load(cls, path: Path) -> Self:
        """Options from a saved mapping.

        Raises:
            InspectorError: If it cannot be read, or has unknown settings.
        """
        try:
            saved = from_toml(text_of(path))
        except OSError as error:
            raise InspectorError(f"{path}: cannot be read ({error.strerror})") from error
        except ValueError as error:
            raise InspectorError(f"{path}: not a mapping in TOML ({error})") from error
        if saved.pop("format", None) != FORMAT:
            raise InspectorError(f'{path}: not a mapping; expected format = "{FORMAT}"')
        entries = saved.pop("map", {})
        known = {field.name for field in fields(cls)} - {"entries"}
        if unknown := sorted(set(saved) - known):
            raise InspectorError(
                f"{path}: unknown setting {unknown[0]!r}; there are {', '.join(sorted(known))}, map"
            )
        try:
            for target, source in entries.items():
                _setting(target, source)
            parsed = parse_mapping(f"{target}={source}" for target, source in entries.items())
            return cls(
                **{name: _setting(name, value) for name, value in saved.items()}, entries=parsed
            )
        except (InspectorError, AttributeError, TypeError) as error:
            raise InspectorError(f"{path}: {error}") from error

    def save(self, path: Path, *, overwrite: bool = False) -> None:
        """Write the options as TOML, to be loaded again.

        Raises:
            OutputError: If the file exists or cannot be written.
        """
        lines = [f'format = "{FORMAT}"']
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name != "entries" and value not in (None, "", ()):
                lines.append(f"{field.name} = {_toml(value)}")
        if self.entries:
            lines += ["", "[map]"]
            lines += [f"{_toml(each.target)} = {_toml(each.source)}" for each in self.entries]
        with replacing(path, overwrite=overwrite) as temporary:
            temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def parse_mapping(entries: Iterable[str]) -> tuple[Entry, ...]:
    """Mapping of columns and arrays, parsed.

    Args:
        entries: ``SIGNAL.JOINT=COLUMN``, ``SIGNAL=ARRAY`` or ``time=COLUMN`` each. The column may
            hold any character, the joint any but "="; of an array ``[3]``, ``[7:]`` or ``[:7]``
            names a part. Signals of the base may name a convention of ``CONVENTIONS``:
            ``base_pose.wxyz=root_pose``.

    Returns:
        The entries.

    Raises:
        OptionError: If an entry is not of that form, or a column or target is named twice.
    """
    parsed: list[Entry] = []
    for text in entries:
        target, _, source = text.partition("=")
        signal, dot, joint = target.partition(".")
        known = signal in (*JOINT_SIGNALS, *BASE_SIGNALS) or target == "time"
        if not source or not known or (dot and not joint):
            raise OptionError(
                f"mapping {text!r}: expected SIGNAL.JOINT=COLUMN, such as velocity.elbow=dq2,"
                " SIGNAL=ARRAY, such as position=qpos[7:], or time=COLUMN; signals are"
                f" {', '.join((*JOINT_SIGNALS, *BASE_SIGNALS))}"
            )
        if joint and joint not in CONVENTIONS.get(signal, (joint,)):
            raise OptionError(
                f"mapping {text!r}: a {signal} is written as {' or '.join(CONVENTIONS[signal])}"
            )
        if any(entry.source == source for entry in parsed):
            raise OptionError(f"mapping {text!r}: column {source!r} is mapped twice")
        if any(entry.target == target for entry in parsed):
            raise OptionError(f"mapping {text!r}: {target} is mapped twice")
        parsed.append(Entry(signal, joint, source))
    return tuple(parsed)


def _setting(name: str, value: Any) -> Any:
    """Setting of a saved mapping, its type checked."""
    if name in ("joints", "topics", "columns"):
        correct = isinstance(value, list) and all(isinstance(each, str) for each in value)
        value = tuple(value) if correct else value
    elif name in ("rate", "offset"):
        correct = isinstance(value, int | float) and not isinstance(value, bool)
    else:
        correct = isinstance(value, str)
    if not correct:
        raise InspectorError(f"{name} = {toml_shown(value)} is of another type than expected")
    return value


def _toml(value: str | float | tuple[str, ...]) -> str:
    if isinstance(value, tuple):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, str):  # JSON's strings are TOML's, but for one character
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(float(value))
