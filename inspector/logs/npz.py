"""NumPy files: run files, archives of simulators' arrays, and others by mapping."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.format import MAGIC_PREFIX
from numpy.typing import NDArray

from inspector.errors import LogError
from inspector.logs.arrays import episodes_of, log_of, single_numbers
from inspector.logs.log import Log, LogReader
from inspector.logs.mapping import ReadOptions
from noisemodel import Run, RunError, runfile
from noisemodel.run import check_time
from noisemodel.runfile import ARRAYS, STAGE

OBJECTS = (
    "Python objects, such as None, or PyBullet's joint states as they are; save numbers:"
    " np.savez(path, time=times, position=positions, velocity=velocities)"
)
SAMPLE = "noise-sample/"
SAMPLE_PROBLEM = (
    "holds the noise of a simulated run, not its motion: the folder of the data set is for"
    " `inspector train`, `tune` and `evaluate`; `inspector simulate run` writes runs"
)
ALONE = "array"
"""Name of the array in a .npy file, for a mapping."""


def open_log(path: Path, options: ReadOptions) -> LogReader:
    """Reader of an archive."""
    arrays = _arrays(path)
    if str(arrays.get("format", "")).startswith(SAMPLE):
        raise LogError(path, SAMPLE_PROBLEM)
    run = None
    if _is_run(arrays) and not (options.entries or options.units or options.joints):
        run = lambda: Run.load(path)  # noqa: E731
    return LogReader(
        "npz",
        tuple(episodes_of(arrays)),
        lambda episode, progress: _read(path, _arrays(path), options, episode),
        lambda: tuple(f"{name}  {each.dtype} {each.shape}" for name, each in _arrays(path).items()),
        run,
    )


def _arrays(path: Path) -> dict[str, NDArray[Any]]:
    try:
        with path.open("rb") as stream:
            if stream.read(len(MAGIC_PREFIX)) == MAGIC_PREFIX:
                stream.seek(0)
                array = np.asarray(runfile.read_array(stream, "it", path.stat().st_size))
                names = array.dtype.names or ()
                return {name: array[name] for name in names} if names else {ALONE: array}
        return runfile.read_npz(path)
    except OSError as error:
        raise LogError(path, f"cannot be read ({error.strerror or error})") from error
    except runfile.ObjectArrayError as error:
        problem = f"not an archive of plain arrays: {error.name!r} holds {OBJECTS}"
        raise LogError(path, problem) from error
    except runfile.ArchiveError as error:
        raise LogError(path, f"not an archive of plain arrays: {error}") from error


def _is_run(arrays: dict[str, NDArray[Any]]) -> bool:
    """Whether it is a run file with uniform time; one without is resampled."""
    known = all(name in ARRAYS or name.startswith(STAGE) for name in arrays)
    if not known or "time" not in arrays:
        return False
    try:
        check_time(arrays["time"])
    except (RunError, TypeError):
        return False
    return True


def _read(path: Path, arrays: dict[str, NDArray[Any]], options: ReadOptions, episode: str) -> Log:
    part = episodes_of(arrays)[episode]
    samples = max((len(each) for each in arrays.values() if each.ndim), default=0)
    joints = {
        ending: tuple(map(str, arrays[key].ravel()))
        for ending, key in (("", "joint_names"), ("_desired", "desired_joint_names"))
        if key in arrays and arrays[key].dtype.kind == "U"
    }
    kept = {
        name: each[part] if len(each) == samples else each
        for name, each in arrays.items()
        if each.ndim and each.dtype.kind in "iufM"
    }
    return log_of(
        path, kept, options, episode=episode, numbers=single_numbers(arrays), joints=joints
    )
