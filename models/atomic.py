"""Write a file whole or not at all."""

import os
import tempfile
from pathlib import Path

from models.errors import OutputError


def write_bytes(path: str | Path, content: bytes, *, overwrite: bool = False) -> None:
    """Write a file beside its place, and move it there when it is safely on the disk.

    Args:
        path: The file to write.
        content: What it shall hold.
        overwrite: Whether a file that exists may be replaced.

    Raises:
        OutputError: If ``path`` exists and may not be replaced, or cannot be written.
    """
    path = Path(path)
    if path.is_dir():
        raise OutputError(path, "is a folder; name a file")
    if path.exists() and not overwrite:
        raise OutputError(
            path, "exists already; choose another name, or overwrite it (--overwrite)"
        )
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    except OSError as error:
        raise OutputError(path, f"cannot be written ({error.strerror})") from error
    temporary = Path(name)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        temporary.chmod(0o644)  # a temporary file starts out readable by its owner only
        temporary.replace(path)
    except OSError as error:
        raise OutputError(path, f"cannot be written ({error.strerror or error})") from error
    finally:
        temporary.unlink(missing_ok=True)
