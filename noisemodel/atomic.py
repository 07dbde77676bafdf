"""Write a file whole or not at all."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from noisemodel.errors import OutputError


@contextmanager
def replacing(path: str | Path, *, overwrite: bool = False) -> Iterator[Path]:
    """Offer a temporary path beside ``path`` that takes its place only if the block succeeds.

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
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from error
    finally:
        temporary.unlink(missing_ok=True)


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
        raise OutputError(
            f"{path}: exists already; choose another name, or overwrite it (--overwrite)"
        )
    if not path.parent.is_dir():
        raise OutputError(f"{path}: cannot be written (No such file or directory: {path.parent})")


def _umask() -> int:
    """Read the process's umask (POSIX only tells it by setting it)."""
    mask = os.umask(0o077)
    os.umask(mask)
    return mask
