"""Verdicts as text, JSON, JUnit XML and GitHub annotations."""

import json
import re
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

from inspector.analysis.status import IGNORED, Status, Unknown
from inspector.analysis.verdict import Verdict
from models import Event
from models.labels import interval

if TYPE_CHECKING:
    from inspector.localisation.localise import Localisation

ANNOTATIONS = 10
"""GitHub silently drops what goes beyond ten of a kind per step."""


def text(verdicts: Sequence[Verdict]) -> str:
    """Verdicts as text, a line per run and a line per event.

    Bad inputs are left out: the command line prints them on stderr.
    """
    lines = []
    for verdict in verdicts:
        if verdict.status is Status.BAD_INPUT:
            continue
        model = f" [{verdict.model}]" if verdict.model else ""
        message = f": {verdict.message}" if verdict.message else ""
        lines.append(f"{verdict.path}: {verdict.status}{model}{message}")
        lines += [f"  {_sentence(verdict, event)}" for event in verdict.events]
    return "\n".join(lines)


def as_json(verdicts: Sequence[Verdict]) -> str:
    """Verdicts as JSON, ``noise-verdict/2``.

    Args:
        verdicts: What was found in runs; findings that were localised have a ``localisation``.
    """
    runs = [
        {
            "run": str(verdict.path),
            "model": verdict.model,
            "model_sha256": verdict.model_sha256,
            "status": verdict.status.value,
            "unknown": verdict.unknown.value,
            "events": [
                {
                    "label": event.label,
                    "start": round(event.start, 6),
                    "stop": round(event.stop, 6),
                    "score": round(event.score, 6),
                    "novel": event.novel,
                    "order": _order(verdict, event),
                    **_localised(verdict, event),
                }
                for event in verdict.events
            ],
            "message": verdict.message,
            "assumed": verdict.assumed,
        }
        for verdict in verdicts
    ]
    return json.dumps({"format": "noise-verdict/2", "runs": runs}, indent=2)


def junit(verdicts: Sequence[Verdict]) -> str:
    """Write verdicts as JUnit XML: a test case per run."""
    count = {status: sum(v.status is status for v in verdicts) for status in Status}
    suite = ET.Element(
        "testsuite",
        name="inspector",
        tests=str(len(verdicts)),
        failures=str(count[Status.FINDINGS]),
        errors=str(count[Status.BAD_INPUT]),
        skipped=str(count[Status.CANNOT_TELL]),
    )
    tags = {
        Status.FINDINGS: "failure",
        Status.BAD_INPUT: "error",
        Status.CANNOT_TELL: "skipped",
    }
    for verdict in verdicts:
        case = ET.SubElement(suite, "testcase", classname="inspector", name=_plain(verdict.path))
        if verdict.status in tags:
            sentences = [_sentence(verdict, event) for event in verdict.events]
            sentences = sentences or [verdict.message]
            outcome = ET.SubElement(case, tags[verdict.status], message=_plain(sentences[0]))
            outcome.text = _plain("\n".join(sentences))
        if verdict.message and verdict.status in (Status.OK, Status.FINDINGS):
            ET.SubElement(case, "system-out").text = _plain(verdict.message)
    root = ET.Element("testsuites")
    root.append(suite)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True)


def github(verdicts: Sequence[Verdict]) -> str:
    """Write verdicts as GitHub workflow commands, at most ten of a kind."""
    errors = [
        _annotation(
            "error",
            verdict,
            "; ".join(_sentence(verdict, event) for event in verdict.events) or verdict.message,
        )
        for verdict in verdicts
        if verdict.status in (Status.BAD_INPUT, Status.FINDINGS)
    ]
    warnings = [
        _annotation("warning", verdict, verdict.message)
        for verdict in verdicts
        if verdict.status is Status.CANNOT_TELL
    ]
    ignored = any(verdict.unknown is Unknown.IGNORE for verdict in verdicts)
    notices = [f"::notice::{IGNORED}"] if ignored else []
    return "\n".join(_capped(errors, "error") + _capped(warnings, "warning") + notices)


FORMATS: dict[str, Callable[[Sequence[Verdict]], str]] = {
    "text": text,
    "json": as_json,
    "junit": junit,
    "github": github,
}


def _localised(verdict: Verdict, event: Event) -> dict[str, object]:
    known = verdict.localisations.get(event)
    return {} if known is None else {"localisation": _localisation(known)}


def _localisation(known: "Localisation") -> dict[str, object]:
    """Localisation of a finding: lag in [s], band in [Hz], null where it is not known."""
    return {
        "stage": known.stage or None,
        "following": known.following or None,
        "lag": round(known.lag, 6) if known.stage else None,
        "joints": {name: round(share, 3) for name, share in known.joints},
        "band": known.band and [round(frequency, 3) for frequency in known.band],
    }


def _order(verdict: Verdict, event: Event) -> dict[str, object] | None:
    """Joint with whose speed a finding goes, and periods per turn of it; None if none."""
    known = verdict.orders.get(event)
    if known is None:
        return None
    return {"joint": known.joint, "periods_per_turn": round(known.periods_per_turn, 1)}


def _sentence(verdict: Verdict, event: Event) -> str:
    order = f", {verdict.orders[event]}" if event in verdict.orders else ""
    return f"{event.label} from {interval(event.start, event.stop)}{event.novelty}{order}"


def _plain(value: object) -> str:
    """Drop the control characters that XML forbids."""
    return re.sub(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "", str(value))


def _annotation(kind: str, verdict: Verdict, message: str) -> str:
    path = _escaped(str(verdict.path)).replace(":", "%3A").replace(",", "%2C")
    return f"::{kind} file={path}::{_escaped(f'{verdict.status}: {message}')}"


def _escaped(value: str) -> str:
    return value.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _capped(lines: list[str], kind: str) -> list[str]:
    if len(lines) <= ANNOTATIONS:
        return lines
    rest = len(lines) - ANNOTATIONS + 1
    return [*lines[: ANNOTATIONS - 1], f"::{kind}::{rest} more runs are not shown here"]
