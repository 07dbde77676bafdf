"""The report of a recording, in Markdown."""

from inspector.analysis import Analysis
from inspector.localisation.localise import fault_links, has_stages
from inspector.report.findings import words
from inspector.text import counted
from noiseclassifier import UNKNOWN, Event
from noiseclassifier.labels import interval
from noisemodel import Block

LOCALISATION = ("shows first in", "by joints", "band", "links, shares of the excess")
"""Names of the columns of a localisation."""
SPOKEN = {"highaccelerations": "high accelerations"}
"""Classes of NoisyTest whose names people read as two words."""


def spoken(text: str) -> str:
    """A class as people read it, or a text with classes in it."""
    for name, said in SPOKEN.items():
        text = text.replace(name, said)
    return text


def report(analysis: Analysis) -> str:
    """Write the report of an analysed run."""
    run = analysis.run
    facts = [
        f"{run.duration:.2f} s at {run.rate:g} Hz",
        counted(len(run.joint_names), "joint"),
        run.robot or "robot not named",
        f"model {analysis.model or 'none'}",
        *(f"{key} {run.meta[key]}" for key in ("scenario", "seed") if key in run.meta),
    ]
    found = [f"- {sentence(analysis, event, bold='**')}" for event in analysis.findings]
    parts = [
        f"### {spoken(analysis.headline)}",
        "\n".join(found),
        f"{analysis.name}: {', '.join(facts)}",
    ]
    if run.blocks:
        failures = [block for block in run.blocks if block.label != "ok"]
        lines = [f"- {_annotation(analysis, block)}" for block in failures]
        parts += ["**Annotated**", "\n".join(lines) or "- no failure"]
    if note(analysis):
        parts += [note(analysis)]
    if analysis.remarks:
        parts += ["**Remarks**", "\n".join(f"- {spoken(remark)}" for remark in analysis.remarks)]
    return "\n\n".join(filter(None, parts)) + "\n"


def sentence(analysis: Analysis, event: Event | Block, *, bold: str = "") -> str:
    """Class, time, score, novelty and localisation of an event, in a line of Markdown."""
    stage, joints, band, links = localised(analysis, event, quote="`")
    named = {"joints": joints, "loudest links": links, "": band, "first in": stage}
    where = "; ".join(f"{name} {part}".strip() for name, part in named.items() if part)
    sure = _sure(analysis, event) if isinstance(event, Event) else ""
    when = f"{interval(event.start, event.stop)}{sure}"
    return f"{bold}{spoken(event.label)}{bold}, {when}{where and f': {where}'}"


def brief(analysis: Analysis, event: Event | Block) -> str:
    """Class, time and first joint of an event, in a few words."""
    _, joints, _, _ = localised(analysis, event)
    first = joints.partition(",")[0]
    return ", ".join(
        filter(None, [f"{spoken(event.label)} {interval(event.start, event.stop)}", first])
    )


def _annotation(analysis: Analysis, block: Block) -> str:
    """An annotated failure and what became of it; where it was found, that says the rest."""
    when, became = interval(block.start, block.stop), matched(analysis, block)
    if finding_of(analysis, block) is not None:
        return f"**{spoken(block.label)}**, {when}: found, {became}"
    found = f", found {became}" if became not in ("", "no") else ", not found" if became else ""
    return sentence(analysis, block, bold="**").replace(when, f"{when}{found}", 1)


def _sure(analysis: Analysis, event: Event) -> str:
    """How certain a finding is, and whether it is out of distribution, if the model tells."""
    labels = analysis.labels
    measured = labels is not None and labels.novel is not None
    novelty = event.novelty or (", in distribution" if measured else "")
    return f", score {event.score:.2f}{novelty}"


def finding_of(analysis: Analysis, block: Block) -> Event | None:
    """The finding of an annotated class that overlaps it longest; None if it was missed."""
    shared = {
        event: min(event.stop, block.stop) - max(event.start, block.start)
        for event in analysis.findings
        if event.label == block.label
    }
    longest = max(shared, key=shared.__getitem__, default=None)
    return longest if longest is not None and shared[longest] > 0.0 else None


def matched(analysis: Analysis, block: Block) -> str:
    """What became of an annotated failure: when it was found, in words; nothing of `ok`."""
    if block.label == "ok" or analysis.labels is None:
        return ""
    event = finding_of(analysis, block)
    if event is not None:
        return f"{event.start:.2f} s to {event.stop:.2f} s"
    others = {e.label for e in analysis.findings if e.start < block.stop and block.start < e.stop}
    return f"as {', '.join(map(spoken, sorted(others)))}" if others else "no"


def classes_of(analysis: Analysis) -> tuple[str, ...]:
    """The classes that a run's pictures have a row for: failures first, `unknown` and `ok` last."""
    known = () if analysis.labels is None else analysis.labels.classes
    others = {label for *_, label in analysis.lane}
    others |= {event.label for event in analysis.findings}
    others |= {block.label for block in analysis.run.blocks}
    every = [*known, *sorted(others - set(known))]
    last = [name for name in (UNKNOWN, "ok") if name in every]
    return (*(name for name in every if name not in last), *last)


def localised(
    analysis: Analysis, failure: Event | Block, *, quote: str = ""
) -> tuple[str, str, str, str]:
    """Localisation of a failure in words: stage, joints, band (with its order), and links."""
    if failure.label == "ok":
        return "", "", "", ""
    if isinstance(failure, Block):  # what was found is localised once
        failure = finding_of(analysis, failure) or failure
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
