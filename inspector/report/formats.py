"""Verdicts as text, JSON, JUnit XML, GitHub annotations, SARIF and Markdown."""

import hashlib
import json
import re
from collections import Counter
from collections.abc import Callable, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote
from xml.etree import ElementTree as ET

from inspector.analysis.status import IGNORED, Status, Unknown
from inspector.analysis.verdict import Verdict, counts, exit_status
from models import Event
from models.labels import interval

if TYPE_CHECKING:
    from inspector.localisation.localise import Localisation

ANNOTATIONS = 10
"""GitHub silently drops what goes beyond ten of a kind per step."""
COMMENT = 60_000
"""Most characters of the Markdown: GitHub refuses comments of more than 65,536."""
MARKER = "<!-- noise-inspector -->"
"""First line of the Markdown, by which a script finds its own comment to replace it."""
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
    found = [f"{n} {_words(name)}" for name, n in number["findings"].items() if n]
    one = "1 run" if len(verdicts) == 1 else f"{len(verdicts)} runs"
    return f"{one}: {', '.join(runs) or 'none'}" + (
        f"; findings: {', '.join(found)}" if found else ""
    )


def text(verdicts: Sequence[Verdict]) -> str:
    """Verdicts as text: a line per run, a line per finding, and the counts of several runs.

    Bad inputs are left out: the command line prints them on stderr.
    """
    lines = []
    for verdict in verdicts:
        if verdict.status in (Status.BAD_INPUT, Status.INTERNAL_ERROR):
            continue
        model = f" [{verdict.model}]" if verdict.model else ""
        expected = f", by {verdict.expectations}" if verdict.expectations else ""
        message = f": {verdict.message}" if verdict.message else ""
        lines.append(f"{verdict.path}: {verdict.status}{model}{expected}{message}")
        lines += [f"  {sentence}" for sentence in (*failing(verdict), *excused(verdict))]
    return "\n".join([*lines, summary(verdicts)] if len(verdicts) > 1 else lines)


def as_json(verdicts: Sequence[Verdict]) -> str:
    """Verdicts as JSON, ``noise-verdict/3``; its schema is docs/noise-verdict-3.schema.json.

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
                    "fails": verdict.ruled(event).ruling.fails,
                    "ruling": verdict.ruled(event).ruling.value,
                    "reason": verdict.ruled(event).reason,
                    **_localised(verdict, event),
                }
                for event in verdict.events
            ],
            "missing": [
                {
                    "label": missing.label,
                    "start": missing.start and round(missing.start, 6),
                    "stop": missing.stop and round(missing.stop, 6),
                    "reason": missing.reason,
                }
                for missing in verdict.missing
            ],
            "expectations": verdict.expectations,
            "message": verdict.message,
            "assumed": verdict.assumed,
            "scenario": verdict.scenario,
            "duration": round(verdict.duration, 6),
            "seconds": round(verdict.seconds, 3),
            "counted": not verdict.ignored,
            "picture": None if verdict.picture is None else str(verdict.picture),
        }
        for verdict in verdicts
    ]
    whole = {
        "format": "noise-verdict/3",
        "version": _version(),
        "exit_status": exit_status(verdicts),
        "counts": counts(verdicts),
        "runs": runs,
    }
    return json.dumps(whole, indent=2)


def junit(verdicts: Sequence[Verdict]) -> str:
    """Write verdicts as JUnit XML: a test case per run.

    A case has one `failure` with all of its findings, since Jenkins keeps the last of several. Its
    type is the class of the finding with the best score. A picture is attached by a line
    ``[[ATTACHMENT|path]]``, which GitLab, Jenkins and Azure read.
    """
    tags = [_tag(verdict) for verdict in verdicts]
    suite = ET.Element(
        "testsuite",
        name="inspector",
        tests=str(len(verdicts)),
        failures=str(tags.count("failure")),
        errors=str(tags.count("error")),
        skipped=str(tags.count("skipped")),
        time=f"{sum(verdict.seconds for verdict in verdicts):.3f}",
    )
    properties = ET.SubElement(suite, "properties")
    for kind, numbers in counts(verdicts).items():
        for name, number in numbers.items():
            ET.SubElement(properties, "property", name=f"{kind}.{name}", value=str(number))
    seen: Counter[str] = Counter()
    for verdict, tag in zip(verdicts, tags, strict=True):
        name = _plain(verdict.path)
        seen[name] += 1  # GitLab reads the first of several cases of one name only
        name = name if seen[name] == 1 else f"{name} ({seen[name]})"
        time = f"{verdict.seconds:.3f}"
        case = ET.SubElement(suite, "testcase", classname="inspector", name=name, time=time)
        if tag:
            sentences = failing(verdict) or [verdict.message]
            outcome = ET.SubElement(case, tag, message=_plain("; ".join(sentences)))
            if tag != "skipped":
                outcome.set("type", _plain(_kind(verdict)))
            outcome.text = _plain("\n".join([*sentences, *filter(None, [verdict.trace])]))
        lines = [*excused(verdict)]
        if verdict.message and verdict.status in (Status.OK, Status.FINDINGS):
            lines.insert(0, verdict.message)
        if verdict.picture is not None:
            lines.append(f"[[ATTACHMENT|{verdict.picture}]]")
        if lines:
            ET.SubElement(case, "system-out").text = _plain("\n".join(lines))
    root = ET.Element("testsuites")
    root.append(suite)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True)


def github(verdicts: Sequence[Verdict]) -> str:
    """Write verdicts as GitHub workflow commands: the ten worst, and the counts of several runs.

    Of ten errors, bad input takes five at most where there are findings, so that it hides none.
    Runs that cannot be told, and bad input that is ignored, are warnings.
    """
    ranked = sorted(verdicts, key=lambda verdict: verdict.severity)
    bad = [v for v in ranked if _tag(v) == "error"]
    found = [v for v in ranked if _tag(v) == "failure"]
    shown = [*bad[: max(ANNOTATIONS // 2, ANNOTATIONS - len(found))], *found][:ANNOTATIONS]
    quiet = [v for v in ranked if _tag(v) == "skipped"][:ANNOTATIONS]
    lines = [_annotation("error", each) for each in shown]
    lines += [_annotation("warning", each) for each in quiet]
    lines += [f"::notice::{IGNORED}"] if _ignoring(verdicts) else []
    left = len(bad) + len(found) - len(shown)
    more = f"; {left} more are not shown here" if left else ""
    if len(verdicts) > 1:
        lines += [f"::notice title=noise-inspector::{_escaped(summary(verdicts))}{more}"]
    return "\n".join(lines)


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
            "level": "error" if _tag(verdict) == "error" else "warning",
            "message": {"text": f"{verdict.status}: {verdict.message}"},
            "locations": [_location(verdict.path)],
        }
        for verdict in ranked
        if _tag(verdict) in ("error", "skipped")
    ]
    run = {
        "tool": {
            "driver": {
                "name": "noise-inspector",
                "version": _version(),
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
                "executionSuccessful": not any(_tag(each) == "error" for each in verdicts),
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
    """Write verdicts for a job's summary or a comment: a table, the worst first, and a picture.

    GitHub takes no pictures inside the text: that of the worst run is linked if its address is
    known, and else its file is named.
    """
    ranked = sorted(verdicts, key=lambda verdict: verdict.severity)
    failed = [each for each in ranked if each.status is not Status.OK]
    head = [MARKER, f"### Noise: {summary(verdicts)}", ""]
    tail = ["", f"{IGNORED.capitalize()}.", ""] if _ignoring(verdicts) else [""]
    worst = next((each for each in ranked if each.picture is not None), None)
    if worst is not None and failed:
        told = f"Picture of {_code(worst.path)}: {_code(worst.picture)}."
        drawn = f"![{_cell(worst.path)} over time]({worst.picture_url})"
        tail += [drawn if worst.picture_url else told]
    rows = [f"| {_code(v.path)} | {WORDS[v.status]} | {_cell(_told(v))} |" for v in failed]
    ruled = [f"- {_code(v.path)}: {_cell(each)}" for v in ranked for each in excused(v)]
    parts = [*head]
    if rows:
        parts += _cut(["| run | status | findings |", "|---|---|---|"], rows, COMMENT * 2 // 3)
    parts += tail
    if ruled:
        title = f"Findings that do not count: {len(ruled)}"
        opened = ["", f"<details><summary>{title}</summary>", ""]
        parts += [*_cut(opened, ruled, COMMENT // 4), "", "</details>"]
    return "\n".join(parts).rstrip()


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


def _tag(verdict: Verdict) -> str:
    """What a run is as a test: "failure", "error", "skipped", or nothing if it passes."""
    if verdict.ignored:
        return "skipped"
    return {
        Status.FINDINGS: "failure",
        Status.BAD_INPUT: "error",
        Status.INTERNAL_ERROR: "error",
        Status.CANNOT_TELL: "skipped",
        Status.OK: "",
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


def _told(verdict: Verdict) -> str:
    return "; ".join(failing(verdict)) or verdict.message


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
    ruled = str(verdict.ruled(event))
    became = f" ({ruled})" if ruled else ""
    return f"{event.label} from {interval(event.start, event.stop)}{event.novelty}{order}{became}"


def _results(verdict: Verdict) -> list[dict[str, Any]]:
    if _tag(verdict) != "failure":
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


def _version() -> str:
    try:
        return version("noise-inspector")
    except PackageNotFoundError:  # run from its folder
        return "0"


def _words(ruling: str) -> str:
    return ruling.replace("-", " ")


def _plain(value: object) -> str:
    """Drop the control characters that XML forbids."""
    return re.sub(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "", str(value))


def _cell(value: object) -> str:
    """A text that stays in its cell, and is no HTML."""
    line = " ".join(str(value).split())
    for mark, written in (("&", "&amp;"), ("<", "&lt;"), ("|", "\\|"), ("`", "'")):
        line = line.replace(mark, written)
    return line


def _code(path: object) -> str:
    """A path that stays in its cell."""
    return f"`{' '.join(str(path).split()).replace('`', chr(39)).replace('|', chr(92) + '|')}`"


def _cut(head: list[str], rows: list[str], room: int) -> list[str]:
    """As many rows as there is room for, and how many are left out."""
    kept = []
    for row in rows:
        room -= len(row) + 1
        if room < 0:
            break
        kept.append(row)
    left = len(rows) - len(kept)
    return [*head, *kept, *(["", f"{left} more are left out here."] if left else [])]


def _annotation(kind: str, verdict: Verdict) -> str:
    path = _escaped(str(verdict.path)).replace(":", "%3A").replace(",", "%2C")
    return f"::{kind} file={path}::{_escaped(f'{verdict.status}: {_told(verdict)}')}"


def _escaped(value: str) -> str:
    return value.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")
