"""The report that lies in a recording, in Markdown."""

from collections.abc import Sequence

from inspector.analysis.inspection import Inspection
from inspector.localisation.links import culprits
from inspector.localisation.localise import flows
from models import Event
from noisemodel import Block

ORIGIN = ("shows first in", "by joints", "band", "links, shares of the excess")
"""Names of the columns that say where a failure comes from."""
HEAD = ("class", "from [s]", "to [s]", *ORIGIN)


def report(inspection: Inspection) -> str:
    """Write the report of an inspected run.

    Args:
        inspection: The run with what was found in it.

    Returns:
        Markdown: the verdict, the events, the run, and what is missing.
    """
    run = inspection.run
    facts = [
        ("robot", run.robot or "not named"),
        ("duration", f"{run.duration:.2f} s at {run.rate:g} Hz"),
        ("joints", str(len(run.joint_names))),
        ("model", inspection.model or "none"),
        *((key, str(run.meta[key])) for key in ("scenario", "seed") if key in run.meta),
    ]
    parts = [
        f"# {inspection.name}",
        f"**{verdict(inspection)}**",
        _table(("", ""), facts),
    ]
    if inspection.events:
        found = [
            (e.label, f"{e.start:.2f}", f"{e.stop:.2f}", *origin(inspection, e))
            for e in inspection.events
        ]
        parts += ["## Events", _table(HEAD, found)]
    if run.blocks:
        rows = [
            (b.label, f"{b.start:.2f}", f"{b.stop:.2f}", *origin(inspection, b)) for b in run.blocks
        ]
        parts += ["## Annotated", _table(HEAD, rows)]
    if note(inspection):
        parts += [note(inspection)]
    if inspection.remarks:
        parts += ["## Remarks", "\n".join(f"- {remark}" for remark in inspection.remarks)]
    return "\n\n".join(parts) + "\n"


def sentence(inspection: Inspection, event: Event | Block) -> str:
    """Say what an event is, when, and where it comes from."""
    stage, joints, *others = origin(inspection, event)
    by = f"first in {stage}{joints and f' by {joints}'}" if stage else ""
    where = "; ".join(part for part in (by, *others) if part)
    return f"{event.label}, {event.start:.2f} s to {event.stop:.2f} s{where and f': {where}'}"


def origin(inspection: Inspection, failure: Event | Block) -> tuple[str, str, str, str]:
    """Say where a failure comes from: stage of the control flow, joints, band, links."""
    if failure.label == "ok":
        return "", "", "", ""
    known = inspection.origins[failure]
    return known.stage, known.joints, known.frequencies, _links(inspection, failure)


def note(inspection: Inspection) -> str:
    """Say why no failure has a stage; nothing if that is not so."""
    if not inspection.origins or flows(inspection.run):
        return ""
    return "No stages: the run has neither desired velocities nor named stages of the control flow."


def verdict(inspection: Inspection) -> str:
    """Say in a few words what was found."""
    if inspection.labels is None:
        return "Cannot tell"
    if not inspection.events:
        return "Quiet"
    kinds = sorted({event.label for event in inspection.events})
    count = len(inspection.events)
    return f"{count} {'finding' if count == 1 else 'findings'}: {', '.join(kinds)}"


def _links(inspection: Inspection, failure: Event | Block) -> str:
    if inspection.links is None:
        return ""
    annotated = [block for block in inspection.run.blocks if block.label != "ok"]
    failures: list[Event | Block] = [*inspection.events, *annotated]
    first = inspection.origins[failure].first
    named = culprits(inspection.links, failure, failures, first=first)
    return ", ".join(f"{link} {share:.0%}" for link, share in named)


def _table(head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    lines = [head, ("---",) * len(head), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)
