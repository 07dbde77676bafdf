"""Files: written whole or not at all, read within limits, and the cache of what takes long."""

import errno
import hashlib
import io
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias
from uuid import uuid4
from xml.etree import ElementTree as ET
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from noisemodel.types import NoiseModelError, OutputError, RobotError

Arrays: TypeAlias = dict[str, NDArray[Any]]

EXISTS = "{}: exists already; choose another name, or overwrite it (--overwrite)"

# Joints of a robot or a run, columns of a CSV log, triangles of a mesh, bodies and geoms of an
# MJCF.
LIMITS = MappingProxyType(
    {"joints": 1000, "columns": 10_000, "triangles": 2_000_000, "bodies": 20_000}
)
PREFIX = "NOISE_LIMIT_"  # of environment variables with other limits: NOISE_LIMIT_JOINTS=2000
MAX_BYTES = 64 * 2**20  # most bytes of a URDF or an MJCF
MAX_DEPTH = 500  # most elements of XML within each other, as in MuJoCo; parsers that recurse crash
MAX_ATTRIBUTES = 200  # most attributes of an element; Pinocchio compares each with all others
DIGEST = 32  # bytes after a cached archive that show that it is whole, and made for its key

# What the running command reads; None outside of one, where programs decide for themselves.
_read: dict[Path, None] | None = None


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
    """Refuse an output that is a file that is read, or lies in a log that is a folder."""
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
    not replace it, one succeeds.
    """
    path = Path(path)
    refuse_existing(path, overwrite=overwrite)
    if path.is_symlink():
        path = Path(os.path.realpath(path))
    temporary = path.with_name(f".noise-inspector-{uuid4().hex[:8]}")
    try:
        temporary.touch(exist_ok=False)  # with the permissions that the umask leaves to any file
        yield temporary
        if not overwrite:
            try:
                os.link(temporary, path)  # unless another process has taken the name
            except FileExistsError:
                raise
            except OSError:  # a file system without hard links: an empty file claims the name
                path.touch(exist_ok=False)
        temporary.replace(path)  # which does nothing where both are one file
    except FileExistsError:
        raise OutputError(EXISTS.format(path)) from None
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from error
    finally:
        temporary.unlink(missing_ok=True)


def write_whole(path: str | Path, content: str | bytes, *, overwrite: bool = False) -> None:
    """Write a file whole or not at all, text in UTF-8; see `replacing`."""
    # Names of files may be no text in UTF-8: these bytes are written out.
    data = content.encode(errors="backslashreplace") if isinstance(content, str) else content
    with replacing(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(data)


def refuse_existing(path: str | Path, *, overwrite: bool = False) -> None:
    """Refuse an output before long work is done for it, unless it may replace what exists."""
    path = Path(path)
    if path.is_dir():
        raise OutputError(f"{path}: is a folder; name a file")
    if path.exists() and not path.is_file():
        raise OutputError(f"{path}: is no regular file; name one")
    refuse_read(path)
    if path.exists() and not overwrite:
        raise OutputError(EXISTS.format(path))
    if not path.parent.is_dir():
        lost = FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT))
        raise OutputError(f"{path}: cannot be written ({lost.strerror}: {path.parent})") from lost


def limit(name: str) -> int:
    """A limit of ``LIMITS``, or what the environment has instead."""
    stated = os.environ.get(f"{PREFIX}{name.upper()}", "")
    if stated and not (stated.isascii() and stated.isdecimal() and len(stated) < 16):
        raise NoiseModelError(f"{PREFIX}{name.upper()} is {stated!r}, expected a whole number")
    return int(stated) if stated else LIMITS[name]


def beyond(name: str) -> str:
    """Words for what exceeds a limit: the limit, and how it is raised."""
    return f"the limit is {limit(name)} (--limit {name}=N raises it)"


def read_xml(path: Path, kind: str) -> ET.Element:
    """Root element of a robot's file, a ``kind`` of description."""
    try:
        if not path.is_file():
            raise RobotError(f"{path}: there is no such {kind} file")
        if path.stat().st_size > MAX_BYTES:
            raise RobotError(f"{path}: larger than {MAX_BYTES} bytes, no {kind} is")
        text = path.read_bytes()
    except OSError as error:
        raise RobotError(f"{path}: cannot be read ({error.strerror})") from error
    if not text.strip():
        raise RobotError(f"{path}: the {kind} is empty")
    try:
        root = parsed_xml(text)
        text.decode()  # names in other encodings reach no program
    except UnicodeDecodeError as error:
        raise RobotError(f"{path}: the {kind} is not in UTF-8 ({error.reason})") from error
    except ValueError as error:
        raise RobotError(f"{path}: {error}") from error
    return root


def parsed_xml(text: bytes) -> ET.Element:
    """Root element of XML in any encoding."""
    parser = expat.ParserCreate()
    depth = 0

    def refuse(*_: object) -> None:
        raise ValueError("no document type or entities are read")

    def enter(_: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if len(attributes) > MAX_ATTRIBUTES:
            raise ValueError(f"an element has more than {MAX_ATTRIBUTES} attributes")
        if depth > MAX_DEPTH:
            raise ValueError(f"elements are nested more than {MAX_DEPTH} deep")

    def leave(*_: object) -> None:
        nonlocal depth
        depth -= 1

    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler, parser.EndElementHandler = enter, leave
    try:
        parser.Parse(text, True)
        return ET.fromstring(text)  # noqa: S314
    except (expat.ExpatError, ET.ParseError, LookupError) as error:
        raise ValueError(f"not XML ({error})") from error


def cached(key: str, make: Callable[[], Arrays]) -> Arrays:
    """Arrays by a key: from the user's cache if it has them, or else made and kept.

    The key holds all that the arrays depend on, also the version of the code, in letters, digits
    and hyphens. A damaged file is made anew; a folder that others can write to, or that cannot be
    written to, is left alone. The cache may be deleted at any time.
    """
    try:
        file = cache_folder() / f"{key}.npz"
        file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        about = file.parent.stat()
    except (OSError, RuntimeError):  # the user has no home folder
        return make()
    if about.st_uid != os.getuid() or about.st_mode & 0o022:  # who knows whose arrays these are
        return make()
    with suppress(OSError, ValueError):  # what is damaged or made for another key is made anew
        content = file.read_bytes()
        archive, digest = content[:-DIGEST], content[-DIGEST:]
        if _digest(file, archive) == digest:
            with np.load(io.BytesIO(archive), allow_pickle=False) as kept:
                return dict(kept)
    arrays = make()
    with suppress(OSError, ValueError, OutputError):
        stream = io.BytesIO()
        np.savez(stream, allow_pickle=False, **arrays)
        write_whole(file, stream.getvalue() + _digest(file, stream.getvalue()), overwrite=True)
    return arrays


def cache_folder() -> Path:
    """The folder of cached meshes and surfaces (which need not exist)."""
    base = Path(os.environ.get("XDG_CACHE_HOME", ""))
    if not base.is_absolute():  # as the XDG base directory specification has it
        base = Path.home() / ".cache"
    return base / "noise-inspector" / "geometry"


def _digest(file: Path, archive: bytes) -> bytes:
    return hashlib.sha256(file.name.encode() + archive).digest()
