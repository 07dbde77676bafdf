"""Audits of files: run files, and logs that `inspector import` reads."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from inspector.audit.audit import Audit, audit
from inspector.errors import InspectorError, without_path
from inspector.library import Library
from inspector.logs.read import Reading, left_out, open_source, sources
from noisemodel import NoiseModelError


class Audits(NamedTuple):
    """Audits of many files, each by the name of its run."""

    found: dict[str, Audit]
    """Of what could be read."""
    failed: dict[str, str]
    """Why a file cannot be read."""
    assumed: dict[str, str]
    """What was assumed when a log was read, in a line; empty of a run file."""
    others: str
    """Which files of folders were not taken for logs; empty if there are none."""


def audit_all(paths: Sequence[Path], library: Library, reading: Reading | None = None) -> Audits:
    """Audit all runs of many files; one bad file never stops the rest.

    Args:
        paths: Run files, logs, and folders of them.
        library: Models that might label them.
        reading: How logs are read.
    """
    runs, others = sources(paths, reading)
    found: dict[str, Audit] = {}
    failed: dict[str, str] = {}
    assumed: dict[str, str] = {}
    for source in runs:
        name = str(source.shown)
        try:
            opened = open_source(source, reading)
            found[name] = audit(opened.run, library)
            assumed[name] = opened.assumed
        except (InspectorError, NoiseModelError) as error:
            failed[name] = without_path(error, source.path)
    return Audits(found, failed, assumed, left_out(others))
