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
            for commit, by in changes(series):
                yield f"{series.name}: {self.told(series, commit, by)}"

    def told(self, series: Series, commit: int, by: float) -> str:
        """A change in words."""
        number = f"{commit + 1} of {len(self.commits)}"
        return f"{by:+.1f} {series.unit} at {self.commits[commit]} ({number})"


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
    series.sort(key=lambda each: -max([abs(by) for _, by in changes(each)], default=0.0))
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


def changes(series: Series) -> list[tuple[int, float]]:
    """Steps of a series, by commit and size; commits at which it was not run do not count."""
    there = np.flatnonzero(~np.isnan(series.value))
    value = series.value[there]
    least = LEAST_DB if series.unit == "dB" else LEAST_FINDINGS
    edges = [*_stretches(value, least), len(value)]
    levels = [float(value[first:last].mean()) for first, last in pairwise(edges)]
    steps = zip(edges[1:], pairwise(levels), strict=False)
    found = [(int(there[first]), after - before) for first, (before, after) in steps]
    return [(commit, by) for commit, by in found if abs(by) >= least]


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
        for commit, by in found:
            add_text(body, "p", history.told(series, commit, by), "step")
        _draw(body, history, series, found)
    return written(html)


def _draw(
    body: ET.Element, history: History, series: Series, found: Sequence[tuple[int, float]]
) -> None:
    """Draw a series: a point for each commit, a line at each step."""
    value = series.value
    low, high = min(0.0, float(np.nanmin(value))), max(float(np.nanmax(value)), 1.0)
    x = (np.arange(len(value)) + 0.5) * WIDTH / len(value)
    y = HEIGHT - 10 - (value - low) / (high - low) * (HEIGHT - 20)
    drawn = ET.SubElement(body, "svg", viewBox=f"0 0 {WIDTH} {HEIGHT}", role="img")
    for commit, _ in found:
        at = f"{x[commit] - WIDTH / len(value) / 2:.1f}"
        ET.SubElement(drawn, "line", x1=at, x2=at, y1="0", y2=str(HEIGHT))
    for place in np.flatnonzero(~np.isnan(value)):
        point = ET.SubElement(drawn, "circle", cx=f"{x[place]:.1f}", cy=f"{y[place]:.1f}", r="3")
        told = f"{history.commits[place]}: {value[place]:.1f} {series.unit}"
        add_text(point, "title", told)
    unit = "dB over the reference" if series.unit == "dB" else "findings per run"
    add_text(body, "p", f"{unit}, {low:.1f} to {high:.1f}", "note")
