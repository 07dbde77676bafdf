"""Audits of files: run files, and logs that `inspector import` reads."""

import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from inspector.audit.audit import Audit, audit
from inspector.errors import InspectorError
from inspector.library import Library
from noisemodel import NoiseModelError, Run


def audit_all(paths: Sequence[Path], library: Library) -> tuple[dict[str, Audit], dict[str, str]]:
    """Audit all runs of many files; one bad file never stops the rest.

    Args:
        paths: Run files, or logs.
        library: Models that might label them.

    Returns:
        Audits by the name of the run, which is that of its file, with a number where the file
        holds several; and the error by the name of each file that cannot be read.
    """
    found: dict[str, Audit] = {}
    failed: dict[str, str] = {}
    for path in paths:
        try:
            audits = [audit(run, library) for run in _runs(path)]
        except (InspectorError, NoiseModelError) as error:
            failed[str(path)] = str(error).removeprefix(f"{path}: ")
            continue
        for number, each in enumerate(audits, start=1):
            found[str(path) if len(audits) == 1 else f"{path} [{number}]"] = each
    return found, failed


def _runs(path: Path) -> Iterator[Run]:
    if path.suffix == ".npz" and (not zipfile.is_zipfile(path) or _is_run(path)):
        yield Run.load(path)
        return
    from inspector import read_logs

    yield from (imported.run for imported in read_logs(path))


def _is_run(path: Path) -> bool:
    """Whether an archive has what a run file has; simulators write others."""
    with zipfile.ZipFile(path) as archive:
        names = set(archive.namelist())
    return "time.npy" in names and bool(names & {"velocity.npy", "position.npy"})
