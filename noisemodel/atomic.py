"""Files that are written whole or not at all."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4

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
    temporary = path.with_name(f".{path.name}.{uuid4().hex[:8]}")
    try:
        temporary.touch(exist_ok=False)  # with the permissions that the umask leaves to any file
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error
    try:
        yield temporary
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
