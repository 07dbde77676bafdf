"""Findings in words, alike in all outputs, and runs of one scenario folded into a row.

An analysis has findings and annotations, which recordings and pages show; a verdict has findings
of which some may not count. Both are localised by the same words.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from pathlib import Path

from inspector.analysis import Analysis
from inspector.errors import Status
from inspector.localisation import Localisation, fault_links, has_stages
from inspector.reference.store import REPETITION
from inspector.text import counted
from inspector.verdict import UNREAD, Beside, Finding, Verdict
from noiseclassifier import UNKNOWN, Event
from noiseclassifier.labels import interval
from noisemodel import Block

# Onsets this close in repetitions are one row, in [s]: the hop of frames is 0.1 s or 0.2 s.
TOGETHER = 0.25
# How people read a status.
WORDS = {
    Status.INTERNAL_ERROR: "internal error",
    Status.BAD_INPUT: "bad input",
    Status.FINDINGS: "FAIL",
    Status.CANNOT_TELL: "cannot tell",
    Status.OK: "ok",
}
COUNTED = WORDS | {Status.FINDINGS: "with findings"}  # how people count them
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
    low, high = (f"{frequency:.0f}" for frequency in found.band or (0.0, 0.0))
    band = f"{low} Hz" if low == high else f"{low}-{high} Hz"
    return stage, joints, band if found.band else ""


# --- of an analysis


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
        there = [e for e in analysis.findings if e.start < block.stop and block.start < e.stop]
        others = ", ".join(map(spoken, sorted({event.label for event in there})))
        found = f", found as {others}" if others else ", not found"
        found = "" if analysis.labels is None else found
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
    without = analysis.localisations and not has_stages(analysis.run)
    return "No stages: the run has no desired velocities and no named stages." if without else ""


# --- of verdicts


def row(event: Finding, beside: Beside | None, runs: str = "") -> tuple[str, ...]:
    """A finding as cells: time, class, joints, band, and the rest, with its number of runs."""
    by = event.evidence
    _, joints, band = words(event.localisation) if event.localisation else ("", "", "")
    over = "by the general model" if beside is not None and not by.excused else ""
    if by.over_db is not None and not by.excused:
        several = beside is not None and beside.repetitions and by.kind == "repetitions"
        of = counted(beside.repetitions, "repetition") if beside and several else by.kind
        over = f"{by.over_db:+.0f} dB over {of}"
        joints = joints or by.joint or ""
        band = band or (f"{by.band_hz[0]:.0f}-{by.band_hz[1]:.0f} Hz" if by.band_hz else "")
    order, ruled = str(event.order or ""), event.became and f"({event.became})"
    rest = _listed(event.novelty.removeprefix(", "), order, over, runs, ruled)
    return f"{event.start:6.2f} - {event.stop:6.2f} s", event.label, joints, band, rest


def told(event: Finding, beside: Beside | None, runs: str = "", *, short: bool = False) -> str:
    """The same as a sentence, or short, for lines that are cut."""
    _, label, *rest = row(event, beside, runs)
    when = f"from {interval(event.start, event.stop)}"
    when = f"{event.start:.2f}-{event.stop:.2f} s" if short else when
    return _listed(f"{label} {when}", *rest)


def _listed(*parts: str) -> str:
    """What there is of several parts; a ruling in brackets follows without a comma."""
    return ", ".join(filter(None, parts)).replace(", (", " (")


def failing(verdict: Verdict) -> list[str]:
    """Sentences on what fails a run."""
    findings = [told(event, verdict.beside) for event in verdict.failing]
    return [*findings, *map(str, verdict.missing)]


def excused(verdict: Verdict) -> list[str]:
    """Sentences on findings that do not."""
    return [told(event, verdict.beside) for event in verdict.excused]


# --- of several runs


@dataclass(frozen=True)
class Group:
    """The runs of one scenario, the worst first, or a single run, by its path."""

    name: str
    verdicts: Sequence[Verdict]

    @property
    def worst(self) -> Verdict:
        """The verdict that stands for all."""
        return self.verdicts[0]

    def found(self, *, fails: bool) -> list[tuple[Finding, Beside | None, str]]:
        """Findings that fail their runs, or that do not; repetitions of one finding count once."""
        beside = {verdict.path: verdict.beside for verdict in self.verdicts}
        every = [
            (verdict.path, event)
            for verdict in self.verdicts
            for event in (verdict.failing if fails else verdict.excused)
        ]
        groups = folded(every, len(self.verdicts))
        return [(event, beside[path], runs) for path, event, runs in groups]

    @property
    def words(self) -> str:
        """What became of it: a scenario may be missing or cut."""
        if self.worst.missing and not self.worst.failing:
            return self.worst.missing[0].words
        return WORDS[self.worst.status]

    @property
    def missing(self) -> list[str]:
        """Required findings that were not found."""
        return list(dict.fromkeys(each.told for one in self.verdicts for each in one.missing))


def folded(found: Iterable[tuple[Path, Finding]], runs: int) -> list[tuple[Path, Finding, str]]:
    """Findings by run: of those that are one the loudest, and how many of so many runs have it."""
    groups: list[list[tuple[Path, Finding]]] = []
    for run, event in found:
        for group in groups:
            path, other = group[0]
            joint = event.evidence.joint
            same = event.label == other.label or joint == other.evidence.joint is not None
            near = abs(event.start - other.start) <= TOGETHER
            if same and near and run != path and event.became == other.became:
                group.append((run, event))
                break
        else:
            groups.append([(run, event)])
    result = []
    for group in groups:
        (label, _), *_ = Counter(event.label for _, event in group).most_common(1)
        named = [each for each in group if each[1].label == label]
        worst = max(named, key=lambda each: (each[1].evidence.over_db or 0.0, each[1].score))
        number = len({run for run, _ in group})
        result.append((*worst, f"{number} of {counted(runs, 'run')}" if runs > 1 else ""))
    return result


def each_missing(verdicts: Sequence[Verdict]) -> list[Verdict]:
    """The verdicts with one for each scenario that has no log."""
    found: list[Verdict] = []
    for verdict in verdicts:
        absent = [replace(verdict, missing=(each,)) for each in verdict.missing]
        found += [verdict] if verdict.of_run else absent
    return found


def groups(verdicts: Sequence[Verdict]) -> list[Group]:
    """Runs by scenario, the worst first.

    A scenario is what runs of one folder name so, or have one name but for a number, and one that
    has no log. What could not be read stays alone.
    """
    found: dict[tuple[str, str], list[Verdict]] = {}
    absent = []
    for verdict in sorted(each_missing(verdicts), key=lambda each: each.severity):
        path, repeated = verdict.path, REPETITION.fullmatch(verdict.path.stem)
        if not verdict.of_run:
            absent.append(Group(verdict.missing[0].scenario, [verdict]))
        elif verdict.status in UNREAD:
            found.setdefault((str(path), ""), []).append(verdict)
        else:
            name = verdict.scenario or str(path.with_name(repeated["name"]) if repeated else path)
            found.setdefault((str(path.parent), name), []).append(verdict)
    return absent + [
        Group(name if len(each) > 1 else str(each[0].path), each)
        for (_, name), each in found.items()
    ]


def table(rows: Sequence[Sequence[str]], gap: str = "   ") -> list[str]:
    """Lines of cells, each column as wide as its widest cell.

    A row of fewer cells ends with a sentence, which may reach over the columns to its right.
    """
    most = max(map(len, rows), default=0)
    kept = [cells if len(cells) == most else cells[:-1] for cells in rows]
    widths = [max(map(len, column)) for column in zip_longest(*kept, fillvalue="")]
    lines = []
    for cells in rows:
        pairs = zip(cells, widths, strict=False)
        lines.append(gap.join(cell.ljust(width) for cell, width in pairs if width or cell).rstrip())
    return lines
