"""Cache of arrays that take long to make, in the user's cache folder."""

import hmac
import io
import os
import stat
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from noisemodel.atomic import replacing
from noisemodel.errors import OutputError

Arrays: TypeAlias = dict[str, NDArray[Any]]

DIGEST = 32
"""Bytes after the archive that show whether it is whole, and was made by this user for its key."""


def cached(key: str, make: Callable[[], Arrays]) -> Arrays:
    """Arrays by a key: from the cache if it has them, or else made and kept.

    A cache is a convenience: a file that is damaged, or comes from elsewhere, is made anew, a
    folder that cannot be written to is left alone. It may be deleted at any time.

    Args:
        key: All that the arrays depend on, the version of the code that makes them included; also
            the file's name. Letters, digits and hyphens.
        make: Makes the arrays; what it raises is passed on, and nothing is kept.

    Returns:
        The arrays by name, as ``make`` returns them.
    """
    try:
        file = folder() / f"{key}.npz"
    except RuntimeError:  # the user has no home folder
        return make()
    try:
        return _read(file)
    except (OSError, ValueError):
        arrays = make()
    with suppress(OSError, ValueError, OutputError):
        file.parent.mkdir(parents=True, exist_ok=True)
        _write(file, arrays)
    return arrays


def _read(file: Path) -> Arrays:
    content = file.read_bytes()
    archive, digest = content[:-DIGEST], content[-DIGEST:]
    if not hmac.compare_digest(_digest(file, archive), digest):
        raise ValueError("damaged, or from elsewhere")
    with np.load(io.BytesIO(archive), allow_pickle=False) as kept:
        return dict(kept)


def _write(file: Path, arrays: Arrays) -> None:
    archive = io.BytesIO()
    np.savez(archive, allow_pickle=False, **arrays)
    content = archive.getvalue()
    with replacing(file, overwrite=True) as temporary:
        temporary.write_bytes(content + _digest(file, content))


def _digest(file: Path, archive: bytes) -> bytes:
    """A digest that only this user can make, so that nobody else's arrays are taken for ours."""
    return hmac.digest(_secret(file.parent.parent), file.name.encode() + archive, "sha256")


def _secret(parent: Path) -> bytes:
    """The user's secret, made when it is first needed.

    Raises:
        OSError: If it can be neither read nor made.
        ValueError: If others can read it.
    """
    file = parent / "secret"
    with suppress(FileExistsError):
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL
        parent.mkdir(parents=True, exist_ok=True)
        with os.fdopen(os.open(file, flags, 0o600), "wb") as stream:
            stream.write(os.urandom(DIGEST))
    about = file.stat()
    if about.st_uid != os.getuid() or stat.S_IMODE(about.st_mode) & 0o077:
        raise ValueError("others can read the secret")
    secret = file.read_bytes()
    if len(secret) != DIGEST:
        raise ValueError("the secret is being written, or was cut off")
    return secret


def folder() -> Path:
    """The folder of cached surfaces (which need not exist).

    Raises:
        RuntimeError: If the user has no home folder.
    """
    base = Path(os.environ.get("XDG_CACHE_HOME", ""))
    if not base.is_absolute():  # as the XDG base directory specification has it
        base = Path.home() / ".cache"
    return base / "noise-inspector" / "surfaces"
