"""Test cases of a job, runs or scenarios, as JUnit XML, GitHub annotations and Markdown."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from urllib.parse import quote
from xml.etree import ElementTree as ET

ANNOTATIONS = 10
"""GitHub silently drops what goes beyond ten of a kind per step."""
COMMENT = 60_000
"""Most characters of the Markdown: GitHub refuses comments of more than 65,536."""
MARKER = "<!-- noise-inspector -->"
"""First line of the Markdown, by which a script finds its own comment to replace it."""
DIFF_MARKER = "<!-- noise-inspector diff -->"
"""The same of `diff`: a job may have a comment of each."""


class Outcome(StrEnum):
    """What a case is as a test, by its element in JUnit XML."""

    PASSED = ""
    FAILURE = "failure"
    ERROR = "error"
    SKIPPED = "skipped"


@dataclass(frozen=True)
class Case:
    """One case.

    Attributes:
        name: What it is of, a file or a scenario.
        path: The file that it is about.
        line: Its line there, from 1; 0 without.
        status: What became of it, as machines read it.
        words: The same, as people read it.
        outcome: What that is as a test.
        rank: Sorts cases, the worst first.
        kind: Type of a failure or an error.
        sentences: What fails it, a sentence each.
        message: A line that says more; may be empty.
        notes: What does not fail it, a sentence each.
        trace: The traceback of a bug; empty without.
        seconds: How long it took, in [s].
        quiet: Whether there is nothing to say of it, so that tables leave it out.
        picture: A picture of it, if there is one.
        picture_url: Where that will be published; empty if that is not known.
        timeline: It over time as text, for where there is no picture; may be empty.
    """

    name: str
    path: Path
    status: str
    words: str
    outcome: Outcome
    rank: tuple[float, ...] = ()
    kind: str = ""
    sentences: tuple[str, ...] = ()
    message: str = ""
    notes: tuple[str, ...] = ()
    trace: str = ""
    seconds: float = 0.0
    quiet: bool = False
    picture: Path | None = None
    picture_url: str = ""
    timeline: str = ""
    line: int = 0

    @property
    def told(self) -> str:
        """What is said of it in a line."""
        return "; ".join(self.sentences) or self.message


@dataclass(frozen=True)
class Job:
    """All cases of a job.

    Attributes:
        title: What they are about, in a word.
        summary: The counts in a line.
        counts: The counts, by kind and name.
        cases: The cases, in order of their files.
        remarks: What holds for all of them, a sentence each.
    """

    title: str
    summary: str
    counts: Mapping[str, Mapping[str, int]]
    cases: Sequence[Case]
    remarks: tuple[str, ...] = ()

    @property
    def ranked(self) -> list[Case]:
        """The cases, the worst first."""
        return sorted(self.cases, key=lambda case: case.rank)

    @property
    def summed(self) -> bool:
        """Whether the counts say more than the cases: of one that passes they are all there is."""
        return len(self.cases) > 1


def junit(job: Job) -> str:
    """Write a job as JUnit XML: a test case each.

    A case has one `failure` with all that fails it, since Jenkins keeps the last of several. A
    picture is attached by a line ``[[ATTACHMENT|path]]``, which GitLab, Jenkins and Azure read.
    """
    outcomes = Counter(case.outcome for case in job.cases)
    suite = ET.Element(
        "testsuite",
        name="inspector",
        tests=str(len(job.cases)),
        failures=str(outcomes[Outcome.FAILURE]),
        errors=str(outcomes[Outcome.ERROR]),
        skipped=str(outcomes[Outcome.SKIPPED]),
        time=f"{sum(case.seconds for case in job.cases):.3f}",
    )
    properties = ET.SubElement(suite, "properties")
    for kind, numbers in job.counts.items():
        for name, number in numbers.items():
            ET.SubElement(properties, "property", name=f"{kind}.{name}", value=str(number))
    seen: Counter[str] = Counter()
    for case in job.cases:
        name = _plain(case.name)
        seen[name] += 1  # GitLab reads the first of several cases of one name only
        name = name if seen[name] == 1 else f"{name} ({seen[name]})"
        time = f"{case.seconds:.3f}"
        node = ET.SubElement(suite, "testcase", classname="inspector", name=name, time=time)
        lines = [*case.notes]
        if case.outcome:
            sentences = case.sentences or (case.message,)
            told = ET.SubElement(node, case.outcome, message=_plain("; ".join(sentences)))
            if case.outcome is not Outcome.SKIPPED:
                told.set("type", _plain(case.kind))
            told.text = _plain("\n".join([*sentences, *filter(None, [case.trace])]))
        if case.message and (case.sentences or not case.outcome):
            lines.insert(0, case.message)
        if case.picture is not None:
            lines.append(f"[[ATTACHMENT|{case.picture}]]")
        if lines:
            ET.SubElement(node, "system-out").text = _plain("\n".join(lines))
    root = ET.Element("testsuites")
    root.append(suite)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True)


def github(job: Job) -> str:
    """Write a job as GitHub workflow commands: the ten worst, and the counts.

    One case that is annotated needs no counts.

    Of ten errors, those that cannot be read take five at most where others fail, so that they hide
    none. Cases that are skipped are warnings.
    """
    ranked = job.ranked
    bad = [case for case in ranked if case.outcome is Outcome.ERROR]
    failed = [case for case in ranked if case.outcome is Outcome.FAILURE]
    shown = [*bad[: max(ANNOTATIONS // 2, ANNOTATIONS - len(failed))], *failed][:ANNOTATIONS]
    skipped = [case for case in ranked if case.outcome is Outcome.SKIPPED][:ANNOTATIONS]
    lines = [_annotation("error", case) for case in shown]
    lines += [_annotation("warning", case) for case in skipped]
    lines += [f"::notice::{_escaped(remark)}" for remark in job.remarks]
    left = len(bad) + len(failed) - len(shown)
    more = f"; {left} more are not shown here" if left else ""
    if job.summed or not lines:
        lines += [f"::notice title=noise-inspector::{_escaped(job.summary)}{more}"]
    return "\n".join(lines)


def markdown(job: Job, *, head: str, notes: str, marker: str = MARKER) -> str:
    """Write a job for its summary or a comment: a table, the worst first, and a picture.

    GitHub takes no pictures inside the text: the worst case's is linked if its address is
    known, and else its file is named.

    Args:
        notes: Title of what does not fail its case.
    """
    ranked = job.ranked
    shown = [case for case in ranked if case.outcome or not case.quiet]
    lines = [marker, f"### {job.title}: {job.summary}", ""]
    tail = [""]
    for remark in job.remarks:
        tail += [f"{_cell(remark[:1].upper() + remark[1:])}.", ""]
    worst = next((case for case in ranked if case.picture is not None), None)
    if worst is not None and shown:
        told = f"Picture of {_code(worst.name)}: {_code(worst.picture)}."
        drawn = f"![{_cell(worst.name)} over time]({worst.picture_url})"
        tail += [drawn if worst.picture_url else told]
    sketched = next((case for case in ranked if case.timeline), None)
    if sketched is not None and (worst is None or not worst.picture_url):
        tail += ["", f"{_code(sketched.name)} over time:", "```", sketched.timeline, "```"]
    rows = [f"| {_code(case.name)} | {case.words} | {_cell(case.told)} |" for case in shown]
    left = [f"- {_code(case.name)}: {_cell(note)}" for case in ranked for note in case.notes]
    if rows:
        lines += _cut([head, "|---|---|---|"], rows, COMMENT * 2 // 3)
    lines += tail
    if left:
        opened = ["", f"<details><summary>{notes}: {len(left)}</summary>", ""]
        lines += [*_cut(opened, left, COMMENT // 4), "", "</details>"]
    return "\n".join(lines).rstrip()


def published(picture: Path | None, folder: Path | None, address: str) -> str:
    """Address of a picture; empty if it will not be published, or there is none.

    Args:
        folder: The folder of the report that it lies in, however deep.
        address: Where that folder is published; empty if it is not.
    """
    if picture is None or folder is None or not address:
        return ""
    return f"{address.rstrip('/')}/{quote(picture.relative_to(folder).as_posix())}"


def _annotation(kind: str, case: Case) -> str:
    about = {"file": str(case.path)}
    if case.line:
        about["line"] = str(case.line)
    if case.name != about["file"]:
        about["title"] = case.name
    listed = ",".join(
        f"{key}={_escaped(value).replace(':', '%3A').replace(',', '%2C')}"
        for key, value in about.items()
    )
    return f"::{kind} {listed}::{_escaped(f'{case.status}: {case.told}')}"


def _escaped(value: str) -> str:
    return value.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _plain(value: object) -> str:
    """Drop the control characters that XML forbids."""
    return re.sub(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "", str(value))


def _cell(value: object) -> str:
    """A text that stays in its cell, and is no HTML."""
    line = " ".join(str(value).split())
    for mark, written in (("&", "&amp;"), ("<", "&lt;"), ("|", "\\|"), ("`", "'")):
        line = line.replace(mark, written)
    return line


def _code(path: object) -> str:
    """A path that stays in its cell."""
    return f"`{' '.join(str(path).split()).replace('`', chr(39)).replace('|', chr(92) + '|')}`"


def _cut(head: list[str], rows: list[str], room: int) -> list[str]:
    """As many rows as there is room for, and how many are left out."""
    kept = []
    for row in rows:
        room -= len(row) + 1
        if room < 0:
            break
        kept.append(row)
    left = len(rows) - len(kept)
    return [*head, *kept, *(["", f"{left} more are left out here."] if left else [])]
