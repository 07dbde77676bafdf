"""The state of a batch: one line of JSON per verdict, so that a killed batch resumes.

The first line is the header: models and settings. A verdict is appended as soon as it is there,
with the SHA-256 of its input. A line without its end was being written when the process was
killed: it is dropped. Of several verdicts on a run the last one of its present content counts.
Internal errors are not kept: these runs are tried again.
"""

import fcntl
import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from itertools import zip_longest
from pathlib import Path
from time import monotonic, sleep
from typing import IO, Any

from inspector.analysis.status import Status, Unknown
from inspector.analysis.verdict import Verdict
from inspector.errors import FileError, InspectorError
from inspector.localisation.order import Order
from inspector.localisation.stage import Localisation
from noiseclassifier import Event
from noiseclassifier.jsontext import from_json
from noisemodel import OutputError

KIND = "noise-classify-state/"
FORMAT = f"{KIND}1"

PATIENCE = 2.0
"""How long a file that another process holds is waited for, in [s]."""

SETTINGS = ("how logs are read", "--unknown", "--localise", "--report")
"""The first settings of a header; what follows are files that options name."""

MAX_BYTES = 256 * 2**20
"""Most bytes of a state file that is read: those of some hundred thousand runs."""


class StateError(FileError):
    """A state file that a batch cannot resume."""

    advice = "; name another file, or delete it"


@dataclass(eq=False)
class State:
    """The verdicts so far.

    Attributes:
        path: The file.
        verdicts: By run and SHA-256 of its content.
    """

    path: Path
    verdicts: dict[tuple[Path, str], Verdict]
    _file: IO[bytes]

    def add(self, verdict: Verdict, sha256: str) -> None:
        """Append a verdict, flushed to the disk.

        Raises:
            OutputError: If it cannot be written.
        """
        if verdict.status is not Status.INTERNAL_ERROR:
            _append(self.path, self._file, {"sha256": sha256, **_as_dict(verdict)})


@contextmanager
def opened(path: Path, settings: Mapping[str, Any]) -> Iterator[State]:
    """Open a state file to resume, or create it.

    Args:
        path: The file.
        settings: Models and settings, by name, as JSON can hold them.

    Yields:
        The state so far.

    Raises:
        StateError: If the file is no such file, is damaged, or of other models or settings.
        InspectorError: If another process is writing it.
        OutputError: If it cannot be written.
    """
    if path.exists() and not path.is_file():
        raise StateError(path, "is no regular file")
    try:
        file = path.open("a+b")
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from error
    with _closing(file):
        try:
            _lock(file)
        except OSError as error:
            raise InspectorError(
                f"{path}: is being written by another process; wait for it, or name another file"
            ) from error
        if os.fstat(file.fileno()).st_size > MAX_BYTES:
            raise StateError(path, f"is larger than {MAX_BYTES} bytes")
        file.seek(0)
        whole, end, torn = file.read().rpartition(b"\n")
        header = {"format": FORMAT, **settings}
        verdicts = {}
        if end:
            first, *rows = whole.split(b"\n")
            _check_header(path, first, header)
            for number, row in enumerate(rows, start=2):
                try:
                    content = from_json(row)
                    verdict = _verdict(content)
                    verdicts[verdict.path, content["sha256"]] = verdict
                except (ValueError, KeyError, TypeError, AttributeError) as error:
                    raise StateError(path, f"is damaged in line {number}") from error
        elif not json.dumps(header).encode().startswith(torn):
            raise StateError(path, "holds no state of classify")
        file.truncate(len(whole) + len(end))
        if not end:
            _append(path, file, header)
        yield State(path, verdicts, file)


def _lock(file: IO[bytes]) -> None:
    """Lock a file, once the workers of a process that was killed have ended.

    Raises:
        OSError: If another process still holds it after ``PATIENCE``.
    """
    until = monotonic() + PATIENCE
    while True:
        try:
            return fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            if monotonic() > until:
                raise
            sleep(0.02)


def digest(path: Path) -> str:
    """SHA-256 of a file, or of all names and files in a folder; empty if it cannot be read."""
    try:
        if path.is_file():
            with path.open("rb") as file:
                return hashlib.file_digest(file, "sha256").hexdigest()
        inside = sorted(each for each in path.rglob("*") if each.is_file())
        lines = [f"{each.relative_to(path)} {digest(each)}" for each in inside]
        return hashlib.sha256("\n".join(lines).encode()).hexdigest()
    except OSError:
        return ""


def _append(path: Path, file: IO[bytes], content: Mapping[str, Any]) -> None:
    try:
        file.write(json.dumps(content).encode() + b"\n")
        file.flush()
        os.fsync(file.fileno())
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from error


@contextmanager
def _closing(file: IO[bytes]) -> Iterator[None]:
    """Close a file in the end; what it could not write has been said by then."""
    try:
        yield
    finally:
        with suppress(OSError):
            file.close()


def _check_header(path: Path, line: bytes, header: Mapping[str, Any]) -> None:
    try:
        there = from_json(line)
    except ValueError:
        there = None
    form = there.get("format") if isinstance(there, dict) else None
    if not isinstance(there, dict) or not str(form).startswith(KIND):
        raise StateError(path, "holds no state of classify")
    if form != header["format"]:
        raise StateError(path, f"is of format {form}, this version writes {header['format']}")
    there = {"version": header.get("version"), **there}  # 0.5.0 wrote none
    for name, value in header.items():
        if there.get(name) != value:
            raise StateError(path, f"is of {_difference(name, there.get(name), value)}")


def _difference(name: str, there: Any, here: Any) -> str:
    """What of a header differs, in words."""
    if name == "version":
        return f"another version ({there}, this is {here})"
    if name != "settings" or not isinstance(there, list):
        return f"other {name}"
    differs = [one != two for one, two in zip_longest(there, here)]
    named = [what for what, other in zip(SETTINGS, differs, strict=False) if other]
    return f"other settings ({', '.join(named or ['the file of an option'])})"


def _as_dict(verdict: Verdict) -> dict[str, Any]:
    return {
        "run": str(verdict.path),
        "status": verdict.status.value,
        "unknown": verdict.unknown.value,
        "events": [
            {
                **asdict(event),
                "localisation": event in verdict.localisations
                and asdict(verdict.localisations[event]),
                "order": event in verdict.orders and asdict(verdict.orders[event]),
            }
            for event in verdict.events
        ],
        "picture": None if verdict.picture is None else str(verdict.picture),
        **{name: getattr(verdict, name) for name in PLAIN},
    }


PLAIN = (
    "model",
    "message",
    "model_sha256",
    "assumed",
    "scenario",
    "begin",
    "duration",
    "seconds",
    "lost",
)
"""Attributes of a verdict that JSON can hold as they are."""


def _verdict(content: Mapping[str, Any]) -> Verdict:
    localisations, orders, events = {}, {}, []
    for row in content["events"]:
        localisation, order = row.pop("localisation"), row.pop("order")
        event = Event(**row)
        events.append(event)
        if order:
            orders[event] = Order(**order)
        if localisation:
            joints = tuple((name, share) for name, share in localisation.pop("joints"))
            band = localisation.pop("band")
            localisations[event] = Localisation(
                **localisation, joints=joints, band=None if band is None else tuple(band)
            )
    content = {"begin": 0.0, **content}  # which earlier versions have not written
    plain = {name: content[name] for name in PLAIN}
    _check_types(content["run"], plain, (*events, *orders.values()), localisations.values())
    return Verdict(
        Path(content["run"]),
        Status(content["status"]),
        events=tuple(events),
        unknown=Unknown(content["unknown"]),
        localisations=localisations,
        orders=orders,
        picture=None if content["picture"] is None else Path(content["picture"]),
        **{**plain, "lost": tuple(plain["lost"])},
    )


def _check_types(
    run: str, plain: Mapping[str, Any], shown: Iterable[object], found: Iterable[Localisation]
) -> None:
    """Write a verdict as it will be printed, once.

    Raises:
        TypeError: If a text is no text.
        ValueError: If a number is no number.
    """
    texts = [run, *(plain[name] for name in PLAIN[:5]), *plain["lost"], *map(str, shown)]
    numbers = [plain["begin"], plain["duration"], plain["seconds"]]
    for each in found:
        texts += [each.stage, each.following, *(name for name, _ in each.joints)]
        numbers += [each.lag, *(share for _, share in each.joints), *(each.band or ())]
        numbers += [] if each.onset is None else [each.onset]
    " ".join(texts)
    " ".join(f"{number:.3f}" for number in numbers)
