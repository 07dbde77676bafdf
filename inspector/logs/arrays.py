"""A log made of named arrays, as simulators and policies write them, by a table of their names."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inspector.errors import LogError
from inspector.logs.clocks import counted_stamps, counting, stamps_of
from inspector.logs.log import SAMPLES, Entry, Field, Log, Stamps
from inspector.logs.mapping import ReadOptions, pose_of
from inspector.logs.names import (
    SIGNALS,
    TIMES,
    Naming,
    array_signal,
    column_signal,
    listed,
    time_column,
)
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

RATES = ("fps", "hz", "rate", "frequency", "control_freq", "sample_rate", "sampling_rate", "fs")
STEPS = ("dt", "timestep", "time_step", "control_dt", "ts")
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

FOLLOWS, SLOPES = 0.9, (0.5, 2.0)
"""Least correlation of a position with its target, and the range of its slope."""
STILL, NEARBY = 1e-3, 0.1
"""What moves less does not move; largest mean distance of its target, both in [rad] or [m]."""

RELATIVE_TO = "obs/joint_pos"
RELATIVE = "obs/joint_pos may be relative to a default pose (Isaac Lab)"

Arrays = Mapping[str, NDArray[Any]]


def meaning(name: str) -> str:
    """What an array holds by its name: a signal, or one of this module's constants; or empty."""
    lower = name.lower()
    found = next((what for pattern, what in TABLE if re.fullmatch(pattern, lower)), "")
    return found or array_signal(name) or ""


def log_of(
    path: Path,
    arrays: Arrays,
    options: ReadOptions,
    *,
    episode: str = "",
    rate: float | None = None,
    numbers: Mapping[str, float] | None = None,
    joints: Mapping[str, tuple[str, ...]] | None = None,
    controller: str = "",
    not_read: Sequence[str] = (),
) -> Log:
    """Log of the arrays of one episode."""
    arrays = dict(_unpacked(arrays))
    options = options.for_columns(path, [*arrays])
    mapped = {entry.part()[0] for entry in options.entries if entry.signal != "time"}
    roles = _roles(arrays, mapped)
    motion = [name for name, what in roles.items() if what in MOTION or name in mapped]
    if not motion:
        raise LogError(path, _nothing(episode, arrays))
    time, arrays = _time(arrays, options)
    arrays = _of_one_length(path, arrays, [*([time] if time else []), *motion], roles)
    suggested, remarks = [*_of_mujoco(arrays, roles)], list[str]()
    place, position, velocity = _measured(arrays, roles, suggested, options)
    samples = len(arrays[motion[0]])
    stated = ("env_args", rate) if rate else _stated(numbers or {})
    stamps = Stamps(Decimal(0), np.arange(samples, dtype=np.float64), unit=SAMPLES)
    if time:
        stamps = stamps_of(path, time, arrays[time], options.rate)
    if stamps.unit == SAMPLES and not any(arrays[name].ndim == 1 for name in motion):
        stamps = counted_stamps(path, stamps, options, position, velocity, stated)
    elif stamps.unit == SAMPLES and stated[1] and not options.rate:
        stamps = counted_stamps(path, stamps, options, None, None, stated)
    suggested += _base_of_isaac(arrays, roles, stamps, remarks)
    suggested += _targets(arrays, roles, options, position, place, controller, remarks)
    if RELATIVE_TO in roles and not any(STATES.fullmatch(name) for name in roles):
        remarks.append(RELATIVE)
    fields = tuple(
        Field(
            name,
            _numbers(each.reshape(samples, -1)),
            stamps,
            joints=_joints(joints or {}, name, roles, each.size // samples, suggested),
            signal=roles[name] if roles[name] in SIGNALS and _is_array(name, each) else "",
            source=path.name,
            rank=0 if STATES.fullmatch(name) else 1,
        )
        for name, each in arrays.items()
        if name in roles and len(each) == samples and each.ndim <= 2 and name != time
    )
    read = {time, *(each.name for each in fields)}
    return Log(
        path,
        fields,
        episode,
        not_read=(*(n for n in arrays if n not in read and meaning(n) != COPY), *not_read),
        remarks=(*_taken(fields, suggested, options), *remarks),
        suggested=tuple(suggested),
        time=time,
    )


def _is_array(name: str, each: NDArray[Any]) -> bool:
    """Whether it is no column, whose name may tell its joint."""
    return each.ndim == 2 or (column_signal(name) is None and array_signal(name) is None)


def gathered(log: Log, options: ReadOptions) -> Log:
    """Log of a table with the columns of MuJoCo's state as arrays; itself if it has none."""
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
    suggested = [*_of_mujoco(arrays, roles)]
    place, position, velocity = _measured(arrays, roles, suggested, options)
    suggested += _targets(arrays, roles, options, position, place, "", remarks)
    columns = {id(each) for members in groups.values() for each in members.values()}
    stamps, source = log.fields[0].stamps, log.path.name
    if stamps.unit == SAMPLES:
        stamps = counted_stamps(log.path, stamps, options, position, velocity)
    fields = (
        *(replace(each, stamps=stamps) for each in log.fields if id(each) not in columns),
        *(Field(name, each, stamps, source=source) for name, each in arrays.items()),
    )
    return replace(
        log,
        fields=fields,
        suggested=tuple(suggested),
        remarks=(*log.remarks, *_taken((), suggested, options), *remarks),
    )


def episodes_of(arrays: Arrays) -> dict[str, slice]:
    """Episodes of a file that has them one after the other, of two samples or more.

    Args:
        arrays: Arrays by name; only ``EPISODE_ENDS`` are used.
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


def _time(arrays: Arrays, options: ReadOptions) -> tuple[str, Arrays]:
    """Name of the array with the stamps, empty without; a part of one is an array then."""
    rows = [name for name, each in arrays.items() if each.ndim == 1]
    if not options.time:
        samples = max((len(each) for each in arrays.values() if each.ndim), default=0)
        counters = {
            name: arrays[name]
            for name in rows
            if len(arrays[name]) == samples and not (column_signal(name) or array_signal(name))
        }
        return time_column(rows) or counting(counters), arrays
    entry = next(each for each in options.entries if each.signal == "time")
    name, part = (entry.source, slice(None)) if entry.source in arrays else entry.part()
    if name not in arrays:
        return time_column(rows), arrays
    values = arrays[name].reshape(len(arrays[name]), -1)[:, part]
    return (entry.source, {**arrays, entry.source: values[:, 0]}) if values.size else ("", arrays)


def _roles(arrays: Arrays, mapped: set[str]) -> dict[str, str]:
    """Meaning of the arrays, without those for which another one stands."""
    naming = Naming.of(name for name, each in arrays.items() if each.ndim == 1)
    roles = {name: "" if name in mapped else meaning(name) for name in arrays}
    for name, each in arrays.items():  # columns that name their joint
        if name not in mapped and not roles[name] and each.ndim == 1:
            known = column_signal(name, naming)
            roles[name] = known[0] if known else ""
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


def _unpacked(arrays: Arrays) -> Iterator[tuple[str, NDArray[Any]]]:
    """Arrays, with PyBullet's joint states taken apart, and stamps in a column as a row."""
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
    path: Path, arrays: Arrays, names: Sequence[str], roles: Mapping[str, str]
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


def _stated(numbers: Mapping[str, float]) -> tuple[str, float | None]:
    """Name of the number that states the rate, and the rate, in [Hz]."""
    for name, number in numbers.items():
        last = name.rpartition("/")[2].lower()
        if number > 0 and last in (*RATES, *STEPS):
            return name, float(f"{number if last in RATES else 1 / number:.9g}")
    return "", None


def _of_mujoco(arrays: Arrays, roles: Mapping[str, str]) -> Iterator[Entry]:
    """Mapping of MuJoCo's state: a floating base, if there is one, then the robot's joints.

    Objects that float, and what follows them, are left out.
    """
    names = {what: name for name, what in reversed([*roles.items()]) if what in (QPOS, QVEL, FORCE)}
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
    arrays: Arrays, roles: Mapping[str, str], stamps: Stamps, remarks: list[str]
) -> Iterator[Entry]:
    """Mapping of a root that moves; the root of a robot on a table stands still and is left out."""
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
    arrays: Arrays,
    roles: Mapping[str, str],
    options: ReadOptions,
    position: Real | None,
    source: str,
    controller: str,
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
            part = name if count == command.shape[1] else f"{name}[0:{count}]"
            yield Entry("position_desired", "", part)
            return
    if commands:
        to = f", they are the input of a controller of type {controller}" if controller else ""
        remarks.append(
            f"{listed(commands)} not taken as desired positions: {source} does not follow{to};"
            f" --map position_desired={commands[0]} takes it"
        )


def _measured(
    arrays: Arrays, roles: Mapping[str, str], suggested: Sequence[Entry], options: ReadOptions
) -> tuple[str, Real | None, Real | None]:
    """Where the positions are, and positions and velocities: by the mapping, the format, or names.

    Either is None if there is no such array.
    """
    found: dict[str, Real | None] = {}
    place = ""
    for signal in ("velocity", "position"):
        mapped = [e for e in (*options.entries, *suggested) if e.signal == signal and not e.joint]
        named = sorted(
            (n for n in roles if roles[n] == signal), key=lambda n: not STATES.fullmatch(n)
        )
        entry = (*mapped, *(Entry(signal, "", name) for name in named), Entry(signal, "", ""))[0]
        name, part = (entry.source, slice(None)) if entry.source in arrays else entry.part()
        each, place = arrays.get(name), entry.source
        found[signal] = None if each is None else _numbers(each.reshape(len(each), -1)[:, part])
    return place, found["position"], found["velocity"]


def _numbers(values: NDArray[Any]) -> Real:
    return values if values.dtype.kind == "f" else values.astype(np.float64)


def _joints(
    joints: Mapping[str, tuple[str, ...]],
    name: str,
    roles: Mapping[str, str],
    width: int,
    suggested: Sequence[Entry],
) -> tuple[str, ...]:
    """Names of an array's columns, if the file has them; empty for those without."""
    arms = {match["arm"] for each in roles if (match := ARMS.fullmatch(each))}
    if len(arms) > 1 and (match := ARMS.fullmatch(name)):
        return tuple(f"{match['arm']}_joint_{number}" for number in range(width))
    parts = [entry for entry in suggested if entry.part()[0] == name]
    signal = parts[-1].signal if parts else roles[name]
    names = joints.get("_desired" if signal.endswith("_desired") else "", joints.get("", ()))
    first, stop, _ = (parts[-1].part()[1] if parts else slice(None)).indices(width)
    if signal.endswith("_desired") and parts:
        names = names[: stop - first]
    if not names or len(names) != stop - first:
        return ()
    return (*("",) * first, *names, *("",) * (width - stop))


def _taken(
    fields: Sequence[Field], suggested: Sequence[Entry], options: ReadOptions
) -> Iterator[str]:
    """Say what is taken as what, if anything is that the options do not map."""
    targets = {entry.signal for entry in options.entries}
    named = [each for each in fields if each.signal]
    best = {each.signal: each.rank for each in sorted(named, key=lambda each: -each.rank)}
    known = [(each.signal, each.name) for each in named if each.rank == best[each.signal]]
    known += [(each.signal, f"{each.source}{_why(each)}") for each in suggested]
    order = sorted(known, key=lambda each: SIGNALS.index(each[0]))
    if taken := [f"{signal} = {name}" for signal, name in order if signal not in targets]:
        yield f"taken: {', '.join(taken)}"


def _why(entry: Entry) -> str:
    if entry.signal == "position_desired":
        return " (position follows it)"
    return f" ({QUATERNION[entry.joint]})" if entry.joint in QUATERNION else ""


def _shape(name: str, each: NDArray[Any]) -> str:
    return f"{name} ({', '.join(map(str, each.shape))})"


def _nothing(episode: str, arrays: Arrays) -> str:
    """Problem of a file that is not known to hold motion: what it holds, and what to type."""
    where = episode or "the file"
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
