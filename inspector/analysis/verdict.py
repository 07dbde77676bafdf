"""Verdicts on files: what `classify` prints of an analysis, without its arrays."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import models
import noisemodel as nm
from inspector.analysis.analyse import Analysis, analyse, analyse_noise
from inspector.analysis.status import EXIT, Status, Unknown
from inspector.errors import InspectorError, without_path
from inspector.library import Library
from inspector.logs.opening import Reading, Source, open_source
from models import Event
from noisemodel.parallel import each

if TYPE_CHECKING:
    from inspector.localisation.localise import Localisation
    from inspector.localisation.order import Order

EXPECTED = (InspectorError, models.ModelsError, nm.NoiseModelError)
"""The errors that are printed in one line; all others are bugs."""


@dataclass(frozen=True)
class Verdict:
    """What was found in one file.

    Attributes:
        path: The file.
        status: The outcome.
        model: Name of the model that labelled, empty if none could.
        events: Findings, in order.
        message: A line that says more, may be empty.
        localisations: The localisation of each finding, if it was requested.
        unknown: What became of `unknown` frames.
        model_sha256: SHA-256 of the model's file, empty without.
        orders: Of the findings whose vibration goes with the speed of a joint.
        assumed: What was assumed when its log was read, in a line; empty of a run file.
    """

    path: Path
    status: Status
    model: str = ""
    events: tuple[Event, ...] = ()
    message: str = ""
    localisations: Mapping[Event, "Localisation"] = field(default_factory=dict)
    unknown: Unknown = Unknown.FINDING
    model_sha256: str = ""
    orders: Mapping[Event, "Order"] = field(default_factory=dict)
    assumed: str = ""

    @classmethod
    def of(cls, path: Path, analysis: Analysis, *, localise: bool = False) -> "Verdict":
        """Take from an analysis what is printed.

        Args:
            path: The file that it is of.
            analysis: The analysis.
            localise: Whether to localise each finding.
        """
        known = analysis.localisations if localise and analysis.findings else {}
        return cls(
            path,
            analysis.status,
            analysis.model,
            analysis.findings,
            analysis.message,
            {event: known[event] for event in analysis.findings if event in known},
            analysis.unknown,
            analysis.model_sha256,
            analysis.orders,
            analysis.assumed,
        )


def classify_file(
    path: Path | Source,
    library: Library,
    *,
    reading: Reading | None = None,
    unknown: Unknown = Unknown.FINDING,
    localise: bool = False,
) -> Verdict:
    """Classify one file; expected errors become part of the verdict.

    Args:
        path: A run file, any log that `inspector import` reads, or one of NoisyTest's two-column
            logs (``*.log``).
        library: Models to choose from.
        reading: How logs are read.
        unknown: Whether out-of-distribution frames below the alarm threshold are findings.
        localise: Whether to localise each finding.

    Returns:
        The verdict.
    """
    source = path if isinstance(path, Source) else Source(path)
    try:
        if source.path.suffix == ".log" and not _has_header(source.path):
            analysis = analyse_noise(*models.read_log(source.path), library, unknown=unknown)
        else:
            opened = open_source(source, reading)
            analysis = analyse(opened.run, library, unknown=unknown)
            analysis = replace(analysis, assumed=opened.assumed)
        return Verdict.of(source.shown, analysis, localise=localise)
    except EXPECTED as error:
        message = without_path(error, source.path)
        return Verdict(source.shown, Status.BAD_INPUT, message=message, unknown=unknown)


def classify_files(
    paths: Sequence[Path | Source],
    library: Library,
    *,
    reading: Reading | None = None,
    unknown: Unknown = Unknown.FINDING,
    localise: bool = False,
    jobs: int = 1,
) -> Iterator[Verdict]:
    """Classify many files; one bad file never stops the rest.

    Args:
        paths: The files, see `classify_file`.
        library: Models to choose from.
        reading: How logs are read.
        unknown: Whether out-of-distribution frames below the alarm threshold are findings.
        localise: Whether to localise each finding.
        jobs: How many to work on at once.

    Returns:
        A verdict per file, in their order.
    """
    one = partial(
        classify_file, library=library, reading=reading, unknown=unknown, localise=localise
    )
    return each(one, paths, jobs=jobs)


def _has_header(path: Path) -> bool:
    """Whether a text begins with a line of names: NoisyTest's logs have two numbers a line."""
    with suppress(OSError), path.open(encoding="utf-8", errors="replace") as stream:
        for line in stream:
            content = line.partition("#")[0].strip()
            if content:
                return len(re.split(r"[,;\s]+", content)) > 2 or content[0].isalpha()
    return False


def exit_status(verdicts: Iterable[Verdict]) -> int:
    """Take the worst of several: bad input, findings, cannot tell, ok."""
    statuses = {verdict.status for verdict in verdicts}
    return next((code for status, code in EXIT.items() if status in statuses), 0)
