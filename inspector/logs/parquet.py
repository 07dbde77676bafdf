"""Parquet logs with a row per sample, and LeRobot's data sets of such files, v2 and v3.

What columns unpack to is known before by the headers of their pages: pyarrow makes room for a page
by its header, whatever the end of the file states, and its table of columns ends the process on
some damage. Both are structs of Thrift's compact protocol:
https://github.com/apache/thrift/blob/master/doc/specs/thrift-compact-protocol.md and
https://github.com/apache/parquet-format/blob/master/src/main/thrift/parquet.thrift

The states and actions of a LeRobot data set are joint positions, in a unit that it does not name:
radians, degrees, or normalised to each joint's calibrated range.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import pyarrow.compute as pc
import pyarrow.parquet
from numpy.typing import NDArray

from inspector.errors import LogError
from inspector.logs.arrays import episodes_of, floats, log_of, may_hold, part_of
from inspector.logs.clocks import stamps_of
from inspector.logs.mapping import Field, Log, LogReader, ReadOptions, Stamps, errors_of, no_motion
from inspector.logs.names import EPISODES, Naming, array_signal, listed
from inspector.text import counted
from noiseclassifier.jsontext import from_json, text_of
from noisemodel.files import beyond, limit
from noisemodel.runfile import ArchiveError, check_regular, check_unpacked

# Errors that pyarrow raises for damaged files.
DAMAGE = (pyarrow.ArrowException, OSError, ValueError, KeyError, RuntimeError)
EPISODE = "episode_index"  # the column with the number of the episode, if there is one

INFO = Path("meta", "info.json")  # the file that describes a LeRobot data set
STATE, ACTION, STAMP = "observation.state", "action", "timestamp"
# Features and their signals; some data sets (ALOHA's) have more than states and actions.
FEATURES = {
    STATE: "position",
    ACTION: "position",
    "observation.velocity": "velocity",
    "observation.effort": "effort",
}
# Signals by the last part of a name: ``shoulder_pan.pos``.
PARTS = {"pos": "position", "vel": "velocity", "effort": "effort", "torque": "effort"}
# Column names of an end effector's pose.
CARTESIAN = {"x", "y", "z", "roll", "pitch", "yaw", "rx", "ry", "rz", "qx", "qy", "qz", "qw"}
SLOWEST, FASTEST = 1e-3, 1e6  # rates that a data set may have, in [Hz]
TOLERANCE = 1e-4  # largest difference of a stamp from the rate's, in [s], as in LeRobot
IMAGES = "observation.images"  # beginning of the names of features that are videos
UNKNOWN = (
    "LeRobot does not log the unit of its '.pos' features: specify --units degrees or radians;"
    " numbers of -100 to 100 of each joint's range are no angles"
)


def open_log(path: Path, options: ReadOptions) -> LogReader:
    """Reader of a Parquet file, or of a LeRobot data set or one of its files."""
    above = [path] if path.is_dir() else path.resolve().parents[:3]
    if folder := next((each for each in above if (each / INFO).is_file()), None):
        return _data_set(path, folder, options)
    return LogReader(
        "Parquet",
        _episodes(path),
        lambda episode: _read(path, options, episode),
        lambda: (
            f"{pyarrow.parquet.read_metadata(path).num_rows} rows",
            *(f"{each.name}  {each.type}" for each in _schema(path)),
        ),
    )


def _schema(path: Path) -> Any:
    """Names and types of the columns."""
    with errors_of(path, DAMAGE):
        check_regular(path)
        return pyarrow.parquet.read_schema(path)


def _episodes(path: Path) -> tuple[str, ...]:
    """Episodes in a file; "" if it neither numbers nor ends them."""
    names = _schema(path).names
    if EPISODE not in names:
        found = [name for name in names if name.lower() in EPISODES]
        return (*episodes_of(_arrays(path, _table([path], found, ""), found)),) if found else ("",)
    column = _table([path], [EPISODE], "").column(0)
    if not pyarrow.types.is_integer(column.type) or column.null_count:
        raise LogError(path, f"column {EPISODE!r} holds {column.type}, expected whole numbers")
    return tuple(str(each) for each in np.unique(column.to_numpy()))


def _table(paths: Sequence[Path], columns: Sequence[str], episode: str) -> Any:
    """Table of some columns, of one episode if there are several."""
    filters = [(EPISODE, "==", int(episode))] if episode else None
    tables = []
    for path in paths:
        with errors_of(path, DAMAGE):
            unpacked, width = unpacked_size(path, {*columns, *([EPISODE] if episode else [])})
            if width > limit("columns"):
                raise ArchiveError(f"lists of {width} numbers in a row, {beyond('columns')}")
            check_unpacked(unpacked, path.stat().st_size)
            tables.append(pyarrow.parquet.read_table(path, columns=list(columns), filters=filters))
    return pyarrow.concat_tables(tables)


def _values(path: Path, table: Any, name: str) -> NDArray[Any] | None:
    """Column as an array, shape (samples, columns); None if it holds no numbers."""
    column = table.column(name)
    samples = len(column)
    if pyarrow.types.is_timestamp(column.type):
        return np.asarray(column.to_numpy())[:, None]
    flat = column.combine_chunks()
    while pyarrow.types.is_list(flat.type) or pyarrow.types.is_fixed_size_list(flat.type):
        flat = flat.flatten()
    types = pyarrow.types
    if not any(kind(flat.type) for kind in (types.is_floating, types.is_integer, types.is_boolean)):
        return None
    numbers = flat.to_numpy(zero_copy_only=False)
    widths = pc.list_value_length(column).unique() if pyarrow.types.is_list(column.type) else ()
    if len(widths) > 1 or not samples or len(numbers) % samples:
        problem = f"column {name!r} has {len(numbers)} numbers in {samples} rows of any length"
        raise LogError(path, problem)
    return np.asarray(numbers).reshape(samples, -1)


def _arrays(path: Path, table: Any, names: Sequence[str]) -> dict[str, NDArray[Any]]:
    """Columns of numbers, as arrays."""
    values = {name: _values(path, table, name) for name in names}
    return {n: e[:, 0] if e.shape[1] == 1 else e for n, e in values.items() if e is not None}


def _read(path: Path, options: ReadOptions, episode: str) -> Log:
    schema = _schema(path)
    time = options.stamps_in(schema.names)
    names = [name for name in schema.names if name not in (time, EPISODE)]
    mapped = options.for_columns(path, names).mapped
    naming = Naming.of(names, options.known_joints)
    wanted = [n for n in names if n in mapped or may_hold(n, naming) or array_signal(n)]
    if not wanted:
        raise no_motion(path, schema.names)
    flags = [name for name in names if name.lower() in EPISODES]
    wanted += [time] if time else []
    table = _table([path], [*wanted, *flags], episode if EPISODE in schema.names else "")
    arrays = _arrays(path, table, [*wanted, *flags])
    if EPISODE not in schema.names:
        arrays = part_of(arrays, episode)
    if time and time not in arrays:
        raise LogError(path, f"column {time!r} holds no stamps but {table.column(time).type}")
    not_read = [name for name in schema.names if name not in (*arrays, *EPISODES)]
    return log_of(path, arrays, options, not_read=not_read)


# What columns unpack to

TRUE, FALSE, BYTE, DOUBLE, BINARY, LIST, SET, STRUCT = 1, 2, 3, 7, 8, 9, 10, 12
# Types of Thrift's compact protocol; the last are integers of 16, 32 and 64 bits.
NUMBERS = (4, 5, 6)
DEPTH = 13  # structs and lists within each other; the end of a file has eight
MAGIC = b"PAR1"
LARGEST_END = 32 * 2**20  # most bytes of a file's end: a column of a row group takes hundreds

# Fields of structs, by the names of parquet.thrift
ROW_GROUPS, COLUMNS, ROWS, META_DATA = 4, 1, 3, 3
PATH, VALUES, ALL_UNPACKED, ALL_PACKED, DATA_PAGE, DICTIONARY_PAGE = 3, 5, 6, 7, 9, 11
UNPACKED, PACKED = 2, 3


def unpacked_size(path: Path, columns: Collection[str]) -> tuple[int, int]:
    """Bytes that columns unpack to, as pages or the end state, and the most numbers in a row."""
    stated = held = width = 0
    with path.open("rb") as stream, mmap(stream.fileno(), 0, access=ACCESS_READ) as data:
        length = int.from_bytes(data[-8:-4], "little")
        if data[-4:] != MAGIC or length > min(LARGEST_END, len(data) - 8):
            raise ValueError("its end is no table of columns")
        data.seek(len(data) - 8 - length)
        try:
            for group in _thrift(data)[ROW_GROUPS]:
                numbers = 0
                for about in (chunk[META_DATA] for chunk in group[COLUMNS]):
                    name = b".".join(about[PATH]).decode(errors="replace")
                    if any(f"{name}.".startswith(f"{each}.") for each in columns):
                        numbers += about[VALUES]
                        stated += max(about[ALL_UNPACKED], 8 * about[VALUES])
                        held += sum(_pages(data, about))
                width = max(width, numbers // max(1, group[ROWS]))
        except ValueError as error:
            if data.tell() < len(data):
                raise
            raise ValueError("a header is cut off") from error
        except (KeyError, TypeError, AttributeError) as error:
            raise ValueError("its end is no table of columns") from error
    return max(stated, held), width


def _pages(data: mmap, about: dict[int, Any]) -> Iterator[int]:
    """Bytes that each page of a column of a row group unpacks to."""
    place: int = about[DATA_PAGE]
    if 0 < about.get(DICTIONARY_PAGE, 0) < place:
        place = about[DICTIONARY_PAGE]
    stop = min(place + about[ALL_PACKED], len(data))
    while 0 <= place < stop:
        data.seek(place)
        header = _thrift(data)
        if min(header.get(UNPACKED, -1), header.get(PACKED, -1)) < 0:
            raise ValueError("a page has no size")
        yield header[UNPACKED]
        place = data.tell() + header[PACKED]


def _thrift(data: mmap, kind: int = STRUCT, depth: int = DEPTH) -> Any:
    """The value at the place of the file, which moves on; a struct is its fields by number."""
    if not depth:
        raise ValueError("a header is nested too deeply")
    if kind in (TRUE, FALSE, BYTE):  # of lists; those of structs are in their heads
        return data.read_byte()
    if kind in NUMBERS:
        number = _varint(data)
        return (number >> 1) ^ -(number & 1)
    if kind in (DOUBLE, BINARY):
        return data.read(8 if kind == DOUBLE else min(_varint(data), len(data)))
    if kind in (LIST, SET):
        count, kind = divmod(data.read_byte(), 16)
        count = _varint(data) if count == 15 else count
        if count > len(data):
            raise ValueError("a header has a list of more than there is")
        return [_thrift(data, kind, depth - 1) for _ in range(count)]
    if kind != STRUCT:
        raise ValueError(f"a header has a field of kind {kind}")
    fields: dict[int, Any] = {}
    name = 0
    while head := data.read_byte():
        step, kind = divmod(head, 16)
        name = name + step if step else _thrift(data, NUMBERS[0])
        fields[name] = _thrift(data, kind, depth - 1) if kind not in (TRUE, FALSE) else kind == TRUE
    return fields


def _varint(data: mmap) -> int:
    number = 0
    for shift in range(0, 70, 7):
        byte = data.read_byte()
        number |= (byte & 127) << shift
        if byte < 128:
            return number
    raise ValueError("a header has a number of more than 64 bits")


# LeRobot's data sets


def _data_set(path: Path, folder: Path, options: ReadOptions) -> LogReader:
    """Reader of a data set, or of one of its files."""
    info = _info(folder / INFO)
    files = sorted((folder / "data").rglob("*.parquet")) if path.is_dir() else [path]
    if not files:
        raise LogError(path, "the data set has no data/**/*.parquet")
    places: dict[str, list[Path]] = {}
    for file in files:
        for episode in _episodes(file):
            if not episode:
                has = listed(_schema(file).names)
                raise LogError(file, f"there is no column {EPISODE!r}; it has {has}")
            places.setdefault(episode, []).append(file)
    return LogReader(
        f"LeRobot {info.get('codebase_version', '')}".strip(),
        tuple(sorted(places, key=int)),
        lambda episode: _episode(path, info, places[episode], episode, options),
        lambda: (
            f"{counted(len(places), 'episode')} at {info.get('fps', 'unknown')} Hz",
            *(
                f"{name}  {each.get('dtype')} {each.get('shape')}"
                f"  {listed(_names(each.get('names')))}".rstrip()
                for name, each in info["features"].items()
            ),
        ),
    )


def _info(path: Path) -> dict[str, Any]:
    with errors_of(path, (OSError, ValueError), "cannot be read"):
        info: dict[str, Any] = from_json(text_of(path))
    features = info.get("features") if isinstance(info, dict) else None
    if not isinstance(features, dict) or not all(isinstance(f, dict) for f in features.values()):
        raise LogError(path, "has no table of features")
    rate = info.get("fps")
    if rate is not None and not (type(rate) in (int, float) and SLOWEST <= rate <= FASTEST):
        raise LogError(path, f"fps is {rate!r}, expected {SLOWEST:g} to {FASTEST:g} Hz")
    return info


def _names(names: Any) -> list[str]:
    """Names of a feature's columns, flattened; empty if there are none."""
    if isinstance(names, str):
        return [names]
    if isinstance(names, dict):
        names = [*names.values()]
    return [n for each in names for n in _names(each)] if isinstance(names, list) else []


def _episode(
    path: Path, info: dict[str, Any], files: Sequence[Path], episode: str, options: ReadOptions
) -> Log:
    features, present = info["features"], _schema(files[0]).names
    mapped = options.mapped
    wanted = [name for name in present if name in {*FEATURES, *mapped, STAMP}]
    table = _table(files, wanted, episode)
    arrays = {n: v for n in wanted if n != STAMP and (v := _values(path, table, n)) is not None}
    columns = {}
    for name, each in arrays.items():
        names = _names(features.get(name, {}).get("names"))
        columns[name] = names if len(names) == each.shape[1] else [""] * each.shape[1]
    remarks = []
    state = [] if STATE in mapped else columns.get(STATE, [])
    if CARTESIAN & {name.lower() for name in state}:
        how = "name the columns that are joints, such as --map position=observation.state[6:12]"
        problem = f"{STATE} holds {listed(state)}: the pose of an end effector, not joints"
        raise LogError(path, f"{problem}; {how}")
    if state and not any(state):
        remarks.append(f"{STATE} has no names; it is read as joint positions")
    if ACTION in arrays and ACTION not in mapped and columns[ACTION] != state:
        del arrays[ACTION]
        how = f"--map position_desired={ACTION}[0:6] takes some"
        why = f"its columns are not those of {STATE}; {how}"
        remarks.append(f"{ACTION} not taken as desired positions: {why}")
    stamps = _stamps(path, info, table, options)
    fields: list[Field] = []
    for name, each in arrays.items():
        held = "" if name in mapped else FEATURES[name]
        fields += _fields(path.name, name, held, each, columns[name], stamps)
    meta = {"robot_type": info.get("robot_type"), "dataset": info.get("codebase_version")}
    ends = [column.rpartition(".")[1:] for name in arrays for column in columns[name]]
    read = {*arrays, STAMP}
    return Log(
        path,
        tuple(fields),
        not_read=tuple(n for n in features if n not in read and not n.startswith(IMAGES)),
        remarks=tuple(remarks),
        units=UNKNOWN if any(dot and end in PARTS for dot, end in ends) else "",
        meta={key: value for key, value in meta.items() if value},
    )


def _fields(
    source: str, name: str, held: str, values: NDArray[Any], columns: list[str], stamps: Stamps
) -> Iterator[Field]:
    """Fields of a feature, one for each signal that its columns hold; ``held`` is the usual one."""
    ends = [column.rpartition(".") for column in columns]
    kinds = [held and PARTS.get(end, held) for _, _, end in ends]
    for kind in dict.fromkeys(kinds):
        of_kind = [place for place, other in enumerate(kinds) if other == kind]
        alone = len(of_kind) == len(kinds)
        signal = f"{kind}_desired" if name == ACTION and kind else kind
        yield Field(
            name if alone else f"{name}/{kind}",
            floats(values if alone else values[:, of_kind]),
            stamps,
            joints=tuple(filter(None, (ends[n][0] or ends[n][2] for n in of_kind))),
            signal="" if signal == "effort_desired" else signal,
            source=source,
        )


def _stamps(path: Path, info: dict[str, Any], table: Any, options: ReadOptions) -> Stamps:
    """Stamps at the rate, if the logged ones agree: these are float32, too coarse."""
    rate = options.rate or info.get("fps")
    even = Stamps.counted(len(table))
    if rate:
        even = replace(even, time=even.time * (1 / rate), unit="seconds")
    if STAMP not in table.column_names:
        return even
    logged = stamps_of(path, STAMP, table.column(STAMP).to_numpy(), rate)
    agrees = rate and (np.abs(logged.time - even.time) <= TOLERANCE).all()
    return replace(logged, time=even.time) if agrees else logged
