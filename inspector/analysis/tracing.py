"""Where the findings of verdicts come from: their runs are read once more."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TypeAlias

from inspector.analysis.verdict import Verdict
from inspector.library import Library
from inspector.localisation.localise import Origin, origins
from inspector.parallel import each
from models import Event
from noisemodel import Run

Origins: TypeAlias = Mapping[Event, Origin]
"""Where each finding of a run comes from."""


def trace(verdict: Verdict, library: Library) -> Origins:
    """Tell where the findings of a run come from.

    Args:
        verdict: What was found in it.
        library: The models that looked for it.

    Returns:
        The origin of each finding; none of a log that holds a noise alone.

    Raises:
        RunFileError: If the run cannot be read any more.
    """
    if not verdict.events or verdict.path.suffix == ".log":
        return {}
    frame = library[verdict.model].profile.duration
    known = origins(Run.load(verdict.path), verdict.events, frame=frame)
    return {event: known[event] for event in verdict.events}


def trace_all(verdicts: Sequence[Verdict], library: Library, *, jobs: int = 1) -> list[Origins]:
    """Tell where the findings of many runs come from.

    Args:
        verdicts: What was found in them.
        library: The models that looked for it.
        jobs: How many to work on at once.

    Returns:
        The origins of the findings of each run, in the order of the verdicts.
    """
    return list(each(partial(trace, library=library), verdicts, jobs=jobs))
