"""HDF5 logs, with a group per episode (robomimic, Isaac Lab) or a row per sample."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from inspector.errors import LogError
from inspector.logs.log import Field, Log, LogReader, Stamps
from inspector.logs.options import Entry, ReadOptions
from inspector.logs.signals import array_signal, listed
from inspector.logs.timestamps import stamps_at_rate, stamps_of, time_name

EPISODES = "data"
"""The group that holds the episodes."""

DAMAGE = (OSError, KeyError, RuntimeError, ValueError, TypeError)
"""Errors that h5py raises for damaged files."""

RELATIVE = "obs/joint_pos may be relative to a default pose (Isaac Lab)"

STATES = re.compile(r"states/articulation/(?P<robot>[^/]+)/(?P<what>root_pose|root_velocity)")
"""Isaac Lab's base pose, with the quaternion w, x, y, z, and base velocity in world axes."""


def open_log(path: Path, options: ReadOptions) -> LogReader:
    """Reader of an HDF5 file.

    Args:
        path: The file.
        options: How to read it.

    Raises:
        LogError: If it cannot be read.
    """
    try:
        with h5py.File(path) as file:
            group = file.get(EPISODES)
            episodes = _episodes(group) if isinstance(group, h5py.Group) else ("",)
    except DAMAGE as error:
        raise LogError(path, f"damaged or cut off ({_one_line(error)})") from error
    return LogReader(
        "HDF5",
        episodes,
        lambda episode, progress: _read(path, options, episode),
        lambda: _listing(path, episodes),
    )


def _episodes(group: Any) -> tuple[str, ...]:
    groups = [name for name, each in group.items() if isinstance(each, h5py.Group)]
    numbered = sorted(groups, key=lambda name: [int(n) for n in re.findall(r"\d+", name)])
    return tuple(numbered) or ("",)


def _read(path: Path, options: ReadOptions, episode: str) -> Log:
    try:
        with h5py.File(path) as file:
            group = file[f"{EPISODES}/{episode}"] if episode else file
            arrays = dict(_arrays(group))
            rate = options.rate or _rate(file.get(EPISODES, file).attrs.get("env_args"))
    except DAMAGE as error:
        raise LogError(path, f"{episode or 'it'} is damaged ({_one_line(error)})") from error
    time = time_name((name for name, each in arrays.items() if each.ndim == 1), options)
    motion = [each for name, each in arrays.items() if _is_motion(name, options)]
    if not motion:
        raise LogError(
            path,
            f"{episode or 'the file'} holds no known joint positions or velocities; name them,"
            f" such as --map position=obs/q; it has {listed(sorted(arrays))}",
        )
    samples = len(motion[0])
    if time:
        stamps = stamps_of(path, time, arrays[time], options.rate)
    elif rate:
        stamps = Stamps.every(1 / rate, samples)
    else:
        stamps = stamps_at_rate(path, samples, options, arrays)
    fields = [
        Field(
            name,
            each.reshape(samples, -1),
            stamps,
            source=path.name,
            rank=0 if name.startswith("states/") else 1,
        )
        for name, each in arrays.items()
        if len(each) == len(stamps.time) == samples and each.ndim <= 2 and name != time
    ]
    relative = "obs/joint_pos" in arrays and not any(n.startswith("states/") for n in arrays)
    return Log(
        path,
        tuple(fields),
        episode,
        remarks=(RELATIVE,) if relative else (),
        suggested=tuple(_suggested(arrays)),
    )


def _arrays(group: Any) -> Iterator[tuple[str, Any]]:
    """Numeric arrays of one or two dimensions, with their names within the group."""
    found: list[tuple[str, Any]] = []

    def visit(name: str, each: Any) -> None:
        if isinstance(each, h5py.Dataset) and each.dtype.kind in "iuf" and 1 <= each.ndim <= 2:
            found.append((name, each))

    group.visititems(visit)
    for name, dataset in found:
        values = dataset[()]
        yield name, values if values.dtype.kind == "f" else values.astype(np.float64)


def _is_motion(name: str, options: ReadOptions) -> bool:
    mapped = {entry.part()[0] for entry in options.entries if entry.signal != "time"}
    return name in mapped or array_signal(name) is not None


def _suggested(arrays: dict[str, Any]) -> Iterator[Entry]:
    robots = {match["robot"] for name in arrays if (match := STATES.fullmatch(name))}
    chosen = "robot" if "robot" in robots else min(robots, default="")
    for signal, convention, what in (
        ("base_pose", "wxyz", "root_pose"),
        ("base_velocity", "world", "root_velocity"),
    ):
        name = f"states/articulation/{chosen}/{what}"
        if name in arrays:
            yield Entry(signal, convention, name)


def _rate(env_args: Any) -> float | None:
    """Control rate in [Hz] from the environment's arguments of robomimic or Isaac Lab."""
    try:
        args = json.loads(env_args)
        if frequency := args.get("env_kwargs", {}).get("control_freq"):
            return float(frequency)
        sim = args.get("sim_args", {})
        return 1 / (float(sim["dt"]) * float(sim["decimation"]))
    except (TypeError, ValueError, KeyError, AttributeError, ZeroDivisionError):
        return None


def _listing(path: Path, episodes: tuple[str, ...]) -> tuple[str, ...]:
    with h5py.File(path) as file:
        group = file[f"{EPISODES}/{episodes[0]}"] if episodes[0] else file
        rows = [f"{len(episodes)} episodes: {listed(episodes)}"] if episodes[0] else []
        group.visititems(
            lambda name, each: (
                rows.append(f"{name}  {each.dtype} {each.shape}")
                if isinstance(each, h5py.Dataset)
                else None
            )
        )
    return tuple(rows)


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())
