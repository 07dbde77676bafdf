"""Files that are written whole or not at all."""

import os
import re
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from uuid import uuid4

from noisemodel.errors import OutputError

TEMPORARY = re.compile(r"\.noise-inspector-[0-9a-f]{8}")
"""Names of temporary files; those of `models.modelfile` too."""
ABANDONED = 86_400.0
"""Age from which a temporary file is one of a process that was killed, in [s]."""


@contextmanager
def replacing(path: str | Path, *, overwrite: bool = False) -> Iterator[Path]:
    """Offer a temporary path beside ``path`` that takes its place only if the block succeeds.

    Of several that write one file at once and may not replace it, one succeeds. Temporary files
    that have not changed for a day are deleted from the folder.

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
    _sweep(path.parent.absolute())
    temporary = path.with_name(f".noise-inspector-{uuid4().hex[:8]}")
    try:
        temporary.touch(exist_ok=False)  # with the permissions that the umask leaves to any file
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error
    try:
        yield temporary
        _place(temporary, path, overwrite=overwrite)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from error
    finally:
        temporary.unlink(missing_ok=True)


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
            if TEMPORARY.fullmatch(entry.name):
                with suppress(OSError):
                    if time.time() - entry.stat().st_mtime > ABANDONED:
                        Path(entry.path).unlink()


def refuse_existing(path: str | Path, *, overwrite: bool = False) -> None:
    """Refuse an output before long work is done for it.

    Args:
        path: The file that will be written.
        overwrite: Whether a file that exists may be replaced.

    Raises:
        OutputError: If ``path`` exists and may not be replaced, is a folder, or has no folder.
    """
    path = Path(path)
    if path.is_dir():
        raise OutputError(f"{path}: is a folder; name a file")
    if path.exists() and not overwrite:
        raise _exists(path)
    if not path.parent.is_dir():
        raise OutputError(f"{path}: cannot be written (No such file or directory: {path.parent})")
