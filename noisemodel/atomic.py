"""Files that are written whole or not at all."""

import fcntl
import hashlib
import os
import platform
import re
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from uuid import uuid4

from noisemodel.errors import OutputError

TEMPORARY = re.compile(r"\.noise-inspector-([0-9a-f]{8})?[0-9a-f]{8}")
"""Names of temporary files, with the machine; those of model files, without, too."""
ABANDONED, ABANDONED_HERE = 86_400.0, 60.0
"""Ages from which a temporary file is one of a process that was killed, in [s]: on any machine that
shares the folder, and on this one, whose locks are known."""


_read: dict[Path, None] | None = None
"""What the running command reads; None outside of one, where programs decide for themselves."""


@contextmanager
def reading(paths: Iterable[Path]) -> Iterator[None]:
    """Name files that are read: while the block runs, no output replaces them, by any name."""
    global _read
    before = _read
    _read = {**(before or {}), **dict.fromkeys(paths)}
    try:
        yield
    finally:
        _read = before


def also_reading(paths: Iterable[Path]) -> None:
    """Add to the files of `reading`, such as the logs of a folder; nothing outside of its block."""
    if _read is not None:
        _read.update(dict.fromkeys(paths))


def refuse_read(path: str | Path) -> None:
    """Refuse an output that is a file that is read, or lies in a log that is a folder.

    Raises:
        OutputError: If it does, by device and inode, whatever its name is.
    """
    real = Path(os.path.realpath(path))
    if not _read or not real.exists():
        return
    places = [place.stat() for place in (real, *real.parents)]
    for each in _read:
        with suppress(FileNotFoundError, PermissionError):
            about = each.stat()
            if any(os.path.samestat(about, place) for place in places):
                raise OutputError(f"{path}: is read, too; choose another name for the output")


@contextmanager
def replacing(path: str | Path, *, overwrite: bool = False) -> Iterator[Path]:
    """Offer a temporary path beside ``path`` that takes its place only if the block succeeds.

    A link stays, and what it leads to is written. Of several that write one file at once and may
    not replace it, one succeeds. Temporary files that no process holds are deleted from the folder:
    after a minute without a change, or after a day if another machine may hold them.

    Args:
        path: The file to write.
        overwrite: Whether a file that exists may be replaced.

    Yields:
        The temporary path to write to, in the same folder.

    Raises:
        OutputError: If ``path`` exists and may not be replaced, or cannot be written.
    """
    path = Path(path)
    refuse_existing(path, overwrite=overwrite)
    if path.is_symlink():
        path = Path(os.path.realpath(path))
    _sweep(path.parent.absolute())
    temporary = path.with_name(f".noise-inspector-{_machine()}{uuid4().hex[:8]}")
    try:  # with the permissions that the umask leaves to any file
        held = os.open(temporary, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error
    try:
        _lock(held)  # a live recording may wait for its next sample for days
        yield temporary
        _place(temporary, path, overwrite=overwrite)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from error
    finally:
        temporary.unlink(missing_ok=True)
        os.close(held)


def _lock(file: int) -> bool:
    """Lock an open file; whether nobody else has. It ends with the process."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks: age alone decides
        return True
    return True


def _place(temporary: Path, path: Path, *, overwrite: bool) -> None:
    """Give a file its final name, which another process may have taken since it was checked."""
    if not overwrite:
        try:
            os.link(temporary, path)
            return
        except FileExistsError:
            raise _exists(path) from None
        except OSError:  # a file system without hard links: the name is claimed by an empty file
            try:
                path.open("xb").close()
            except FileExistsError:
                raise _exists(path) from None
    temporary.replace(path)


def _exists(path: Path) -> OutputError:
    return OutputError(
        f"{path}: exists already; choose another name, or overwrite it (--overwrite)"
    )


@cache
def _sweep(folder: Path) -> None:
    """Delete what processes that were killed have left in a folder, once per process."""
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if found := TEMPORARY.fullmatch(entry.name):
                age = ABANDONED_HERE if found[1] == _machine() else ABANDONED
                with suppress(OSError):
                    if time.time() - entry.stat().st_mtime > age and _is_left(entry.path):
                        Path(entry.path).unlink()


@cache
def _machine() -> str:
    """This machine since it was started, as 8 hexadecimal digits."""
    try:
        name = Path("/proc/sys/kernel/random/boot_id").read_text()
    except OSError:
        name = platform.node()
    return hashlib.sha256(name.encode()).hexdigest()[:8]


def _is_left(path: str) -> bool:
    """Whether no process holds a temporary file."""
    file = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    try:
        return _lock(file)
    finally:
        os.close(file)


def refuse_existing(path: str | Path, *, overwrite: bool = False) -> None:
    """Refuse an output before long work is done for it.

    Args:
        path: The file that will be written.
        overwrite: Whether a file that exists may be replaced.

    Raises:
        OutputError: If ``path`` exists and may not be replaced, is a folder, a device or a pipe, is
            read (`reading`), or has no folder.
    """
    path = Path(path)
    if path.is_dir():
        raise OutputError(f"{path}: is a folder; name a file")
    if path.exists() and not path.is_file():
        raise OutputError(f"{path}: is no regular file; name one")
    refuse_read(path)
    if path.exists() and not overwrite:
        raise _exists(path)
    if not path.parent.is_dir():
        raise OutputError(f"{path}: cannot be written (No such file or directory: {path.parent})")
