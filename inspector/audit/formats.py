"""Audits as text, as the line or two of a report, and as JSON."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any

from inspector.audit.audit import Audit
from inspector.audit.sight import ClassSight, Sight


def text(name: str, audit: Audit) -> str:
    """Write an audit for people.

    Args:
        name: What the run is called.
        audit: Its audit.
    """
    return "\n".join([f"{name}: {audit.duration:.2f} s, {audit.joints} joints", *_lines(audit)])


def summary(audit: Audit) -> tuple[str, ...]:
    """Write the one or two lines that a report has for an audit: classes, then doubts.

    Args:
        audit: The audit.
    """
    doubts = f"Looks wrong: {'; '.join(audit.doubts)}." if audit.doubts else ""
    return tuple(line for line in (_classes(audit), doubts) if line)


def shortcomings(audit: Audit) -> tuple[str, ...]:
    """Write the summary of an audit, and nothing where all is well.

    Args:
        audit: The audit.
    """
    flawed = audit.doubts or any(each.sight is not Sight.OBSERVABLE for each in audit.classes)
    return summary(audit) if flawed else ()


def as_json(found: Mapping[str, Audit], failed: Mapping[str, str]) -> str:
    """Write audits as ``noise-audit/1``.

    Args:
        found: Audits by the name of the run.
        failed: By the name of each file without one, why.
    """
    runs = [_plain(name, audit) for name, audit in found.items()]
    runs += [{"run": name, "message": message} for name, message in failed.items()]
    return json.dumps({"format": "noise-audit/1", "runs": runs}, indent=2)


def _lines(audit: Audit) -> Iterator[str]:
    off = "stamps are uniform"
    if audit.jitter:
        rms, largest = (1e3 * value for value in audit.jitter)
        off = f"stamps were off by {rms:.3g} ms rms, {largest:.3g} ms at most"
    yield f"  rate: {audit.rate:g} Hz, {off}"
    yield f"  missing: {audit.gaps}"
    yield f"  bandwidth: up to {audit.bandwidth.usable:.4g} Hz ({audit.bandwidth.limit})"
    yield from (f"  looks wrong: {doubt}" for doubt in audit.doubts)
    yield from (f"  note: {note}" for note in audit.notes)
    yield from (f"  {each}" for each in audit.classes)


def _classes(audit: Audit) -> str:
    """Say in a sentence which classes can be seen."""
    if not audit.classes:
        return ""
    seen = [each.label for each in audit.classes if each.sight is Sight.OBSERVABLE]
    others = [each for each in audit.classes if each.sight is not Sight.OBSERVABLE]
    if len({_rest(each) for each in others}) == 1 and len(others) > 1:
        clauses = [f"{_listed([each.label for each in others])} {_rest(others[0])}"]
    else:
        clauses = [f"{each.label} {_rest(each)}" for each in others]
    if seen:
        clauses = [f"can show {_listed(seen)}", *clauses]
    sentence = "; ".join(clauses)
    return f"{sentence[0].upper()}{sentence[1:]}."


def _rest(each: ClassSight) -> str:
    if each.sight is Sight.CANNOT_TELL:
        needed = f"; it takes {each.needed:g} Hz" if each.needed else ""
        return f"cannot be told ({each.reason}{needed})"
    needed = f"; all of it takes {each.needed:g} Hz" if each.needed else ""
    return f"only from {each.low:.3g} to {each.high:.4g} Hz ({each.reason}{needed})"


def _listed(words: list[str]) -> str:
    return " and ".join([", ".join(words[:-1]), words[-1]] if words[1:] else words)


def _plain(name: str, audit: Audit) -> dict[str, Any]:
    reach = audit.bandwidth
    return {
        "run": name,
        "rate": audit.rate,
        "duration": audit.duration,
        "joints": audit.joints,
        "jitter": dict(zip(("rms", "max"), audit.jitter, strict=True)) if audit.jitter else None,
        "gaps": asdict(audit.gaps),
        "bandwidth": {
            "usable": reach.usable,
            "limit": reach.limit,
            "held": reach.held,
            "differentiated": reach.slope.name if reach.slope else None,
            "filtered_from": reach.corner,
            "rounding_step": reach.step,
            "drowned_from": reach.drowned,
            "quiet_from": reach.quiet,
        },
        "doubts": list(audit.doubts),
        "notes": list(audit.notes),
        "classes": [asdict(each) for each in audit.classes],
    }
