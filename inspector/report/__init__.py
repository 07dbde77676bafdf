"""Findings and annotations of an analysis in words, as recordings and pages show them."""

from collections.abc import Iterable
from math import ceil, floor

from inspector.analysis import Analysis
from inspector.errors import Status
from inspector.localisation import Localisation, fault_links
from inspector.text import counted
from inspector.verdict import Finding
from noiseclassifier import UNKNOWN, Event
from noiseclassifier.labels import interval
from noisemodel import Block

# How people read a status.
WORDS = {
    Status.INTERNAL_ERROR: "internal error",
    Status.BAD_INPUT: "bad input",
    Status.FINDINGS: "FAIL",
    Status.CANNOT_TELL: "cannot tell",
    Status.OK: "ok",
}
LEAST = 0.05  # joints with a smaller share are left out


def spoken(text: str) -> str:
    """A class of NoisyTest as people read it, or a text with classes in it."""
    return text.replace("highaccelerations", "high accelerations")


def words(found: Localisation) -> tuple[str, str, str]:
    """Stage with its lead over the next, joints with their shares, and band; empty if not known."""
    stage = found.stage
    if found.lag > 0.0:
        stage = f"{stage}, {1e3 * found.lag:.1f} ms before {found.following}"
    joints = ", ".join(f"{joint} {share:.0%}" for joint, share in found.joints if share >= LEAST)
    edges = found.band or (0.0, 0.0)
    low, high = floor(round(edges[0], 1)), ceil(round(edges[1], 1))  # no tone is rounded out of it
    band = f"{low} Hz" if low == high else f"{low}-{high} Hz"
    return stage, joints, band if found.band else ""


def report(analysis: Analysis) -> str:
    """The report of an analysed run, in Markdown."""
    found = [sentence(analysis, event, bold="**") for event in analysis.findings]
    parts = [f"### {spoken(analysis.headline)}", _bullets(found), facts(analysis)]
    if analysis.run.blocks:
        parts += ["**Annotated**", _bullets(annotated(analysis, bold="**") or ["no failure"])]
    parts += [note(analysis)]
    if analysis.remarks:
        parts += ["**Remarks**", _bullets(map(spoken, analysis.remarks))]
    return "\n\n".join(filter(None, parts)) + "\n"


def _bullets(lines: Iterable[str]) -> str:
    return "\n".join(f"- {line}" for line in lines)


def facts(analysis: Analysis) -> str:
    """What a run is, in a line."""
    run = analysis.run
    parts = [
        f"{run.duration:.2f} s at {run.rate:g} Hz",
        counted(len(run.joint_names), "joint"),
        run.robot or "robot not named",
        f"model {analysis.model or 'none'}",
        *(f"{key} {run.meta[key]}" for key in ("scenario", "seed") if key in run.meta),
    ]
    return f"{analysis.name}: {', '.join(parts)}"


def sentence(analysis: Analysis, event: Event | Block, *, bold: str = "", found: str = "") -> str:
    """Class, what became of it, time, score, novelty and localisation of an event, in a line."""
    stage, joints, band, links = localised(analysis, event)
    named = {"joints": joints, "loudest links": links, "": band, "first in": stage}
    where = "; ".join(f"{name} {part}".strip() for name, part in named.items() if part)
    sure = ""
    if isinstance(event, Event):
        measured = analysis.labels is not None and analysis.labels.novel is not None
        sure = f", score {event.score:.2f}"
        sure += event.novelty or (", in distribution" if measured else "")
    if isinstance(event, Finding) and event.evidence.over_db is not None:
        sure += f", {event.evidence}"
    when = f"{interval(event.start, event.stop)}{found}{sure}"
    return f"{bold}{spoken(event.label)}{bold}, {when}{where and f': {where}'}"


def brief(analysis: Analysis, event: Event | Block) -> str:
    """Class, time and first joint of an event, in a few words."""
    first = localised(analysis, event)[1].partition(",")[0]
    when = interval(event.start, event.stop)
    return ", ".join(filter(None, [f"{spoken(event.label)} {when}", first]))


def missed(analysis: Analysis, block: Block) -> str:
    """What became of an annotated failure of which no finding has the class."""
    there = [e for e in analysis.findings if e.start < block.stop and block.start < e.stop]
    others = ", ".join(map(spoken, sorted({event.label for event in there})))
    return f"found as {others}" if others else "not found"


def annotated(analysis: Analysis, *, bold: str = "") -> list[str]:
    """Annotated failures and what became of them; where one was found, that says the rest."""
    lines = []
    for block in analysis.run.blocks:
        if block.label == "ok":
            continue
        if event := finding_of(analysis, block):
            when = interval(block.start, block.stop)
            found = f"found, {event.start:.2f} s to {event.stop:.2f} s"
            lines.append(f"{bold}{spoken(block.label)}{bold}, {when}: {found}")
            continue
        found = "" if analysis.labels is None else f", {missed(analysis, block)}"
        lines.append(sentence(analysis, block, bold=bold, found=found))
    return lines


def finding_of(analysis: Analysis, block: Block) -> Event | None:
    """The finding of an annotated class that overlaps it longest; None if it was missed."""
    shared = {
        event: min(event.stop, block.stop) - max(event.start, block.start)
        for event in analysis.findings
        if event.label == block.label
    }
    longest = max(shared, key=shared.__getitem__, default=None)
    return longest if longest is not None and shared[longest] > 0.0 else None


def classes_of(analysis: Analysis) -> tuple[str, ...]:
    """The classes that a run's pictures have a row for: failures first, `unknown` and `ok` last."""
    known = () if analysis.labels is None else analysis.labels.classes
    others = {label for *_, label in analysis.lane}
    others |= {event.label for event in analysis.findings}
    others |= {block.label for block in analysis.run.blocks}
    every = [*known, *sorted(others - set(known))]
    last = [name for name in (UNKNOWN, "ok") if name in every]
    return (*(name for name in every if name not in last), *last)


def localised(analysis: Analysis, failure: Event | Block) -> tuple[str, str, str, str]:
    """Localisation of a failure in words: stage, joints, band (with its order), and links."""
    if failure.label == "ok":
        return "", "", "", ""
    if isinstance(failure, Block):  # what was found is localised once
        failure = finding_of(analysis, failure) or failure
    known, links = analysis.localisations[failure], ""
    if analysis.links is not None:
        annotated = [block for block in analysis.run.blocks if block.label != "ok"]
        failures: list[Event | Block] = [*analysis.findings, *annotated]
        named = fault_links(analysis.links, failure, failures, known=known)
        links = ", ".join(f"{link} {share:.0%}" for link, share in named)
    stage, joints, band = words(known)
    order = analysis.orders.get(failure) if isinstance(failure, Event) else None
    return stage, joints, "; ".join(str(part) for part in (band, order) if part), links


def note(analysis: Analysis) -> str:
    """Why no failure has a stage; empty if the run has stages."""
    if not analysis.localisations or analysis.run.stages:
        return ""
    without = analysis.run.velocity_desired is None
    return "No stages: the run has no desired velocities and no named stages." if without else ""
