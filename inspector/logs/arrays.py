"""A log made of named arrays, as simulators and policies write them, by a table of their names."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inspector.errors import LogError
from inspector.logs.floatingbase import pose_of
from inspector.logs.log import Field, Log, Stamps
from inspector.logs.options import Entry, ReadOptions
from inspector.logs.signals import SIGNALS, TIMES, array_signal, listed
from inspector.logs.timestamps import stamps_at_rate, stamps_of, time_name
from noisemodel.types import Array, Real

COMMAND, COPY = "command", "copy"
QPOS, QVEL, FORCE = "qpos", "qvel", "qfrc_actuator"

TABLE: tuple[tuple[str, str], ...] = (
    # The state before the first step, and the observations once more, a step later:
    # Isaac Lab, robomimic, D4RL, ManiSkill.
    (r"(initial_state|next_obs|next_observations|env_states)/.*", COPY),
    # Isaac Lab's recorder, with further terms
    (r"states/articulation/[^/]+/joint_position", "position"),
    (r"states/articulation/[^/]+/joint_velocity", "velocity"),
    (r"states/articulation/[^/]+/joint_position_target", "position_desired"),
    (r"states/articulation/[^/]+/joint_velocity_target", "velocity_desired"),
    # robomimic and robosuite; LIBERO
    (r"(.*/)?robot\d+_joint_pos", "position"),
    (r"(.*/)?robot\d+_joint_vel", "velocity"),
    (r"(.*/)?joint_states", "position"),
    # MuJoCo, and what is made of it: Gymnasium's infos, Minari, D4RL, ManiSkill, ALOHA
    (r"(.*/)?qpos", QPOS),
    (r"(.*/)?qvel", QVEL),
    (r"(.*/)?qfrc_actuator", FORCE),
    # PyBullet's getJointStates, by the names of its documentation, and in the plural
    (r"(.*/)?joint_?positions?", "position"),
    (r"(.*/)?joint_?velocit(y|ies)", "velocity"),
    (r"(.*/)?(appliedjointmotortorques?|joint_torques|torques)", "effort"),
    (r"(.*/)?(targetpositions?|(joint_)?target_positions?)", "position_desired"),
    (r"(.*/)?(targetvelocit(y|ies)|(joint_)?target_velocit(y|ies))", "velocity_desired"),
    # What a policy says: positions, or anything else; decided by the values (`followed`)
    (r"processed_actions", COMMAND),
    (r"(.*/)?(ctrl|actions?|(joint_)?targets?|commands?)", COMMAND),
)
"""What arrays hold, by their names (in any case); the first row that fits counts."""

STATES = re.compile(r"states/articulation/(?P<robot>[^/]+)/(?P<what>.+)")
"""Isaac Lab's scene: several things may have joints."""

ARMS = re.compile(r"(?:.*/)?(?P<arm>robot\d+)_joint_(?:pos|vel)")
"""robosuite's robots, of which there may be two."""

EPISODE_ENDS = ("terminals", "timeouts", "terminations", "truncations", "dones")
"""Flags of D4RL and Gymnasium: the last step of an episode has one."""

CELLS = re.compile(
    r"(?P<array>qpos|qvel|qfrc_actuator|ctrl|actions?)[_.\[]?(?P<number>\d+)\]?", re.IGNORECASE
)
"""Columns of a table that are the columns of such an array: ``qpos_0``, ``qvel[3]``, ``ctrl2``."""

RATES = ("fps", "hz", "rate", "frequency", "control_freq", "sample_rate", "sampling_rate")
STEPS = ("dt", "timestep", "time_step", "control_dt")
"""Names of the number that is the rate in [Hz], or the step in [s]."""

MOTION = {*SIGNALS, QPOS, QVEL} - {"effort"}
QUATERNION = {"wxyz": "w, x, y, z", "xyzw": "x, y, z, w"}

JOINT_STATES = ("joint_states", "joint_state", "jointstates", "states")
PARTS: Mapping[int, Mapping[str, int]] = {
    2: {"position": 0, "velocity": 1},
    3: {"position": 0, "velocity": 1, "effort": 2},
    9: {"position": 0, "velocity": 1, "effort": 8},
}
"""Names of what PyBullet's getJointStates returns, stacked to (samples, joints, numbers): with or
without the motor's torque; nine numbers have the six reaction forces between."""

COMMON_RATES = (
    *(10, 15, 20, 24, 25, 30, 40, 50, 60, 80, 90, 100, 120, 125, 150, 200, 240, 250, 300, 333),
    *(400, 480, 500, 600, 800, 1000, 1200, 1500, 2000, 2400, 4000, 5000, 10_000),
)
NEAR_RATE = 0.02
"""A rate found from the values is one of these, in [Hz], if it differs by no more than that."""

LARGEST_STEP = 1.0
"""Larger steps of a position are a turn or a reset, in [rad] or [m]."""

FITS, DISAGREE = 0.98, 0.25
"""Least correlation of velocities with the steps of positions from which the rate is found; the
relative difference from which it counts for more than what the file says."""

FOLLOWS, SLOPES = 0.9, (0.5, 2.0)
"""Least correlation of a position with its target, and the range of its slope."""

STILL, NEARBY = 1e-3, 0.1
"""What moves less does not move; largest mean distance of its target, both in [rad] or [m]."""

RELATIVE_TO = "obs/joint_pos"
RELATIVE = "obs/joint_pos may be relative to a default pose (Isaac Lab)"


@dataclass(frozen=True, eq=False)
class Episode:
    """Arrays of one episode, and what its file says besides.

    Attributes:
        path: The file.
        arrays: Numbers by name, samples along the first axis.
        name: Name of the episode, empty for a file without.
        rate: The rate that the format defines, if any, in [Hz].
        numbers: Single numbers by name, among them perhaps the rate or the step.
        joints: Names of the joints by the ending of their signals, "" or "_desired".
        controller: What takes the actions, if the file says so.
        not_read: Names of further arrays, of which nothing is known.
    """

    path: Path
    arrays: Mapping[str, NDArray[Any]]
    name: str = ""
    rate: float | None = None
    numbers: Mapping[str, float] = field(default_factory=dict)
    joints: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    controller: str = ""
    not_read: tuple[str, ...] = ()


def meaning(name: str) -> str:
    """What an array holds by its name: a signal, or one of this module's constants; or empty."""
    lower = name.lower()
    found = next((what for pattern, what in TABLE if re.fullmatch(pattern, lower)), "")
    return found or array_signal(name) or ""


def log_of(episode: Episode, options: ReadOptions) -> Log:
    """Log of the arrays of one episode.

    Args:
        episode: The arrays.
        options: How to read them.

    Raises:
        LogError: If none of them is known to hold motion, their lengths differ, or there are no
            stamps and no rate.
    """
    path, arrays = episode.path, dict(_unpacked(episode.arrays))
    mapped = {entry.part()[0] for entry in options.entries if entry.signal != "time"}
    roles = _roles(arrays, mapped)
    copies = [name for name in arrays if meaning(name) == COPY]
    motion = [name for name, what in roles.items() if what in MOTION or name in mapped]
    if not motion:
        raise LogError(path, _nothing(episode, arrays))
    time = time_name((name for name, each in arrays.items() if each.ndim == 1), options)
    arrays = _of_one_length(path, arrays, [*([time] if time else []), *motion], roles)
    names = {what: name for name, what in reversed(roles.items()) if what in (QPOS, QVEL, FORCE)}
    suggested, remarks = [*_of_mujoco(arrays, names)], list[str]()
    place = _source("position", options, suggested, roles)
    position = _values(arrays, place)
    velocity = _values(arrays, _source("velocity", options, suggested, roles))
    samples = len(arrays[motion[0]])
    if time:
        stamps = stamps_of(path, time, arrays[time], options.rate)
    else:
        stamps = _stamps(episode, samples, options, position, velocity, arrays)
    suggested += _base_of_isaac(arrays, roles, stamps, remarks)
    suggested += _targets(episode, arrays, roles, options, position, place.source, remarks)
    if RELATIVE_TO in roles and not any(STATES.fullmatch(name) for name in roles):
        remarks.append(RELATIVE)
    arms = {match["arm"] for name in roles if (match := ARMS.fullmatch(name))}
    fields = tuple(
        Field(
            name,
            _numbers(each.reshape(samples, -1)),
            stamps,
            joints=_joints(episode, name, roles, each.size // samples, suggested, arms),
            signal=roles[name] if roles[name] in SIGNALS else "",
            source=path.name,
            rank=0 if STATES.fullmatch(name) else 1,
        )
        for name, each in arrays.items()
        if name in roles and len(each) == samples and each.ndim <= 2 and name != time
    )
    taken = _taken(fields, suggested, options)
    read = {time, *(each.name for each in fields), *copies}
    return Log(
        path,
        fields,
        episode.name,
        not_read=(*(name for name in arrays if name not in read), *episode.not_read),
        remarks=(*((f"taken: {taken}",) if taken else ()), *remarks),
        suggested=tuple(suggested),
        time=time,
    )


def gathered(log: Log, options: ReadOptions) -> Log:
    """Log of a table with the columns of MuJoCo's state as arrays; itself if it has none.

    Args:
        log: A log with a field for each column, of one clock.
        options: How to read it; columns that they map stay columns.
    """
    mapped = {entry.source for entry in options.entries}
    groups: dict[str, dict[int, Field]] = {}
    for each in log.fields:
        if match := CELLS.fullmatch(each.name):
            groups.setdefault(match["array"].lower(), {})[int(match["number"])] = each
    groups = {
        name: columns
        for name, columns in groups.items()
        if not mapped & {each.name for each in columns.values()}
    }
    if not {QPOS, QVEL} & set(groups):
        return log
    arrays: dict[str, NDArray[Any]] = {
        name: np.hstack([columns[number].values for number in sorted(columns)])
        for name, columns in groups.items()
    }
    roles, remarks = {name: meaning(name) for name in arrays}, list[str]()
    state = {name: name for name in (QPOS, QVEL, FORCE) if name in arrays}
    suggested = [*_of_mujoco(arrays, state)]
    place = _source("position", options, suggested, roles)
    position = _values(arrays, place)
    suggested += _targets(
        Episode(log.path, arrays), arrays, roles, options, position, place.source, remarks
    )
    columns = {id(each) for members in groups.values() for each in members.values()}
    stamps, source = log.fields[0].stamps, log.path.name
    fields = (
        *(each for each in log.fields if id(each) not in columns),
        *(Field(name, each, stamps, source=source) for name, each in arrays.items()),
    )
    taken = _taken((), suggested, options)
    return replace(
        log,
        fields=fields,
        suggested=tuple(suggested),
        remarks=(*log.remarks, f"taken: {taken}", *remarks),
    )


def episodes_of(arrays: Mapping[str, NDArray[Any]]) -> dict[str, slice]:
    """Episodes of a file that has them one after the other, of two samples or more.

    Args:
        arrays: Arrays by name, of which those of ``EPISODE_ENDS`` are looked at.

    Returns:
        The samples of each by its number; all samples by "" if the file has a single one.
    """
    ends = [each.ravel() for name, each in arrays.items() if name.lower() in EPISODE_ENDS]
    if not ends or len({len(each) for each in ends}) > 1:
        return {"": slice(None)}
    last = np.flatnonzero(np.logical_or.reduce(ends)) + 1
    edges = [0, *(int(each) for each in last if each < len(ends[0])), len(ends[0])]
    found = [slice(start, stop) for start, stop in pairwise(edges) if stop - start > 1]
    if len(found) < 2:
        return {"": slice(None)}
    return {str(number): part for number, part in enumerate(found)}


def single_numbers(items: Mapping[str, Any]) -> dict[str, float]:
    """Single numbers among arrays or attributes, by name."""
    arrays = {name: np.asarray(each) for name, each in items.items()}
    return {
        name: float(each.item())
        for name, each in arrays.items()
        if each.size == 1 and each.dtype.kind in "iuf"
    }


def rate_of(position: Real, velocity: Real) -> float | None:
    """Sample rate at which velocities are the steps of positions, in [Hz].

    Args:
        position: Shape (samples, joints).
        velocity: Shape (samples, joints).

    Returns:
        The common rate nearby, or else the rate to three digits; None if they do not fit.
    """
    position, velocity = position.astype(np.float64), velocity.astype(np.float64)
    step = np.diff(position, axis=0)
    simpson = (velocity[2:] + 4 * velocity[1:-1] + velocity[:-2]) / 6
    correlation, rate = max(
        _slope((position[2:] - position[:-2]) / 2, simpson),
        _slope(step, velocity[1:]),  # of simulators, whose velocity comes first,
        _slope(step, velocity[:-1]),  # or whose position does
    )
    if correlation < FITS:
        return None
    near = min(COMMON_RATES, key=lambda common: abs(common / rate - 1))
    return float(near if abs(near / rate - 1) <= NEAR_RATE else f"{rate:.3g}")


def _slope(steps: Real, speed: Real) -> tuple[float, float]:
    """Correlation of steps and velocities, and their ratio by least squares."""
    usable = np.isfinite(steps) & np.isfinite(speed) & (np.abs(steps) < LARGEST_STEP)
    steps, speed = steps[usable], speed[usable]
    both, own, other = (float(each) for each in (steps @ speed, steps @ steps, speed @ speed))
    return (both / np.sqrt(own * other), both / own) if own * other > 0 else (0.0, 0.0)


def followed(command: Real, position: Real) -> int:
    """Number of leading columns of a command that are targets of the positions beside them.

    Args:
        command: Shape (samples, commands).
        position: Shape (samples, joints).

    Returns:
        0 if they are not targets of half of the joints, or if no joint moves.
    """
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


def _roles(arrays: Mapping[str, NDArray[Any]], mapped: set[str]) -> dict[str, str]:
    """Meaning of the arrays, without those for which another one stands."""
    roles = {name: "" if name in mapped else meaning(name) for name in arrays}
    robots = {match["robot"] for name in arrays if (match := STATES.fullmatch(name))}
    chosen = "robot" if "robot" in robots else min(robots, default="")
    dropped = []
    for name, what in roles.items():
        match = STATES.fullmatch(name)
        others = [n for n in roles if n != name and roles[n] == what and n not in dropped]
        if (match and match["robot"] != chosen and name not in mapped) or (
            what in (QPOS, QVEL, FORCE) and others and name != min((name, *others), key=len)
        ):
            dropped.append(name)
    return {n: what for n, what in roles.items() if what != COPY and n not in dropped}


def _unpacked(arrays: Mapping[str, NDArray[Any]]) -> Iterator[tuple[str, NDArray[Any]]]:
    """Arrays, those of PyBullet's joint states taken apart, and stamps in a column as a row."""
    for name, each in arrays.items():
        last = name.rpartition("/")[2].lower()
        if each.ndim == 3 and last in JOINT_STATES and each.shape[2] in PARTS:
            for part, column in PARTS[each.shape[2]].items():
                yield f"{name}/{part}", each[:, :, column]
        elif each.ndim == 2 and each.shape[1] == 1 and last in TIMES:
            yield name, each[:, 0]
        elif each.ndim in (1, 2) and len(each) > 1:
            yield name, each


def _of_one_length(
    path: Path, arrays: Mapping[str, NDArray[Any]], names: Sequence[str], roles: Mapping[str, str]
) -> dict[str, NDArray[Any]]:
    """Arrays of as many samples as there are stamps.

    Of an episode with one state more than actions the last state is left out.
    """
    commands = [name for name, what in roles.items() if what == COMMAND]
    lengths = {len(arrays[name]) for name in (*names, *commands)}
    if max(lengths) - min(lengths) == 1:
        shortest = min(lengths)
        arrays = {n: each[:-1] if len(each) == shortest + 1 else each for n, each in arrays.items()}
    samples = len(arrays[names[0]])
    for name in names:
        each = arrays[name]
        if len(each) != samples:
            transposed = each.ndim == 2 and each.shape[1] == samples
            hint = "; samples come first, is it transposed?" if transposed else ""
            raise LogError(
                path, f"{name!r} has shape {each.shape}, there are {samples} stamps{hint}"
            )
    return dict(arrays)


def _stamps(
    episode: Episode,
    samples: int,
    options: ReadOptions,
    position: Real | None,
    velocity: Real | None,
    arrays: Mapping[str, NDArray[Any]],
) -> Stamps:
    """Stamps of an episode without: at a rate that is given, stated, or found from the values."""
    if options.rate:
        return Stamps.every(1 / options.rate, samples)
    found = None
    if position is not None and velocity is not None and position.shape == velocity.shape:
        found = rate_of(position, velocity)
    name, stated = ("env_args", episode.rate) if episode.rate else _stated(episode.numbers)
    if stated and (found is None or abs(found / stated - 1) <= DISAGREE):
        remark = f"there are no stamps: {stated:g} Hz, by {name}"
        return replace(Stamps.every(1 / stated, samples), remark=remark)
    if found is None:
        return stamps_at_rate(
            episode.path, samples, options, [_shape(*each) for each in arrays.items()]
        )
    but = f" ({name} says {stated:g} Hz)" if stated else ""
    remark = f"there are no stamps: {found:g} Hz, at which positions and velocities fit{but}"
    return replace(Stamps.every(1 / found, samples), remark=f"{remark}; --rate sets another")


def _stated(numbers: Mapping[str, float]) -> tuple[str, float | None]:
    """Name of the number that states the rate, and the rate, in [Hz]."""
    for name, number in numbers.items():
        last = name.rpartition("/")[2].lower()
        if number > 0 and last in (*RATES, *STEPS):
            return name, float(f"{number if last in RATES else 1 / number:.9g}")
    return "", None


def _of_mujoco(arrays: Mapping[str, NDArray[Any]], names: Mapping[str, str]) -> Iterator[Entry]:
    """Mapping of MuJoCo's state: a floating base, if there is one, then the robot's joints.

    Objects that float, and what follows them, are left out.
    """
    flat = {what: arrays[name].reshape(len(arrays[name]), -1) for what, name in names.items()}
    if QPOS not in flat:
        if QVEL in flat:
            yield Entry("velocity", "", names[QVEL])
        return
    qpos, qvel = flat[QPOS], flat.get(QVEL)
    width = qpos.shape[1]
    floating = _floating(qpos, 1 if qvel is None else width - qvel.shape[1])
    if qvel is None and floating != [0]:
        floating = []  # four numbers of norm 1 among joints may be chance
    base = floating[:1] == [0]
    stop = next((place for place in floating if place > 0), width)
    first = 7 * base
    if base:
        yield Entry("base_pose", "wxyz", f"{names[QPOS]}[0:7]")
    if stop > first:
        yield Entry("position", "", f"{names[QPOS]}[{first}:{stop}]")
    for what, signal in ((QVEL, "velocity"), (FORCE, "effort")):
        each = flat.get(what)
        if each is None or each.shape[1] < stop - base:
            continue
        if base and what == QVEL:
            yield Entry("base_velocity", "mujoco", f"{names[what]}[0:6]")
        if stop > first:
            yield Entry(signal, "", f"{names[what]}[{6 * base}:{stop - base}]")


def _floating(qpos: Real, count: int) -> list[int]:
    """First columns of up to ``count`` free joints: x, y, z and a quaternion."""
    places, first = list[int](), 0
    while len(places) < count and first + 7 <= qpos.shape[1]:
        length = np.linalg.norm(qpos[:, first + 3 : first + 7], axis=1)
        if (np.abs(length - 1) < 0.01).all():
            places.append(first)
            first += 7
        else:
            first += 1
    return places


def _base_of_isaac(
    arrays: Mapping[str, NDArray[Any]], roles: Mapping[str, str], stamps: Stamps, remarks: list[str]
) -> Iterator[Entry]:
    """Mapping of a root that moves; that of a robot on a table stands still and is left out."""
    found = {match["what"]: name for name in roles if (match := STATES.fullmatch(name))}
    pose = arrays.get(found.get("root_pose", ""))
    if pose is None or pose.shape != (len(stamps.time), 7):
        return
    velocity = arrays.get(found.get("root_velocity", ""))
    turning = velocity is not None and bool(np.abs(velocity).max() > STILL)
    if np.ptp(pose, axis=0).max() < STILL and not turning:
        remarks.append(f"{found['root_pose']} stands still: the base is taken as fixed")
        return
    order = "wxyz"
    if velocity is not None and velocity.shape == (len(pose), 6):
        # Isaac Lab 3.0 changed the order: the one whose turns are the logged angular velocities.
        errors = {
            each: np.linalg.norm(_turns(pose_of(pose, each), stamps) - velocity[:, 3:])
            for each in ("wxyz", "xyzw")
        }
        order = min(errors, key=lambda each: float(errors[each]))
        yield Entry("base_velocity", "world", found["root_velocity"])
    yield Entry("base_pose", order, found["root_pose"])


def _turns(pose: Array, stamps: Stamps) -> Array:
    """Angular velocity of a base in world axes, shape (samples, 3), in [rad/s]."""
    rate = np.gradient(pose[:, 3:], stamps.time, axis=0)
    vector, scalar = pose[:, 3:6], pose[:, 6:]
    # omega = 2 vec(q_dot conj(q))
    turned: Array = scalar * rate[:, :3] - rate[:, 3:] * vector - np.cross(rate[:, :3], vector)
    return 2 * turned


def _targets(
    episode: Episode,
    arrays: Mapping[str, NDArray[Any]],
    roles: Mapping[str, str],
    options: ReadOptions,
    position: Real | None,
    source: str,
    remarks: list[str],
) -> Iterator[Entry]:
    """Mapping of the first command that the positions follow."""
    given = {entry.signal for entry in options.entries} | set(roles.values())
    if position is None or "position_desired" in given:
        return
    commands = [n for n, what in roles.items() if what == COMMAND and arrays[n].ndim == 2]
    for name in sorted(commands, key=lambda name: "processed" not in name):
        command = arrays[name]
        count = followed(command, position) if len(command) == len(position) else 0
        if count:
            yield Entry("position_desired", "", _part(name, 0, count, command.shape[1]))
            return
    if commands:
        to = f", they are the input of a controller of type {episode.controller}"
        remarks.append(
            f"{listed(commands)} not taken as desired positions: {source} does not follow"
            f"{to if episode.controller else ''}; --map position_desired={commands[0]} takes it"
        )


def _part(name: str, first: int, stop: int, width: int) -> str:
    return name if (first, stop) == (0, width) else f"{name}[{first}:{stop}]"


def _source(
    signal: str, options: ReadOptions, suggested: Sequence[Entry], roles: Mapping[str, str]
) -> Entry:
    """Where a signal of all joints is: by the mapping, the format, or the name of an array."""
    mapped = [e for e in (*options.entries, *suggested) if e.signal == signal and not e.joint]
    named = sorted((n for n in roles if roles[n] == signal), key=lambda n: not STATES.fullmatch(n))
    return (*mapped, *(Entry(signal, "", name) for name in named), Entry(signal, "", ""))[0]


def _values(arrays: Mapping[str, NDArray[Any]], entry: Entry) -> Real | None:
    """Numbers of an entry; None if there is no such array."""
    name, part = (entry.source, slice(None)) if entry.source in arrays else entry.part()
    return (
        _numbers(arrays[name].reshape(len(arrays[name]), -1)[:, part]) if name in arrays else None
    )


def _numbers(values: NDArray[Any]) -> Real:
    return values if values.dtype.kind == "f" else values.astype(np.float64)


def _joints(
    episode: Episode,
    name: str,
    roles: Mapping[str, str],
    width: int,
    suggested: Sequence[Entry],
    arms: set[str],
) -> tuple[str, ...]:
    """Names of an array's columns, if the file has them; empty for those without."""
    if len(arms) > 1 and (match := ARMS.fullmatch(name)):
        return tuple(f"{match['arm']}_joint_{number}" for number in range(width))
    parts = [entry for entry in suggested if entry.part()[0] == name]
    signal = parts[-1].signal if parts else roles[name]
    ending = "_desired" if signal.endswith("_desired") and "_desired" in episode.joints else ""
    names = episode.joints.get(ending, ())
    first, stop, _ = (parts[-1].part()[1] if parts else slice(None)).indices(width)
    if signal.endswith("_desired") and parts:
        names = names[: stop - first]
    if not names or len(names) != stop - first:
        return ()
    return (*("",) * first, *names, *("",) * (width - stop))


def _taken(fields: Sequence[Field], suggested: Sequence[Entry], options: ReadOptions) -> str:
    """What is taken as what, for a person."""
    targets = {entry.signal for entry in options.entries}
    best = {
        signal: min(each.rank for each in fields if each.signal == signal)
        for signal in {each.signal for each in fields}
    }
    known = [
        (each.signal, each.name)
        for each in fields
        if each.signal and each.rank == best[each.signal]
    ]
    known += [(each.signal, f"{each.source}{_why(each)}") for each in suggested]
    order = sorted(known, key=lambda each: SIGNALS.index(each[0]))
    return ", ".join(f"{signal} = {name}" for signal, name in order if signal not in targets)


def _why(entry: Entry) -> str:
    if entry.signal == "position_desired":
        return " (position follows it)"
    return f" ({QUATERNION[entry.joint]})" if entry.joint in QUATERNION else ""


def _shape(name: str, each: NDArray[Any]) -> str:
    return f"{name} ({', '.join(map(str, each.shape))})"


def _nothing(episode: Episode, arrays: Mapping[str, NDArray[Any]]) -> str:
    """Problem of a file that is not known to hold motion: what it holds, and what to type."""
    where = episode.name or "the file"
    wide = [(n, each) for n, each in arrays.items() if each.ndim == 2 and meaning(n) != COMMAND]
    name, values = max(wide, key=lambda each: len(each[1]), default=("qpos", np.zeros((2, 7))))
    half = values.shape[1] // 2
    example = f"--map position={name}"
    if re.fullmatch(r"(.*/)?obs(ervations?)?", name) and half:
        example = f"--map position={name}[0:{half}] --map velocity={name}[{half}:{2 * half}]"
    if name == "states":  # of robosuite, before robomimic has extracted observations
        example = "--map position=states[1:8] (MuJoCo's flattened states are time, qpos, qvel)"
    return (
        f"{where} holds no known joint positions or velocities; name them, such as {example};"
        f" it has {listed([_shape(*each) for each in arrays.items()])}"
    )
