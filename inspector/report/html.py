"""Pages that need no viewer: of a run, of many with a row and picture of each, and of many commits.

The page of one run has no links to others; that of many has the worst first; that of many commits
shows how far each scenario is over its reference, and where that changed.
"""

import hashlib
import os
import re
from base64 import b64encode
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from inspector.analysis import Analysis
from inspector.errors import InspectorError, Status
from inspector.export.sound import clip, common_gain, worst_time
from inspector.reference.judging import Comparison
from inspector.reference.verdicts import seen
from inspector.report import annotated, facts, note, sentence, spoken
from inspector.report.formats import COUNTED, case_of, groups, summary
from inspector.report.picture import picture
from inspector.text import counted, natural
from inspector.verdict import Verdict, read_results
from noisemodel.files import write_whole
from noisemodel.types import Array

AUDIBLE = "Audible are the joints' velocities above 20 Hz; their powers are added."
# Policies for browsers: nothing is fetched, whatever a run's names are; of many runs, the pictures
# beside the page, also from a disk.
POLICY = "default-src 'none'; img-src data:; media-src data:; style-src 'unsafe-inline'"
HISTORY_POLICY = "default-src 'none'; style-src 'unsafe-inline'"
INDEX_POLICY = "default-src 'none'; img-src 'self' file:; style-src 'unsafe-inline'"
STYLE = """
:root { color-scheme: light dark; --ink: #1b1f24; --dim: #57606a; --line: #d0d7de; --back: #fff;
  --bad: #cf222e; --warn: #9a6700; --good: #1a7f37; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6edf3; --dim: #9da7b3; --line: #30363d;
  --back: #0d1117; --bad: #ff7b72; --warn: #e3b341; --good: #56d364; } }
body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--back);
  max-width: 72rem; margin: 2rem auto; padding: 0 1rem; overflow-wrap: anywhere; }
h1 { margin-bottom: 0; }
h2 { margin: 2.2rem 0 .6rem; font-size: 1.15rem; }
.verdict { font-size: 1.25rem; font-weight: 600; margin: .2rem 0 1.2rem; }
.note { color: var(--dim); font-size: .9rem; margin: .3rem 0; }
.wide { overflow-x: auto; }
img, svg, audio { width: 100%; height: auto; }
img { background: #fff; }
li { margin: .2rem 0; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: .25rem 1.2rem .25rem 0; border-bottom: 1px solid var(--line);
  vertical-align: top; }
a { color: inherit; text-underline-offset: .15em; }
.status { display: inline-block; border: 2px solid; border-radius: .4rem; padding: 0 .5rem;
  font-weight: 600; white-space: nowrap; }
.internal-error, .bad-input { color: var(--bad); border-style: dashed; }
.findings { color: var(--bad); } .cannot-tell { color: var(--warn); border-style: dotted; }
.ok { color: var(--good); }
section { display: grid; grid-template-columns: minmax(0, 2fr) minmax(0, 3fr); gap: 0 1.5rem;
  border-top: 1px solid var(--line); padding: 1rem 0; break-inside: avoid; }
section h2 { margin: 0 0 .4rem; }
section p { margin: .2rem 0; }
@media (max-width: 60rem) { section { display: block; } }
svg { border: 1px solid var(--line); } circle { fill: #0072b2; } .step { color: #d55e00; }
line { stroke: #d55e00; stroke-width: 2; stroke-dasharray: 6 4; }
"""


def page(
    analysis: Analysis,
    *,
    audit: str = "",
    verdict: Verdict | None = None,
    beside: Comparison | None = None,
) -> str:
    """Write the page of an inspected run, beside a reference too; it says what a recording says."""
    html, body = document(f"{analysis.name}: {spoken(analysis.headline)}", POLICY)
    add(body, "h1", analysis.name)
    add(body, "p", spoken(analysis.headline), "verdict")
    add(body, "p", facts(analysis), "note")
    if verdict is not None and verdict.beside is not None:
        add(body, "p", f"Reference: {verdict.beside.path}, {verdict.beside.words}.", "note")
    found = [sentence(analysis, event) for event in analysis.findings]
    _add_list(body, "Findings", found)
    _add_list(body, "Annotated", annotated(analysis))
    if remark := note(analysis):
        add(body, "p", remark, "note")
    if verdict is not None:
        _add_list(body, "Missing", [str(each) for each in verdict.missing])
        _add_list(body, "Does not count", case_of([verdict]).notes)
    add(body, "h2", "Over time")
    image = f"data:image/png;base64,{b64encode(picture(analysis, beside)).decode()}"
    described = f"Noise, classes and spectrograms over {analysis.run.duration:.2f} s"
    add(body, "img", src=image, alt=f"{described}; the lists have the findings")
    add(body, "h2", "Sound")
    if (sound := clip(analysis.run, around=worst_time(analysis))) is None:
        add(body, "p", "The log's rate is too low for audible frequencies.", "note")
    else:
        gain = common_gain([sound])
        source = f"data:audio/wav;base64,{b64encode(sound.file(gain)).decode()}"
        add(body, "audio", controls="controls", src=source)
        span = f"From {sound.start:.2f} s to {sound.stop:.2f} s: {sound.what}"
        add(body, "p", f"{span}, {sound.description(gain)}. {AUDIBLE}", "note")
    _add_list(body, "What the log can show", audit.splitlines())
    _add_list(body, "Remarks", [spoken(remark) for remark in analysis.remarks])
    made = (
        f"Made by noise-inspector of an input with SHA-256 {analysis.sha256}. The noise is an"
        " estimate from the velocities of rigid links: compare it, do not quote it."
    )
    add(body, "p", made, "note")
    return written(html)


# --- elements of pages


def document(title: str, policy: str) -> tuple[ET.Element, ET.Element]:
    """An HTML page without content, and its body."""
    html = ET.Element("html", lang="en")
    head = ET.SubElement(html, "head")
    ET.SubElement(head, "meta", charset="utf-8")
    ET.SubElement(head, "meta", {"http-equiv": "Content-Security-Policy", "content": policy})
    ET.SubElement(head, "meta", name="viewport", content="width=device-width")
    add(head, "title", title)
    add(head, "style", STYLE)
    return html, ET.SubElement(html, "body")


def add(parent: ET.Element, tag: str, text: str = "", kind: str = "", **more: str) -> ET.Element:
    """Add an element with a text, of a class in the style, to another one."""
    element = ET.SubElement(parent, tag, {"class": kind} if kind else {}, **more)
    # HTML has no way to write these characters.
    element.text = re.sub(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]", "\ufffd", text)
    return element


def written(html: ET.Element) -> str:
    """A page as text."""
    return f"<!DOCTYPE html>\n{ET.tostring(html, encoding='unicode', method='html')}\n"


def _add_list(body: ET.Element, title: str, lines: Sequence[str]) -> None:
    if lines:
        add(body, "h2", title)
        items = add(body, "ul")
        for line in lines:
            add(items, "li", line.strip())


# --- the page of many runs

PAGE = "index.html"
PICTURES = "pictures"


def draw(analysis: Analysis, verdict: Verdict, beside: Comparison | None, *, folder: Path) -> Path:
    """Draw a run over time into the folder; the picture is named after the verdict's file."""
    path = verdict.path
    if beside is not None:
        analysis = seen(analysis, verdict)
    # The hash keeps runs of one name in several folders apart, in any process.
    name = re.sub(r"[^\w.-]", "_", path.stem)[:80]
    name = f"{name}-{hashlib.sha256(os.fsencode(path)).hexdigest()[:8]}.png"
    return _kept(folder, name, picture(analysis, beside))


def with_picture(verdict: Verdict, folder: Path) -> Verdict:
    """A verdict of another job with its picture copied into the folder, without if it is gone."""
    drawn = verdict.picture
    if drawn is not None:
        drawn = _kept(folder, drawn.name, drawn.read_bytes()) if drawn.is_file() else None
    return replace(verdict, picture=drawn)


def _kept(folder: Path, name: str, png: bytes) -> Path:
    """Write a picture where the page looks for it."""
    (folder / PICTURES).mkdir(exist_ok=True)
    write_whole(folder / PICTURES / name, png, overwrite=True)
    return folder / PICTURES / name


def write_index(verdicts: Sequence[Verdict], folder: Path) -> None:
    """Write the page, whole or not at all."""
    write_whole(folder / PAGE, index_page(verdicts), overwrite=True)


def index_page(verdicts: Sequence[Verdict]) -> str:
    """The page as text; pictures lie in its folder."""
    html, body = document(f"Noise: {summary(verdicts)}", INDEX_POLICY)
    add(body, "h1", "Noise of the joints")
    add(body, "p", summary(verdicts), "verdict")
    cases = [(case_of(*each), each[0][0]) for each in groups(verdicts, by_run=True)]
    ranked = sorted(cases, key=lambda each: each[0].rank)
    # What is so of all runs that a model could label, if they are several, is said once.
    first, *others = [_facts(each) for _, each in ranked if each.model] or [[]]
    shared = [fact for fact in first if others and all(fact in other for other in others)]
    for fact in shared:
        add(body, "p", fact, "note")
    frame = add(add(body, "div", kind="wide"), "table")
    head, rows = add(add(frame, "thead"), "tr"), add(frame, "tbody")
    for cell in ("status", "run", "findings"):
        add(head, "th", cell)
    add(body, "h2", "Pictures")
    for number, (case, verdict) in enumerate(ranked, 1):
        row, part = add(rows, "tr"), add(body, "section", id=f"run-{number}")
        _add_status(add(row, "td"), verdict)
        add(add(row, "td"), "a", case.name, href=f"#run-{number}")
        add(row, "td", _in_short(verdict))
        told = add(part, "div")
        add(told, "h2", case.name)
        _add_status(add(told, "p"), verdict)
        for line in case.sentences:
            add(told, "p", line)
        message = "" if verdict.model else verdict.message
        own = [fact for fact in _facts(verdict) if fact not in shared]
        length = f"{verdict.duration:.2f} s" if verdict.duration else ""
        for remark in filter(None, [*case.notes, message, *own, length]):
            add(told, "p", remark, "note")
        if case.picture is not None:
            source = f"{PICTURES}/{case.picture.name}"
            link = add(add(part, "div"), "a", href=source)
            add(link, "img", src=source, alt=f"{case.name} over time", loading="lazy")
    return written(html)


def _facts(verdict: Verdict) -> list[str]:
    """By which model and reference a run was judged, and what limits that."""
    by = verdict.expectations
    if verdict.beside is not None:
        by = f"{verdict.beside.path}, {verdict.beside.words}"
    model, message = (f"model {verdict.model}", verdict.message) if verdict.model else ("", "")
    return list(filter(None, [model, by and f"reference: {by}", message, verdict.assumed]))


def _in_short(verdict: Verdict) -> str:
    """The classes that were found, or why nothing could be."""
    if verdict.status not in (Status.OK, Status.FINDINGS):
        return verdict.message
    counts = Counter(event.label for event in verdict.failing)
    told = [f"{label} ({n})" if n > 1 else label for label, n in counts.items()]
    told += [f"missing: {each.label}" for each in verdict.missing]
    told += [f"{len(verdict.excused)} that do not count"] if verdict.excused else []
    return ", ".join(told)


def _add_status(parent: ET.Element, verdict: Verdict) -> None:
    words = f"{COUNTED[verdict.status]}{' (ignored)' if verdict.ignored else ''}"
    kind = Status.CANNOT_TELL if verdict.ignored else verdict.status
    add(parent, "span", words, f"status {kind}")


# --- the page of many commits

SHORTEST = 4  # commits from which a stretch has a level of its own
# Smallest change that the page names: of a level in [dB], and of findings per run.
LEAST_DB, LEAST_FINDINGS = 2.0, 0.5
WIDTH, HEIGHT = 900, 120


@dataclass(frozen=True, eq=False)
class Series:
    """What became of a scenario, or of a joint in it, at each commit; NaN where it was not run.

    Levels are over a reference: results without one have findings only.
    """

    name: str  # how it is called
    joint: str
    unit: str
    value: Array


@dataclass(frozen=True, eq=False)
class History:
    """Commits in order, series with most change first, and what was not read or left out."""

    commits: tuple[str, ...]
    series: tuple[Series, ...]
    problems: tuple[str, ...]
    notes: tuple[str, ...]

    def lines(self) -> Iterator[str]:
        """The changes, a line each."""
        yield f"{counted(len(self.commits), 'commit')}, {self.commits[0]} to {self.commits[-1]}"
        yield from self.notes
        for series in self.series:
            yield from (f"{series.name}: {told}" for told in self.told(series))

    def told(self, series: Series) -> list[str]:
        """The changes of a series in words."""
        of, count = self.commits, len(self.commits)
        return [
            f"{by:+.1f} {series.unit} at {of[commit]} ({commit + 1} of {count})"
            for commit, by in changes(series)
        ]


def read_history(folder: Path) -> History:
    """Read the results of a folder, one per commit; what is no result is named and left out.

    Files are in order of their names, numbers by their value. A name that is a number, a dash and
    the rest is of that number, and called the rest: ``0061-3f2a1c9.json``. Of results with one
    number, as a rebase leaves them, the file that was modified last counts.
    """
    commits, results, problems, notes = [], [], [], []
    last: dict[str, tuple[Path, str]] = {}
    for path in sorted(folder.glob("*.json"), key=lambda path: (path.stat().st_mtime, path)):
        number, _, name = path.stem.rpartition("-")
        if not number.isdigit():
            number = name = path.stem
        if number in last:
            notes.append(f"{last[number][0].name}: replaced by {path.name}")
        last[number] = path, name
    for path, name in sorted(last.values(), key=lambda each: natural(each[0].stem)):
        try:
            results.append(read_results(path))
            commits.append(name)
        except InspectorError as error:
            problems.append(str(error))
    if not commits:
        why = f"; {problems[0]}" if problems else ""
        raise InspectorError(f"{folder}: no result of `classify --write json=FILE`{why}")
    series = list(_series(results))
    series.sort(key=lambda each: -max([abs(by) for _, by in changes(each)], default=0.0))
    return History(tuple(commits), tuple(series), tuple(problems), tuple(notes))


def _series(results: Sequence[Sequence[Verdict]]) -> Iterator[Series]:
    """The series of each scenario, and of its joints."""
    nowhere, none = (partial(np.full, len(results), value) for value in (np.nan, 0.0))
    runs: dict[str, Array] = defaultdict(nowhere)
    over: dict[tuple[str, str], Array] = defaultdict(nowhere)
    found: dict[tuple[str, str], Array] = defaultdict(none)
    for commit, verdicts in enumerate(results):
        for of, called in groups(verdicts):
            name = of[0].scenario or str(Path(called).with_suffix(""))
            runs[name][commit] = np.nansum((runs[name][commit], len(of)))
            for verdict in of:
                known = verdict.beside
                levels = {} if known is None or known.over_db is None else {"": known.over_db}
                for joint, worst in (levels | dict(known.joints_db if known else {})).items():
                    over[name, joint][commit] = np.fmax(over[name, joint][commit], worst)
                for event in verdict.failing:
                    where = event.localisation
                    joint = where.joints[0][0] if where and where.joints else ""
                    for key in dict.fromkeys([(name, ""), (name, joint)]):
                        found[key][commit] += 1
    every = [("dB", *each) for each in over.items()]
    found |= {(name, ""): none() for name in runs if (name, "") not in found}
    every += [("findings", of, number / runs[of[0]]) for of, number in found.items()]
    for unit, (name, joint), value in every:
        yield Series(f"{name}, {joint}" if joint else name, joint, unit, value)


def changes(series: Series) -> list[tuple[int, float]]:
    """Steps of a series, by commit and size; commits at which it was not run do not count."""
    there = np.flatnonzero(~np.isnan(series.value))
    value, least = series.value[there], LEAST_DB if series.unit == "dB" else LEAST_FINDINGS
    edges = [*_stretches(value, least), len(value)]
    levels = [float(value[first:last].mean()) for first, last in pairwise(edges)]
    steps = zip(there[edges[1:-1]].tolist(), np.diff(levels).tolist(), strict=True)
    return [(commit, by) for commit, by in steps if abs(by) >= least]


def _stretches(value: Array, least: float) -> list[int]:
    """Where stretches of one level begin.

    A stretch is cut where two levels that differ explain it better, by Schwarz's criterion.
    """
    n = len(value)
    places = range(SHORTEST, n - SHORTEST + 1)
    errors = {k: _error(value[:k]) + _error(value[k:]) for k in places}
    best = min(errors, key=errors.__getitem__, default=0)
    floor = 1e-4 * n  # of values without any noise
    # Twice the gain in log likelihood, for two more numbers: a level, and the place, found among n.
    if not best or n * np.log((_error(value) + floor) / (errors[best] + floor)) < 3 * np.log(n):
        return [0]
    if abs(value[best:].mean() - value[:best].mean()) < least:
        return [0]
    later = [best + place for place in _stretches(value[best:], least)]
    return [*_stretches(value[:best], least), *later]


def _error(value: Array) -> float:
    """Sum of squares about the mean of a stretch."""
    return float(np.square(value - value.mean()).sum())


def history_page(history: History) -> str:
    """Write series as one HTML page, those with most change first; no joints without a change.

    Each is drawn as a point for each commit and a line at each step.
    """
    html, body = document("Noise over commits", HISTORY_POLICY)
    add(body, "h1", "Noise over commits")
    add(body, "p", next(history.lines()), "verdict")
    for problem in (*history.problems, *history.notes):
        add(body, "p", problem, "note")
    for series in history.series:
        found = history.told(series)
        if series.joint and not found:
            continue
        add(body, "h2", series.name)
        for step in found:
            add(body, "p", step, "step")
        value = series.value
        low, high = min(0.0, float(np.nanmin(value))), max(float(np.nanmax(value)), 1.0)
        x = (np.arange(len(value)) + 0.5) * WIDTH / len(value)
        y = HEIGHT - 10 - (value - low) / (high - low) * (HEIGHT - 20)
        drawn = add(body, "svg", viewBox=f"0 0 {WIDTH} {HEIGHT}", role="img")
        for commit, _ in changes(series):
            at = f"{x[commit] - WIDTH / len(value) / 2:.1f}"
            add(drawn, "line", x1=at, x2=at, y1="0", y2=str(HEIGHT))
        for place in np.flatnonzero(~np.isnan(value)):
            point = add(drawn, "circle", cx=f"{x[place]:.1f}", cy=f"{y[place]:.1f}", r="3")
            add(point, "title", f"{history.commits[place]}: {value[place]:.1f} {series.unit}")
        unit = "dB over the reference" if series.unit == "dB" else "findings per run"
        add(body, "p", f"{unit}, {low:.1f} to {high:.1f}", "note")
    return written(html)
