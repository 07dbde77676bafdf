"""Many runs whose verdicts are kept in a file, so that a killed batch resumes."""

from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from pathlib import Path

from inspector.analysis.analyse import Analysis
from inspector.analysis.state import State, digest, opened
from inspector.analysis.status import Unknown
from inspector.analysis.verdict import Verdict, classify_file, died, work_of
from inspector.library import Library
from inspector.logs.opening import Reading, Source
from inspector.version import program_version
from noisemodel.parallel import Jobs, as_done


def classify_resumed(
    runs: Sequence[Source],
    library: Library,
    path: Path,
    *,
    reading: Reading,
    unknown: Unknown = Unknown.FINDING,
    localise: bool = False,
    draw: Callable[[Analysis, Path], Path] | None = None,
    jobs: Jobs = 1,
) -> Iterator[Verdict]:
    """Classify the runs that a state file has no verdict on; see `verdict.classify_files`.

    Args:
        runs: The runs.
        library: Models to choose from.
        path: The state file; it is created if it does not exist.
        reading: How logs are read.
        unknown: Whether out-of-distribution frames below the alarm threshold are findings.
        localise: Whether to localise each finding.
        draw: Draws a picture of an analysis.
        jobs: How many to work on at once, or the address of a Dask scheduler.

    Yields:
        A verdict per run, in no order: first those of the file.

    Raises:
        InspectorError: If the file cannot be resumed or written.
    """
    beside = (reading.desired, Path(str(reading.options.robot or "")))
    settings = {
        "version": program_version(),
        "models": {name: model.sha256 for name, model in library.items()},
        "settings": [repr(reading), unknown.value, localise, draw is not None]
        + [digest(each) for each in beside if each and each.is_file()],
    }
    content = cache(digest)
    with opened(path, settings) as state:
        todo = []
        for run in runs:
            known = state.verdicts.get((run.shown, content(run.path)))
            if known is None or (known.picture is not None and not known.picture.exists()):
                todo.append(run)
            else:
                yield known
        one = partial(
            _one, library=library, reading=reading, unknown=unknown, localise=localise, draw=draw
        )
        yield from _kept(
            state, as_done(one, todo, jobs=jobs, died=_died(unknown), work=work_of(todo))
        )


def _one(run: Source, **settings: object) -> tuple[Verdict, str]:
    sha256 = digest(run.path)  # before it is read: what changes meanwhile is done again
    return classify_file(run, **settings), sha256  # type: ignore[arg-type]


def _died(unknown: Unknown) -> Callable[[Source], tuple[Verdict, str]]:
    return lambda run: (died(run, unknown), "")


def _kept(state: State, done: Iterator[tuple[int, tuple[Verdict, str]]]) -> Iterator[Verdict]:
    for _, (verdict, sha256) in done:
        state.add(verdict, sha256)
        yield verdict
