"""A folder about many runs: a page with a row and a picture for each, the worst first."""

import hashlib
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

from inspector.analysis import Analysis
from inspector.colors import of_classes
from inspector.errors import InspectorError, Status
from inspector.reference.judging import Comparison
from inspector.reference.verdicts import seen
from inspector.report.findings import COUNTED, excused, failing
from inspector.report.formats import summary
from inspector.report.html import STYLE, add_text, document, written
from inspector.verdict import Verdict
from noisemodel.files import replacing

PAGE = "index.html"
PICTURES = "pictures"
WIDTH = 1000
"""Width of a timeline, in units of its own."""
POLICY = "default-src 'none'; img-src 'self' file:; style-src 'unsafe-inline'"
"""Policy for browsers: nothing but the pictures is fetched, also from a page on a disk."""
ROWS = """
:root { color-scheme: light dark; --ink: #1b1f24; --dim: #57606a; --line: #d0d7de; --back: #fff;
  --bad: #cf222e; --warn: #9a6700; --good: #1a7f37; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6edf3; --dim: #9da7b3; --line: #30363d;
  --back: #0d1117; --bad: #ff7b72; --warn: #e3b341; --good: #56d364; } }
body { max-width: 82rem; color: var(--ink); background: var(--back); }
.note { color: var(--dim); }
th, td { border-color: var(--line); vertical-align: top; }
td:last-child, th:last-child { padding-right: 0; }
a { color: inherit; text-underline-offset: .15em; }
.counts a { display: inline-block; margin: 0 .6rem .6rem 0; text-decoration: none; }
.counts strong { font-size: 1.5rem; margin-right: .3rem; font-variant-numeric: tabular-nums; }
.status { display: inline-block; border: 2px solid; border-radius: .4rem; padding: 0 .5rem;
  font-weight: 600; white-space: nowrap; }
.internal-error, .bad-input { color: var(--bad); border-style: dashed; }
.findings { color: var(--bad); } .cannot-tell { color: var(--warn); border-style: dotted; }
.ok { color: var(--good); }
table { width: 100%; }
td.run, td.told { overflow-wrap: anywhere; }
td.told { max-width: 26rem; }
td.line { width: 15rem; }
svg { display: block; width: 15rem; height: 1.1rem; margin-top: .2rem;
  border: 1px solid var(--dim); }
svg .missing { fill: none; stroke: var(--ink); stroke-width: 2; stroke-dasharray: 4 3; }
svg .excused { opacity: .45; }
svg line, svg rect { vector-effect: non-scaling-stroke; }
section { display: grid; grid-template-columns: minmax(0, 2fr) minmax(0, 3fr); gap: 0 1.5rem;
  border-top: 1px solid var(--line); padding: 1rem 0; break-inside: avoid; }
section h2 { margin: 0 0 .4rem; overflow-wrap: anywhere; }
section p { margin: .2rem 0; overflow-wrap: anywhere; }
section img { background: #fff; border-radius: .2rem; }
@media (max-width: 60rem) { section { display: block; } td.line, th.line { display: none; } }
@media print { :root { --ink: #000; --dim: #444; --line: #bbb; --back: #fff; --bad: #a40e26;
  --warn: #7d4e00; --good: #116329; } body { margin: 0; max-width: none; font-size: 12px; }
  thead { display: table-header-group; } tr { break-inside: avoid; } }
"""


def prepare(folder: Path, *, overwrite: bool = False) -> None:
    """Make the folder before long work is done for it; refuse one that has a page already."""
    try:
        (folder / PICTURES).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InspectorError(f"{folder}: cannot be made a folder ({error.strerror})") from error
    if (folder / PAGE).exists() and not overwrite:
        raise InspectorError(
            f"{folder / PAGE}: exists already; choose another folder, or overwrite it (--overwrite)"
        )


def draw(analysis: Analysis, verdict: Verdict, beside: Comparison | None, *, folder: Path) -> Path:
    """Draw a run over time into the folder; the picture is named after the verdict's file."""
    from inspector.report.picture import picture

    path = verdict.path
    if beside is not None:
        analysis = seen(analysis, verdict)
    # The hash keeps runs of one name in several folders apart, in any process.
    name = re.sub(r"[^\w.-]", "_", path.stem)[:80]
    target = folder / PICTURES / f"{name}-{hashlib.sha256(str(path).encode()).hexdigest()[:8]}.png"
    with replacing(target, overwrite=True) as temporary:
        temporary.write_bytes(picture(analysis, beside))
    return target


def with_picture(verdict: Verdict, folder: Path) -> Verdict:
    """A verdict of another job with its picture copied into the folder, without if it is gone."""
    picture = verdict.picture
    if picture is None or not picture.is_file():
        return replace(verdict, picture=None)
    target = folder / PICTURES / picture.name
    with replacing(target, overwrite=True) as temporary:
        temporary.write_bytes(picture.read_bytes())
    return replace(verdict, picture=target)


def write(verdicts: Sequence[Verdict], folder: Path) -> Path:
    """Write the page, whole or not at all."""
    path = folder / PAGE
    with replacing(path, overwrite=True) as temporary:
        temporary.write_text(page(verdicts), encoding="utf-8")
    return path


def page(verdicts: Sequence[Verdict]) -> str:
    """The page as text; pictures lie in its folder."""
    html, body = document(f"Noise: {summary(verdicts)}", STYLE + ROWS, POLICY)
    add_text(body, "h1", "Noise of the joints")
    add_text(body, "p", summary(verdicts), "verdict")
    ranked = sorted(verdicts, key=lambda each: each.severity)
    _add_counts(body, ranked)
    # What is so of all runs that a model could label, if they are several, is said once.
    first, *others = [_facts(each) for each in ranked if each.model] or [[]]
    shared = [fact for fact in first if others and all(fact in facts for facts in others)]
    for fact in shared:
        add_text(body, "p", fact, "note")
    table = ET.SubElement(ET.SubElement(body, "div", {"class": "wide"}), "table")
    head = ET.SubElement(ET.SubElement(table, "thead"), "tr")
    for name, kind in (("status", ""), ("run", ""), ("findings", ""), ("over time", "line")):
        add_text(head, "th", name, kind)
    rows = ET.SubElement(table, "tbody")
    for number, verdict in enumerate(ranked, 1):
        _add_row(rows, verdict, number)
    add_text(body, "h2", "Pictures")
    for number, verdict in enumerate(ranked, 1):
        _add_run(body, verdict, number, shared)
    return written(html)


def _add_counts(body: ET.Element, ranked: Sequence[Verdict]) -> None:
    """Add the number of runs of each status, a link to the first of them."""
    line = ET.SubElement(body, "p", {"class": "counts"})
    runs = [(number, each.status) for number, each in enumerate(ranked, 1) if each.of_run]
    first = {status: number for number, status in reversed(runs)}
    for status, number in sorted(first.items(), key=lambda item: item[1]):
        link = ET.SubElement(line, "a", href=f"#run-{number}")
        badge = ET.SubElement(link, "span", {"class": f"status {status}"})
        number_of = str(sum(each is status for _, each in runs))
        add_text(badge, "strong", number_of).tail = COUNTED[status]


def _facts(verdict: Verdict) -> list[str]:
    """By which model and reference a run was judged, and what limits that."""
    model = f"model {verdict.model}" if verdict.model else ""
    message = verdict.message if verdict.model else ""
    return list(filter(None, [model, _judged_by(verdict), message, verdict.assumed]))


def _judged_by(verdict: Verdict) -> str:
    """By which reference a run was judged, in a line; empty without one."""
    if verdict.beside is None:
        return f"reference: {verdict.expectations}" if verdict.expectations else ""
    return f"reference: {verdict.beside.path}, {verdict.beside.words}"


def _add_row(rows: ET.Element, verdict: Verdict, number: int) -> None:
    row = ET.SubElement(rows, "tr")
    _add_status(ET.SubElement(row, "td"), verdict)
    name = ET.SubElement(row, "td", {"class": "run"})
    add_text(name, "a", str(verdict.path), href=f"#run-{number}")
    counts = Counter(event.label for event in verdict.failing)
    told = [f"{label} ({n})" if n > 1 else label for label, n in counts.items()]
    told += [f"missing: {each.label}" for each in verdict.missing]
    told += [f"{len(verdict.excused)} that do not count"] if verdict.excused else []
    failed = verdict.status not in (Status.OK, Status.FINDINGS)
    cell = add_text(row, "td", verdict.message if failed else ", ".join(told), "told")
    if verdict.beside is not None:
        add_text(cell, "p", _judged_by(verdict), "note")
    _add_timeline(ET.SubElement(row, "td", {"class": "line"}), verdict)


def _add_timeline(cell: ET.Element, verdict: Verdict) -> None:
    """Draw the findings of a run from its start to its end."""
    if not verdict.duration or not verdict.model:
        return
    shades = of_classes(tuple(dict.fromkeys(event.label for event in verdict.events)))
    box = {"viewBox": f"0 0 {WIDTH} 10", "preserveAspectRatio": "none", "role": "img"}
    drawn = ET.SubElement(cell, "svg", box)
    sentences = [*failing(verdict), *excused(verdict)]
    told = f"{verdict.duration:.2f} s: {'; '.join(sentences) or 'no finding'}"
    ET.SubElement(drawn, "title").text = told
    scale = WIDTH / verdict.duration
    spans = [
        (event.start, event.stop, "" if event in verdict.failing else "excused", event.label)
        for event in verdict.events
    ]
    spans += [
        (each.start, each.stop or each.start, "missing", "")
        for each in verdict.missing
        if each.start is not None
    ]
    for start, stop, kind, label in spans:
        left, width = (start - verdict.begin) * scale, max((stop - start) * scale, 4.0)
        place = {"x": f"{left:.1f}", "width": f"{width:.1f}", "y": "0", "height": "10"}
        place |= {"class": kind} if kind else {}
        place |= {"fill": "#{:02x}{:02x}{:02x}".format(*shades[label][:3])} if label else {}
        ET.SubElement(drawn, "rect", place)


def _add_run(body: ET.Element, verdict: Verdict, number: int, shared: Sequence[str]) -> None:
    part = ET.SubElement(body, "section", id=f"run-{number}")
    told = ET.SubElement(part, "div")
    add_text(told, "h2", str(verdict.path))
    _add_status(ET.SubElement(told, "p"), verdict)
    for sentence in failing(verdict):
        add_text(told, "p", sentence)
    message = "" if verdict.model else verdict.message
    facts = [fact for fact in _facts(verdict) if fact not in shared]
    length = f"{verdict.duration:.2f} s" if verdict.duration else ""
    for note in filter(None, [*excused(verdict), message, *facts, length]):
        add_text(told, "p", note, "note")
    if verdict.picture is not None:
        source = f"{PICTURES}/{verdict.picture.name}"
        link = ET.SubElement(ET.SubElement(part, "div"), "a", href=source)
        described = f"{verdict.path} over time: classes, noise, spectrogram"
        ET.SubElement(link, "img", src=source, alt=described, loading="lazy")


def _add_status(parent: ET.Element, verdict: Verdict) -> None:
    words = f"{COUNTED[verdict.status]}{' (ignored)' if verdict.ignored else ''}"
    kind = Status.CANNOT_TELL if verdict.ignored else verdict.status
    add_text(parent, "span", words, f"status {kind}")
