"""Label files of the findings of `classify`, one for each run."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from inspector.analysis.status import Status
from inspector.analysis.verdict import Verdict
from inspector.errors import InspectorError
from inspector.labels.files import format_of, write_labels
from noisemodel.atomic import refuse_existing


def label_paths(
    runs: Sequence[Path], folder: Path, *, format_name: str, overwrite: bool = False
) -> dict[Path, Path]:
    """Paths of the label files, checked before the runs are classified.

    Args:
        runs: The runs.
        folder: Folder of the files; it is created if it does not exist.
        format_name: "noisytest", "csv" or "audacity".
        overwrite: Whether files that exist may be replaced.

    Returns:
        The file of each run, named like the run.

    Raises:
        InspectorError: If there is no such format, two runs have one name, or the folder cannot be
            created.
        OutputError: If a file exists.
    """
    suffix = format_of(folder, format_name).suffix
    targets: dict[Path, Path] = {}
    for run in dict.fromkeys(runs):
        target = folder / f"{run.stem}{suffix}"
        if twin := next((other for other, path in targets.items() if path == target), None):
            raise InspectorError(f"the labels of {twin} and {run} would both be {target}")
        targets[run] = target
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InspectorError(f"{folder}: cannot be made a folder ({error.strerror})") from error
    for target in targets.values():
        refuse_existing(target, overwrite=overwrite, read=targets)
    return targets


def write_findings(
    verdicts: Iterable[Verdict],
    targets: Mapping[Path, Path],
    *,
    format_name: str,
    overwrite: bool = False,
) -> None:
    """Write the findings of each run that was classified; one without has an empty file.

    Args:
        verdicts: The verdicts.
        targets: The file of each run.
        format_name: "noisytest", "csv" or "audacity".
        overwrite: Whether files that exist may be replaced.

    Raises:
        LabelFileError: If the format cannot represent one of the findings.
        OutputError: If a file cannot be written.
    """
    for verdict in verdicts:
        if verdict.status in (Status.OK, Status.FINDINGS):
            path = targets[verdict.path]
            write_labels(verdict.events, path, format_name=format_name, overwrite=overwrite)
