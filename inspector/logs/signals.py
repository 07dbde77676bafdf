"""Signals of a log, and the names of columns and arrays that they are known by.

``PATTERNS`` is the table of names; docs/logs.md has the rules in words. Names are matched in any
case, without the unit at their end.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import pi

JOINT_SIGNALS = ("position", "velocity", "effort", "position_desired", "velocity_desired")
BASE_SIGNALS = ("base_pose", "base_velocity")
SIGNALS = (*JOINT_SIGNALS, *BASE_SIGNALS)

TIMES = ("time", "timestamp", "t", "__time", "stamp", "ts", "elapsed", "sec", "secs", "seconds")
"""Names of a time column, in any case; the first of these that a log has is used."""

TIME = re.compile(
    r"(?:.*[./])?(?:(?:elapsed|ros|rosbag|system|sys|robot|host|pc|unix|wall|sim|log)[_ ]?)?"
    r"(?P<name>__time|time[_ ]?stamp|time|stamp|t|ts|elapsed|secs?|seconds)",
    re.IGNORECASE,
)
"""``field.header.stamp``, ``ros_time``, ``elapsed_time``."""

TIME_UNITS = {
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), "seconds"),
    **dict.fromkeys(("ms", "msec", "millis", "milliseconds"), "milliseconds"),
    **dict.fromkeys(("us", "µs", "μs", "usec", "micros", "microseconds"), "microseconds"),
    **dict.fromkeys(("ns", "nsec", "nanos", "nanoseconds"), "nanoseconds"),
}
"""Units of stamps, as names of columns have them."""

UNITS = {
    **dict.fromkeys(("rad", "radians"), ("position", 1.0)),
    **dict.fromkeys(("deg", "degree", "degrees", "°"), ("position", pi / 180)),
    **dict.fromkeys(("rev", "turns"), ("position", 2 * pi)),
    **dict.fromkeys(("m",), ("position", 1.0)),
    **dict.fromkeys(("mm",), ("position", 1e-3)),
    **dict.fromkeys(("rad/s", "rad/sec", "rad_s", "rads", "radps"), ("velocity", 1.0)),
    **dict.fromkeys(
        ("deg/s", "deg/sec", "deg_s", "degs", "degps", "dps", "°/s"), ("velocity", pi / 180)
    ),
    **dict.fromkeys(("rpm", "rev/min"), ("velocity", pi / 30)),
    **dict.fromkeys(("rev/s", "turns/s"), ("velocity", 2 * pi)),
    **dict.fromkeys(("m/s",), ("velocity", 1.0)),
    **dict.fromkeys(("mm/s",), ("velocity", 1e-3)),
    **dict.fromkeys(("nm", "n m", "n*m", "n.m", "n·m", "n", "a"), ("effort", 1.0)),
}
"""Quantity and size, in [rad], [rad/s], [m] or [m/s], of units, as names of columns have them."""

UNIT = re.compile(
    r"(?P<name>.*?)(?:\s*[\[(]\s*(?P<bracketed>[^\])]*[^\d\s\])][^\])]*)[\])]"
    r"|[_ ](?P<suffix>m?s|sec|secs|seconds|msec|us|usec|ns|nsec"
    r"|rad|rads|radps|rad_s|deg|degs|degps|deg_s|dps|rpm|nm))",
    re.IGNORECASE,
)
"""``Time [sec]``, ``timestamp_ms``, ``Joint1 Velocity (deg/s)``, ``q1_deg``."""

QUANTITIES = {
    "position": r"positions?|pos|angles?|q_?pos|q|theta",
    "velocity": r"velocity|velocities|vel|speeds?|q_?vel|q_?dot|qd|dq|omega",
    "effort": r"efforts?|eff|torques?|tau(?:_?j)?",
}
"""Words of a quantity. ``qd`` is a velocity, ``q_d`` a desired position."""

DESIRED = r"desired|des|reference|ref|target|commanded|command|cmd|setpoint|goal"
MEASURED = r"actual|act|feedback|measured|meas|msr"
JOINT_WORD = r"joints?|dof|motor|axis|actuator"

GAP = r"(?:[ _./-]+|(?-i:(?<=[a-z0-9])(?=[A-Z])))"
QUANTITY = rf"(?P<quantity>{'|'.join(QUANTITIES.values())})"
BEFORE = rf"(?:(?P<before>{DESIRED}|{MEASURED}){GAP})?"
WITHIN = rf"(?:(?P<within>{DESIRED}|{MEASURED}){GAP})?"
AFTER = rf"(?:{GAP}?(?P<after>{DESIRED}|{MEASURED}|(?<=_)d)(?![a-z]))?"
LAST = rf"(?:{GAP}?(?P<last>{DESIRED}|{MEASURED}|(?<=_)d))?"
WORD = rf"(?:(?:{JOINT_WORD}){GAP}?)?"
RECORD = r"(?:.*?/)??(?:(?:field|state|robot_?state|joint_?states?|msg|data|robot)[._])?"
NUMBER = r"(?:\[(?P<index>\d+)\]|\((?P<round>\d+)\)|(?P<number>\d+))"
LIMB = r"(?P<joint>(?:left|right|l|r|arm|leg|hand)\d*(?:_(?:left|right|arm|leg|hand)\d*)?)"
ALONE = (
    r"(?P<quantity>(?:joint|dof)_(?:pos|vel|positions?|velocity|velocities|efforts?|torques?)"
    r"|position|velocity|effort|torque|applied_torque|tau|q|qd|dq|q_?dot)"
)

PATTERNS = {
    name: re.compile(pattern, flags)
    for name, pattern, flags in (
        (
            "a joint, then the signal of a run file",
            r"(?:.*/)?(?P<joint>[^/]+)[./](?P<quantity>position|velocity|effort)"
            r"(?P<after>(?<!effort)_desired)?",
            re.NOFLAG,
        ),
        (
            "a quantity and the joint's number",
            RECORD + WORD + BEFORE + WORD + QUANTITY + AFTER + GAP + "?" + NUMBER + LAST,
            re.IGNORECASE,
        ),
        (
            "a quantity of all joints, or of the only one",
            RECORD + BEFORE + ALONE + AFTER,
            re.IGNORECASE,
        ),
        (
            "a limb, a quantity and the joint's number",
            RECORD + LIMB + GAP + WORD + BEFORE + QUANTITY + AFTER + GAP + "?" + NUMBER + LAST,
            re.IGNORECASE,
        ),
        (
            "a joint, then a quantity",
            RECORD + BEFORE + r"(?P<joint>[^/]+?)" + GAP + WITHIN + QUANTITY + AFTER,
            re.IGNORECASE,
        ),
    )
}
"""Names of columns and arrays; the first that matches counts."""

NOT_JOINTS = re.compile(
    rf"(?:.*{GAP})?(?:tcp|eef?|end_?effector|cartesian|cart|linear|angular|lin|ang|com|imu|odom|gps)"
    rf"(?:{GAP}.*)?|base|root|body|tool|object|robot|max|min|mean|x|y|z|roll|pitch|yaw|wind",
    re.IGNORECASE,
)
"""Things before a quantity that are no joints."""

NOT_MOTION = re.compile(
    r"(?:.*[/._ ])?(?:errors?|err)(?:[/._ \[(].*)?|(?:.*/)?output/.*", re.IGNORECASE
)
"""Names of what a controller computes: ``/state/error/positions[0]``, ``joint1_error_pos``."""

GENERIC = re.compile(rf"(?:{JOINT_WORD}|j|a)[ _]?(?P<number>\d+)", re.IGNORECASE)
"""``joint1``, ``J1``, ``axis 1``: names that number the joints."""

LONGEST = 300
"""Characters of a name from which on it is that of no signal: patterns take their square."""

SIDES = ("before", "within", "after", "last")
"""Parts of a name that tell whether it is desired."""

ROBOSUITE = re.compile(r"robot\d+_(?=joint_(pos|vel)$)")
"""Prefix of robosuite's arrays."""


@dataclass(frozen=True)
class Naming:
    """How the columns of one log are named, where single names leave it open.

    Attributes:
        first: Number of the first joint.
        qd_is_desired: Whether ``qd`` is the desired position, since ``dq`` is the velocity.
    """

    first: int = 0
    qd_is_desired: bool = False

    @classmethod
    def of(cls, columns: Iterable[str]) -> "Naming":
        """Naming of some columns: joints count from 1 if none has number 0 and one has 1."""
        numbers, words = set[int](), set[str]()
        for column in columns:
            name = without_unit(column)[0]
            known, match = column_signal(column), _match(name)
            if known and (number := number_of(known[1])) is not None and not name.endswith("]"):
                numbers.add(number)
            if match and not any(_sides(match.groupdict())):
                words.add(match["quantity"].lower())
        return cls(first=int(min(numbers, default=0) == 1), qd_is_desired={"dq", "qd"} <= words)


def without_unit(name: str) -> tuple[str, str]:
    """Name of a column, and the unit at its end in small letters, or an empty text."""
    match = UNIT.fullmatch(name.strip()) if len(name) <= LONGEST else None
    unit = (match["bracketed"] or match["suffix"]).strip().lower() if match else ""
    if match and (unit in UNITS or unit in TIME_UNITS):
        return match["name"].rstrip(), unit
    return name.strip(), ""


def factor_of(column: str) -> float:
    """Size of the unit that a column's name ends with, in [rad], [rad/s], [m], [m/s] or [N m]."""
    return UNITS.get(without_unit(column)[1], ("", 1.0))[1]


def column_signal(column: str, naming: Naming | None = None) -> tuple[str, str | int] | None:
    """Signal and joint of a column, by its name.

    Args:
        column: Its name.
        naming: What the names of the log's other columns tell.

    Returns:
        The signal, and the joint's name or number; None for an unknown name.
    """
    name, unit = without_unit(column)
    match = _match(name if unit in UNITS else column.strip())
    if match is None:
        number = GENERIC.fullmatch(name) if unit in UNITS else None
        return (UNITS[unit][0], name) if number else None
    found = match.groupdict()
    joint: str | int = found.get("joint") or ""
    number_text = found.get("index") or found.get("round") or found.get("number")
    if number_text is not None:
        joint = f"{joint}_{number_text}" if joint else int(number_text)
    signal = _signal(found, naming or Naming())
    return (signal, joint) if signal and joint != "" else None


def array_signal(name: str) -> str | None:
    """Signal of an array by its name, without the folders in it; None for an unknown name."""
    bare = ROBOSUITE.sub("", name.rpartition("/")[2].lower())
    if bare in SIGNALS:
        return bare
    match = len(name) <= LONGEST and PATTERNS[
        "a quantity of all joints, or of the only one"
    ].fullmatch(bare)
    return _signal(match.groupdict(), Naming()) if match else None


def number_of(joint: str | int) -> int | None:
    """Number of a joint that a column tells by its number, or by a name that is one."""
    if isinstance(joint, int):
        return joint
    match = GENERIC.fullmatch(joint) if len(joint) <= LONGEST else None
    return int(match["number"]) if match else None


def says_twice(column: str) -> bool:
    """Whether a column's name says twice that it is desired, as ``cmd.q_d[0]`` does.

    Such a one is the command beside the desired motion that a controller followed.
    """
    match = _match(without_unit(column)[0])
    return match is not None and sum(map(bool, _sides(match.groupdict()))) > 1


def time_column(names: Sequence[str]) -> str:
    """Name of the column or array that holds the stamps; empty if there is none."""
    found: dict[str, str] = {}
    for name in names:
        bare = without_unit(name)[0]
        if len(bare) <= LONGEST and (match := TIME.fullmatch(bare)):
            word = re.sub("[_ ](?=stamp)", "", match["name"].lower())
            plain = "/" not in name and "." not in name
            found.setdefault(word if plain else f"{word} of a record", name)
    wanted = (*TIMES, *(f"{word} of a record" for word in TIMES))
    return next((found[word] for word in wanted if word in found), "")


def listed(names: Sequence[str]) -> str:
    """The first ten of some names, long ones cut off, and how many more there are."""
    shown = ", ".join(name if len(name) <= 80 else f"{name[:77]}..." for name in names[:10])
    return shown + (f" and {len(names) - 10} more" if len(names) > 10 else "")


def _match(name: str) -> re.Match[str] | None:
    if len(name) > LONGEST or NOT_MOTION.fullmatch(name):
        return None
    found = next((match for each in PATTERNS.values() if (match := each.fullmatch(name))), None)
    if found is None or found.re is next(iter(PATTERNS.values())):
        return found
    joint = found.groupdict().get("joint")
    return None if joint and NOT_JOINTS.fullmatch(joint) else found


def _signal(found: dict[str, str | None], naming: Naming) -> str | None:
    """Signal of the parts of a name; None for a desired effort, which runs do not have."""
    word = re.sub(r"^(?:joint|dof|applied)_", "", (found["quantity"] or "").lower())
    signal = next(each for each, words in QUANTITIES.items() if re.fullmatch(words, word))
    sides = _sides(found)
    if word == "qd" and naming.qd_is_desired and not any(sides):
        return "position_desired"
    desired = any(side == "d" or re.fullmatch(DESIRED, side) for side in sides)
    if not desired:
        return signal
    return None if signal == "effort" else f"{signal}_desired"


def _sides(found: dict[str, str | None]) -> list[str]:
    """What the parts of a name say on whether it is desired or measured; empty where nothing."""
    return [(found.get(place) or "").lower().strip("_") for place in SIDES]
