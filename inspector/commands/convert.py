"""Commands that import and export: `import` and `export`."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import typer

from inspector import export as exports
from inspector.analysis import analyse
from inspector.commands import shared
from inspector.commands.shared import argument, opened, option
from inspector.errors import EXIT, OUTPUT_LOST, InspectorError, Status, worst
from inspector.export import read_labels, write_labels
from inspector.library import load_library
from inspector.logs.mapping import errors_of
from inspector.logs.motion import Imported, contradictions, limit_warnings
from inspector.logs.read import Reading, listing, logs_in, readers_of, run_name
from inspector.text import counted, printable, progress
from noisemodel import NoiseModelError, OutputError
from noisemodel.files import also_reading, refuse_existing


def import_(
    ctx: typer.Context,
    logs: Annotated[
        list[Path], argument("CSV, Parquet, HDF5, npz, ROS bags, LeRobot data sets, folders.")
    ],
    output: Annotated[
        Path | None, option("The run file to write; a folder for several runs.", "--output", "-o")
    ] = None,
    save_mapping: Annotated[Path | None, option("Save these options as a mapping (TOML).")] = None,
    list_: Annotated[
        bool, option("List the contents of the logs, write nothing.", "--list")
    ] = False,
    overwrite: shared.Overwrite = False,
) -> None:
    """Convert logs of robots to run files.

    The exit status is 3 if a log cannot be read, 5 if a run file cannot be written; the others are.
    """
    reading = ctx.obj
    if list_:
        for line in (line for log in logs for line in listing(log, reading.options)):
            typer.echo(printable(line))
        return
    if output is None:
        raise typer.BadParameter("name the run file to write", param_hint="'--output' / '-o'")
    status = _import(logs, output, reading, overwrite=overwrite)
    if save_mapping:
        reading.options.save(save_mapping, overwrite=overwrite)
    raise typer.Exit(status)


def _import(paths: Sequence[Path], output: Path, reading: Reading, *, overwrite: bool) -> int:
    """Write a run file for each run of some logs, and return the exit status."""
    logs = [log for path in paths for log in logs_in(path)[0]]
    also_reading(logs)
    several = len(logs) > 1
    if reading.desired and several:
        raise InspectorError(f"{reading.desired}: belongs to one log, {len(logs)} are given")
    jobs: list[tuple[str, Callable[[], Imported]]] = []
    failed: list[int] = []
    for log in logs:
        with _refusals(failed, alone=not several):
            jobs += [(run_name(log, each), read) for each, read in readers_of(log, reading).items()]
    targets = _targets([name for name, _ in jobs], output, several=several)
    for target in targets:
        refuse_existing(target, overwrite=overwrite)
    reads = zip([read for _, read in jobs], targets, strict=True)
    for read, target in progress(reads, "import", total=len(jobs)):
        with _refusals(failed, alone=len(targets) == 1 and not several):
            imported = read()
            run = imported.run
            run.save(target, overwrite=overwrite)
            for remark in (*imported.remarks, *contradictions(run), *limit_warnings(run)):
                typer.echo(f"  {remark}")
            typer.echo(f"{target}: {run.duration:.2f} s at {run.rate:g} Hz")
    return worst(failed)


@contextmanager
def _refusals(statuses: list[int], *, alone: bool) -> Iterator[None]:
    """Print why a log has no run file, and keep the exit status; of one alone, raise it."""
    try:
        yield
    except (InspectorError, NoiseModelError) as error:
        if alone:
            raise
        typer.echo(f"inspector: {error}", err=True)
        lost = isinstance(error, OutputError) and isinstance(error.__cause__, OSError)
        statuses.append(OUTPUT_LOST if lost else EXIT[Status.BAD_INPUT])


def _targets(names: Sequence[str], output: Path, *, several: bool) -> tuple[Path, ...]:
    """Paths of the run files, checked before the logs are read."""
    with errors_of(output):
        if len(names) == 1 and not several and not output.is_dir():
            shared.check_suffix(output, ".npz")
            return (output,)
    if output.suffix == ".npz" or output.is_file():
        problem = f"{len(names)} runs do not fit into one file"
        raise InspectorError(f"{output}: {problem}; name a folder, or choose one (--episode)")
    targets = tuple(output / f"{name}.npz" for name in names)
    if twice := [path for path in targets if targets.count(path) > 1]:
        problem = "two logs would be written there; import them one by one"
        raise InspectorError(f"{twice[0]}: {problem}")
    try:
        output.mkdir(exist_ok=True)
    except OSError as error:
        raise InspectorError(f"{output}: cannot be created ({error.strerror})") from error
    return targets


def export(
    ctx: typer.Context,
    run: Annotated[Path, argument("A run file, or any log: CSV, bag, ...")],
    output: Annotated[
        Path,
        option(
            "The file to write: .mcap, .csv or .parquet; labels as .toml (NoisyTest), .csv or"
            " .txt (Audacity); a run as .npz.",
            "--output",
            "-o",
        ),
    ],
    labels: Annotated[
        Literal["findings", "annotated"] | None,
        option("Write a label file of the findings or annotated blocks."),
    ] = None,
    annotate: Annotated[
        Path | None, option("Write the run with the labels of this file instead.")
    ] = None,
    kind: Annotated[str, option("Extended noise: normal, rms, mean, paper, A, B or C.")] = "normal",
    model: shared.ModelFiles = None,
    overwrite: shared.Overwrite = False,
) -> None:
    """Write noise, labels and scores for other tools.

    Foxglove and PlotJuggler read MCAP, which holds the joints' motion as well; data frames read
    CSV and Parquet; annotation tools and spreadsheets read label files.
    """
    if labels and annotate:
        raise typer.BadParameter("name one of --labels and --annotate")
    refuse_existing(output, overwrite=overwrite)
    library = {} if annotate else load_library(model)
    recorded = opened(run, ctx.obj).run
    if annotate:
        shared.check_suffix(output, ".npz")
        blocks = read_labels(annotate, recorded)
        replace(recorded, blocks=blocks).save(output, overwrite=overwrite)
        told = counted(len(blocks), "label")
    elif labels:
        spans = analyse(recorded, library).findings if labels == "findings" else recorded.blocks
        write_labels(spans, output, overwrite=overwrite)
        for each in spans:
            typer.echo(f"{each.label} from {each.start:.2f} s to {each.stop:.2f} s")
        told = counted(len(spans), "label")
    else:
        written = exports.export(recorded, output, library, kind=kind, overwrite=overwrite)
        typer.echo(f"{run}: {written.analysis.headline}")
        for remark in written.remarks:
            typer.echo(f"  {remark}")
        told = str(written)
    typer.echo(f"{output}: {told}")
