"""NumPy archives: run files, arrays of MuJoCo and Isaac, and others by mapping."""

import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inspector.errors import LogError
from inspector.logs.log import Field, Log, LogReader
from inspector.logs.options import Entry, ReadOptions
from inspector.logs.signals import array_signal, listed
from inspector.logs.timestamps import stamps_at_rate, stamps_of, time_name
from noisemodel import Run, RunError, checks
from noisemodel.runfile import ARRAYS, DAMAGE, MAX_BYTES, STAGE


def open_log(path: Path, options: ReadOptions) -> LogReader:
    """Reader of an archive.

    Args:
        path: The file.
        options: How to read it.

    Raises:
        LogError: If it is not an archive of plain arrays.
    """
    arrays = _arrays(path)
    run = None
    if _is_run(arrays) and not options.entries:
        run = lambda: Run.load(path)  # noqa: E731
    return LogReader(
        "npz",
        ("",),
        lambda _, progress: _read(path, _arrays(path), options),
        lambda: tuple(f"{name}  {each.dtype} {each.shape}" for name, each in _arrays(path).items()),
        run,
    )


def _arrays(path: Path) -> dict[str, NDArray[Any]]:
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(member.file_size for member in archive.infolist())
        if size > MAX_BYTES:
            raise LogError(path, f"unpacks to {size} bytes; the limit is {MAX_BYTES}")
        with np.load(path, allow_pickle=False) as archive:
            return {name: np.asarray(archive[name]) for name in archive.files}
    except LogError:
        raise
    except (OSError, ValueError, KeyError, zipfile.BadZipFile, *DAMAGE) as error:
        problem = " ".join(str(error).split()) or type(error).__name__
        raise LogError(path, f"not an archive of plain arrays ({problem})") from error


def _is_run(arrays: dict[str, NDArray[Any]]) -> bool:
    """Whether it is a run file with uniform time; one without is resampled."""
    known = all(name in ARRAYS or name.startswith(STAGE) for name in arrays)
    if not known or "time" not in arrays:
        return False
    try:
        checks.check_time(arrays["time"])
    except (RunError, TypeError):
        return False
    return True


def _read(path: Path, arrays: dict[str, NDArray[Any]], options: ReadOptions) -> Log:
    numbers = {
        name: each if each.dtype.kind == "f" else each.astype(np.float64)
        for name, each in arrays.items()
        if each.dtype.kind in "iuf" and each.ndim in (1, 2)
    }
    suggested = tuple(_suggested(numbers))
    mapped = {entry.part()[0] for entry in (*options.entries, *suggested) if entry.signal != "time"}
    motion = [each for name, each in numbers.items() if name in mapped or array_signal(name)]
    time = time_name((name for name, each in arrays.items() if each.ndim == 1), options)
    if not motion:
        raise LogError(
            path,
            "holds no known joint positions or velocities; name them, such as --map"
            f" position=qpos[7:]; it has {listed(sorted(arrays))}",
        )
    samples = len(motion[0])
    if time:
        stamps = stamps_of(path, time, arrays[time], options.rate)
    else:
        stamps = stamps_at_rate(path, samples, options, arrays)
    samples = len(stamps.time)
    for name, each in numbers.items():
        if (name in mapped or array_signal(name)) and len(each) != samples:
            transposed = each.ndim == 2 and each.shape[1] == samples
            hint = "; samples come first, is it transposed?" if transposed else ""
            problem = f"{name!r} has shape {each.shape}, there are {samples} stamps{hint}"
            raise LogError(path, problem)
    names = {
        suffix: tuple(map(str, arrays[key].ravel()))
        for suffix, key in (("", "joint_names"), ("_desired", "desired_joint_names"))
        if key in arrays and arrays[key].dtype.kind == "U"
    }
    fields = []
    for name, each in numbers.items():
        if name != time and len(each) == samples:
            values = each.reshape(samples, -1)
            joints = names.get("", ())
            if (array_signal(name) or "").endswith("_desired"):
                joints = names.get("_desired", joints)
            matching = joints if len(joints) == values.shape[1] else ()
            fields.append(Field(name, values, stamps, joints=matching, source=path.name))
    read = {field.name for field in fields} | {time, "joint_names", "desired_joint_names"}
    not_read = tuple(name for name in arrays if name not in read)
    return Log(path, tuple(fields), not_read=not_read, suggested=suggested)


def _suggested(arrays: dict[str, NDArray[Any]]) -> Iterator[Entry]:
    """Mapping of MuJoCo's state: a floating base, if there is one, then the joints."""
    qpos, qvel = (arrays.get(name) for name in ("qpos", "qvel"))
    if qpos is None or qpos.ndim != 2:
        return
    free = qpos.shape[1] >= 7 and _are_quaternions(qpos[:, 3:7])
    free = free and (qvel is None or (qvel.ndim == 2 and qvel.shape[1] == qpos.shape[1] - 1))
    if free:
        yield Entry("base_pose", "wxyz", "qpos[0:7]")
    if qpos.shape[1] > 7 * free:
        yield Entry("position", "", f"qpos[{7 * free}:]")
    if qvel is not None and qvel.ndim == 2:
        if free:
            yield Entry("base_velocity", "mujoco", "qvel[0:6]")
        if qvel.shape[1] > 6 * free:
            yield Entry("velocity", "", f"qvel[{6 * free}:]")


def _are_quaternions(quaternions: NDArray[Any]) -> bool:
    length = np.linalg.norm(quaternions, axis=1)
    return bool((np.abs(length - 1) < 0.01).all())
