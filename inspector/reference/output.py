"""A difference as text, JSON, JUnit XML, GitHub annotations and Markdown."""

import json
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

from inspector.reference.difference import (
    BROKEN,
    LOUDER,
    NEW,
    RESOLVED,
    Change,
    Difference,
    Finding,
    Outcome,
    Row,
)
from inspector.report import cases
from inspector.report.cases import DIFF_MARKER, Case, Job
from inspector.report.cases import Outcome as OfTest
from inspector.report.findings import table
from inspector.status import EXIT, Status
from inspector.text import counted
from inspector.version import program_version

MOST, CHANGES = 5, 3
"""Findings and changes of a scenario that the text lists."""


def text(found: Difference) -> str:
    """A row for each scenario, the worst first, and below what is new and what changed."""
    rows = [("scenario", "runs", "verdict", "over before [dB]", "findings")]
    for row in found.rows:
        kinds = Counter(each.kind for each in row.findings)
        listed = ", ".join(
            f"{kinds[kind]} {kind}" for kind in (NEW, LOUDER, RESOLVED) if kinds[kind]
        )
        score = "" if row.score is None else f"{row.score:+.1f}"
        runs = f"{len(row.before)} + {len(row.after)}"
        rows.append((row.name, runs, row.outcome.value, score, listed))
    lines = [summary(found), "", *table(rows), ""]
    for row in found.rows:
        if row.outcome is Outcome.SAME and not row.findings and not row.remarks:
            continue
        lines.append(f"{row.name}: {row.outcome}, {row.reason}")
        lines += [f"  {finding}" for finding in row.findings[:MOST]]
        if (left := len(row.findings) - MOST) > 0:
            lines.append(f"  and {counted(left, 'more finding')} (--format json)")
        if row.outcome is Outcome.WORSE:
            lines += [f"  {change}" for change in row.changes[:CHANGES]]
        lines += [f"  {remark}" for remark in row.remarks]
    bad = [row for row in found.rows if row.outcome is Outcome.WORSE and row.worst is not None]
    if bad and bad[0].worst is not None:
        lines.append(f"next: inspector view {bad[0].before[0]} {bad[0].worst.run.run}")
    return "\n".join(lines).rstrip()


def as_json(found: Difference) -> str:
    """The difference as JSON, ``noise-diff/1``; its schema is docs/noise-diff-1.schema.json."""
    alone = [row for row in found.rows if row.outcome in (Outcome.MISSING, Outcome.ADDED)]
    whole = {
        "format": "noise-diff/1",
        "version": program_version(),
        "exit_status": found.exit_status,
        "counts": counts(found),
        "verdict": found.outcome,
        "alpha": None,
        "confidence": None,
        "margin_db": found.margin,
        "paired_by": "name and motion",
        "scenarios": [_row(row) for row in found.rows],
        "together": None,
        "picture": None if found.picture is None else str(found.picture),
        "not_paired": [str(path) for row in alone for path in (*row.before, *row.after)],
        "unpaired": [
            {
                "run": str(path),
                "side": "candidate" if row.after else "reference",
                "findings": [_finding(each) for each in row.findings if each.run == path],
            }
            for row in alone
            for path in (*row.before, *row.after)
        ],
        "failed": {str(each.path): each.problem for each in found.failed},
    }
    return json.dumps(whole, indent=2, ensure_ascii=False, allow_nan=False)


def _row(row: Row) -> dict[str, Any]:
    return {
        "name": row.name,
        "verdict": row.outcome,
        "reason": row.reason,
        "testable": bool(row.changes),
        "paired": False,
        "reference": [str(path) for path in row.before],
        "candidate": [str(path) for path in row.after],
        "confidence": None,
        "margin_db": round(row.margin, 3),
        "over_db": None if row.score is None else round(row.score, 3),
        "findings": [_finding(each) for each in row.findings],
        "changes": [_change(each) for each in row.changes],
        "remarks": list(row.remarks),
    }


def _finding(each: Finding) -> dict[str, Any]:
    return {
        "kind": each.kind,
        "run": str(each.run),
        "label": each.event.label,
        "start": round(each.event.start, 6),
        "stop": round(each.event.stop, 6),
        "level_db": each.level,
        "change_db": each.over,
    }


def _change(each: Change) -> dict[str, Any]:
    return {
        "kind": "joint and band" if each.signal == "velocity" else "tracking error",
        "joint": each.joint,
        "link": None,
        "band_hz": list(each.band),
        "label": None,
        "unit": "dB",
        "change": round(each.change, 3),
        "low": round(each.low, 3),
        "high": round(each.high, 3),
        "p_louder": None,
        "p_quieter": None,
    }


def counts(found: Difference) -> dict[str, dict[str, int]]:
    """Count scenarios by what became of them, findings by kind, and files."""
    outcomes = Counter(row.outcome for row in found.rows)
    kinds = Counter(each.kind for row in found.rows for each in row.findings)
    alone = [row for row in found.rows if row.outcome in (Outcome.MISSING, Outcome.ADDED)]
    every = sum(len(row.before) + len(row.after) for row in found.rows)
    unpaired = sum(len(row.before) + len(row.after) for row in alone)
    bugs = sum(each.status is Status.INTERNAL_ERROR for each in found.failed)
    return {
        "scenarios": {each.value: outcomes[each] for each in Outcome},
        "findings": {kind: kinds[kind] for kind in (NEW, LOUDER, RESOLVED)},
        "files": {
            "compared": every - unpaired,
            "not-paired": unpaired,
            "bad-input": len(found.failed) - bugs,
            "internal-error": bugs,
        },
    }


def summary(found: Difference) -> str:
    """The counts in a line, new findings first."""
    number = counts(found)
    findings = _listed(number["findings"])
    left = _listed({name: n for name, n in number["files"].items() if name != "compared"})
    total = counted(len(found.rows), "scenario")
    parts = [f"{found.outcome}: {total} ({_listed(number['scenarios'])})" if found.rows else ""]
    parts += [f"findings: {findings}" if findings else "", f"files: {left}" if left else ""]
    return "; ".join(filter(None, parts)) or "nothing is compared"


def _listed(numbers: Mapping[str, int]) -> str:
    return ", ".join(f"{n} {name.replace('-', ' ')}" for name, n in numbers.items() if n)


def _job(found: Difference) -> Job:
    shown = [_case(found, row, place) for place, row in enumerate(found.rows)]
    shown += [
        Case(
            name=str(each.path),
            path=each.path,
            status=each.status,
            words=each.status.replace("-", " "),
            outcome=OfTest.ERROR if found.gate.failed else OfTest.SKIPPED,
            rank=(list(EXIT).index(each.status),),
            kind=each.status,
            message=each.problem,
            trace=each.trace,
        )
        for each in found.failed
    ]
    return Job("Noise beside the runs before", summary(found), counts(found), shown)


def _case(found: Difference, row: Row, place: int) -> Case:
    status = found.status(row)
    fails = status is Status.FINDINGS
    news = [str(each) for each in row.new]
    changes = list(map(str, row.changes[:CHANGES])) if row.outcome is Outcome.WORSE else []
    why = [f"{row.outcome}, {row.reason}"] if row.outcome in (*BROKEN, Outcome.WORSE) else []
    outcomes = {Status.FINDINGS: OfTest.FAILURE, Status.CANNOT_TELL: OfTest.SKIPPED}
    worst = [path for path in row.after if row.worst and str(path) == row.worst.run.run]
    others = [str(each) for each in row.findings if each.kind == RESOLVED or not fails]
    return Case(
        name=row.name,
        path=(worst or row.after or row.before)[0],
        status=row.outcome,
        words=row.outcome,
        outcome=outcomes.get(status, OfTest.PASSED),
        rank=(list(EXIT).index(status), place),
        kind=row.outcome if why else "new finding",
        sentences=(*why, *changes, *news) if fails else (),
        message="" if fails else row.reason,
        notes=(*others, *row.remarks),
        quiet=row.outcome is Outcome.SAME,
        picture=found.picture if not place else None,
        picture_url=found.picture_url,
    )


def junit(found: Difference) -> str:
    """A test case per scenario and bad file, as JUnit XML."""
    return cases.junit(_job(found))


def github(found: Difference) -> str:
    """GitHub workflow commands: the ten worst scenarios, and the counts."""
    return cases.github(_job(found))


def markdown(found: Difference) -> str:
    """A table for a job's summary or a comment, the worst first, and a picture."""
    head, notes = "| scenario | verdict | what changed |", "Changes that do not count"
    return cases.markdown(_job(found), head=head, notes=notes, marker=DIFF_MARKER)


FORMATS: dict[str, Callable[[Difference], str]] = {
    "text": text,
    "json": as_json,
    "junit": junit,
    "github": github,
    "markdown": markdown,
}
