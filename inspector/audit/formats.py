"""Audits as text, as the line or two of a report, and as JSON."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any

from inspector.audit.audit import Audit
from inspector.audit.observability import MASKED, ClassObservability, Observability
from inspector.text import counted, plain

ROUNDING = 1e-9
"""Deviation of a stamp that is rounding, in [s]: stamps have nanoseconds at best."""


def text(name: str, audit: Audit, assumed: str = "") -> str:
    """An audit as text.

    Args:
        name: What the run is called.
        audit: Its audit.
        assumed: What was assumed when its log was read, in a line; empty of a run file.
    """
    head = f"{name}: {audit.duration:.2f} s, {counted(audit.joints, 'joint')}"
    return "\n".join([head, *([f"  {assumed}"] if assumed else []), *_lines(audit)])


def summary(audit: Audit, *, classes: bool = True) -> tuple[str, ...]:
    """Write the one or two lines that a report has for an audit: classes, then warnings.

    Args:
        audit: The audit.
        classes: Whether to say what can be seen, or cannot.
    """
    warnings = f"Warnings: {'; '.join(audit.warnings)}." if audit.warnings else ""
    return tuple(line for line in (_classes(audit) if classes else "", warnings) if line)


def shortcomings(audit: Audit) -> tuple[str, ...]:
    """Write the summary of an audit, and nothing without warnings or limits.

    Args:
        audit: The audit.
    """
    limited = any(each.observability is not Observability.OBSERVABLE for each in audit.classes)
    return summary(audit) if audit.warnings or limited else ()


def as_json(
    found: Mapping[str, Audit], failed: Mapping[str, str], assumed: Mapping[str, str]
) -> str:
    """Write audits as ``noise-audit/2``.

    Args:
        found: Audits by the name of the run.
        failed: Errors by the name of each file that cannot be read.
        assumed: What was assumed when a log was read, by the name of the run.
    """
    runs = [
        {**_plain(name, audit), "assumed": assumed.get(name, "")} for name, audit in found.items()
    ]
    runs += [{"run": name, "message": message} for name, message in failed.items()]
    return json.dumps({"format": "noise-audit/2", "runs": runs}, indent=2)


def _lines(audit: Audit) -> Iterator[str]:
    off = "stamps are uniform"
    if audit.jitter and audit.jitter[1] >= ROUNDING:
        rms, largest = (1e3 * value for value in audit.jitter)
        off = f"stamps were off by {rms:.3g} ms rms, {largest:.3g} ms at most"
    yield f"  rate: {audit.rate:g} Hz, {off}"
    yield f"  missing: {audit.gaps}"
    yield f"  bandwidth: up to {plain(audit.bandwidth.usable, 4)} Hz ({audit.bandwidth.limit})"
    yield from (f"  warning: {warning}" for warning in audit.warnings)
    yield from (f"  note: {note}" for note in audit.notes)
    yield from (f"  {each}" for each in audit.classes)


def _classes(audit: Audit) -> str:
    """Write a sentence on what cannot be seen, or that all classes can."""
    if not audit.classes:
        return ""
    limited: dict[tuple[str, str], list[str]] = {}
    for each in audit.classes:
        if each.observability is not Observability.OBSERVABLE:
            limited.setdefault(_limit(each, audit), []).append(each.label)
    clauses = [f"{lead}{_listed(labels)} {rest}" for (lead, rest), labels in limited.items()]
    if not clauses:
        clauses = [f"the log can show {_listed([each.label for each in audit.classes])}"]
    sentence = "; ".join(clauses)
    return f"{sentence[0].upper()}{sentence[1:]}."


def _limit(each: ClassObservability, audit: Audit) -> tuple[str, str]:
    """What cannot be seen of a class: the words before and after its name."""
    if each.observability is Observability.CANNOT_TELL:
        needed = f"; requires {each.needed:g} Hz" if each.needed else ""
        return "", f"cannot be observed ({each.reason}{needed})"
    if each.reason.startswith(MASKED):
        return "", f"only from {plain(each.low)} to {plain(each.high, 4)} Hz ({each.reason})"
    above = f"above {plain(each.high, 4)} Hz cannot be seen"
    reach = audit.bandwidth
    if each.reason == reach.limit and reach.usable == reach.nyquist / reach.hold:
        return f"at {plain(2 * reach.usable, 4)} Hz, ", above
    needed = f"; all of it requires {each.needed:g} Hz" if each.needed else ""
    return "", f"{above} ({each.reason}{needed})"


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
            "zero_order_hold": reach.hold,
            "differentiated": reach.differentiator.name if reach.differentiator else None,
            "filtered_from": reach.corner,
            "quantisation_step": reach.step,
            "quantisation_floor_from": reach.floor_from,
            "quiet_from": reach.quiet_from,
        },
        "warnings": list(audit.warnings),
        "notes": list(audit.notes),
        "classes": [asdict(each) for each in audit.classes],
    }
