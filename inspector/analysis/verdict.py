"""What CI wants to know of a run: status, events, one line why."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from pathlib import Path

import models
import noisemodel as nm
from inspector.audit import audit, shortcomings, summary
from inspector.errors import InspectorError
from inspector.library import CannotTellError, Labelled, Library, label_noise, label_run
from inspector.parallel import each

EXPECTED = (InspectorError, models.ModelsError, nm.NoiseModelError)
"""The errors that are told in one line; all others are bugs."""


class Status(StrEnum):
    """How a run fared."""

    OK = "ok"
    FINDINGS = "findings"
    CANNOT_TELL = "cannot-tell"
    BAD_INPUT = "bad-input"


EXIT = {Status.BAD_INPUT: 3, Status.FINDINGS: 1, Status.CANNOT_TELL: 4, Status.OK: 0}
"""Exit status of each, the worst first."""


@dataclass(frozen=True)
class Verdict:
    """What was found in one run.

    Attributes:
        path: The file.
        status: How it fared.
        model: Name of the model that looked, empty if none could.
        events: Findings, in order.
        message: A line that says more, may be empty.
    """

    path: Path
    status: Status
    model: str = ""
    events: tuple[models.Event, ...] = ()
    message: str = ""


def judge(path: Path, library: Library) -> Verdict:
    """Classify one file; expected errors become part of the verdict.

    Args:
        path: A run file, or one of NoisyTest's two-column logs (``*.log``).
        library: Models to choose from.

    Returns:
        The verdict.
    """
    try:
        return _verdict(path, library)
    except CannotTellError as error:
        return Verdict(path, Status.CANNOT_TELL, message=str(error))
    except EXPECTED as error:
        message = str(error).removeprefix(f"{path}: ")
        return Verdict(path, Status.BAD_INPUT, message=message)


def exit_status(verdicts: Iterable[Verdict]) -> int:
    """Take the worst of several: bad input, findings, cannot tell, ok."""
    statuses = {verdict.status for verdict in verdicts}
    return next((code for status, code in EXIT.items() if status in statuses), 0)


def judge_all(paths: Sequence[Path], library: Library, *, jobs: int = 1) -> Iterator[Verdict]:
    """Classify many files; one bad file never stops the rest.

    Args:
        paths: The files.
        library: Models to choose from.
        jobs: How many to work on at once.

    Returns:
        A verdict per file, in their order.
    """
    return each(partial(judge, library=library), paths, jobs=jobs)


def _verdict(path: Path, library: Library) -> Verdict:
    if path.suffix == ".log":
        return _heard(path, label_noise(*models.read_log(path), library))
    run = nm.Run.load(path)
    labelled, seen = label_run(run, library), audit(run, library)
    if seen.blind and not labelled.labels.events():
        return Verdict(path, Status.CANNOT_TELL, labelled.model, message=" ".join(summary(seen)))
    return _heard(path, labelled, shortcomings(seen))


def _heard(path: Path, labelled: Labelled, remarks: Sequence[str] = ()) -> Verdict:
    events = labelled.labels.events()
    status = Status.FINDINGS if events else Status.OK
    message = " ".join(filter(None, (labelled.remark, *remarks)))
    return Verdict(path, status, labelled.model, events, message)
