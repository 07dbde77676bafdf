"""Verdicts as text, JSON, JUnit XML, GitHub annotations, SARIF and Markdown."""

import hashlib
import json
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from inspector.analysis.status import IGNORED, Status, Unknown
from inspector.report import cases
from inspector.report.cases import Case, Job, Outcome
from inspector.text import counted
from inspector.verdict import Verdict, counts, exit_status
from inspector.version import program_version
from noiseclassifier import Event
from noiseclassifier.labels import interval

SARIF_SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"
RESULTS = 5000
"""GitHub shows no more results of one SARIF file."""

WORDS = {
    Status.INTERNAL_ERROR: "internal error",
    Status.BAD_INPUT: "bad input",
    Status.FINDINGS: "with findings",
    Status.CANNOT_TELL: "cannot tell",
    Status.OK: "ok",
}
"""How people read a status."""


def summary(verdicts: Sequence[Verdict]) -> str:
    """Count runs by status and findings by what became of them, in a line."""
    number = counts(verdicts)
    runs = [f"{n} {WORDS[Status(name)]}" for name, n in number["runs"].items() if n]
    ignored = sum(verdict.ignored for verdict in verdicts)
    runs += [f"{ignored} of the bad input ignored"] if ignored else []
    absent = sum(len(verdict.missing) for verdict in verdicts if not verdict.of_run)
    logs = f"; no log for {counted(absent, 'required finding')}" if absent else ""
    found = [f"{n} {_words(name)}" for name, n in number["findings"].items() if n]
    total = counted(sum(verdict.of_run for verdict in verdicts), "run")
    findings = f"; findings: {', '.join(found)}" if found else ""
    return f"{total}: {', '.join(runs) or 'none'}{logs}{findings}"


def text(verdicts: Sequence[Verdict]) -> str:
    """Verdicts as text: a line per run, a line per finding, and the counts of several runs.

    Bad inputs are left out: the command line prints them on stderr.
    """
    lines = []
    for verdict in verdicts:
        if verdict.status in (Status.BAD_INPUT, Status.INTERNAL_ERROR):
            continue
        model = f" [{verdict.model}]" if verdict.model else ""
        expected = f", by {verdict.expectations}" if verdict.expectations and verdict.of_run else ""
        message = f": {verdict.message}" if verdict.message else ""
        lines.append(f"{verdict.path}: {verdict.status}{model}{expected}{message}")
        lines += [f"  {sentence}" for sentence in (*failing(verdict), *excused(verdict))]
    return "\n".join([*lines, summary(verdicts)] if len(verdicts) > 1 else lines)


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
    return cases.github(_job(verdicts))


def sarif(verdicts: Sequence[Verdict]) -> str:
    """Write the findings that count as SARIF 2.1.0, the worst runs first.

    The location of a finding is its run's file: GitHub shows no result without one, and takes its
    first line where there is no other. Expected findings are counted, but no results: GitHub would
    show them. Bad input is a notification of the tool, and so is what cannot be told.
    """
    ranked = sorted(verdicts, key=lambda verdict: verdict.severity)
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
    head, notes = "| run | status | findings |", "Findings that do not count"
    return cases.markdown(_job(verdicts), head=head, notes=notes)


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
    found = [
        Case(
            name=str(verdict.path),
            path=verdict.path,
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
        for verdict in verdicts
    ]
    remarks = (IGNORED,) if _ignoring(verdicts) else ()
    return Job("Noise", summary(verdicts), counts(verdicts), found, remarks)


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


def failing(verdict: Verdict) -> list[str]:
    """Sentences on what fails a run."""
    return [
        *(_sentence(verdict, event) for event in verdict.failing),
        *map(str, verdict.missing),
    ]


def excused(verdict: Verdict) -> list[str]:
    """Sentences on findings that do not."""
    return [_sentence(verdict, event) for event in verdict.excused]


def _sentence(verdict: Verdict, event: Event) -> str:
    order = f", {verdict.orders[event]}" if event in verdict.orders else ""
    ruled = str(verdict.ruled(event))
    became = f" ({ruled})" if ruled else ""
    return f"{event.label} from {interval(event.start, event.stop)}{event.novelty}{order}{became}"


def _results(verdict: Verdict) -> list[dict[str, Any]]:
    if _outcome(verdict) is not Outcome.FAILURE:
        return []
    number: Counter[str] = Counter()
    results = []
    facts = [
        (
            event.label,
            _sentence(verdict, event),
            {"start": round(event.start, 6), "stop": round(event.stop, 6)},
        )
        for event in verdict.failing
    ]
    facts += [
        (f"missing-{each.label.replace(' ', '-')}", str(each), {}) for each in verdict.missing
    ]
    for rule, sentence, span in facts:
        number[rule] += 1
        same = f"{_uri(verdict.path)}:{rule}:{number[rule]}"
        results.append(
            {
                "ruleId": rule,
                "level": "error",
                "message": {"text": f"{verdict.path}: {sentence}"},
                "locations": [_location(verdict.path)],
                "partialFingerprints": {
                    "primaryLocationLineHash": hashlib.sha256(same.encode()).hexdigest()[:16]
                },
                "properties": span,
            }
        )
    return results


def _location(path: Path) -> dict[str, object]:
    return {
        "physicalLocation": {
            "artifactLocation": {"uri": _uri(path)},
            "region": {"startLine": 1},
        }
    }


def _uri(path: Path) -> str:
    """Address of a file, relative to the folder of the job if it lies there."""
    full, here = path.absolute(), Path.cwd()
    return quote(full.relative_to(here).as_posix()) if full.is_relative_to(here) else full.as_uri()


def _described(rule: str) -> str:
    label = rule.removeprefix("missing-")
    if label != rule:
        return f"A required finding of class {label.replace('-', ' ')} was not found."
    return f"The noise of the joints shows a failure of class {label}."


def _words(ruling: str) -> str:
    return ruling.replace("-", " ")
