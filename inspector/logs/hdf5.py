"""HDF5 logs, with a group for each episode (robomimic, Isaac Lab, Minari) or a row per sample.

MATLAB's files of version 7.3 are HDF5 too: structs are groups, and arrays are transposed.
"""

import re
from collections.abc import Collection, Mapping
from functools import partial
from math import prod
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from inspector.errors import LogError
from inspector.logs import arrays
from inspector.logs.mapping import Log, LogReader, ReadOptions, errors_of
from inspector.logs.names import EPISODES, TIMES, listed
from inspector.text import counted
from noisemodel.runfile import check_unpacked

HOME = "data"  # the group that holds the episodes of robomimic and Isaac Lab
# Names of episodes in a file without that group: Minari's, ManiSkill's and others.
NUMBERED = re.compile(r"(demo|ep|episode|traj|trajectory|rollout|run)[_-]?\d+")
# Errors that h5py raises for damaged files.
DAMAGE = (OSError, KeyError, RuntimeError, ValueError, TypeError)
SMALL = 8 * 2**20  # bytes up to which a dataset is read whatever its name is
NAMES = {*TIMES, *EPISODES}

MATLAB = b"MATLAB 7.3"  # the first bytes of a file that MATLAB wrote
REFERENCES = "#refs#"  # the group in which MATLAB keeps the cells and objects of a file


def open_log(path: Path, options: ReadOptions) -> LogReader:
    """Reader of an HDF5 file."""
    with path.open("rb") as stream:
        is_matlab = stream.read(len(MATLAB)) == MATLAB
    with errors_of(path, DAMAGE), h5py.File(path) as file:
        home, episodes = _episodes(path, file, is_matlab=is_matlab)
    read = partial(_read, path, options, home, is_matlab=is_matlab)
    kind = "MATLAB 7.3" if is_matlab else "HDF5"
    return LogReader(kind, episodes, read, partial(_listing, path, home, episodes))


def _episodes(path: Path, file: Any, *, is_matlab: bool) -> tuple[str, tuple[str, ...]]:
    """Name of the group with a group for each episode, empty without one, and their names."""
    for home in (HOME, "/"):
        group = _own(path, file.get(home), file)
        if isinstance(group, h5py.Group) and not is_matlab:
            groups = {
                h5py.h5o.get_info(each.id).addr: name  # of many links to one group the last
                for name, each in group.items()
                if isinstance(each, h5py.Group)
            }
            if found := [n for n in groups.values() if home == HOME or NUMBERED.fullmatch(n)]:
                found.sort(key=lambda name: [int(number) for number in re.findall(r"\d+", name)])
                return home, tuple(found)
    flags = {name: file.get(name) for name in EPISODES}
    datasets = {name: each for name, each in flags.items() if isinstance(each, h5py.Dataset)}
    return "", tuple(arrays.episodes_of(_values(path, file, datasets)))


def _read(path: Path, options: ReadOptions, home: str, episode: str, *, is_matlab: bool) -> Log:
    with errors_of(path, DAMAGE, f"{episode or 'it'} is damaged"), h5py.File(path) as file:
        group = _own(path, file[f"{home}/{episode}"], file) if home else file
        datasets, left_out = _wanted(group, options)
        values = _values(path, file, datasets)
        attributes = {**_single(file.attrs), **_single(group.attrs)}
    if is_matlab:
        turned = {name: each.T for name, each in values.items()}
        return arrays.log_of_variables(path, turned, options)
    if not home:
        values = arrays.part_of(values, episode)
    numbers = {name: each for name, each in values.items() if each.dtype.kind in "iuf"}
    stated = arrays.stated_rate({**attributes, **values})
    return arrays.log_of(path, numbers, options, stated=stated, not_read=left_out)


def _single(attributes: Any) -> dict[str, Any]:
    """Attributes that state a rate or a step; others may be of any size, and are not read."""
    names = (*arrays.RATES, *arrays.STEPS)
    known = [written for name in names for written in (name, name.upper(), name.title())]
    about = {name: attributes.get_id(name) for name in known if name in attributes}
    return {
        name: attributes[name]
        for name, each in about.items()
        if each.dtype.kind in "iuf" and each.shape is not None and prod(each.shape) == 1
    }


def _own(path: Path, each: Any, file: Any) -> Any:
    """What a file has by a name, which may not be the content of another file."""
    if each is not None and each.file.filename != file.filename:
        raise LogError(path, f"{each.name!r} lies in another file ({each.file.filename})")
    if isinstance(each, h5py.Dataset) and (each.external or each.is_virtual):
        raise LogError(path, f"{each.name!r} is stored in other files; copy its numbers into one")
    return each


def _values(path: Path, file: Any, datasets: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
    """Read datasets that are in the file, or nearly so: a few bytes may state any shape."""
    own = {name: _own(path, each, file) for name, each in datasets.items()}
    check_unpacked(sum(int(each.nbytes) for each in own.values()), path.stat().st_size)
    return {name: np.atleast_1d(each[()]) for name, each in own.items()}


def _wanted(group: Any, options: ReadOptions) -> tuple[dict[str, Any], list[str]]:
    """Numeric datasets that may hold motion, by name, and names of large unknown ones."""
    mapped = {entry.part()[0] for entry in options.entries}
    found, left_out = dict[str, Any](), list[str]()
    for name, each in _datasets(group, mapped).items():
        if each.dtype.kind not in "iufb" or each.attrs.get("MATLAB_class") == b"char":
            continue
        if 1 <= each.ndim <= 2 or each.size == 1:
            if _is_known(name, mapped) or each.nbytes <= SMALL:
                found[name] = each
            else:
                left_out.append(name)
    return found, left_out


def _is_known(name: str, mapped: Collection[str]) -> bool:
    if name in mapped or name.rpartition("/")[2].lower() in NAMES:
        return True
    return arrays.meaning(name) not in ("", arrays.COPY) or bool(arrays.STATES.fullmatch(name))


def _datasets(group: Any, mapped: Collection[str]) -> dict[str, Any]:
    """Datasets in a group, each once, by a name that is known if one of its links has such."""
    found: dict[int, tuple[str, Any]] = {}
    seen, waiting = set[int](), [("", group)]
    while waiting:
        place, each = waiting.pop()
        for name in sorted(each):
            if name == REFERENCES or not isinstance(each.get(name, getlink=True), h5py.HardLink):
                continue
            inside, path = each[name], f"{place}{name}"
            address = h5py.h5o.get_info(inside.id).addr
            if isinstance(inside, h5py.Dataset):
                before = found.setdefault(address, (path, inside))[0]
                if _is_known(path, mapped) and not _is_known(before, mapped):
                    found[address] = (path, inside)
            elif isinstance(inside, h5py.Group) and address not in seen:
                seen.add(address)
                waiting.append((f"{path}/", inside))
    return dict(sorted(found.values(), key=lambda each: each[0]))


def _listing(path: Path, home: str, episodes: tuple[str, ...]) -> tuple[str, ...]:
    rows = [f"{counted(len(episodes), 'episode')}: {listed(episodes)}"] if episodes[0] else []
    with errors_of(path, DAMAGE, f"{episodes[0] or 'it'} is damaged"), h5py.File(path) as file:
        found = _datasets(file[f"{home}/{episodes[0]}"] if home else file, ())
        rows += (f"{name}  {each.dtype} {each.shape}" for name, each in found.items())
    return tuple(rows)
