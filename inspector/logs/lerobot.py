"""LeRobot data sets, v2 and v3: Parquet, and an info file that says what it holds.

States and actions are joint positions, in a unit that the data set does not say: radians, degrees,
or shares of each joint's calibrated range.
"""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from inspector.errors import LogError
from inspector.logs import parquet
from inspector.logs.columns import listed
from inspector.logs.log import Field, Log, Stamps
from inspector.logs.opened import Opened
from inspector.logs.reading import Reading

STATE, ACTION, STAMP, FRAME = "observation.state", "action", "timestamp", "frame_index"

PARTS = {"pos": "position", "vel": "velocity", "effort": "effort", "torque": "effort"}
"""What the ends of names mean: ``shoulder_pan.pos``."""

CARTESIAN = {"x", "y", "z", "roll", "pitch", "yaw", "rx", "ry", "rz", "qx", "qy", "qz", "qw"}
"""Names of an end effector's pose, which moves no joint that we know of."""

TOLERANCE = 1e-4
"""How far a stamp may be from its frame's number over the rate, in [s]; LeRobot's own."""

UNKNOWN = (
    "LeRobot does not log the unit of its '.pos' features: say --units degrees, normalised (-100"
    " to 100 of each joint's range, needs --robot) or radians"
)


def open_log(path: Path, reading: Reading) -> Opened:
    """Offer a data set, or one of its files.

    Args:
        path: The data set's folder, or a Parquet file within it.
        reading: What a person said of it.

    Raises:
        LogError: If its info file or its data cannot be read.
    """
    home = path if path.is_dir() else _home(path)
    info = _info(home)
    files = sorted((home / "data").rglob("*.parquet")) if path.is_dir() else [path]
    if not files:
        raise LogError(path, "the data set has no data/**/*.parquet")
    places: dict[str, list[Path]] = {}
    for file in files:
        for episode in parquet.episodes_of(file):
            places.setdefault(episode, []).append(file)
    return Opened(
        f"LeRobot {info.get('codebase_version', '')}".strip(),
        tuple(sorted(places, key=int)),
        lambda episode, watch: _read(path, info, places[episode], episode, reading),
        lambda: _listing(info, len(places)),
    )


def names_of(feature: Any, width: int) -> tuple[str, ...]:
    """Read the names of a feature's columns, however they are nested; empty if there are none."""
    names = tuple(_flat(feature.get("names") if isinstance(feature, dict) else None))
    return names if len(names) == width else ()


def _read(
    path: Path, info: dict[str, Any], files: Sequence[Path], episode: str, reading: Reading
) -> Log:
    features = info["features"]
    present = parquet.schema_of(files[0]).names
    said = {entry.part()[0] for entry in reading.entries}
    wanted = [name for name in present if name in (STATE, ACTION) or name in said]
    clock = [name for name in (STAMP, FRAME) if name in present]
    table = parquet.table_of(files, [*wanted, *clock], episode)
    stamps = _stamps(path, info, table, reading)
    fields: list[Field] = []
    remarks = []
    for name in wanted:
        values = parquet.values_of(path, name, table.column(name))
        if values is None:
            continue
        names = names_of(features.get(name), values.shape[1])
        if not names and name == STATE:
            remarks.append(f"{STATE} has no names; it is taken for joint positions")
        fields += _fields(name, values, stamps, names, said=name in said)
    fields = _checked(path, fields, said)
    left = tuple(name for name in features if name not in {each.source for each in fields})
    dotted = any(part in PARTS for each in fields for part in _ends(features, each.source))
    meta = {"robot_type": info.get("robot_type"), "dataset": info.get("codebase_version")}
    return Log(
        path,
        tuple(fields),
        episode,
        left=tuple(name for name in left if not name.startswith("observation.images")),
        remarks=tuple(remarks),
        units=UNKNOWN if dotted else "",
        meta={key: value for key, value in meta.items() if value},
    )


def _fields(
    name: str, values: Any, stamps: Stamps, names: tuple[str, ...], *, said: bool
) -> Iterator[Field]:
    """Take a feature apart where its columns hold different signals."""
    ends = [each.rpartition(".") for each in names]
    kinds = ["position" if said else PARTS.get(end, "position") for _, _, end in ends]
    suffix = "_desired" if name == ACTION else ""
    for kind in dict.fromkeys(kinds) or ["position"]:
        columns = [place for place, each in enumerate(kinds) if each == kind]
        joints = tuple(ends[place][0] or ends[place][2] for place in columns)
        signal = f"{kind}{suffix}" if name in (STATE, ACTION) else ""
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


def _checked(path: Path, fields: list[Field], said: set[str]) -> list[Field]:
    """Refuse a pose for joints, and take no action for desired motion that is none."""
    state = [each for each in fields if each.source == STATE]
    for field in state:
        if field.source not in said and CARTESIAN & {name.lower() for name in field.joints}:
            raise LogError(
                path,
                f"{STATE} holds {listed(field.joints)}: the pose of an end effector, not joints;"
                " say which columns are joints, such as --map position=observation.state[6:12]",
            )
    known = {
        (each.signal, each.joints, each.values.shape[1]) for each in state if STATE not in said
    }

    def follows(field: Field) -> bool:
        if field.source != ACTION:
            return True
        signal = field.signal.removesuffix("_desired")
        return (signal, field.joints, field.values.shape[1]) in known

    return [each for each in fields if each.source in said - {STATE} or follows(each)]


def _stamps(path: Path, info: dict[str, Any], table: Any, reading: Reading) -> Stamps:
    """Take whole frames where the stamps are: they are float32, too coarse for a long episode."""
    rate = reading.rate or info.get("fps")
    frames = table.column(FRAME).to_numpy() if FRAME in table.column_names else None
    if STAMP in table.column_names:
        logged = table.column(STAMP).to_numpy().astype(np.float64)
        if not np.isfinite(logged).all():
            raise LogError(path, f"column {STAMP!r} holds a value that is not finite")
        if frames is None or not rate or (np.abs(logged - frames / rate) > TOLERANCE).any():
            return Stamps.of_nanoseconds(np.round(logged * 1e9).astype(np.int64))
    if not isinstance(rate, int | float) or rate <= 0:
        raise LogError(path, "meta/info.json says no fps; say the rate (--rate)")
    return Stamps.every(1 / rate, len(table))


def _info(home: Path) -> dict[str, Any]:
    path = home / "meta" / "info.json"
    try:
        info = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise LogError(path, f"cannot be read ({error})") from error
    if not isinstance(info, dict) or not isinstance(info.get("features"), dict):
        raise LogError(path, "names no features")
    return info


def _home(path: Path) -> Path:
    return next(
        folder for folder in path.resolve().parents[:3] if (folder / "meta" / "info.json").is_file()
    )


def _listing(info: dict[str, Any], episodes: int) -> tuple[str, ...]:
    rows = [f"{episodes} episodes at {info.get('fps', 'unknown')} Hz"]
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
