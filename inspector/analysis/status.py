"""Statuses of runs and their exit statuses, light enough for the command line to import."""

from enum import StrEnum


class Status(StrEnum):
    """The outcome for a run."""

    OK = "ok"
    FINDINGS = "findings"
    CANNOT_TELL = "cannot-tell"
    BAD_INPUT = "bad-input"


class Unknown(StrEnum):
    """What becomes of frames that are out of distribution and below the alarm threshold."""

    FINDING = "finding"
    IGNORE = "ignore"


EXIT = {Status.BAD_INPUT: 3, Status.FINDINGS: 1, Status.CANNOT_TELL: 4, Status.OK: 0}
"""Exit status of each, the worst first."""

IGNORED = "unknown frames are ignored"
"""What outputs say where they are."""
