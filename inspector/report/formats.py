"""Verdicts as text, JSON, JUnit XML, GitHub annotations, SARIF and Markdown.

Three formats are written from a job of cases, which a difference is, too.
"""

import hashlib
import json
import re
import shlex
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import accumulate
from pathlib import Path
from typing import Any
from urllib.parse import quote
from xml.etree import ElementTree as ET

from inspector.analysis import NOTHING
from inspector.errors import IGNORED, Status, Unknown
from inspector.report.findings import (
    COUNTED,
    WORDS,
    Group,
    each_missing,
    excused,
    failing,
    groups,
    row,
    sentence,
    table,
    timeline,
)
from inspector.text import counted, program_version
from inspector.verdict import Verdict, counts, exit_status

ANNOTATIONS = 10
"""GitHub silently drops what goes beyond ten of a kind per step."""
COMMENT = 60_000
"""Most characters of the Markdown: GitHub refuses comments of more than 65,536."""
MARKER = "<!-- noise-inspector -->"
"""First line of the Markdown, by which a script finds its own comment to replace it."""


class Outcome(StrEnum):
    """What a case is as a test, by its element in JUnit XML."""

    PASSED = ""
    FAILURE = "failure"
    ERROR = "error"
    SKIPPED = "skipped"


@dataclass(frozen=True)
class Case:
    """One case: a run, a scenario, or a file that cannot be read.

    Attributes:
        path: The file that it is about.
        status: What became of it, as machines read it; `words` as people do.
        rank: Sorts cases, the worst first.
        kind: Type of a failure or an error.
        sentences: What fails it, a sentence each.
        message: A line that says more; may be empty.
        notes: What does not fail it, a sentence each.
        seconds: How long it took, in [s].
        quiet: Whether there is nothing to say of it, so that tables leave it out.
        picture_url: Where its picture will be published; empty if that is not known.
        timeline: It over time as text, for where there is no picture; may be empty.
        line: Its line in the file, from 1; 0 without.
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
    """All cases of a job, in order of their files, with counts by kind and name."""

    title: str
    summary: str
    counts: Mapping[str, Mapping[str, int]]
    cases: Sequence[Case]
    remarks: tuple[str, ...] = ()

    @property
    def ranked(self) -> list[Case]:
        """The cases, the worst first."""
        return sorted(self.cases, key=lambda case: case.rank)


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
    if len(job.cases) > 1 or not lines:
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


def _cut(head: list[str], lines: list[str], room: int) -> list[str]:
    """As many lines as there is room for, and how many are left out."""
    ends = accumulate(len(line) + 1 for line in lines)
    kept = [line for line, end in zip(lines, ends, strict=True) if end <= room]
    left = len(lines) - len(kept)
    return [*head, *kept, *(["", f"{left} more are left out here."] if left else [])]


SARIF_SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"
UNREAD = (Status.BAD_INPUT, Status.INTERNAL_ERROR)
MOST = 20
"""Findings of a scenario that are listed."""
REPEATED = r"\d+% by \d+ repetitions? of "
"""What the line on the reference says for all runs."""
AMOUNT = r"^\d+% (?=by )|^[\d.]+ dB (?=quieter)"
"""By what else remarks of runs differ that say the same."""
RESULTS = 5000
"""GitHub shows no more results of one SARIF file."""


def summary(verdicts: Sequence[Verdict]) -> str:
    """Count runs by status and findings by what became of them, in a line."""
    number = counts(verdicts)
    runs = [f"{n} {COUNTED[Status(name)]}" for name, n in number["runs"].items() if n]
    ignored = sum(verdict.ignored for verdict in verdicts)
    runs += [f"{ignored} of the bad input ignored"] if ignored else []
    absent = sum(len(verdict.missing) for verdict in verdicts if not verdict.of_run)
    logs = f"; no log for {counted(absent, 'required finding')}" if absent else ""
    found = [f"{n} {name.replace('-', ' ')}" for name, n in number["findings"].items() if n]
    total = counted(sum(verdict.of_run for verdict in verdicts), "run")
    findings = f"; findings: {', '.join(found)}" if found else ""
    return f"{total}: {', '.join(runs) or 'none'}{logs}{findings}"


def text(verdicts: Sequence[Verdict], *, verbose: bool = False) -> str:
    """Verdicts as text: a line for each finding; of several runs a row per scenario, worst first.

    What limits a verdict is said once at the end, and what to type next. Bad inputs are left out:
    the command line prints them on stderr.

    Args:
        verbose: Whether to name the runs of each scenario, and their models.
    """
    read = [each for each in verdicts if each.status not in UNREAD]
    if len(verdicts) == 1 and read:
        lines = _one(read[0])
    else:
        lines = table([cells for group in groups(read) for cells in _rows(group)])
    runs = [each for each in read if each.of_run]
    if verbose:
        lines += [f"run:     {each.path} [{each.model or 'no model'}]" for each in runs]
    lines += _remarks(runs, verbose=verbose or len(verdicts) == 1)
    worst = min(runs, key=lambda each: each.severity, default=None)
    if worst is not None and worst.failing:
        lines.append(f"next:    inspector view {shlex.quote(str(worst.path))}")
    return "\n".join([*lines, summary(verdicts)] if len(verdicts) > 1 else lines)


def _one(verdict: Verdict) -> list[str]:
    """A run and its findings."""
    facts = f"{verdict.duration:.1f} s, {counted(verdict.joints, 'joint')}, {verdict.rate:g} Hz"
    status = WORDS[verdict.status]
    if verdict.status is Status.CANNOT_TELL:
        status, facts = f"{status}: {verdict.message}", ""
    facts = facts if verdict.rate else ""
    by = f"by {verdict.expectations}" if verdict.expectations and verdict.of_run else ""
    head = "   ".join(filter(None, [str(verdict.path), status, facts, by]))
    found = [row(verdict, event) for event in (*verdict.failing, *verdict.excused)]
    return [head, *(f"  {line}" for line in [*table(found), *map(str, verdict.missing)])]


def _rows(group: Group) -> Iterator[tuple[str, ...]]:
    """Rows of a scenario: its first finding beside its name, the others below."""
    name, status = group.name, group.words
    number = len(group.verdicts)
    found = [row(*each) for fails in (True, False) for each in group.found(fails=fails)]
    others = group.missing or ([counted(number, "run")] if number > 1 and not found else [])
    if group.worst.status is Status.CANNOT_TELL:
        others = [*others, group.worst.message]
    cells: list[tuple[str, ...]] = [*found, *((each,) for each in others)]
    for each in cells[:MOST] or [("",)]:
        yield (name, status, *each)
        name = status = ""
    if (left := len(cells) - MOST) > 0:
        yield ("", "", f"and {left} more (--format json)")


def _remarks(verdicts: Sequence[Verdict], *, verbose: bool) -> Iterator[str]:
    """What limits verdicts, once for all runs that it limits, and what they were compared with."""
    runs: Counter[str] = Counter()
    for verdict in verdicts:
        if verdict.status is not Status.CANNOT_TELL:
            quiet = NOTHING if len(verdicts) > 1 else ""
            runs.update(filter(None, [re.sub(quiet, "", verdict.message)]))
        if verdict.beside and verbose:
            runs.update([verdict.beside.words])
        elif verdict.beside:
            parts = verdict.beside.words.split("; ")
            runs.update(re.sub(AMOUNT, "", each) for each in parts if not re.match(REPEATED, each))
        elif len(verdicts) > 1 and verdict.expectations:
            runs.update([f"by {verdict.expectations}"])
    for message, number in runs.items():
        several = f" ({number} of {len(verdicts)} runs)" if 1 < len(verdicts) != number else ""
        yield f"note:    {message}{several}"
    if not verbose:
        yield from _compared(verdicts)


def _compared(verdicts: Sequence[Verdict]) -> Iterator[str]:
    """The repetitions that runs were compared with, in a line for all scenarios."""
    known = [each.beside for each in verdicts if each.beside and each.beside.repetitions]
    if not known:
        return
    number = len({each.scenarios for each in known})
    fewest, most = (of(each.repetitions for each in known) for of in (min, max))
    margins = [each.margins.get("repetitions", 0.0) for each in known]
    many = counted(most, "repetition") if fewest == most else f"{fewest} to {most} repetitions"
    each_of = f"each of {number} scenarios" if number > 1 else " and ".join(known[0].scenarios)
    low, high = f"{min(margins):.1f}", f"{max(margins):.1f}"
    margin = low if low == high else f"{low} to {high}"
    yield f"reference: {many} of {each_of}, margin {margin} dB"


def as_json(verdicts: Sequence[Verdict]) -> str:
    """Verdicts as JSON, ``noise-verdict/3``; its schema is docs/noise-verdict-3.schema.json."""
    runs = [verdict.as_dict() for verdict in verdicts]
    whole = {
        "format": "noise-verdict/3",
        "version": program_version(),
        "exit_status": exit_status(verdicts),
        "counts": counts(verdicts),
        "runs": runs,
    }
    return json.dumps(whole, indent=2)


def sarif(verdicts: Sequence[Verdict]) -> str:
    """Write the findings that count as SARIF 2.1.0, the worst runs first.

    The location of a finding is its run's file: GitHub shows no result without one, and takes its
    first line where there is no other. Expected findings are counted, but no results: GitHub would
    show them. Bad input is a notification of the tool, and so is what cannot be told.
    """
    ranked = sorted(each_missing(verdicts), key=lambda verdict: verdict.severity)
    results = [result for verdict in ranked for result in _results(verdict)]
    rules = dict.fromkeys(result["ruleId"] for result in results)
    notes = [
        {
            "level": "error" if _outcome(verdict) is Outcome.ERROR else "warning",
            "message": {"text": f"{verdict.status}: {verdict.message}"},
            "locations": [_location(verdict.path)],
        }
        for verdict in ranked
        if _outcome(verdict) in (Outcome.ERROR, Outcome.SKIPPED)
    ]
    run = {
        "tool": {
            "driver": {
                "name": "noise-inspector",
                "version": program_version(),
                "rules": [
                    {
                        "id": rule,
                        "shortDescription": {"text": _described(rule)},
                        "defaultConfiguration": {"level": "error"},
                    }
                    for rule in rules
                ],
            }
        },
        "invocations": [
            {
                "executionSuccessful": not any(
                    _outcome(each) is Outcome.ERROR for each in verdicts
                ),
                "exitCode": exit_status(verdicts),
                "toolExecutionNotifications": notes,
            }
        ],
        "results": results[:RESULTS],
        "properties": {
            "counts": counts(verdicts),
            **({"remark": IGNORED} if _ignoring(verdicts) else {}),
        },
    }
    return json.dumps({"$schema": SARIF_SCHEMA, "version": "2.1.0", "runs": [run]}, indent=2)


def _ignoring(verdicts: Sequence[Verdict]) -> bool:
    return any(verdict.unknown is Unknown.IGNORE for verdict in verdicts)


def _job(verdicts: Sequence[Verdict], found: Sequence[Case]) -> Job:
    remarks = (IGNORED,) if _ignoring(verdicts) else ()
    return Job("Noise", summary(verdicts), counts(verdicts), found, remarks)


def _by_run(verdicts: Sequence[Verdict]) -> Job:
    """All runs as cases, for programs that count runs."""
    return _job(verdicts, [_case(each) for each in each_missing(verdicts)])


def _by_scenario(verdicts: Sequence[Verdict]) -> Job:
    """All scenarios as cases, for people."""
    found = []
    for group in groups(verdicts):
        drawn = next((each for each in group.verdicts if each.picture), group.worst)
        case = replace(
            _case(group.worst),
            name=group.name,
            words=group.words,
            sentences=tuple(group.sentences),
            notes=tuple(group.notes),
            timeline=timeline(group.worst),
            picture=drawn.picture,
            picture_url=drawn.picture_url,
        )
        found.append(case)
    return _job(verdicts, found)


def _case(verdict: Verdict) -> Case:
    absent = None if verdict.of_run else verdict.missing[0]
    return Case(
        name=str(verdict.path) if absent is None else absent.scenario,
        path=verdict.path,
        line=0 if absent is None else absent.line,
        status=verdict.status,
        words=WORDS[verdict.status],
        outcome=_outcome(verdict),
        rank=verdict.severity,
        kind=_kind(verdict),
        sentences=tuple(failing(verdict)),
        message=verdict.message,
        notes=tuple(excused(verdict)),
        trace=verdict.trace,
        seconds=verdict.seconds,
        quiet=verdict.status is Status.OK,
        picture=verdict.picture,
        picture_url=verdict.picture_url,
    )


def _outcome(verdict: Verdict) -> Outcome:
    """What a run is as a test."""
    if verdict.ignored:
        return Outcome.SKIPPED
    return {
        Status.FINDINGS: Outcome.FAILURE,
        Status.BAD_INPUT: Outcome.ERROR,
        Status.INTERNAL_ERROR: Outcome.ERROR,
        Status.CANNOT_TELL: Outcome.SKIPPED,
        Status.OK: Outcome.PASSED,
    }[verdict.status]


def _kind(verdict: Verdict) -> str:
    """Type of a failure: class of the best score, else `missing`, else the status."""
    if verdict.failing:
        return max(verdict.failing, key=lambda event: event.score).label
    return "missing" if verdict.missing else verdict.status.value


def _results(verdict: Verdict) -> list[dict[str, Any]]:
    case = _case(verdict)
    if case.outcome is not Outcome.FAILURE:
        return []
    number: Counter[str] = Counter()
    results = []
    facts = [
        (
            event.label,
            sentence(verdict, event),
            {"start": round(event.start, 6), "stop": round(event.stop, 6)},
        )
        for event in verdict.failing
    ]
    facts += [(each.rule, str(each), {}) for each in verdict.missing]
    known = _uri(verdict.path) if verdict.of_run else case.name
    for rule, told, span in facts:
        number[rule] += 1
        same = f"{known}:{rule}:{number[rule]}"
        results.append(
            {
                "ruleId": rule,
                "level": "error",
                "message": {"text": f"{case.name}: {told}"},
                "locations": [_location(verdict.path, case.line or 1)],
                "partialFingerprints": {
                    "primaryLocationLineHash": hashlib.sha256(same.encode()).hexdigest()[:16]
                },
                "properties": span,
            }
        )
    return results


def _location(path: Path, line: int = 1) -> dict[str, object]:
    return {
        "physicalLocation": {
            "artifactLocation": {"uri": _uri(path)},
            "region": {"startLine": line},
        }
    }


def _uri(path: Path) -> str:
    """Address of a file, relative to the folder of the job if it lies there."""
    full, here = path.absolute(), Path.cwd()
    return quote(full.relative_to(here).as_posix()) if full.is_relative_to(here) else full.as_uri()


def _described(rule: str) -> str:
    known = {
        "missing-log": "A scenario that was accepted has no log.",
        "louder": "A joint is louder than in accepted runs.",
    }
    if rule in known:
        return known[rule]
    label = rule.removeprefix("missing-")
    if label != rule:
        return f"A required finding of class {label.replace('-', ' ')} was not found."
    return f"The noise of the joints shows a failure of class {label}."


FORMATS: dict[str, Callable[[Sequence[Verdict]], str]] = {
    "text": text,
    "json": as_json,
    "junit": lambda verdicts: junit(_by_run(verdicts)),
    "github": lambda verdicts: github(_by_scenario(verdicts)),
    "sarif": sarif,
    "markdown": lambda verdicts: markdown(
        _by_scenario(verdicts),
        head="| scenario | status | findings |",
        notes="Findings that do not count",
    ),
}
