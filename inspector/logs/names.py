"""Names of columns and arrays, and the signals and joints that they stand for.

``PATTERNS`` is the table of names, read in any case and without the unit at their end. Names that
leave a question open are decided beside the log's other names, by `Naming`. Patterns are texts,
which `re` compiles where they are first used: run files need none of them.
"""

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from math import pi
from typing import NamedTuple, TypeAlias

Meaning: TypeAlias = tuple[str, str | int]  # a signal, and the name or the number of its joint
JOINT_SIGNALS = ("position", "velocity", "effort", "position_desired", "velocity_desired")
BASE_SIGNALS = ("base_pose", "base_velocity")
SIGNALS = (*JOINT_SIGNALS, *BASE_SIGNALS)

# Names of a time column, in any case; the first of these that a log has is used.
TIMES = (
    *("time", "times", "timestamp", "timestamps", "t", "tout", "__time", "stamp", "ts", "elapsed"),
    *("sec", "secs", "seconds"),
)
# ``field.header.stamp``, ``ros_time``, ``elapsed_time``; a computer's clock is no robot's.
TIME = (
    r"(?:.*[./])?(?:(?:elapsed|ros|rosbag|robot|sim|log|(?P<host>system|sys|host|pc|unix|wall))"
    r"[_ ]?)?(?P<name>__time|time[_ ]?stamps?|times?|stamp|tout|t|ts|elapsed|secs?|seconds)"
)
# Flags of D4RL, Gymnasium and RLDS: the last step of an episode has one.
EPISODE_ENDS = (
    *("terminals", "timeouts", "terminations", "truncations", "dones"),
    *("terminated", "truncated", "done", "is_last"),
)
EPISODE_NUMBERS = ("episode_index", "episode")  # columns with the number of the episode
EPISODES = (*EPISODE_ENDS, *EPISODE_NUMBERS)
# Units of stamps, as names of columns have them.
TIME_UNITS = {
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), "seconds"),
    **dict.fromkeys(("ms", "msec", "millis", "milliseconds"), "milliseconds"),
    **dict.fromkeys(("us", "µs", "μs", "usec", "micros", "microseconds"), "microseconds"),
    **dict.fromkeys(("ns", "nsec", "nanos", "nanoseconds"), "nanoseconds"),
}
# Quantity and size, in [rad], [rad/s], [m] or [m/s], of units, as names of columns have them.
UNITS = {
    unit: (quantity, size)
    for quantity, size, units in (
        ("position", 1.0, "rad,radians,m"),
        ("position", 1e-3, "mrad,mm"),
        ("position", pi / 180, "deg,degree,degrees,°"),
        ("position", 2 * pi, "rev,turns"),
        ("velocity", 1.0, "rad/s,rad/sec,rad_s,rads,radps,m/s"),
        ("velocity", 1e-3, "mrad/s,mm/s"),
        ("velocity", pi / 180, "deg/s,deg/sec,deg_s,degs,degps,dps,°/s"),
        ("velocity", pi / 30, "rpm,rev/min"),
        ("velocity", 2 * pi, "rev/s,turns/s"),
        ("effort", 1.0, "nm,n m,n*m,n.m,n·m,n,a"),
    )
    for unit in units.split(",")
}
# ``Time [sec]``, ``timestamp_ms``, ``Joint1 Velocity (deg/s)``, ``q1_deg``.
UNIT = (
    r"(?P<name>.*?)(?:\s*+[\[(]\s*+(?P<bracketed>(?=[^\])]*[^\d\s\])])[^\])]*+)[\])]"
    r"|[_ ](?P<suffix>m?s|sec|secs|seconds|msec|us|usec|ns|nsec"
    r"|rad|rads|radps|rad_s|deg|degs|degps|deg_s|dps|rpm|nm))"
)
# Words of a quantity. ``qd`` is a velocity, ``q_d`` a desired position.
QUANTITIES = {
    "position": r"positions?|pos|angles?|q_?pos|q|theta",
    "velocity": r"velocity|velocities|vel|speeds?|q_?vel|q_?dot|theta_?dot|dtheta|qd|dq|omega",
    "effort": r"efforts?|eff|torques?|tau(?:_?j)?",
}
DESIRED = (
    r"desired|des|reference|ref|targets?|commanded|commands?|cmd|cmptd|set_?points?|sp|goal"
    r"|demand(?:ed)?|planned|soll|set|nominal|traj(?:ectory)?|tgt|requested|expected|actions?"
)
MEASURED = r"actual|act|feedback|fbk|measured|meas|msr|present|ist"
JOINT_WORD = r"joints?|dof|motor|axis|actuator"

GAP = r"(?:[ _./-]++|(?-i:(?<=[a-z0-9])(?=[A-Z])))"
QUANTITY = rf"(?P<quantity>{'|'.join(QUANTITIES.values())})"
BEFORE = rf"(?:(?P<before>{DESIRED}|{MEASURED}){GAP})?"
WITHIN = rf"(?:(?P<within>{DESIRED}|{MEASURED}){GAP})?"
AFTER = rf"(?:{GAP}?(?P<after>{DESIRED}|{MEASURED}|(?<=_)d)(?![a-z]))?"
LAST = rf"(?:{GAP}?(?P<last>{DESIRED}|{MEASURED}|(?<=_)d))?"
WORD = rf"(?:(?:{JOINT_WORD}){GAP}?)?"
RECORDS = r"field|(?:observation\.)?state|robot_?state|joint_?states?|msg|data|robot"
RECORD = rf"(?:.*?/)??(?:(?:{RECORDS})[._])?"
NUMBER = r"(?:\[(?P<index>\d+)\]|\((?P<round>\d+)\)|(?P<number>\d+))"
LIMB = r"(?P<joint>(?:left|right|l|r|arm|leg|hand)\d*(?:_(?:left|right|arm|leg|hand)\d*)?)"
WHOSE = rf"(?:(?:output|shaft|rotor|encoder|angular|motor|joint){GAP})?"
ALONE = (
    r"(?P<quantity>(?:joint|dof)_(?:pos|vel|positions?|velocity|velocities|efforts?|torques?)"
    r"|positions?|pos|angles?|velocity|velocities|vel|efforts?|torques?|applied_torque|tau"
    r"|q|qd|dq|q_?dot|theta|theta_?dot|dtheta|omega)"
)

# A joint, then the signal of a run file, as it is written there
FIRST = (
    r"(?-i:(?:.*/)?(?P<joint>[^/]+)[./](?P<quantity>position|velocity|effort)"
    r"(?P<after>(?<!effort)_desired)?)"
)
# A quantity of all joints, or of the only one
WHOLE = RECORD + BEFORE + WHOSE + ALONE + AFTER

NUMBERED = QUANTITY + AFTER + GAP + "?" + NUMBER + LAST
# Names of columns and arrays; the first that matches counts.
PATTERNS = (
    FIRST,
    RECORD + WORD + BEFORE + WORD + NUMBERED,  # q_d[0], joint_pos_1
    WHOLE,
    RECORD + LIMB + GAP + WORD + BEFORE + NUMBERED,  # left_q_1
    # a joint, then a quantity: elbow_target_vel
    RECORD + BEFORE + r"(?P<joint>[^/]+?)" + GAP + WITHIN + QUANTITY + AFTER,
)
# Things before a quantity that are no joints.
NOT_JOINTS = (
    rf"(?:.*{GAP})?(?:tcp|eef?|end_?effector|cartesian|cart|linear|angular|lin|ang|com|imu|odom|gps"
    rf"|gravity|friction|external|ext|contact|inertia|bias|residual|disturbance|limits?)"
    rf"(?:{GAP}.*)?|base|root|body|tool|object|wind|(?:.*{GAP})?(?:max|min|mean)"
)
AXES = r"x|y|z|roll|pitch|yaw"  # of a pose, but joints in ``x.velocity``
# Names of what a controller computes: ``/state/error/positions[0]``, ``PositionError1``.
NOT_MOTION = (
    r"(?:.*[/._ ])?(?:errors?|err)(?:[/._ \[(].*)?|(?:.*/)?output/.*|(?:.*\.)?controller\.input_.*"
    r"|.*(?-i:(?<=[a-z0-9])E(?:rr|rror)s?)[_\[(]?\d*[\])]?"
)
# ``joint1``, ``J1``, ``axis 1``: names that number the joints.
GENERIC = rf"(?:{JOINT_WORD}|servo|j|a)[ _]?(?P<number>\d+)"
LIMBS = r"left|right|front|rear|hind|back|l|r|fl|fr|rl|rr|lf|rf|lh|rh|hl|hr|bl|br|arm|leg|hand"
PARTS = (
    r"shoulder|elbow|wrist|hip|knee|ankle|thigh|calf|shank|waist|torso|neck|upper_?arm|fore_?arm"
    r"|haa|hfe|kfe|abad|gripper|finger|thumb"
)
# Names of joints without a quantity: ``Joint1``, ``FL_0``, ``shoulder_lift``, ``wrist_1``. What
# repeats has one reading or a bound: ``rrrr`` is `r` four times or `rr` twice.
BARE = (
    rf"(?:(?:{LIMBS}){GAP}?){{0,4}}(?:(?:{JOINT_WORD}|servo|j|(?-i:A))[ _]?\d+|(?<=[a-z][ _.-])\d+)"
    rf"|(?=.*(?:{PARTS}))(?:(?:{LIMBS}|{PARTS}|{JOINT_WORD}|lift|pan|tilt|flex|rotate|rotation"
    rf"|roll|pitch|yaw|[xyz]|\d+(?!\d))(?:{GAP}|(?=\d)|$))+"
)
SIDED = rf"{BEFORE}(?P<joint>.+?)(?:{GAP}(?P<after>{DESIRED}|{MEASURED}))?"

# What each pattern of a quantity has in it, and each of a joint alone: most names have neither, and
# the patterns, which take 5 ms to compile, are not needed for them.
HINTS = ("pos", "angle", "q", "theta", "vel", "speed", "omega", "eff", "torque", "tau")
BARE_HINT = rf"\d|{PARTS}"
LONGEST = 300  # characters of a name from which on it names no signal: patterns take their square

SIDES = ("before", "within", "after", "last")  # parts of a name that tell whether it is desired


class Naming(NamedTuple):
    """How the columns of one log are named, where single names leave it open."""

    first: int = 0  # lowest number of a joint
    qd_is_desired: bool = False  # whether `qd` is the desired position, since `dq` is the velocity
    bare: Mapping[str, Meaning] = {}  # of columns that name a joint alone
    remark: str = ""  # what was decided about these, a sentence; empty if nothing
    alone: bool = True  # whether a column that names no joint is of the only one

    @classmethod
    def of(cls, columns: Iterable[str], joints: Collection[str] = ()) -> "Naming":
        """Naming of some columns; ``joints`` are names that the robot is known to have."""
        columns = [*columns]
        named = {column: what for column in columns if (what := column_signal(column))}
        bare, remark = _bare(columns, named, joints)
        known = named | bare
        own = {what[1] for c, what in known.items() if not without_unit(c)[0].endswith("]")}
        numbers = [n for joint in own - {*joints} if (n := number_of(joint)) is not None]
        matches = filter(None, (_match(without_unit(column)[0]) for column in columns))
        words = {match["quantity"].lower() for match in matches if not any(_sides(match))}
        moves = any(signal.startswith(("position", "velocity")) for signal, _ in known.values())
        is_pose = {"x", "y"} <= {column.lower() for column in columns}  # beside x, y, an angle
        first, qd_is_desired = min(numbers, default=0), {"dq", "qd"} <= words
        return cls(first, qd_is_desired, bare, remark, alone=not (moves or is_pose))


def _bare(
    columns: Sequence[str], named: dict[str, Meaning], joints: Collection[str]
) -> tuple[dict[str, Meaning], str]:
    """Meaning of columns that name a joint alone, where no other column has its position."""
    found: dict[str, tuple[str, str, str]] = {}  # signal, joint, and what says so
    for column in columns:
        name, unit = without_unit(column)
        if column in named or _fits(NOT_MOTION, name):
            continue
        if not (joints or re.search(BARE_HINT, name, re.IGNORECASE)):
            continue
        match = None if name in joints else _fits(SIDED, name)
        joint = match["joint"] if match else name
        side = next(filter(None, _sides(match)), "") if match else ""
        if joint in joints or _fits(BARE, joint):
            found[column] = (UNITS.get(unit, ("position", 1.0))[0], joint, side)
    measured = {
        _key(joint): joint
        for signal, joint, side in found.values()
        if signal != "effort" and not _is_desired(side)
    }
    taken = {_key(joint) for signal, joint in named.values() if signal == "position"}
    moving = {_key(joint) for signal, joint in named.values() if signal == "velocity"}
    certain = [joint for joint in measured.values() if joint in joints or _fits(GENERIC, joint)]
    if taken or (moving and moving != set(measured)) or not (certain or len(measured) > 1):
        return {}, ""
    sided = {_key(joint) for _, joint, side in found.values() if side and not _is_desired(side)}
    bare: dict[str, Meaning] = {}
    for column, (signal, joint, side) in found.items():
        if _is_desired(side) and signal != "effort" and _key(joint) in measured:
            bare[column] = (f"{signal}_desired", joint)
        elif not _is_desired(side) and (side or _key(joint) not in sided):
            bare[column] = (signal, joint)  # `FR_0_actual` counts more than `FR_0`
    plain = [c for c in bare if without_unit(c)[1] not in UNITS and bare[c][0] == "position"]
    if not plain:
        return bare, ""
    example = plain[0].replace(found[plain[0]][1], "{joint}")
    which = plain[0] if len(plain) == 1 else f"{plain[0]} to {plain[-1]}"
    how = f"if they are velocities: --map 'velocity.{{joint}}={example}'"
    return bare, f"{which}: names of joints alone, taken for positions ({how})"


def _fits(pattern: str, name: str) -> re.Match[str] | None:
    """Match of all of a name, in any case."""
    return re.fullmatch(pattern, name, re.IGNORECASE) if len(name) <= LONGEST else None


def _is_desired(side: str) -> bool:
    return _fits(DESIRED, side) is not None


def _key(joint: str | int) -> str | int:
    """What two names of one joint share: its number, or its name in small letters."""
    number = number_of(joint)
    return str(joint).lower() if number is None else number


def without_unit(name: str) -> tuple[str, str]:
    """Name of a column, and the unit at its end in small letters, or an empty text."""
    match = _fits(UNIT, name.strip())
    unit = (match["bracketed"] or match["suffix"]).strip().lower() if match else ""
    if match and (unit in UNITS or unit in TIME_UNITS):
        return match["name"].rstrip(), unit
    return name.strip(), ""


def factor_of(column: str) -> float:
    """Size of the unit that a column's name ends with, in [rad], [rad/s], [m], [m/s] or [N m]."""
    return UNITS.get(without_unit(column)[1], ("", 1.0))[1]


def tells_unit(label: str) -> bool:
    """Whether the name of a column, or of one of an array (``q_deg[0]``), ends with its unit."""
    return without_unit(re.sub(r"\[\d+\]$", "", label))[1] in UNITS


def column_signal(column: str, naming: Naming | None = None) -> Meaning | None:
    """Signal and joint of a column, by its name; None for another, and where its unit disagrees."""
    naming = naming or Naming()
    if column in naming.bare:
        return naming.bare[column]
    name, unit = without_unit(column)
    match = _match(name if unit in UNITS else column.strip())
    if match is None:  # ``J1 [deg]``, ``J1_cmd [deg]``
        form = rf"(?P<joint>{GENERIC})(?:{GAP}(?P<after>{DESIRED}))?"
        alone = _fits(form, name) if unit in UNITS else None
        what = f"{UNITS[unit][0]}{'_desired' * bool(alone['after'])}" if alone else ""
        return (what, alone["joint"]) if alone and what in JOINT_SIGNALS else None
    found = match.groupdict()
    joint: str | int = found.get("joint") or ""
    number = found.get("index") or found.get("round") or found.get("number")
    if number is not None:
        joint = f"{joint}_{number}" if joint else int(number)
    signal = _signal(match, naming, name)
    if not signal or joint == "" or not signal.startswith(UNITS.get(unit, (signal, 1.0))[0]):
        return None
    return signal, joint


def array_signal(name: str, naming: Naming | None = None) -> str | None:
    """Signal of an array by its name, without the folders in it; None for an unknown name."""
    whole = without_unit(name)[0]
    place, _, bare = whole.rpartition("/")
    if bare.lower() in BASE_SIGNALS:
        return bare.lower()
    if len(name) > LONGEST or _fits(NOT_MOTION, whole):
        return None
    match = None if _fits(NOT_JOINTS, place.rpartition("/")[2]) else _fits(WHOLE, bare)
    return _signal(match, naming or Naming(), name) if match else None


def number_of(joint: str | int) -> int | None:
    """Number of a joint that a column tells by its number, or by a name that is one."""
    if isinstance(joint, int):
        return joint
    match = _fits(GENERIC, joint)
    return int(match["number"]) if match else None


def rank_of(column: str) -> int:
    """How far a column is behind others of its signal.

    So are a motor's side (``theta``, beside ``q``), and a name that says twice that it is desired:
    ``cmd.q_d[0]``, beside what is followed.
    """
    match = _match(without_unit(column)[0])
    twice = match is not None and sum(map(bool, _sides(match))) > 1
    return twice + bool(re.search("theta|joint_motor_", column.lower()))


def time_column(names: Sequence[str]) -> str:
    """Name of the column or array that holds the stamps; empty if there is none."""
    found: dict[tuple[bool, bool, int], str] = {}
    for name in names:
        if match := _fits(TIME, without_unit(name)[0]):
            word = re.sub("[_ ](?=stamp)", "", match["name"].lower())
            of_record = "/" in name or "." in name
            found.setdefault((of_record, bool(match["host"]), TIMES.index(word)), name)
    return found[min(found)] if found else ""


def listed(names: Sequence[str]) -> str:
    """The first ten of some names, long ones cut off, and how many more there are."""
    shown = ", ".join(name if len(name) <= 80 else f"{name[:77]}..." for name in names[:10])
    return shown + (f" and {len(names) - 10} more" if len(names) > 10 else "")


def first_to_last(names: Sequence[str]) -> str:
    """Up to three names, of more the first and the last."""
    return ", ".join(names) if len(names) <= 3 else f"{names[0]} to {names[-1]}"


def _match(name: str) -> re.Match[str] | None:
    """Match of the first pattern that fits a name, unless it tells of no joint's motion."""
    if not any(hint in name.lower() for hint in HINTS) or _fits(NOT_MOTION, name):
        return None
    for found in filter(None, (_fits(each, name) for each in PATTERNS)):
        joint = found.groupdict().get("joint") or ""
        none = f"{NOT_JOINTS}|{RECORDS}" + f"|{AXES}" * (found.re.pattern != FIRST)
        words = re.split(r"[^A-Za-z]+|(?<=[a-z0-9])(?=[A-Z])", joint)  # of ``motorCmd[0]``
        # No set point is read as a measured signal; `target.velocity` fits another pattern, too.
        sided = any(map(_is_desired, words)) or _fits(MEASURED, words[-1])
        if not sided and not (joint and _fits(none, joint)):
            return found
    return None


def _signal(match: re.Match[str], naming: Naming, name: str) -> str | None:
    """Signal of the parts of a name; None for a desired effort, which runs do not have."""
    word = re.sub(r"^(?:joint|dof|applied)_", "", match["quantity"].lower())
    signal = next(each for each, words in QUANTITIES.items() if re.fullmatch(words, word))
    sides = _sides(match)
    if word == "qd" and naming.qd_is_desired and not any(sides):
        return "position_desired"
    desired = any(side == "d" or _is_desired(side) for side in sides)
    if not any(sides):  # a topic may say it: /joint_commands/elbow/position
        desired = any(map(_is_desired, re.split(r"[/_]", name.rpartition("/")[0])))
    if not desired:
        return signal
    return None if signal == "effort" else f"{signal}_desired"


def _sides(match: re.Match[str]) -> list[str]:
    """What the parts of a name say on whether it is desired or measured; empty where nothing."""
    found = match.groupdict()
    return [(found.get(place) or "").lower().strip("_") for place in SIDES]
