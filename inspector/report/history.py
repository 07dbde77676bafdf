"""Results of many commits: how far each scenario is over its reference, and where that changed.

A file of `classify --write json=FILE` is a commit. They are in order of their names, numbers by
their value. A name that is a number, a dash and the rest is of that number, and called the rest:
``0061-3f2a1c9.json``. Levels are those over a reference: results without one have findings only.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from inspector.errors import InspectorError
from inspector.report.findings import groups
from inspector.report.html import STYLE, add_text, document, written
from inspector.text import counted, natural
from inspector.verdict import Verdict, read_results
from noisemodel.types import Array

SHORTEST = 4  # commits from which a stretch has a level of its own
# Smallest change that the page names: of a level in [dB], and of findings per run.
LEAST_DB, LEAST_FINDINGS = 2.0, 0.5
WIDTH, HEIGHT = 900, 120
POLICY = "default-src 'none'; style-src 'unsafe-inline'"
LOOK = """
svg { width: 100%; height: auto; border: 1px solid #d0d7de; } circle { fill: #0072b2; }
line { stroke: #d55e00; stroke-width: 2; stroke-dasharray: 6 4; } .step { color: #d55e00; }
"""


@dataclass(frozen=True, eq=False)
class Series:
    """What became of a scenario, or of a joint in it, at each commit; NaN where it was not run."""

    scenario: str
    joint: str
    unit: str
    value: Array

    @property
    def name(self) -> str:
        """How it is called."""
        return f"{self.scenario}, {self.joint}" if self.joint else self.scenario


@dataclass(frozen=True)
class Change:
    """A step at a commit, or a drift from the first to the last of several."""

    first: int
    last: int
    by: float


@dataclass(frozen=True, eq=False)
class History:
    """Commits in order, series with most change first, and what was not read or left out."""

    commits: tuple[str, ...]
    series: tuple[Series, ...]
    problems: tuple[str, ...]
    notes: tuple[str, ...] = ()

    def lines(self) -> Iterator[str]:
        """The changes, a line each."""
        yield f"{counted(len(self.commits), 'commit')}, {self.commits[0]} to {self.commits[-1]}"
        yield from self.notes
        for series in self.series:
            for change in changes(series):
                yield f"{series.name}: {self.told(series, change)}"

    def told(self, series: Series, change: Change) -> str:
        """A change in words."""
        by, number = f"{change.by:+.1f} {series.unit}", len(self.commits)
        first, last = self.commits[change.first], self.commits[change.last]
        if change.first == change.last:
            return f"{by} at {first} ({change.first + 1} of {number})"
        return f"drift of {by} from {first} to {last}"


def read(folder: Path) -> History:
    """Read the results of a folder; what is no result is named and left out.

    Of results with one number, as a rebase leaves them, the file that was modified last counts.
    """
    commits, results, problems, notes = [], [], [], []
    last: dict[str, Path] = {}
    for path in sorted(folder.glob("*.json"), key=lambda path: (path.stat().st_mtime, path)):
        number = _named(path)[0]
        if number in last:
            notes.append(f"{last[number].name}: replaced by {path.name}")
        last[number] = path
    for path in sorted(last.values(), key=lambda path: natural(path.stem)):
        try:
            results.append(read_results(path))
            commits.append(_named(path)[1])
        except InspectorError as error:
            problems.append(str(error))
    if not commits:
        why = f"; {problems[0]}" if problems else ""
        raise InspectorError(f"{folder}: no result of `classify --write json=FILE`{why}")

    series = list(_series(results))
    series.sort(key=lambda each: -max([abs(change.by) for change in changes(each)], default=0.0))
    return History(tuple(commits), tuple(series), tuple(problems), tuple(notes))


def _named(path: Path) -> tuple[str, str]:
    """Number and name of a commit; both are the whole name of a file without a number."""
    number, _, name = path.stem.rpartition("-")
    return (number, name) if number.isdigit() else (path.stem, path.stem)


def _series(results: Sequence[Sequence[Verdict]]) -> Iterator[Series]:
    """The series of each scenario, and of its joints."""
    count = len(results)
    runs: dict[str, Array] = defaultdict(lambda: np.full(count, np.nan))
    over: dict[tuple[str, str], Array] = defaultdict(lambda: np.full(count, np.nan))
    found: dict[tuple[str, str], Array] = defaultdict(lambda: np.zeros(count))
    for commit, verdicts in enumerate(results):
        for group in groups(verdicts):
            name = group.worst.scenario or str(Path(group.name).with_suffix(""))
            runs[name][commit] = np.nansum((runs[name][commit], len(group.verdicts)))
            for verdict in group.verdicts:
                known = verdict.beside
                levels = {} if known is None or known.over_db is None else {"": known.over_db}
                for joint, worst in (levels | dict(known.joints_db if known else {})).items():
                    over[name, joint][commit] = np.fmax(over[name, joint][commit], worst)
                for event in verdict.failing:
                    where = event.localisation
                    joint = where.joints[0][0] if where and where.joints else ""
                    for key in dict.fromkeys([(name, ""), (name, joint)]):
                        found[key][commit] += 1
    yield from (Series(*of, "dB", level) for of, level in over.items())
    for name in runs:
        found.setdefault((name, ""), np.zeros(count))
    for (name, joint), number in found.items():
        yield Series(name, joint, "findings", number / runs[name])


def changes(series: Series) -> list[Change]:
    """Steps and drifts of a series, in order; commits at which it was not run do not count."""
    there = np.flatnonzero(~np.isnan(series.value))
    value = series.value[there]
    least = LEAST_DB if series.unit == "dB" else LEAST_FINDINGS
    found, before = [], None
    for first, last in pairwise([*_stretches(value), len(value)]):
        start, stop = _line(value[first:last])
        if before is not None and abs(by := start - before) >= least:
            found.append(Change(int(there[first]), int(there[first]), float(by)))
        if abs(stop - start) >= least:
            found.append(Change(int(there[first]), int(there[last - 1]), float(stop - start)))
        before = stop
    return found


def _stretches(value: Array) -> list[int]:
    """Where stretches begin in each of which a line describes a series.

    It is cut where two lines explain it better than one, by Schwarz's criterion.
    """
    n = len(value)
    places = range(SHORTEST, n - SHORTEST + 1)
    errors = {k: _error(value[:k]) + _error(value[k:]) for k in places}
    best = min(errors, key=errors.__getitem__, default=0)
    # Three more numbers: two of a line, and the place, found among n.
    if not best or _gain(n, _error(value), errors[best]) < 4 * np.log(n):
        return [0]
    return [*_stretches(value[:best]), *(best + place for place in _stretches(value[best:]))]


def _line(value: Array) -> tuple[float, float]:
    """Values at both ends of the line through a stretch; its mean if it is no better."""
    n, mean = len(value), float(value.mean())
    constant = float(np.square(value - mean).sum())
    if n < 2 * SHORTEST or _gain(n, constant, _error(value)) < 2 * np.log(n):
        return mean, mean
    slope, begin = np.polyfit(np.arange(n), value, 1)
    return float(begin), float(begin + slope * (n - 1))


def _gain(n: int, error: float, better: float) -> float:
    """Twice the logarithm of the likelihood that smaller errors gain."""
    floor = 1e-4 * n  # of values without any noise
    return float(n * np.log((error + floor) / (better + floor)))


def _error(value: Array) -> float:
    """Sum of squares about the line through a stretch."""
    x = np.arange(len(value)) - (len(value) - 1) / 2
    y = value - value.mean()
    square = float(np.square(x).sum())
    slope = float(x @ y) / square if square else 0.0
    return float(np.square(y - slope * x).sum())


def page(history: History) -> str:
    """Write series as one HTML page, those with most change first; no joints without a change."""
    html, body = document("Noise over commits", STYLE + LOOK, POLICY)
    add_text(body, "h1", "Noise over commits")
    add_text(body, "p", next(history.lines()), "verdict")
    for problem in (*history.problems, *history.notes):
        add_text(body, "p", problem, "note")
    for series in history.series:
        found = changes(series)
        if series.joint and not found:
            continue
        add_text(body, "h2", series.name)
        for change in found:
            add_text(body, "p", history.told(series, change), "step")
        _draw(body, history, series, found)
    return written(html)


def _draw(body: ET.Element, history: History, series: Series, found: Sequence[Change]) -> None:
    """Draw a series: a point for each commit, a line at each step."""
    value = series.value
    low, high = min(0.0, float(np.nanmin(value))), max(float(np.nanmax(value)), 1.0)
    x = (np.arange(len(value)) + 0.5) * WIDTH / len(value)
    y = HEIGHT - 10 - (value - low) / (high - low) * (HEIGHT - 20)
    drawn = ET.SubElement(body, "svg", viewBox=f"0 0 {WIDTH} {HEIGHT}", role="img")
    for change in found:
        if change.first == change.last:
            at = f"{x[change.first] - WIDTH / len(value) / 2:.1f}"
            ET.SubElement(drawn, "line", x1=at, x2=at, y1="0", y2=str(HEIGHT))
    for place in np.flatnonzero(~np.isnan(value)):
        point = ET.SubElement(drawn, "circle", cx=f"{x[place]:.1f}", cy=f"{y[place]:.1f}", r="3")
        told = f"{history.commits[place]}: {value[place]:.1f} {series.unit}"
        add_text(point, "title", told)
    unit = "dB over the reference" if series.unit == "dB" else "findings per run"
    add_text(body, "p", f"{unit}, {low:.1f} to {high:.1f}", "note")
