"""LeRobot data sets, v2 and v3: Parquet files, and an info file that describes them.

States and actions are joint positions, in a unit that the data set does not name: radians,
degrees, or normalised to each joint's calibrated range.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from inspector.errors import LogError
from inspector.logs import parquet
from inspector.logs.log import Field, Log, LogReader, Stamps
from inspector.logs.mapping import ReadOptions
from inspector.logs.names import listed
from inspector.text import counted
from noiseclassifier.jsontext import from_json, text_of

STATE, ACTION, STAMP, FRAME = "observation.state", "action", "timestamp", "frame_index"

FURTHER = {"observation.velocity": "velocity", "observation.effort": "effort"}
"""Features that some data sets have besides (ALOHA's), and their signals."""

PARTS = {"pos": "position", "vel": "velocity", "effort": "effort", "torque": "effort"}
"""Signals by the last part of a name: ``shoulder_pan.pos``."""

CARTESIAN = {"x", "y", "z", "roll", "pitch", "yaw", "rx", "ry", "rz", "qx", "qy", "qz", "qw"}
"""Column names of an end effector's pose."""

SLOWEST, FASTEST = 1e-3, 1e6
"""Rates that a data set may have, in [Hz]."""

LATEST = 9e9
"""Stamps and frame numbers lie before: in nanoseconds, these fit into 64 bits."""

TOLERANCE = 1e-4
"""Largest difference of a stamp from its frame number over the rate, in [s], as in LeRobot."""

UNKNOWN = (
    "LeRobot does not log the unit of its '.pos' features: specify --units degrees, normalised"
    " (-100 to 100 of each joint's range, needs --robot) or radians"
)


def open_log(path: Path, options: ReadOptions) -> LogReader:
    """Reader of a data set, or of one of its files."""
    folder = path if path.is_dir() else _folder(path)
    info = _info(folder)
    files = sorted((folder / "data").rglob("*.parquet")) if path.is_dir() else [path]
    if not files:
        raise LogError(path, "the data set has no data/**/*.parquet")
    places: dict[str, list[Path]] = {}
    for file in files:
        for episode in parquet.episodes_of(file):
            places.setdefault(episode, []).append(file)
    return LogReader(
        f"LeRobot {info.get('codebase_version', '')}".strip(),
        tuple(sorted(places, key=int)),
        lambda episode, progress: _read(path, info, places[episode], episode, options),
        lambda: _listing(info, len(places)),
    )


def names_of(feature: Any, width: int) -> tuple[str, ...]:
    """Names of a feature's columns, flattened; empty if there are none."""
    names = tuple(_flat(feature.get("names") if isinstance(feature, dict) else None))
    return names if len(names) == width else ()


def _read(
    path: Path, info: dict[str, Any], files: Sequence[Path], episode: str, options: ReadOptions
) -> Log:
    features = info["features"]
    present = parquet.schema_of(files[0]).names
    mapped = {entry.part()[0] for entry in options.entries}
    wanted = [name for name in present if name in (STATE, ACTION, *FURTHER) or name in mapped]
    clock = [name for name in (STAMP, FRAME) if name in present]
    table = parquet.table_of(files, [*wanted, *clock], episode)
    stamps = _stamps(path, info, table, options)
    fields: list[Field] = []
    remarks = []
    for name in wanted:
        values = parquet.values_of(path, name, table.column(name))
        if values is None:
            continue
        names = names_of(features.get(name), values.shape[1])
        if not names and name == STATE:
            remarks.append(f"{STATE} has no names; it is read as joint positions")
        fields += _fields(name, values, stamps, names, mapped=name in mapped)
    found, fields = fields, _checked(path, fields, mapped)
    taken = [f"{each.signal} = {each.name}" for each in fields if each.signal]
    remarks += [f"taken: {', '.join(taken)}"] if taken else []
    if ACTION in {each.source for each in found} - {each.source for each in fields}:
        remarks.append(
            f"{ACTION} not taken as desired positions: its columns are not those of {STATE};"
            f" --map position_desired={ACTION}[0:6] takes some"
        )
    not_read = tuple(name for name in features if name not in {each.source for each in fields})
    dotted = any(part in PARTS for each in fields for part in _ends(features, each.source))
    meta = {"robot_type": info.get("robot_type"), "dataset": info.get("codebase_version")}
    return Log(
        path,
        tuple(fields),
        episode,
        not_read=tuple(name for name in not_read if not name.startswith("observation.images")),
        remarks=tuple(remarks),
        units=UNKNOWN if dotted else "",
        meta={key: value for key, value in meta.items() if value},
    )


def _fields(
    name: str, values: Any, stamps: Stamps, names: tuple[str, ...], *, mapped: bool
) -> Iterator[Field]:
    """Fields of a feature, one for each signal that its columns hold."""
    ends = [each.rpartition(".") for each in names]
    whole_kind = FURTHER.get(name, "position")
    kinds = ["position" if mapped else PARTS.get(end, whole_kind) for _, _, end in ends]
    suffix = "_desired" if name == ACTION else ""
    for kind in dict.fromkeys(kinds) or [whole_kind]:
        columns = [place for place, each in enumerate(kinds) if each == kind]
        joints = tuple(ends[place][0] or ends[place][2] for place in columns)
        signal = f"{kind}{suffix}" if name in (STATE, ACTION, *FURTHER) and not mapped else ""
        part = values[:, columns] if len(columns) not in (0, values.shape[1]) else values
        whole = name if part is values else f"{name}/{kind}"
        yield Field(
            whole,
            np.asarray(part, dtype=part.dtype if part.dtype.kind == "f" else np.float64),
            stamps,
            joints=joints,
            signal="" if signal == "effort_desired" else signal,
            source=name,
        )


def _checked(path: Path, fields: list[Field], mapped: set[str]) -> list[Field]:
    """Fields without actions that do not match the state; an end effector's pose is refused."""
    state = [each for each in fields if each.source == STATE]
    for field in state:
        if field.source not in mapped and CARTESIAN & {name.lower() for name in field.joints}:
            raise LogError(
                path,
                f"{STATE} holds {listed(field.joints)}: the pose of an end effector, not joints;"
                " name the columns that are joints, such as --map position=observation.state[6:12]",
            )
    known = {
        (each.signal, each.joints, each.values.shape[1]) for each in state if STATE not in mapped
    }

    def matches_state(field: Field) -> bool:
        if field.source != ACTION:
            return True
        signal = field.signal.removesuffix("_desired")
        return (signal, field.joints, field.values.shape[1]) in known

    return [each for each in fields if each.source in mapped - {STATE} or matches_state(each)]


def _stamps(path: Path, info: dict[str, Any], table: Any, options: ReadOptions) -> Stamps:
    """Stamps from frame numbers if they agree: logged stamps are float32, too coarse."""
    rate = options.rate or info.get("fps")
    clock = {}
    for name in (FRAME, STAMP):
        if name in table.column_names:
            values = parquet.values_of(path, name, table.column(name))
            if values is None or values.shape[1] != 1 or values.dtype.kind not in "iuf":
                kind = table.column(name).type
                raise LogError(path, f"column {name!r} holds {kind}, expected numbers")
            clock[name] = values[:, 0].astype(np.float64)
            if not (np.abs(clock[name]) < LATEST).all():
                raise LogError(path, f"column {name!r} holds a value that is no time")
    frames = clock.get(FRAME)
    if STAMP in clock:
        logged = clock[STAMP]
        if frames is None or not rate or (np.abs(logged - frames / rate) > TOLERANCE).any():
            return Stamps.of_nanoseconds(np.round(logged * 1e9).astype(np.int64))
    if not rate:
        raise LogError(path, "meta/info.json has no fps; specify the rate (--rate)")
    return Stamps.every(1 / rate, len(table))


def _info(folder: Path) -> dict[str, Any]:
    path = folder / "meta" / "info.json"
    try:
        info = from_json(text_of(path))
    except (OSError, ValueError) as error:
        raise LogError(path, f"cannot be read ({error})") from error
    if not isinstance(info, dict) or not isinstance(info.get("features"), dict):
        raise LogError(path, "has no features")
    for name, feature in info["features"].items():
        if not isinstance(feature, dict):
            raise LogError(path, f"the feature {name!r} is no table")
    rate = info.get("fps")
    if rate is not None and not (type(rate) in (int, float) and SLOWEST <= rate <= FASTEST):
        raise LogError(path, f"fps is {rate!r}, expected {SLOWEST:g} to {FASTEST:g} Hz")
    return info


def _folder(path: Path) -> Path:
    return next(
        folder for folder in path.resolve().parents[:3] if (folder / "meta" / "info.json").is_file()
    )


def _listing(info: dict[str, Any], episodes: int) -> tuple[str, ...]:
    rows = [f"{counted(episodes, 'episode')} at {info.get('fps', 'unknown')} Hz"]
    for name, feature in info["features"].items():
        names = listed(tuple(_flat(feature.get("names"))))
        rows.append(f"{name}  {feature.get('dtype')} {feature.get('shape')}  {names}".rstrip())
    return tuple(rows)


def _ends(features: dict[str, Any], name: str) -> Iterator[str]:
    for each in _flat((features.get(name) or {}).get("names")):
        _, dot, end = each.rpartition(".")
        if dot:
            yield end


def _flat(names: Any) -> Iterator[str]:
    if isinstance(names, str):
        yield names
    elif isinstance(names, dict):
        for each in names.values():
            yield from _flat(each)
    elif isinstance(names, list):
        for each in names:
            yield from _flat(each)
