"""Verdicts and differences as text, JSON, JUnit XML, GitHub annotations, SARIF and Markdown.

JUnit, GitHub, SARIF and Markdown are written from a job of cases: a run, a scenario, or a file that
cannot be read, of verdicts and of differences alike.
"""

import hashlib
import json
import os
import re
import shlex
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, zip_longest
from pathlib import Path
from typing import Any
from urllib.parse import quote
from xml.etree import ElementTree as ET

from inspector.analysis import NOTHING
from inspector.errors import EXIT, IGNORED, Status, Unknown
from inspector.reference import difference as diff
from inspector.reference.difference import LOUDER, NEW, RESOLVED, Difference
from inspector.reference.store import REPETITION
from inspector.report import WORDS, words
from inspector.text import counted, program_version
from inspector.verdict import END, RESULTS, UNREAD, Beside, Finding, Verdict, counts, exit_status
from noiseclassifier.labels import interval

ANNOTATIONS = 10  # GitHub silently drops what goes beyond ten of a kind per step
COMMENT = 60_000  # most characters of the Markdown: GitHub refuses comments of more than 65,536
# First line of the Markdown, by which a script finds its own comment to replace it: a job may have
# one of verdicts and one of a difference.
MARKER, DIFF_MARKER = "<!-- noise-inspector -->", "<!-- noise-inspector diff -->"
MOST_RESULTS = 5000  # GitHub shows no more results of one SARIF file
SARIF_SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"
# Findings of a scenario that are listed, and of a difference those of each kind.
MOST, MOST_OF_KIND = 20, 5
QUIET = (Status.OK, diff.Outcome.SAME)  # what tables leave out
REPEATED = r"\d+% by \d+ repetitions? of "  # what the line on the reference says for all runs
# By what else remarks of runs differ that say the same.
AMOUNT = r"^\d+% (?=by )|^[\d.]+ dB (?=quieter)"
# Onsets this close in repetitions are one row, in [s]: the hop of frames is 0.1 s or 0.2 s.
TOGETHER = 0.25
# What is written for characters that mean more: in GitHub's commands and their properties, in code
# in a cell of Markdown, and outside of code.
COMMAND = str.maketrans({"%": "%25", "\r": "%0D", "\n": "%0A"})
PROPERTY = COMMAND | str.maketrans({":": "%3A", ",": "%2C"})
CODE, HTML = str.maketrans({"|": "\\|", "`": "'"}), str.maketrans({"&": "&amp;", "<": "&lt;"})
COUNTED = WORDS | {Status.FINDINGS: "with findings"}  # how people count them

# What a case is as a test, by its element in JUnit XML.
PASSED, FAILURE, ERROR, SKIPPED = "", "failure", "error", "skipped"
OUTCOMES = {
    Status.FINDINGS: FAILURE,
    Status.BAD_INPUT: ERROR,
    Status.INTERNAL_ERROR: ERROR,
    Status.CANNOT_TELL: SKIPPED,
    Status.OK: PASSED,
}


@dataclass(frozen=True)
class Case:
    """One case: a run, a scenario, or a file that cannot be read."""

    name: str
    path: Path  # the file that it is about
    status: str  # what became of it, as machines read it
    words: str  # and as people do
    outcome: str  # of OUTCOMES
    rank: tuple[float, ...]  # sorts cases, the worst first
    kind: str  # of a failure or an error
    sentences: tuple[str, ...] = ()  # what fails it
    message: str = ""  # a line that says more
    notes: tuple[str, ...] = ()  # what does not fail it, a sentence each
    cells: tuple[tuple[str, ...], ...] = ()  # all that as rows of a text
    trace: str = ""
    seconds: float = 0.0  # that it took
    picture: Path | None = None
    rules: tuple[tuple[str, dict[str, float]], ...] = ()  # of each sentence, and when, in [s]

    @property
    def told(self) -> str:
        """What is said of it in a line."""
        return "; ".join(self.sentences) or self.message


@dataclass(frozen=True)
class Job:
    """All cases of a job, in order of their files, with counts by kind and name."""

    title: str
    marker: str
    summary: str
    counts: Mapping[str, Mapping[str, int]]
    cases: Sequence[Case]
    exit_status: int
    remark: str = ""

    @property
    def ranked(self) -> list[Case]:
        """The cases, the worst first."""
        return sorted(self.cases, key=lambda case: case.rank)


# --- what continuous integration reads


def junit(job: Job) -> str:
    """Write a job as JUnit XML: a test case each.

    A case has one `failure` with all that fails it, since Jenkins keeps the last of several. A
    picture is attached by a line ``[[ATTACHMENT|path]]``, which GitLab, Jenkins and Azure read.
    """
    outcomes = Counter(case.outcome for case in job.cases)
    root = ET.Element("testsuites")
    suite = ET.SubElement(
        root,
        "testsuite",
        name="inspector",
        tests=str(len(job.cases)),
        failures=str(outcomes[FAILURE]),
        errors=str(outcomes[ERROR]),
        skipped=str(outcomes[SKIPPED]),
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
        lines = [case.message] if case.message and (case.sentences or not case.outcome) else []
        lines += case.notes
        if case.outcome:
            element = ET.SubElement(node, case.outcome, message=_plain(case.told))
            if case.outcome != SKIPPED:
                element.set("type", _plain(case.kind))
            parts = [*(case.sentences or [case.message]), *filter(None, [case.trace])]
            element.text = _plain("\n".join(parts))
        if case.picture is not None:
            lines.append(f"[[ATTACHMENT|{case.picture}]]")
        if lines:
            ET.SubElement(node, "system-out").text = _plain("\n".join(lines))
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True)


def _plain(value: object) -> str:
    """Drop the control characters that XML forbids."""
    return re.sub(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "", str(value))


def github(job: Job) -> str:
    """Write a job as GitHub workflow commands: the ten worst, and the counts of several cases.

    Files that cannot be read take five of ten errors at most where others fail.
    """
    bad, failed, skipped = (
        [case for case in job.ranked if case.outcome == outcome]
        for outcome in (ERROR, FAILURE, SKIPPED)
    )
    shown = [*bad[: max(ANNOTATIONS // 2, ANNOTATIONS - len(failed))], *failed][:ANNOTATIONS]
    lines = [_annotation("error", case) for case in shown]
    lines += [_annotation("warning", case) for case in skipped[:ANNOTATIONS]]
    lines += [f"::notice::{job.remark.translate(COMMAND)}"] if job.remark else []
    left = len(bad) + len(failed) - len(shown)
    more = f"; {left} more are not shown here" if left else ""
    if len(job.cases) > 1 or not lines:
        lines += [f"::notice title=noise-inspector::{job.summary.translate(COMMAND)}{more}"]
    return "\n".join(lines)


def _annotation(kind: str, case: Case) -> str:
    file, name = (each.translate(PROPERTY) for each in (str(case.path), case.name))
    title = "" if name == file else f",title={name}"
    return f"::{kind} file={file}{title}::{f'{case.status}: {case.told}'.translate(COMMAND)}"


def sarif(job: Job) -> str:
    """Write what fails cases as SARIF 2.1.0, the worst first.

    A result lies in the first line of its case's file: GitHub shows no result without a location.
    Files that cannot be read and what cannot be told are notifications of the tool.
    """
    results = [result for case in job.ranked for result in _results(case)][:MOST_RESULTS]
    rules = [
        {
            "id": rule,
            "shortDescription": {"text": f"Noise of the joints: {rule.replace('-', ' ')}"},
            "defaultConfiguration": {"level": "error"},
        }
        for rule in dict.fromkeys(result["ruleId"] for result in results)
    ]
    notes = [
        {
            "level": "error" if case.outcome == ERROR else "warning",
            "message": {"text": f"{case.status}: {case.message}"},
            "locations": [_location(case.path)],
        }
        for case in job.ranked
        if case.outcome in (ERROR, SKIPPED)
    ]
    invocation = {
        "executionSuccessful": all(case.outcome != ERROR for case in job.cases),
        "exitCode": job.exit_status,
        "toolExecutionNotifications": notes,
    }
    driver = {"name": "noise-inspector", "version": program_version(), "rules": rules}
    about = {"counts": job.counts} | ({"remark": job.remark} if job.remark else {})
    run = {"tool": {"driver": driver}, "invocations": [invocation], "results": results}
    whole = {"$schema": SARIF_SCHEMA, "version": "2.1.0", "runs": [{**run, "properties": about}]}
    return json.dumps(whole, indent=2)


def _results(case: Case) -> Iterator[dict[str, Any]]:
    """What fails a case, as results of SARIF."""
    known = _uri(case.path) if case.name == str(case.path) else case.name
    number = Counter[str]()
    for sentence, (rule, span) in zip(case.sentences, case.rules, strict=True):
        number[rule] += 1
        same = hashlib.sha256(
            f"{known}:{rule}:{number[rule]}".encode(errors="replace")
        ).hexdigest()[:16]
        yield {
            "ruleId": rule,
            "level": "error",
            "message": {"text": f"{case.name}: {sentence}"},
            "locations": [_location(case.path)],
            "partialFingerprints": {"primaryLocationLineHash": same},
            "properties": span,
        }


def _location(path: Path) -> dict[str, object]:
    place = {"artifactLocation": {"uri": _uri(path)}, "region": {"startLine": 1}}
    return {"physicalLocation": place}


def _uri(path: Path) -> str:
    """Address of a file, relative to the folder of the job if it lies there."""
    full, here = path.absolute(), Path.cwd()
    inside = full.is_relative_to(here)
    return quote(os.fsencode(full.relative_to(here))) if inside else full.as_uri()


def markdown(job: Job) -> str:
    """Write a job for its summary or a comment: a table, the worst first, and a picture."""
    ranked = job.ranked
    shown = [case for case in ranked if case.outcome or case.status not in QUIET]
    lines, tail = [job.marker, f"### {job.title}: {job.summary}", ""], [""]
    if job.remark:
        tail += [f"{job.remark.capitalize()}.", ""]
    worst = next((case for case in ranked if case.picture is not None), None)
    if worst is not None and shown:
        tail += [f"Picture of {_code(worst.name)}: {_code(worst.picture)}."]
    rows = [f"| {_code(case.name)} | {case.words} | {_cell(case.told)} |" for case in shown]
    left = [f"- {_code(case.name)}: {_cell(note)}" for case in ranked for note in case.notes]
    if rows:
        lines += _cut(["| scenario | status | findings |", "|---|---|---|"], rows, COMMENT * 2 // 3)
    lines += tail
    if left:
        opened = ["", f"<details><summary>What does not count: {len(left)}</summary>", ""]
        lines += [*_cut(opened, left, COMMENT // 4), "", "</details>"]
    return "\n".join(lines).rstrip()


def _cell(value: object) -> str:
    """A text that stays in its cell, and is no HTML."""
    return " ".join(str(value).split()).translate(CODE | HTML)


def _code(path: object) -> str:
    """A path that stays in its cell."""
    return f"`{' '.join(str(path).split()).translate(CODE)}`"


def _cut(head: list[str], lines: list[str], room: int) -> list[str]:
    """As many lines as there is room for, and how many are left out."""
    ends = accumulate(len(line) + 1 for line in lines)
    kept = [line for line, end in zip(lines, ends, strict=True) if end <= room]
    left = len(lines) - len(kept)
    return [*head, *kept, *(["", f"{left} more are left out here."] if left else [])]


# --- verdicts


def summary(verdicts: Sequence[Verdict]) -> str:
    """Count runs by status and findings by what became of them, in a line."""
    number = counts(verdicts)
    runs = [f"{n} {COUNTED[Status(name)]}" for name, n in number["runs"].items() if n]
    ignored = sum(verdict.ignored for verdict in verdicts)
    runs += [f"{ignored} of the bad input ignored"] if ignored else []
    absent = sum(len(verdict.missing) for verdict in verdicts if not verdict.of_run)
    logs = f"; too few logs of {counted(absent, 'required scenario')}" if absent else ""
    findings = _numbers(number["findings"])
    total = counted(sum(verdict.of_run for verdict in verdicts), "run")
    found = f"; findings: {findings}" if findings else ""
    return f"{total}: {', '.join(runs) or 'none'}{logs}{found}"


def _numbers(numbers: Mapping[str, int]) -> str:
    return ", ".join(f"{n} {name.replace('-', ' ')}" for name, n in numbers.items() if n)


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


def folded(
    found: Iterable[tuple[Path, Finding, Beside | None]], runs: int
) -> list[tuple[Finding, Beside | None, str]]:
    """Findings by run: of those that are one the loudest, and how many of so many runs have it."""
    if runs == 1:  # findings of one run are never one
        return [(event, beside, "") for _, event, beside in found]
    groups: list[tuple[object, list[tuple[Path, Finding, Beside | None]]]] = []
    for each in found:
        run, event, _ = each
        kind = event.label, event.evidence.joint, event.evidence.band_hz, event.became
        for of, group in groups:
            near = abs(event.start - group[0][1].start) <= TOGETHER
            if of == kind and near and run != group[0][0]:
                group.append(each)
                break
        else:
            groups.append((kind, [each]))
    result = []
    for _, group in groups:
        worst = max(group, key=lambda each: (each[1].evidence.over_db or 0.0, each[1].score))
        number = len({run for run, *_ in group})
        result.append((*worst[1:], f"{number} of {counted(runs, 'run')}"))
    return result


def groups(verdicts: Iterable[Verdict], *, by_run: bool = False) -> list[tuple[list[Verdict], str]]:
    """Runs by scenario, the worst first, or in order and each alone; with their names.

    A scenario is what runs of one folder name so, or have one name but for a number, and one that
    has no log. What could not be read stays alone.
    """
    every: list[Verdict] = []
    for verdict in verdicts:
        absent = [replace(verdict, missing=(each,)) for each in verdict.missing]
        every += [verdict] if verdict.of_run else absent
    if not by_run:
        every.sort(key=lambda each: (each.of_run, each.severity))
    found: dict[tuple[Path | int, str], list[Verdict]] = {}
    for place, verdict in enumerate(every):
        path, repeated = verdict.path, REPETITION.fullmatch(verdict.path.stem)
        if by_run or not verdict.of_run or verdict.status in UNREAD:
            name = "" if verdict.of_run else verdict.missing[0].scenario
            key: tuple[Path | int, str] = place, name
        else:
            name = str(path.with_name(repeated["name"]) if repeated else path)
            key = path.parent, verdict.scenario or name
        found.setdefault(key, []).append(verdict)
    return [
        (each, name if len(each) > 1 or not each[0].of_run else str(each[0].path))
        for (_, name), each in found.items()
    ]


def table(rows: Sequence[Sequence[str]]) -> list[str]:
    """Lines of cells, each column as wide as its widest cell.

    A row of fewer cells ends with a sentence, which may reach over the columns to its right.
    """
    most = max(map(len, rows), default=0)
    kept = [cells if len(cells) == most else cells[:-1] for cells in rows]
    widths = [max(map(len, column)) for column in zip_longest(*kept, fillvalue="")]
    lines = []
    for cells in rows:
        pairs = zip(cells, widths, strict=False)
        shown = [cell.ljust(width) for cell, width in pairs if width or cell]
        lines.append("   ".join(shown).rstrip())
    return lines


def text(verdicts: Sequence[Verdict], *, verbose: bool = False) -> str:
    """Verdicts as text: a line for each finding; of several runs a row per scenario, worst first.

    Bad inputs are left out: the command line prints them on stderr.
    """
    read = [each for each in verdicts if each.status not in UNREAD]
    if len(verdicts) == 1 and read and read[0].of_run:
        (one,) = read
        status, facts = WORDS[one.status], ""
        if one.status is Status.CANNOT_TELL:
            status += f": {one.message}"
        elif one.rate:
            facts = f"{one.duration:.1f} s, {counted(one.joints, 'joint')}, {one.rate:g} Hz"
        by = one.expectations and f"by {one.expectations}"
        lines = ["   ".join(filter(None, [str(one.path), status, facts, by]))]
        lines += [f"  {line}" for line in table(case_of(read).cells)]
    else:
        lines = _rows(case_of(*group) for group in groups(read))
    runs = [each for each in read if each.of_run]
    if verbose:
        lines += [f"run:     {each.path} [{each.model or 'no model'}]" for each in runs]
    lines += _remarks(runs, verbose=verbose or len(verdicts) == 1)
    worst = min(runs, key=lambda each: each.severity, default=None)
    if worst is not None and worst.failing:
        lines.append(f"next:    inspector view {shlex.quote(str(worst.path))}")
    return "\n".join([*lines, summary(verdicts)] if len(verdicts) > 1 else lines)


def _rows(cases: Iterable[Case]) -> list[str]:
    """Lines of cases: the first row of each beside its name, the others below."""
    rows = []
    for case in cases:
        left = len(case.cells) - MOST
        cells = [*case.cells[:MOST], *([(f"and {left} more (--format json)",)] if left > 0 else [])]
        if case.status == Status.CANNOT_TELL or not cells:
            cells.append((case.message if case.outcome == SKIPPED else "",))
        head = case.name, case.words
        for each in cells:
            rows.append((*head, *each))
            head = "", ""
    return table(rows)


def _remarks(verdicts: Sequence[Verdict], *, verbose: bool) -> Iterator[str]:
    """What limits verdicts, once for all runs that it limits, and what they were compared with."""
    runs: Counter[str] = Counter()
    for verdict in verdicts:
        if verdict.status is not Status.CANNOT_TELL:
            runs[re.sub(NOTHING if len(verdicts) > 1 else "", "", verdict.message)] += 1
        if verdict.beside and verbose:
            runs[verdict.beside.words] += 1
        elif verdict.beside:
            parts = verdict.beside.words.split("; ")
            runs.update(re.sub(AMOUNT, "", each) for each in parts if not re.match(REPEATED, each))
        elif len(verdicts) > 1 and verdict.expectations:
            runs[f"by {verdict.expectations}"] += 1
    del runs[""]
    for message, number in runs.items():
        several = f" ({number} of {len(verdicts)} runs)" if 1 < len(verdicts) != number else ""
        yield f"note:    {message}{several}"
    known = [each.beside for each in verdicts if each.beside and each.beside.repetitions]
    if known and not verbose:
        scenarios = counted(len({each.scenarios for each in known}), "scenario")
        most = counted(max(each.repetitions for each in known), "repetition")
        margin = max(db for each in known for db in each.margins_db.values())
        yield f"reference: {scenarios}, up to {most}, margin up to {margin:.1f} dB"


def as_json(verdicts: Sequence[Verdict]) -> str:
    """Verdicts as JSON, ``noise-verdict/3``; its schema is docs/noise-verdict-3.schema.json."""
    whole = {
        "format": RESULTS,
        "version": program_version(),
        "exit_status": exit_status(verdicts),
        "counts": counts(verdicts),
        "runs": [verdict.as_dict() for verdict in verdicts],
    }
    return json.dumps(whole, indent=2)


def case_of(verdicts: Sequence[Verdict], name: str = "") -> Case:
    """A run as a case, all runs of a scenario, the worst first, or a scenario that has no log."""
    worst, number = verdicts[0], len(verdicts)
    every = [(one.path, each, one.beside) for one in verdicts for each in one.events]
    failing, others = (
        folded([each for each in every if each[1].fails is fails], number)
        for fails in (True, False)
    )
    missing = list(dict.fromkeys(each for one in verdicts for each in one.missing))
    cells = [*(row(*each) for each in (*failing, *others)), *((each.told,) for each in missing)]
    if number > 1 and not cells:
        cells = [(counted(number, "run"),)]
    kind = "missing" if worst.missing else worst.status.value
    if worst.failing:
        kind = max(worst.failing, key=lambda event: event.score).label
    became = WORDS[worst.status]
    if worst.missing and not worst.failing:  # a scenario may be missing or cut
        lacks = worst.missing[0]
        became = "MISSING" if lacks.scenario else "CUT" if lacks.label == END else became
    return Case(
        name=name or str(worst.path),
        path=worst.path,
        status=worst.status,
        words=became,
        outcome=SKIPPED if worst.ignored else OUTCOMES[worst.status],
        rank=worst.severity,
        kind=kind,
        sentences=(*(told(*each) for each in failing), *(each.told for each in missing)),
        rules=(
            *((each.label, _rounded(each, "start", "stop")) for each, *_ in failing),
            *((f"missing-{each.kind}", {}) for each in missing),
        ),
        message=worst.message,
        notes=tuple(told(*each) for each in others),
        cells=tuple(cells),
        trace=worst.trace,
        seconds=worst.seconds,
        picture=next((each.picture for each in verdicts if each.picture), None),
    )


def _rounded(of: object, *names: str, digits: int = 6) -> dict[str, float]:
    return {name: round(getattr(of, name), digits) for name in names}


def _job(verdicts: Sequence[Verdict], *, by_run: bool) -> Job:
    """All runs as cases, or all scenarios."""
    cases = [case_of(*each) for each in groups(verdicts, by_run=by_run)]
    remark = IGNORED if any(each.unknown is Unknown.IGNORE for each in verdicts) else ""
    number, status = counts(verdicts), exit_status(verdicts)
    return Job("Noise", MARKER, summary(verdicts), number, cases, status, remark)


FORMATS: dict[str, Callable[[Sequence[Verdict]], str]] = {
    "text": text,
    "json": as_json,
    "junit": lambda verdicts: junit(_job(verdicts, by_run=True)),
    "github": lambda verdicts: github(_job(verdicts, by_run=False)),
    "sarif": lambda verdicts: sarif(_job(verdicts, by_run=True)),
    "markdown": lambda verdicts: markdown(_job(verdicts, by_run=False)),
}


# --- differences


def diff_text(found: Difference) -> str:
    """A row for each scenario, the worst first, with a line for each new finding; remarks last."""
    cases = [_of_row(found, each) for each in found.rows]
    remarks = dict.fromkeys(remark for each in found.rows for remark in each.remarks)
    lines = [_diff_summary(found), "", *_rows(cases), *(f"note:    {each}" for each in remarks)]
    worse = [each for each in found.rows if each.outcome is diff.Outcome.WORSE]
    for before, worst in [(each.before[0], each.worst) for each in worse if each.worst][:1]:
        lines.append(f"next:    inspector view {before} {worst.run.run}")
    return "\n".join(lines).rstrip()


def _folded(of: diff.Row, kind: str) -> list[str]:
    """Findings of a kind, one line for what repetitions share."""
    own = [(each.run, each.event, None) for each in of.findings if each.kind == kind]
    shared = folded(own, len(of.before if kind == RESOLVED else of.after))
    lines = [f"{kind}: {told(*each, short=True)}" for each in shared[:MOST_OF_KIND]]
    left = len(shared) - MOST_OF_KIND
    return lines + ([f"and {left} more {kind} (--format json)"] if left > 0 else [])


def diff_json(found: Difference) -> str:
    """The difference as JSON, ``noise-diff/2``; its schema is docs/noise-diff-2.schema.json."""
    whole = {
        "format": "noise-diff/2",
        "version": program_version(),
        "exit_status": found.exit_status,
        "counts": _diff_counts(found),
        "verdict": found.outcome,
        "margin_db": found.margin,
        "scenarios": [
            {
                "name": of.name,
                "verdict": of.outcome,
                "reason": of.reason,
                "reference": [str(path) for path in of.before],
                "candidate": [str(path) for path in of.after],
                "margin_db": round(of.margin, 3),
                "over_db": None if of.score is None else round(of.score, 3),
                "findings": [_finding_as_dict(each) for each in of.findings],
                "changes": [
                    {
                        "kind": "joint and band" if each.signal == "velocity" else "tracking error",
                        "joint": each.joint,
                        "band_hz": list(each.band),
                        **_rounded(each, "change", "low", "high", digits=3),
                    }
                    for each in of.changes
                ],
                "remarks": list(of.remarks),
            }
            for of in found.rows
        ],
        "picture": None if found.picture is None else str(found.picture),
        "unpaired": [
            {
                "run": str(path),
                "side": "candidate" if of.after else "reference",
                "findings": [_finding_as_dict(each) for each in of.findings if each.run == path],
            }
            for of in found.alone
            for path in (*of.before, *of.after)
        ],
        "failed": {str(each.path): each.message for each in found.failed},
    }
    return json.dumps(whole, indent=2, ensure_ascii=False, allow_nan=False)


def _finding_as_dict(each: diff.ChangedFinding) -> dict[str, Any]:
    return {
        "kind": each.kind,
        "run": str(each.run),
        "label": each.event.label,
        **_rounded(each.event, "start", "stop"),
        "level_db": each.event.evidence.level_db,
        "change_db": each.event.evidence.over_db,
    }


def _diff_counts(found: Difference) -> dict[str, dict[str, int]]:
    """Count scenarios by what became of them, findings by kind, and files."""
    outcomes = Counter(each.outcome for each in found.rows)
    kinds = Counter(each.kind for of in found.rows for each in of.findings)
    every, unpaired = (
        sum(len(each.before) + len(each.after) for each in rows)
        for rows in (found.rows, found.alone)
    )
    bugs = sum(each.status is Status.INTERNAL_ERROR for each in found.failed)
    return {
        "scenarios": {each.value: outcomes[each] for each in diff.Outcome},
        "findings": {kind: kinds[kind] for kind in (NEW, LOUDER, RESOLVED)},
        "files": {
            "compared": every - unpaired,
            "not-paired": unpaired,
            "bad-input": len(found.failed) - bugs,
            "internal-error": bugs,
        },
    }


def _diff_summary(found: Difference) -> str:
    """The counts in a line, new findings first."""
    number = _diff_counts(found)
    findings = _numbers(number["findings"])
    left = _numbers({name: n for name, n in number["files"].items() if name != "compared"})
    total = counted(len(found.rows), "scenario")
    parts = [f"{found.outcome}: {total} ({_numbers(number['scenarios'])})" if found.rows else ""]
    parts += [f"findings: {findings}" if findings else "", f"files: {left}" if left else ""]
    return "; ".join(filter(None, parts)) or "nothing is compared"


def _of_difference(found: Difference) -> Job:
    """All scenarios as cases, and the files that cannot be compared."""
    outcome = ERROR if found.unread_fails else SKIPPED
    cases = [_of_row(found, each) for each in found.rows]
    cases += [replace(case_of([each]), outcome=outcome, seconds=0.0) for each in found.failed]
    title, number = "Noise beside the runs before", _diff_counts(found)
    return Job(title, DIFF_MARKER, _diff_summary(found), number, cases, found.exit_status)


def _of_row(found: Difference, of: diff.Row) -> Case:
    """A scenario as a case, with a line for each finding that is new, louder or resolved."""
    status, place = found.status(of), found.rows.index(of)
    lines, resolved = [*_folded(of, NEW), *_folded(of, LOUDER)], _folded(of, RESOLVED)
    worse = of.outcome is diff.Outcome.WORSE
    # Without the levels of what is new, what became of the scenario is told first.
    if not worse or all(each.event.evidence.over_db is None for each in of.new):
        lines = [of.reason, *(str(each) for each in of.changes[:1] if worse), *lines]
    fails = status is Status.FINDINGS
    others = [] if fails else [line for line in lines if line != of.reason]
    return Case(
        name=of.name,
        path=Path(of.worst.run.run) if of.worst else (of.after or of.before)[0],
        status=of.outcome,
        words=of.outcome.upper() if fails else of.outcome,
        outcome=OUTCOMES[status],
        rank=(list(EXIT).index(status), place),
        kind=of.outcome if worse or of.outcome in diff.BROKEN else "new finding",
        sentences=tuple(lines) if fails else (),
        message="" if fails else of.reason,
        notes=(*others, *resolved, *of.remarks),
        cells=tuple((line,) for line in [*lines, *resolved]),
        picture=found.picture if not place else None,
    )


DIFF_FORMATS: dict[str, Callable[[Difference], str]] = {
    "text": diff_text,
    "json": diff_json,
    "junit": lambda found: junit(_of_difference(found)),
    "github": lambda found: github(_of_difference(found)),
    "markdown": lambda found: markdown(_of_difference(found)),
}
