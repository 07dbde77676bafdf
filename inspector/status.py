"""Statuses of runs and their exit statuses, light enough for the command line to import."""

from collections.abc import Iterable
from enum import StrEnum


class Status(StrEnum):
    """The outcome for a run."""

    OK = "ok"
    FINDINGS = "findings"
    CANNOT_TELL = "cannot-tell"
    BAD_INPUT = "bad-input"
    INTERNAL_ERROR = "internal-error"


class Unknown(StrEnum):
    """What becomes of frames that are out of distribution and below the alarm threshold."""

    FINDING = "finding"
    IGNORE = "ignore"


EXIT = {
    Status.INTERNAL_ERROR: 70,
    Status.BAD_INPUT: 3,
    Status.FINDINGS: 1,
    Status.CANNOT_TELL: 4,
    Status.OK: 0,
}
"""Exit status of each, the worst first."""

OUTPUT_LOST = 5
"""Exit status if an output could not be written."""

WORST = (70, OUTPUT_LOST, 3, 1, 4, 0)
"""Exit statuses, the worst first."""

IGNORED = "unknown frames are ignored"
"""What outputs say where they are."""


def worst(codes: Iterable[int]) -> int:
    """Take the worst of several exit statuses; 0 of none."""
    return min(codes, key=WORST.index, default=0)
