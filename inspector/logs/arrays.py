"""Files of named arrays, NumPy's and MATLAB's, and what arrays hold, by a table of their names.

Simulators and policies write them. Of MATLAB's files, those of version 5 are read here, each size
once it agrees with what the file holds; those of version 7.3 are HDF5. The format:
https://www.mathworks.com/help/pdf_doc/matlab/matfile_format.pdf
"""

import re
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from difflib import get_close_matches
from functools import partial
from itertools import pairwise
from math import prod
from pathlib import Path
from struct import error as struct_error
from struct import unpack_from
from typing import Any

import numpy as np
from numpy.lib.format import MAGIC_PREFIX
from numpy.typing import NDArray

from inspector.errors import LogError
from inspector.logs.clocks import stamps_of
from inspector.logs.mapping import (
    COMMAND,
    Entry,
    Field,
    Log,
    LogReader,
    ReadOptions,
    Stamps,
    errors_of,
    no_motion,
)
from inspector.logs.names import (
    EPISODE_ENDS,
    EPISODE_NUMBERS,
    EPISODES,
    JOINT_SIGNALS,
    SIGNALS,
    TIMES,
    Meaning,
    Naming,
    array_signal,
    column_signal,
    listed,
    rank_of,
)
from noisemodel import Run, RunError, runfile
from noisemodel.run import check_time
from noisemodel.runfile import PIECE, ArchiveError, ObjectArrayError, check_unpacked
from noisemodel.types import Real

COPY = "copy"
QPOS, QVEL, FORCE = "qpos", "qvel", "qfrc_actuator"

# What arrays hold, by their names (in any case); the first row that fits counts.
TABLE: tuple[tuple[str, str], ...] = (
    # The state before the first step, and the observations once more, a step later:
    # Isaac Lab, robomimic, D4RL, ManiSkill.
    (r"(initial_state|next_obs|next_observations|env_states)/.*", COPY),
    # robomimic and robosuite; LIBERO
    (r"(.*/)?robot\d+_joint_pos", "position"),
    (r"(.*/)?robot\d+_joint_vel", "velocity"),
    (r"(.*/)?joint_states", "position"),
    # MuJoCo, and what is made of it: Gymnasium's infos, Minari, D4RL, ManiSkill, ALOHA
    (r"(.*/)?qpos", QPOS),
    (r"(.*/)?qvel", QVEL),
    (r"(.*/)?qfrc_actuator", FORCE),
    # PyBullet's joint states, by the names of its documentation, and in the plural
    (r"(.*/)?joint_?positions?", "position"),
    (r"(.*/)?joint_?velocit(y|ies)", "velocity"),
    (r"(.*/)?(appliedjointmotortorques?|joint_torques|torques)", "effort"),
    (r"(.*/)?(targetpositions?|(joint_)?target_positions?)", "position_desired"),
    (r"(.*/)?(targetvelocit(y|ies)|(joint_)?target_velocit(y|ies))", "velocity_desired"),
    # What a policy says: positions, or anything else; decided by the values (`mapping.followed`)
    (r"processed_actions", COMMAND),
    (r"(.*/)?(ctrl|actions?|(joint_)?targets?|commands?)", COMMAND),
)
# What Isaac Lab records of a scene, in which several things may have joints.
STATES = re.compile(r"states/articulation/(?P<robot>[^/]+)/(?P<what>.+)")
# Columns of a table that are the columns of such an array: ``qpos_0``, ``qvel[3]``, ``ctrl2``.
CELLS = re.compile(r"(?i)(?P<array>qpos|qvel|qfrc_actuator|ctrl|actions?)[_.\[]?(?P<number>\d+)\]?")
RATES = ("fps", "hz", "rate", "frequency", "control_freq", "sample_rate", "sampling_rate", "fs")
# Names of the number that is the rate in [Hz], or the step in [s].
STEPS = ("dt", "timestep", "time_step", "control_dt", "ts")
SPARSE = 0.5  # share of rows without a number from which a column has another clock
MOTION = {*SIGNALS, QPOS, QVEL} - {"effort"}

Arrays = Mapping[str, NDArray[Any]]


def meaning(name: str) -> str:
    """What an array holds by its name: a signal, or one of this module's constants; or empty."""
    lower = name.lower()
    found = next((what for pattern, what in TABLE if re.fullmatch(pattern, lower)), "")
    return found or array_signal(name) or ""


def may_hold(name: str, naming: Naming) -> bool:
    """Whether a column may hold motion, by its name: of a joint, of the only one, or of a state."""
    alone = naming.alone and array_signal(name) in JOINT_SIGNALS
    return alone or column_signal(name, naming) is not None or CELLS.fullmatch(name) is not None


def log_of(
    path: Path,
    arrays: Arrays,
    options: ReadOptions,
    *,
    stated: tuple[str, float | None] = ("", None),
    joints: Mapping[str, tuple[str, ...]] | None = None,
    stamps: Stamps | None = None,
    not_read: Sequence[str] = (),
) -> Log:
    """Log of the arrays of one episode.

    ``stated`` is what states the rate, and that in [Hz]; ``joints`` names the columns of arrays.
    """
    every, arrays = arrays, _of_samples(arrays)
    options = options.for_columns(path, [*arrays])
    mapped = options.mapped
    naming = Naming.of((n for n, e in arrays.items() if e.ndim == 1), options.known_joints)
    named = {n: column_signal(n, naming) for n, each in arrays.items() if each.ndim == 1}
    columns = {n for n, what in named.items() if what or array_signal(n)}  # that say what they hold
    arrays = _gathered(arrays, {entry.source for entry in options.entries})
    roles = _roles(arrays, mapped, named)
    last = {name: name.rpartition("/")[2].lower() for name in roles}
    if {"dq", "qd"} <= {*last.values()}:  # as of columns
        roles |= {name: "position_desired" for name in roles if last[name] == "qd"}
    motion = [name for name, what in roles.items() if what in MOTION or name in mapped]
    if not motion:
        raise _nothing(path, every, not_read)
    if not stamps:
        commands = [name for name, what in roles.items() if what == COMMAND]
        stamps, arrays = _stamped(path, arrays, options, motion, commands)
        stamps = replace(stamps, stated=stated)
    time, samples = stamps.name, len(stamps.time)
    fields = [
        Field(
            name,
            floats(arrays[name].reshape(samples, -1)),
            stamps,
            joints=(joints or {}).get(name, ()),
            signal=what if what in (*SIGNALS, COMMAND) and name not in columns else "",
            source=path.name,
            # The second of two sides is a command beside the desired motion: ``cmd.q_d[0]``.
            rank=0 if STATES.fullmatch(name) or name not in every else 1 + rank_of(name),
        )
        for name, what in roles.items()
        if len(arrays[name]) == samples and name != time
    ]
    _refuse_sparse(path, fields)
    read = {time, *(each.name for each in fields)}
    return Log(
        path,
        tuple(fields),
        not_read=(*(n for n in arrays if n not in read and meaning(n) != COPY), *not_read),
        suggested=tuple(_of_mujoco(path, arrays, roles)),
        time=time,
        in_radians=any(what in (QPOS, QVEL) or STATES.fullmatch(n) for n, what in roles.items()),
    )


def _refuse_sparse(path: Path, fields: Sequence[Field]) -> None:
    """Refuse columns of which most rows are empty: several topics were merged into one table."""
    for each in fields:
        lacking = np.isnan(each.values)
        for column, share in zip(lacking.T, lacking.mean(axis=0), strict=True):
            if SPARSE <= share < 1:
                how = "columns with another clock must be in a separate log (--desired)"
                problem = f"column {each.name!r} is empty in {share:.0%} of the rows; {how}"
                rows, first = each.stamps.rows, int(np.argmax(column))
                raise LogError(path, problem, None if rows is None else rows[first])


def _of_samples(arrays: Arrays) -> Arrays:
    """Arrays that may be of samples; times as columns of one dimension."""
    return {
        n: each[:, 0] if each.shape[1:] == (1,) and n.rpartition("/")[2].lower() in TIMES else each
        for n, each in arrays.items()
        if each.ndim in (1, 2) and len(each) > 1 and n.lower() not in EPISODES
    }


def _gathered(arrays: Arrays, mapped: set[str]) -> Arrays:
    """Arrays of MuJoCo's state in place of the columns of a table that hold its numbers."""
    found: dict[str, dict[int, str]] = {}
    for match in filter(None, map(CELLS.fullmatch, arrays)):
        found.setdefault(match["array"].lower(), {})[int(match["number"])] = match[0]
    whole = {
        array: np.column_stack([arrays[cells[number]] for number in sorted(cells)])
        for array, cells in found.items()
        if not mapped & {*cells.values()} and len({len(arrays[n]) for n in cells.values()}) == 1
    }
    if not {QPOS, QVEL} & {*whole}:
        return arrays
    single = {name for array in whole for name in found[array].values()}
    return {name: each for name, each in arrays.items() if name not in single} | whole


def floats(values: NDArray[Any]) -> Real:
    """Values as floating-point numbers; no copy of what they are already."""
    return values if values.dtype.kind == "f" else values.astype(np.float64)


def episodes_of(arrays: Arrays) -> dict[str, slice]:
    """Episodes of a log that has them one after the other, of two samples or more."""
    last, found = list[NDArray[np.bool_]](), list[slice]()
    for name, each in arrays.items():
        if each.size > 1 and name.lower() in EPISODE_ENDS:
            flags = np.nan_to_num(each.ravel()) != 0
            last.append(flags[:-1] & ~flags[1:])  # a flag may stay until the end
        elif each.size > 1 and name.lower() in EPISODE_NUMBERS:
            last.append(each.ravel()[1:] != each.ravel()[:-1])
    if len({len(each) for each in last}) == 1:
        ends = np.flatnonzero(np.logical_or.reduce(last)) + 1
        edges = [0, *ends.tolist(), len(last[0]) + 1]
        found = [slice(start, stop) for start, stop in pairwise(edges) if stop - start > 1]
    return {str(n): part for n, part in enumerate(found)} if len(found) > 1 else {"": slice(None)}


def part_of(arrays: Arrays, episode: str) -> dict[str, NDArray[Any]]:
    """Arrays of which those that have as many samples as the longest are cut to an episode."""
    part = episodes_of(arrays)[episode]
    samples = max((len(each) for each in arrays.values() if each.ndim), default=0)
    return {n: e[part] if e.ndim and len(e) == samples else e for n, e in arrays.items()}


def stated_rate(items: Mapping[str, Any]) -> tuple[str, float | None]:
    """Name of the number among arrays or attributes that states the rate, and the rate in [Hz]."""
    for name, item in items.items():
        last, each = name.rpartition("/")[2].lower(), np.asarray(item)
        if last in (*RATES, *STEPS) and each.size == 1 and each.dtype.kind in "iuf":
            number = float(each.item())
            if number > 0:
                return name, float(f"{number if last in RATES else 1 / number:.9g}")
    return "", None


def _roles(arrays: Arrays, mapped: set[str], named: Mapping[str, Meaning | None]) -> dict[str, str]:
    """Meaning of the arrays, without those for which another one stands."""
    roles = {}
    for name in arrays:
        roles[name] = "" if name in mapped else meaning(name)
        if name in named and name not in mapped and roles[name] in ("", COMMAND):
            roles[name] = (named[name] or ("",))[0]  # of a column, which names its joint
    states = {name: match["robot"] for name in arrays if (match := STATES.fullmatch(name))}
    robot = "robot" if "robot" in states.values() else min(states.values(), default="")
    # Of MuJoCo's arrays the one of the shortest name is read, the first of equals.
    first = {roles[name]: name for name in sorted(roles, key=len)[::-1]}
    return {
        name: what
        for name, what in roles.items()
        if what != COPY
        and (what not in (QPOS, QVEL, FORCE) or first[what] == name)
        and (name in mapped or states.get(name, robot) == robot)
    }


def _stamped(
    path: Path, arrays: Arrays, options: ReadOptions, motion: Sequence[str], commands: Sequence[str]
) -> tuple[Stamps, Arrays]:
    """Stamps, and arrays of as many samples; of one state more than actions, without the last."""
    source = options.time  # which may be a part of an array
    array, part = Entry("time", "", source).part(arrays)
    if array in arrays and (stamps := arrays[array].reshape(len(arrays[array]), -1)[:, part]).size:
        name, arrays = source, {**arrays, source: stamps[:, 0]}
    else:
        name = options.stamps_in([name for name, each in arrays.items() if each.ndim == 1])
    wanted = [*([name] if name else []), *motion]
    lengths = {len(arrays[each]) for each in (*wanted, *commands)}
    longest = max(lengths)
    if longest - min(lengths) == 1:
        arrays = {n: each[:-1] if len(each) == longest else each for n, each in arrays.items()}
    samples = len(arrays[wanted[0]])
    for each in wanted:
        if len(arrays[each]) != samples:
            problem = f"{each!r} has shape {arrays[each].shape}; expected {samples} samples"
            raise LogError(path, f"{problem}, as stamps, along its first axis")
    if not name:
        return Stamps.counted(samples), arrays
    return stamps_of(path, name, arrays[name], options.rate), arrays


def _of_mujoco(path: Path, arrays: Arrays, roles: Mapping[str, str]) -> Iterator[Entry]:
    """Mapping of MuJoCo's state: a floating base, then joints, up to an object that floats."""
    names = {what: name for name, what in roles.items() if what in (QPOS, QVEL, FORCE)}
    flat = {what: arrays[name].reshape(len(arrays[name]), -1) for what, name in names.items()}
    if QPOS not in flat:
        if QVEL in flat:
            yield Entry("velocity", "", names[QVEL])
        return
    qpos, width = flat[QPOS], flat[QPOS].shape[1]

    def is_free(place: int) -> bool:
        """Whether a joint is free from there on: x, y, z and a quaternion."""
        length = np.linalg.norm(qpos[:, place + 3 : place + 7], axis=1)
        known = length[np.isfinite(length)]
        return place + 7 <= width and bool(len(known)) and abs(float(np.median(known)) - 1) < 0.01

    count = width - flat[QVEL].shape[1] if QVEL in flat else 1
    base = count > 0 and is_free(0)
    # Without velocities, four numbers of norm 1 among joints may be chance.
    others = range(7 * base, width - 6) if QVEL in flat and count > base else ()
    stop, first = next(filter(is_free, others), width), 7 * base
    if QVEL in flat and count > 0 and not base and stop == width:
        problem = f"qpos has {width} columns and qvel {width - count}, but there is no quaternion"
        raise LogError(path, f"{problem}; name the joints, such as --map position=qpos[7:{width}]")
    if base:
        yield Entry("base_pose", "wxyz", f"{names[QPOS]}[0:7]")
    if stop > first:
        yield Entry("position", "", f"{names[QPOS]}[{first}:{stop}]")
    for what, signal in ((QVEL, "velocity"), (FORCE, "effort")):
        if what not in flat or flat[what].shape[1] < stop - base:
            continue
        if base and what == QVEL:
            yield Entry("base_velocity", "mujoco", f"{names[what]}[0:6]")
        if stop > first:
            yield Entry(signal, "", f"{names[what]}[{6 * base}:{stop - base}]")


def _nothing(path: Path, arrays: Arrays, not_read: Sequence[str]) -> LogError:
    """Error of a file that is not known to hold motion: what it holds, and what to type."""
    if arrays and all(each.ndim == 1 for each in arrays.values()):
        return no_motion(path, [*arrays, *not_read])
    wide = [n for n, each in arrays.items() if each.ndim == 2 and meaning(n) != COMMAND]
    name = max(wide, key=lambda each: len(arrays[each]), default="qpos")
    signals = ("position", "velocity")
    close = {n: signal for n in wide for signal in get_close_matches(n, signals, 1, 0.8)}
    name, signal = next(iter(close.items()), (name, "position"))
    example = f"--map {signal}={name}"
    if not close and "obs" in name and (half := arrays[name].shape[1] // 2):
        example += f"[0:{half}] --map velocity={name}[{half}:{2 * half}]"
    shapes = listed([f"{n} ({', '.join(map(str, e.shape))})" for n, e in arrays.items()])
    none = "no numbers; of a timeseries of MATLAB or Simulink, save ts.Time and ts.Data"
    problem = "the file holds no known joint positions or velocities; name them, such as"
    return LogError(path, f"{problem} {example}; it has {shapes or none}")


# NumPy's files

OBJECTS = (
    "Python objects, such as None, or PyBullet's joint states as they are; save numbers:"
    " np.savez(path, time=times, position=positions, velocity=velocities)"
)
ALONE = "array"  # name of the array in a .npy file, for a mapping


def open_log(path: Path, options: ReadOptions) -> LogReader:
    """Reader of an archive, an array alone, or a MATLAB file of version 5."""
    with path.open("rb") as stream:
        is_matlab = stream.read(len(MATLAB)) == MATLAB
    arrays, run = _variables(path) if is_matlab else _arrays(path), None

    def listing() -> tuple[str, ...]:
        return tuple(f"{name}  {each.dtype} {each.shape}" for name, each in arrays.items())

    if is_matlab:
        read = partial(log_of_variables, path, arrays, options)
        return LogReader("MATLAB 5", ("",), lambda _: read(), listing)
    known = all(name in runfile.ARRAYS or name.startswith(runfile.STAGE) for name in arrays)
    if known and "time" in arrays and not (options.entries or options.units or options.joints):
        with suppress(RunError, TypeError):  # without uniform time it is resampled
            check_time(arrays["time"])
            run = partial(Run.load, path)
    episodes = (*episodes_of(arrays),)
    return LogReader("npz", episodes, partial(_read, path, arrays, options), listing, run)


def _arrays(path: Path) -> dict[str, NDArray[Any]]:
    with errors_of(path), path.open("rb") as stream:
        try:
            if stream.read(len(MAGIC_PREFIX)) != MAGIC_PREFIX:
                return runfile.read_npz(path)
            stream.seek(0)
            array = np.asarray(runfile.read_array(stream, "it", path.stat().st_size))
        except ArchiveError as error:
            what = str(error)
            if isinstance(error, ObjectArrayError):
                what = f"{error.name!r} holds {OBJECTS}"
            raise LogError(path, f"not an archive of plain arrays: {what}") from error
    names = array.dtype.names or ()
    return {name: array[name] for name in names} if names else {ALONE: array}


def _read(path: Path, arrays: Arrays, options: ReadOptions, episode: str) -> Log:
    texts = {n: tuple(map(str, e.ravel())) for n, e in arrays.items() if e.dtype.kind == "U"}
    measured = texts.get("joint_names", ())
    desired = texts.get("desired_joint_names") or measured
    part = part_of(arrays, episode)
    numbers = {n: each for n, each in part.items() if each.ndim and each.dtype.kind in "iufM"}
    joints = {n: desired if meaning(n).endswith("_desired") else measured for n in numbers}
    return log_of(path, numbers, options, stated=stated_rate(arrays), joints=joints)


# MATLAB's files of version 5

MATLAB = b"MATLAB 5.0 MAT-f"  # the first bytes of such a file
HEADER = 128  # bytes before the first variable
# Types of elements: a variable, one that is packed, and what a variable begins with.
MATRIX, COMPRESSED, FLAGS, DIMENSIONS = 14, 15, 6, 5
# Numbers by the type of their element, whatever the class of the variable is.
STORED = dict(enumerate(("i1", "u1", "i2", "u2", "i4", "u4", "f4"), start=1))
STORED |= {9: "f8", 12: "i8", 13: "u8"}
STRUCT, TEXT = 2, 4  # classes of variables
NO_NUMBERS = (1, 3, 5, 16, 17, 18)  # classes of cells, objects, sparse matrices and functions
COMPLEX = 0x800  # the flag of a variable with imaginary parts
DEPTH = 20  # structs within each other

# Fields of a timeseries, or of what Simulink logs as a struct, that hold the signal itself.
DATA = ("signals/values", "Data", "data", "Values", "values")
STAMPS = ("Time", "time", "t")


def log_of_variables(path: Path, variables: Arrays, options: ReadOptions) -> Log:
    """Log of variables, whose samples are along either axis, as in MATLAB."""
    named = {}
    for name, each in variables.items():
        field = next((f"/{field}" for field in DATA if name.endswith(f"/{field}")), "")
        last = name.rpartition("/")[2]
        plain = name.removesuffix(field) or name  # `q/Data` is `q`, its stamps are `Time`
        plain = last if not field and last in STAMPS else plain
        if each.dtype.kind in "iuf":
            named[plain] = each.ravel() if 1 in each.shape else each
    time = options.stamps_in([name for name, each in named.items() if each.ndim == 1])
    longest = max((max(each.shape) for each in named.values() if each.ndim), default=0)
    samples = len(named[time]) if time in named else longest
    across = {n: e.T for n, e in named.items() if e.shape[1:] == (samples,) != e.shape[:1]}
    turned = named | across
    return log_of(path, turned, options, stated=stated_rate(turned))


def _variables(path: Path) -> dict[str, NDArray[Any]]:
    """Arrays of numbers in a file, and in the fields of a struct."""
    found: dict[str, NDArray[Any]] = {}
    with errors_of(path, (struct_error, ValueError)):  # such as of a shape that no array has
        for data in _unpacked_variables(path.read_bytes()):
            texts = (bytes(content) for kind, content in _elements(data) if kind in (1, 2))
            name = next(texts, b"").decode("latin1")
            if name and not name.startswith("__"):
                found |= _numbers(data, name)
    return found


def _unpacked_variables(data: bytes) -> Iterator[memoryview]:
    """The elements of each variable of a file."""
    if data[126:128] != b"IM":
        raise ArchiveError("a MATLAB file of another byte order; save it again with MATLAB")
    place, total = HEADER, 0
    while place + 8 <= len(data):
        kind, size = unpack_from("<II", data, place)
        element = data[place : place + 8 + size]
        place += 8 + size
        if len(element) < 8 + size:
            raise ArchiveError("damaged or cut off: a variable is shorter than it states")
        if kind == COMPRESSED:
            pieces, unpacker, waiting = [], zlib.decompressobj(), element[8:]
            while waiting and not unpacker.eof:
                try:
                    pieces.append(unpacker.decompress(waiting, PIECE))
                except zlib.error as error:
                    raise ArchiveError(f"damaged: {error}") from error
                waiting = unpacker.unconsumed_tail
                total += len(pieces[-1])
                check_unpacked(total, len(data))
            element = b"".join(pieces)
        if unpack_from("<I", element) == (MATRIX,):
            yield memoryview(element)[8:]


def _elements(data: memoryview) -> Iterator[tuple[int, memoryview]]:
    """Type and content of each element: small ones have their content in their tag."""
    place = 0
    while place + 8 <= len(data):
        kind, size = unpack_from("<II", data, place)
        start = place + 8
        following = start + size + (-size % 8)
        if kind >> 16:
            kind, size, start, following = kind & 0xFFFF, kind >> 16, place + 4, place + 8
        if start + size > len(data):
            raise ArchiveError("damaged: an element is longer than its variable")
        yield kind, data[start : start + size]
        place = following


def _numbers(data: memoryview, name: str, depth: int = DEPTH) -> Iterator[tuple[str, NDArray[Any]]]:
    """Arrays of numbers in a variable, of the sizes that it states."""
    parts = [*_elements(data)]
    kinds = [kind for kind, _ in parts[:2]]
    if not depth or len(parts) < 3 or kinds != [FLAGS, DIMENSIONS]:
        return
    (flags,) = unpack_from("<I", parts[0][1])
    dims = unpack_from(f"<{len(parts[1][1]) // 4}i", parts[1][1])
    kind, count = flags & 0xFF, prod(dims)
    if kind in NO_NUMBERS or min(dims, default=0) < 0:
        return
    if kind == STRUCT and count == 1 and len(parts) > 4:
        (length,) = unpack_from("<i", parts[3][1])
        names = bytes(parts[4][1])
        fields = (names[at : at + length] for at in range(0, len(names), max(1, length)))
        for field, (_, content) in zip(fields, parts[5:], strict=False):
            text = field.partition(bytes(1))[0].decode("latin1")
            yield from _numbers(content, f"{name}/{text}", depth - 1)
    elif kind != STRUCT:
        size = sum(len(content) for _, content in parts[3:])
        stored, content = (*parts, (1, data[:0]))[3]
        dtype = np.dtype(STORED.get(stored, "i1"))
        plain = kind != TEXT and not flags & COMPLEX
        if count > size or (plain and count * dtype.itemsize != len(content)):
            raise ArchiveError(f"damaged: a variable states {count} numbers and holds {size} bytes")
        if plain and len(dims) <= 2:
            yield name, np.ndarray(dims, dtype, content, order="F")
