"""What `diff` prints: a table of scenarios, JSON, JUnit XML, GitHub annotations, Markdown."""

import json
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from inspector.analysis.status import EXIT, Status
from inspector.compare.changes import NEW, RESOLVED
from inspector.regression.difference import (
    Change,
    Compared,
    Difference,
    Unpaired,
    Verdict,
    worst,
    worst_runs,
)
from inspector.regression.findings import LOUDER, ChangedFinding
from inspector.regression.statistic import ALPHA, CONFIDENCE
from inspector.report import cases
from inspector.report.cases import DIFF_MARKER, Case, Job, Outcome
from inspector.text import counted
from inspector.version import program_version

FORMAT = "noise-diff/1"
FINDINGS, CHANGES, UNPAIRED = 10, 5, 10
"""Most findings and changes of a scenario, and most unpaired runs, that are printed as text."""
HEAD = ("scenario", "runs", "verdict", "clearest change", "change", "interval", "p", "findings")


def as_text(found: Difference) -> str:
    """Write verdicts as a table, then what changed in each scenario that is not the same."""
    return "\n".join(_lines(found))


def as_json(found: Difference) -> str:
    """Write verdicts as JSON, ``noise-diff/1``; what is not known is null."""
    return json.dumps(
        {
            "format": FORMAT,
            "version": program_version(),
            "exit_status": found.exit_status,
            "counts": counts(found),
            "verdict": found.verdict,
            "alpha": ALPHA,
            "confidence": CONFIDENCE,
            "margin_db": found.margin,
            "paired_by": found.pairing.by,
            "scenarios": [_row(row) for row in found.scenarios],
            "together": None if found.together is None else _row(found.together),
            "picture": None if found.picture is None else str(found.picture),
            "not_paired": [str(each.path) for each in found.unpaired],
            "unpaired": [
                {
                    "run": str(each.path),
                    "side": each.side,
                    "findings": [_finding(finding) for finding in each.findings],
                }
                for each in found.unpaired
            ],
            "failed": {str(each.path): each.problem for each in found.unreadable},
        },
        indent=2,
        ensure_ascii=False,
        allow_nan=False,
    )


def junit(found: Difference) -> str:
    """Write verdicts as JUnit XML: a test case per scenario, run of one side, and bad file."""
    return cases.junit(_job(found))


def github(found: Difference) -> str:
    """Write verdicts as GitHub workflow commands: the ten worst scenarios, and the counts.

    A scenario has the file of a run of the candidate that shows what changed.
    """
    return cases.github(_job(found))


def markdown(found: Difference) -> str:
    """Write verdicts for a job's summary or a comment: a table, the worst first, and a picture."""
    head, notes = "| scenario | verdict | what changed |", "Changes that do not count"
    return cases.markdown(_job(found), head=head, notes=notes, marker=DIFF_MARKER)


FORMATS: dict[str, Callable[[Difference], str]] = {
    "text": as_text,
    "json": as_json,
    "junit": junit,
    "github": github,
    "markdown": markdown,
}


def counts(found: Difference) -> dict[str, dict[str, int]]:
    """Count what all outputs state.

    Args:
        found: The difference.

    Returns:
        `scenarios`, by verdict; `findings`, by what became of them; `files`: runs that are
        compared, files that only one side has, and those that cannot be compared. Each has all its
        keys. Findings of runs that only the candidate has are new.
    """
    verdicts = Counter(row.verdict for row in found.scenarios)
    kinds = Counter(each.kind for row in found.scenarios for each in row.findings)
    kinds.update(each.kind for run in found.unpaired for each in run.findings)
    compared = sum(len(row.reference) + len(row.candidate) for row in found.scenarios)
    bugs = sum(each.status is Status.INTERNAL_ERROR for each in found.unreadable)
    return {
        "scenarios": {verdict.value: verdicts[verdict] for verdict in Verdict},
        "findings": {kind: kinds[kind] for kind in (NEW, LOUDER, RESOLVED)},
        "files": {
            "compared": compared,
            "not-paired": len(found.unpaired),
            "bad-input": len(found.unreadable) - bugs,
            "internal-error": bugs,
        },
    }


def summary(found: Difference) -> str:
    """Count scenarios by verdict, findings and files by what became of them, in a line."""
    number = counts(found)
    total = len(found.scenarios)
    parts = ["nothing is compared"]
    if total:
        parts = [
            f"{found.verdict}: {counted(total, 'scenario')}"
            f" ({_listed(number['scenarios'])}), paired by {found.pairing.by}"
        ]
    parts += (
        [f"findings: {_listed(number['findings'])}"] if any(number["findings"].values()) else []
    )
    left = {name: n for name, n in number["files"].items() if name != "compared"}
    parts += [f"files: {_listed(left)}"] if any(left.values()) else []
    return "; ".join(parts)


def _listed(numbers: Mapping[str, int]) -> str:
    return ", ".join(f"{n} {name.replace('-', ' ')}" for name, n in numbers.items() if n)


def _job(found: Difference) -> Job:
    shown = [_case(found, row) for row in found.scenarios]
    own = {row.verdict for row in found.scenarios}
    if found.together is not None and found.verdict not in own:
        shown.append(_case(found, found.together))  # what no scenario shows by itself
    shown += [_unpaired_case(found, each) for each in found.unpaired]
    shown += [
        Case(
            name=str(each.path),
            path=each.path,
            status=each.status,
            words=each.status.replace("-", " "),
            outcome=Outcome.SKIPPED if found.ignored(each) else Outcome.ERROR,
            rank=(list(EXIT).index(each.status),),
            kind=each.status,
            message=each.problem,
            trace=each.trace,
        )
        for each in found.unreadable
    ]
    return Job("Noise beside the reference", summary(found), counts(found), shown)


def _case(found: Difference, row: Compared) -> Case:
    status = found.status(row)
    fails = status is Status.FINDINGS
    clearest = list(_significant(row)) if row.verdict is Verdict.WORSE else []
    news = [str(each) for each in row.findings if each.kind != RESOLVED]
    counted = [*clearest * found.gate.worse, *news * found.gate.new]
    others = [str(each) for each in row.findings if str(each) not in counted]
    outcomes = {Status.FINDINGS: Outcome.FAILURE, Status.CANNOT_TELL: Outcome.SKIPPED}
    worse = row.verdict is Verdict.WORSE and found.gate.worse
    return Case(
        name=row.name,
        path=(worst_runs(row)[1] if fails else row.candidate[0]).path,
        status=row.verdict,
        words=row.verdict,
        outcome=outcomes.get(status, Outcome.PASSED),
        rank=(list(EXIT).index(status), list(Verdict).index(row.verdict), -len(news)),
        kind="worse" if worse else "new finding",
        sentences=tuple(counted) if fails else (),
        message="" if fails else row.reason,
        notes=(*others, *row.remarks),
        quiet=row.verdict is Verdict.SAME,
        picture=found.picture if row is worst(found) else None,
        picture_url=found.picture_url,
    )


def _unpaired_case(found: Difference, each: Unpaired) -> Case:
    status = found.status_unpaired(each)
    fails = status is Status.FINDINGS
    alone, findings = f"only in the {each.side}", tuple(map(str, each.findings))
    return Case(
        name=str(each.path),
        path=each.path,
        status="not-paired",
        words="not paired",
        outcome=Outcome.FAILURE if fails else Outcome.SKIPPED,
        rank=(list(EXIT).index(status), len(Verdict)),
        kind="new finding" if findings else "missing run",
        sentences=(alone, *findings) if fails else (),
        message="" if fails else alone,
        notes=() if fails else findings,
    )


def _lines(found: Difference) -> Iterator[str]:
    yield summary(found)
    yield from _unpaired_lines(found)
    if not found.scenarios:
        return
    yield ""
    rows = [HEAD, *(_cells(row) for row in found.rows)]
    widths = [max(len(row[place]) for row in rows) for place in range(len(HEAD))]
    for line in rows:
        cells = (cell.ljust(width) for cell, width in zip(line, widths, strict=True))
        yield "  ".join(cells).rstrip()
    yield ""
    for row in found.rows:
        yield from _details(row)
    yield (
        f"worse and better: p ≤ {ALPHA:g} for all quantities of a family in all scenarios together;"
        f" same: no change by {found.margin:g} dB within intervals of {CONFIDENCE:.0%}"
    )
    if found.new or found.verdict is Verdict.WORSE:
        before, after = worst_runs(worst(found))
        yield f"The worst pair: inspector view {before.path} {after.path}"


def _unpaired_lines(found: Difference) -> Iterator[str]:
    for each in found.unpaired[:UNPAIRED]:
        yield f"only in the {each.side}: {each.path}"
        yield from _finding_lines(each.findings)
    if len(found.unpaired) > UNPAIRED:
        yield f"and {len(found.unpaired) - UNPAIRED} more on one side only (--format json)"


def _finding_lines(findings: Sequence[ChangedFinding]) -> Iterator[str]:
    yield from (f"  {finding}" for finding in findings[:FINDINGS])
    if (left := len(findings) - FINDINGS) > 0:
        yield f"  and {counted(left, 'more finding')} (--format json)"


def _cells(row: Compared) -> tuple[str, ...]:
    runs = f"{len(row.reference)} + {len(row.candidate)}"
    findings = _counted(row)
    if not row.changes:
        return row.name, runs, row.verdict, "", "", "", "", findings
    top = row.changes[0]
    p = min(top.p_louder, top.p_quieter)
    return (
        row.name,
        runs,
        row.verdict,
        top.name,
        _change(top),
        _interval(top, row.confidence),
        f"{p:.4f}" if row.testable else "",
        findings,
    )


def _counted(row: Compared) -> str:
    counts = Counter(each.kind for each in row.findings)
    return ", ".join(f"{counts[kind]} {kind}" for kind in (NEW, LOUDER, RESOLVED) if counts[kind])


def _details(row: Compared) -> Iterator[str]:
    if row.verdict is Verdict.SAME and not row.findings and not row.remarks:
        return
    yield f"{row.name}: {row.verdict}, {row.reason}"
    if row.verdict in (Verdict.WORSE, Verdict.BETTER):
        yield from (f"  {sentence}" for sentence in _significant(row))
    yield from _finding_lines(row.findings)
    yield from (f"  {remark}" for remark in row.remarks)


def _significant(row: Compared) -> Iterator[str]:
    """The clearest changes, a sentence each."""
    for change in [c for c in row.changes if min(c.p_louder, c.p_quieter) <= ALPHA][:CHANGES]:
        interval = _interval(change, row.confidence)
        p = min(change.p_louder, change.p_quieter)
        yield f"{change.name} {_change(change)}{f' {interval}' * bool(interval)}, p {p:.4f}"


def _change(change: Change) -> str:
    return f"{change.change:+.1f} {change.unit}"


def _interval(change: Change, confidence: float) -> str:
    if not np.isfinite(change.low):
        return ""
    return f"{change.low:+.1f} to {change.high:+.1f} ({confidence:.0%})"


def _row(row: Compared) -> dict[str, Any]:
    return {
        "name": row.name,
        "verdict": row.verdict,
        "reason": row.reason,
        "testable": row.testable,
        "paired": row.paired,
        "reference": [str(run.path) for run in row.reference],
        "candidate": [str(run.path) for run in row.candidate],
        "confidence": round(row.confidence, 6) if row.confidence else None,
        "findings": [_finding(each) for each in row.findings],
        "changes": [_as_dict(each) for each in row.changes],
        "remarks": list(row.remarks),
    }


def _finding(each: ChangedFinding) -> dict[str, Any]:
    return {
        "kind": each.kind,
        "run": str(each.path),
        "label": each.label,
        "start": round(each.start, 6),
        "stop": round(each.stop, 6),
        "level_db": round(each.level, 3),
        "change_db": _number(each.change),
    }


def _as_dict(change: Change) -> dict[str, Any]:
    return {
        "kind": change.kind,
        "joint": change.joint or None,
        "link": change.link or None,
        "band_hz": change.band and [round(edge, 3) for edge in change.band],
        "label": change.label or None,
        "unit": change.unit,
        "change": _number(change.change),
        "low": _number(change.low),
        "high": _number(change.high),
        "p_louder": _number(change.p_louder),
        "p_quieter": _number(change.p_quieter),
    }


def _number(value: float) -> float | None:
    return round(value, 6) if np.isfinite(value) else None
