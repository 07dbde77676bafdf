"""What `diff` prints: a table of scenarios, and JSON."""

import json
from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np

from inspector.pair.changes import NEW, RESOLVED
from inspector.regression.difference import (
    Change,
    Compared,
    Difference,
    Verdict,
    worst,
    worst_runs,
)
from inspector.regression.findings import LOUDER, ChangedFinding
from inspector.regression.statistic import ALPHA, CONFIDENCE

FORMAT = "noise-diff/1"
FINDINGS, CHANGES = 10, 5
"""Most findings and changes of a scenario that are printed as text."""
HEAD = ("scenario", "runs", "verdict", "clearest change", "change", "interval", "p", "findings")


def as_text(found: Difference) -> str:
    """Write verdicts as a table, then what changed in each scenario that is not the same."""
    return "\n".join(_lines(found))


def as_json(found: Difference) -> str:
    """Write verdicts as JSON, ``noise-diff/1``; what is not known is null."""
    return json.dumps(
        {
            "format": FORMAT,
            "verdict": found.verdict,
            "alpha": ALPHA,
            "confidence": CONFIDENCE,
            "margin_db": found.margin,
            "paired_by": found.pairing.by,
            "scenarios": [_row(row) for row in found.scenarios],
            "together": None if found.together is None else _row(found.together),
            "not_paired": [str(path) for path in found.pairing.alone],
            "failed": {str(each.path): each.problem for each in found.unreadable},
        },
        indent=2,
        ensure_ascii=False,
        allow_nan=False,
    )


def _lines(found: Difference) -> Iterator[str]:
    counts = Counter(row.verdict for row in found.scenarios)
    total = len(found.scenarios)
    parts = ", ".join(f"{counts[each]} {each}" for each in Verdict if counts[each])
    plural = "" if total == 1 else "s"
    yield f"{found.verdict}: {total} scenario{plural} ({parts}), paired by {found.pairing.by}"
    yield ""
    rows = [HEAD, *(_cells(row) for row in found.rows)]
    widths = [max(len(row[place]) for row in rows) for place in range(len(HEAD))]
    for line in rows:
        cells = (cell.ljust(width) for cell, width in zip(line, widths, strict=True))
        yield "  ".join(cells).rstrip()
    yield ""
    for row in found.rows:
        yield from _details(row)
    alone = found.pairing.alone
    if alone:
        more = f" and {len(alone) - 3} more" if len(alone) > 3 else ""
        yield f"not compared, on one side only: {', '.join(map(str, alone[:3]))}{more}"
    yield (
        f"worse and better: p ≤ {ALPHA:g} for all quantities of all scenarios together;"
        f" same: no change by {found.margin:g} dB within intervals of {CONFIDENCE:.0%}"
    )
    if found.new or found.verdict is Verdict.WORSE:
        before, after = worst_runs(worst(found))
        yield f"The worst pair: inspector view {before.path} {after.path}"


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
        for change in [c for c in row.changes if min(c.p_louder, c.p_quieter) <= ALPHA][:CHANGES]:
            interval = _interval(change, row.confidence)
            p = min(change.p_louder, change.p_quieter)
            yield f"  {change.name} {_change(change)}{f' {interval}' * bool(interval)}, p {p:.4f}"
    yield from (f"  {finding}" for finding in row.findings[:FINDINGS])
    if len(row.findings) > FINDINGS:
        yield f"  and {len(row.findings) - FINDINGS} more findings (--format json)"
    yield from (f"  {remark}" for remark in row.remarks)


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
