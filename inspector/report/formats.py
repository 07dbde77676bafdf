"""Verdicts as text, JSON, JUnit XML, GitHub annotations, SARIF and Markdown."""

import hashlib
import json
import re
import shlex
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import quote

from inspector.analysis import NOTHING
from inspector.report import cases
from inspector.report.cases import Case, Job, Outcome
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
from inspector.status import IGNORED, Status, Unknown
from inspector.text import counted
from inspector.verdict import Verdict, counts, exit_status
from inspector.version import program_version

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
    found = [f"{n} {_words(name)}" for name, n in number["findings"].items() if n]
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


def junit(verdicts: Sequence[Verdict]) -> str:
    """Write verdicts as JUnit XML: a test case per run, of the type of its best score."""
    return cases.junit(_job(verdicts))


def github(verdicts: Sequence[Verdict]) -> str:
    """Write verdicts as GitHub workflow commands: the ten worst, and the counts of several runs.

    Runs that cannot be told, and bad input that is ignored, are warnings.
    """
    return cases.github(_folded(verdicts))


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


def markdown(verdicts: Sequence[Verdict]) -> str:
    """Write verdicts for a job's summary or a comment: a table, the worst first, and a picture."""
    head, notes = "| scenario | status | findings |", "Findings that do not count"
    return cases.markdown(_folded(verdicts), head=head, notes=notes)


FORMATS: dict[str, Callable[[Sequence[Verdict]], str]] = {
    "text": text,
    "json": as_json,
    "junit": junit,
    "github": github,
    "sarif": sarif,
    "markdown": markdown,
}


def _ignoring(verdicts: Sequence[Verdict]) -> bool:
    return any(verdict.unknown is Unknown.IGNORE for verdict in verdicts)


def _job(verdicts: Sequence[Verdict]) -> Job:
    """All runs as cases, for programs that count runs."""
    found = [
        Case(
            name=str(verdict.path) if verdict.of_run else verdict.missing[0].scenario,
            path=verdict.path,
            line=0 if verdict.of_run else verdict.missing[0].line,
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
        for verdict in each_missing(verdicts)
    ]
    remarks = (IGNORED,) if _ignoring(verdicts) else ()
    return Job("Noise", summary(verdicts), counts(verdicts), found, remarks)


def _folded(verdicts: Sequence[Verdict]) -> Job:
    """All scenarios as cases, for people."""
    found = []
    for group in groups(verdicts):
        (case,) = _job([group.worst]).cases
        drawn = next((each for each in group.verdicts if each.picture), group.worst)
        found.append(
            replace(
                case,
                name=group.name,
                words=group.words,
                sentences=tuple(group.sentences),
                notes=tuple(group.notes),
                timeline=timeline(group.worst),
                picture=drawn.picture,
                picture_url=drawn.picture_url,
            )
        )
    return replace(_job(verdicts), cases=found)


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
    if _outcome(verdict) is not Outcome.FAILURE:
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
    line = 0 if verdict.of_run else verdict.missing[0].line
    name = f"{verdict.path}" if verdict.of_run else verdict.missing[0].scenario
    known = _uri(verdict.path) if verdict.of_run else name
    for rule, told, span in facts:
        number[rule] += 1
        same = f"{known}:{rule}:{number[rule]}"
        results.append(
            {
                "ruleId": rule,
                "level": "error",
                "message": {"text": f"{name}: {told}"},
                "locations": [_location(verdict.path, line or 1)],
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


def _words(ruling: str) -> str:
    return ruling.replace("-", " ")
