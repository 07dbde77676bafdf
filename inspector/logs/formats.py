"""Format of a log, detected from its content."""

from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TypeAlias

from inspector.errors import InspectorError, LogError
from inspector.logs.log import LogReader
from inspector.logs.options import ReadOptions
from noisemodel import archive

OpenLog: TypeAlias = Callable[[Path, ReadOptions], LogReader]

MAGIC = {
    b"\x89MCAP0\r\n": "ros.reader",
    b"SQLite format 3\x00": "ros.reader",
    b"#ROSBAG V": "ros.reader",
    b"PAR1": "parquet",
    b"\x89HDF\r\n\x1a\n": "hdf5",
    b"PK\x03\x04": "npz",
    b"PK\x05\x06": "npz",
    b"\x93NUMPY": "npz",
}
"""The first bytes of a file, and the module here that reads it; other files are CSV."""

NEEDS = {"ros.reader": (("rosbags", "mcap"), "ros"), "hdf5": (("h5py",), "hdf5")}
"""The libraries that a reader needs, and the extra that installs them."""


class MissingReaderError(InspectorError):
    """A log whose reader is not installed.

    Args:
        path: The log.
        library: The missing library.
        extra: The extra of this package that installs it.
    """

    def __init__(self, path: Path, library: str, extra: str) -> None:
        self.path, self.library, self.extra = path, library, extra
        super().__init__(
            f"{path}: {library} reads such logs and is not installed;"
            f" pip install 'noise-inspector[{extra}]'"
        )


def open_log(path: Path, options: ReadOptions) -> LogReader:
    """Reader of a log, chosen by its first bytes, or by the files in a folder.

    Args:
        path: A file, or the folder of a bag or a data set.
        options: How to read it.

    Raises:
        LogError: If there is no such file, or it cannot be read.
        MissingReaderError: If a library that reads such logs is not installed.
    """
    module = _of_folder(path) if path.is_dir() else _of_file(path)
    libraries, extra = NEEDS.get(module, ((), ""))
    for library in libraries:
        if find_spec(library) is None:
            raise MissingReaderError(path, library, extra)
    reader: OpenLog = import_module(f"inspector.logs.{module}").open_log
    return reader(path, options)


def is_one_log(folder: Path) -> bool:
    """Whether a folder is one log: a LeRobot data set, or a bag; not a folder of logs."""
    if (folder / "meta" / "info.json").is_file() or (folder / "metadata.yaml").is_file():
        return True
    files = [each for each in folder.iterdir() if not each.name.startswith(".")]
    return len(files) == 1 and files[0].suffix in (".mcap", ".db3")


def _of_file(path: Path) -> str:
    try:
        archive.check_regular(path)
        with path.open("rb") as stream:
            head = stream.read(16)
    except OSError as error:
        raise LogError(path, f"cannot be read ({error.strerror})") from error
    except archive.ArchiveError as error:
        raise LogError(path, str(error)) from error
    if head.startswith(b"PAR1") and _info_above(path):
        return "lerobot"
    return next((module for magic, module in MAGIC.items() if head.startswith(magic)), "csvlog")


def _of_folder(path: Path) -> str:
    if (path / "meta" / "info.json").is_file():
        return "lerobot"
    bags = (path / "metadata.yaml", *path.glob("*.mcap"), *path.glob("*.db3"))
    if any(each.is_file() for each in bags):
        return "ros.reader"
    raise LogError(
        path,
        "a folder that is neither a ROS 2 bag (metadata.yaml) nor a LeRobot data set"
        " (meta/info.json); name its files one by one",
    )


def _info_above(path: Path) -> bool:
    return any((folder / "meta" / "info.json").is_file() for folder in path.resolve().parents[:3])
