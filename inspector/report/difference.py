"""A difference as text, JSON, JUnit XML, GitHub annotations and Markdown."""

import json
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from inspector.errors import EXIT, Status
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
from inspector.report.findings import TOGETHER, folded, table
from inspector.report.formats import Case, Job, github, junit, markdown
from inspector.report.formats import Outcome as OfTest
from inspector.text import counted, program_version

DIFF_MARKER = "<!-- noise-inspector diff -->"
"""First line of its Markdown: a job may have a comment of verdicts, too."""
MOST = 5
"""Findings of a scenario and kind that are listed."""
SHORT = 0.5
"""Up to this, in [s], the onset tells when a finding is."""


def text(found: Difference) -> str:
    """A row for each scenario, the worst first, with a line for each new finding; remarks last."""
    rows = []
    for row in found.rows:
        fails = found.status(row) is Status.FINDINGS
        name, word = row.name, row.outcome.upper() if fails else row.outcome.value
        for line in [*_told(row), *_folded(row, RESOLVED)] or [""]:
            rows.append((name, word, line))
            name = word = ""
    lines = [summary(found), "", *table(rows)]
    remarks = dict.fromkeys(remark for row in found.rows for remark in row.remarks)
    lines += [f"note:    {remark}" for remark in remarks]
    bad = [row for row in found.rows if row.outcome is Outcome.WORSE and row.worst is not None]
    if bad and bad[0].worst is not None:
        lines.append(f"next:    inspector view {bad[0].before[0]} {bad[0].worst.run.run}")
    return "\n".join(lines).rstrip()


def _told(row: Row) -> list[str]:
    """What is new in a scenario, a line each; without levels there, what became of it first."""
    found = [*_folded(row, NEW), *_folded(row, LOUDER)]
    if row.outcome is Outcome.WORSE and any(each.over is not None for each in row.new):
        return found
    change = [str(each) for each in row.changes[:1]] if row.outcome is Outcome.WORSE else []
    return [row.reason, *change, *found]


def _folded(row: Row, kind: str) -> list[str]:
    """Findings of a kind, one line for what repetitions share, by the class that most have."""
    groups = folded([each for each in row.findings if each.kind == kind], _alike)
    side = row.before if kind == RESOLVED else row.after
    lines = [f"{kind}: {_line(group, len(side))}" for group in groups[:MOST]]
    left = len(groups) - MOST
    return lines + ([f"and {left} more {kind} (--format json)"] if left > 0 else [])


def _alike(one: Finding, other: Finding) -> bool:
    same = one.event.label == other.event.label or one.evidence.joint != ""
    near = abs(one.event.start - other.event.start) <= TOGETHER
    return same and near and one.evidence.joint == other.evidence.joint and one.run != other.run


def _line(group: Sequence[Finding], runs: int) -> str:
    """Class, time, joint, octave, and how much louder: the loudest of repetitions."""
    (label, _), *_ = Counter(each.event.label for each in group).most_common(1)
    worst = max(group, key=lambda each: -math.inf if each.over is None else each.over)
    start, stop, known = worst.event.start, worst.event.stop, worst.evidence
    when = f"{start:.2f} s" if stop - start < SHORT else f"{start:.2f}-{stop:.2f} s"
    band = f"{known.octave[0]:.0f}-{known.octave[1]:.0f} Hz" if known.octave else ""
    over = "" if worst.over is None else f"{worst.over:+.0f} dB"
    number = len({each.run for each in group})
    several = f"{number} of {runs} runs" if runs > 1 else ""
    return ", ".join(filter(None, [f"{label} {when}", known.joint, band, over, several]))


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
    told = _told(row)
    outcomes = {Status.FINDINGS: OfTest.FAILURE, Status.CANNOT_TELL: OfTest.SKIPPED}
    worst = [path for path in row.after if row.worst and str(path) == row.worst.run.run]
    others = [*(line for line in told if not fails and line != row.reason), *_folded(row, RESOLVED)]
    return Case(
        name=row.name,
        path=(worst or row.after or row.before)[0],
        status=row.outcome,
        words=row.outcome,
        outcome=outcomes.get(status, OfTest.PASSED),
        rank=(list(EXIT).index(status), place),
        kind=row.outcome if row.outcome in (*BROKEN, Outcome.WORSE) else "new finding",
        sentences=tuple(told) if fails else (),
        message="" if fails else row.reason,
        notes=(*others, *row.remarks),
        quiet=row.outcome is Outcome.SAME,
        picture=found.picture if not place else None,
        picture_url=found.picture_url,
    )


FORMATS: dict[str, Callable[[Difference], str]] = {
    "text": text,
    "json": as_json,
    "junit": lambda found: junit(_job(found)),
    "github": lambda found: github(_job(found)),
    "markdown": lambda found: markdown(
        _job(found),
        head="| scenario | verdict | what changed |",
        notes="Changes that do not count",
        marker=DIFF_MARKER,
    ),
}
