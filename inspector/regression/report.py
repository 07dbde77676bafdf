"""The folder of `diff --report`: the worst pair as recording and picture, and JSON."""

from pathlib import Path

from inspector.compare.pair import compare
from inspector.errors import InspectorError
from inspector.library import Library
from inspector.pair.alignment import Align
from inspector.regression import picture
from inspector.regression.difference import Compared, Difference, worst, worst_runs
from inspector.regression.findings import lag
from inspector.regression.output import as_json
from noisemodel.atomic import refuse_existing, replacing

RECORDING, PICTURE, NUMBERS = FILES = ("worst.rrd", "worst.png", "diff.json")


def prepare(folder: Path, *, overwrite: bool = False) -> None:
    """Make the folder, before long work is done for it.

    Raises:
        InspectorError: If matplotlib is not installed, or the folder cannot be created.
        OutputError: If one of its files exists.
    """
    picture.require()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InspectorError(f"{folder}: cannot be made a folder ({error.strerror})") from error
    for name in FILES:
        refuse_existing(folder / name, overwrite=overwrite)


def write(
    found: Difference,
    folder: Path,
    library: Library,
    *,
    robot: bool = True,
    overwrite: bool = False,
) -> str:
    """Write the worst pair, and all numbers.

    Args:
        found: The difference; it has a scenario.
        folder: Where to; it exists.
        library: Models to choose from.
        robot: Whether to draw the robot.
        overwrite: Whether files that exist may be replaced.

    Returns:
        What was written, in a line.

    Raises:
        OutputError: If a file exists or cannot be written.
    """
    row = worst(found)
    with replacing(folder / NUMBERS, overwrite=overwrite) as temporary:
        temporary.write_text(as_json(found) + "\n", encoding="utf-8")
    before, after = write_pair(
        row, folder / RECORDING, folder / PICTURE, library, robot=robot, overwrite=overwrite
    )
    return f"{folder}: {', '.join(FILES)}; the worst pair: {before} → {after}"


def write_pair(
    row: Compared,
    recording: Path,
    drawn: Path | None,
    library: Library,
    *,
    robot: bool = True,
    overwrite: bool = False,
) -> tuple[Path, Path]:
    """Write a recording and a picture of the two runs of a scenario that show what changed.

    Args:
        row: The scenario.
        recording: The recording to write.
        drawn: The picture to write, or None.
        library: Models to choose from.
        robot: Whether to draw the robot.
        overwrite: Whether files that exist may be replaced.

    Returns:
        The two runs.

    Raises:
        OutputError: If a file exists or cannot be written.
    """
    from inspector.compare.recording import write as write_recording

    before, after = worst_runs(row)
    # Runs of different motion begin together: nothing is cut off to lay one beside the other.
    how = Align.START if lag(before, after) is None else Align.AUTO
    pair = compare(before.path, after.path, library, how=how, robot=robot)
    write_recording(pair, recording, overwrite=overwrite)
    if drawn:
        with replacing(drawn, overwrite=overwrite) as temporary:
            temporary.write_bytes(picture.picture(row, pair))
    return before.path, after.path
