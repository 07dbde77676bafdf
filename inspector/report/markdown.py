"""The report of a recording, in Markdown."""

from collections.abc import Sequence

from inspector.analysis.analyse import Analysis
from inspector.localisation.links import fault_links
from inspector.localisation.localise import has_stages
from inspector.report.localisation import words
from models import Event
from models.labels import interval
from noisemodel import Block

LOCALISATION = ("shows first in", "by joints", "band", "links, shares of the excess")
"""Names of the columns of a localisation."""
HEAD = ("class", "from [s]", "to [s]", *LOCALISATION)


def report(analysis: Analysis) -> str:
    """Write the report of an analysed run.

    Args:
        analysis: The run with what was found in it.

    Returns:
        Markdown: the status, the events, the run, and what is missing.
    """
    run = analysis.run
    facts = [
        ("robot", run.robot or "not named"),
        ("duration", f"{run.duration:.2f} s at {run.rate:g} Hz"),
        ("joints", str(len(run.joint_names))),
        ("model", analysis.model or "none"),
        *((key, str(run.meta[key])) for key in ("scenario", "seed") if key in run.meta),
    ]
    parts = [
        f"# {analysis.name}",
        f"**{analysis.headline}**",
        _table(("", ""), facts),
    ]
    if analysis.findings:
        found = [
            (
                f"{e.label}{e.novelty}",
                f"{e.start:.2f}",
                f"{e.stop:.2f}",
                *localised(analysis, e, quote="`"),
            )
            for e in analysis.findings
        ]
        parts += ["## Events", _table(HEAD, found)]
    if run.blocks:
        rows = [
            (b.label, f"{b.start:.2f}", f"{b.stop:.2f}", *localised(analysis, b, quote="`"))
            for b in run.blocks
        ]
        parts += ["## Annotated", _table(HEAD, rows)]
    if note(analysis):
        parts += [note(analysis)]
    if analysis.remarks:
        parts += ["## Remarks", "\n".join(f"- {remark}" for remark in analysis.remarks)]
    return "\n\n".join(parts) + "\n"


def sentence(analysis: Analysis, event: Event | Block) -> str:
    """Class, time and localisation of an event, in a line of Markdown."""
    stage, joints, *others = localised(analysis, event, quote="`")
    by = f"first in {stage}{joints and f' by {joints}'}" if stage else ""
    where = "; ".join(part for part in (by, *others) if part)
    novel = event.novelty if isinstance(event, Event) else ""
    when = f"{interval(event.start, event.stop)}{novel}"
    return f"{event.label}, {when}{where and f': {where}'}"


def localised(
    analysis: Analysis, failure: Event | Block, *, quote: str = ""
) -> tuple[str, str, str, str]:
    """Localisation of a failure in words: stage, joints, band (with its order), and links."""
    if failure.label == "ok":
        return "", "", "", ""
    stage, joints, band = words(analysis.localisations[failure], quote=quote)
    order = analysis.orders.get(failure) if isinstance(failure, Event) else None
    band = "; ".join(str(part) for part in (band, order) if part)
    return stage, joints, band, _links(analysis, failure)


def note(analysis: Analysis) -> str:
    """Why no failure has a stage; empty if the run has stages."""
    if not analysis.localisations or has_stages(analysis.run):
        return ""
    return "No stages: the run has neither desired velocities nor named stages of the control flow."


def _links(analysis: Analysis, failure: Event | Block) -> str:
    if analysis.links is None:
        return ""
    annotated = [block for block in analysis.run.blocks if block.label != "ok"]
    failures: list[Event | Block] = [*analysis.findings, *annotated]
    known = analysis.localisations[failure]
    named = fault_links(analysis.links, failure, failures, known=known)
    return ", ".join(f"{link} {share:.0%}" for link, share in named)


def _table(head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    lines = [head, ("---",) * len(head), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)
