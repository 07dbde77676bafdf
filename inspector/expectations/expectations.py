"""The file of expectations, ``expect.toml``: which findings of which runs are expected."""

import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from datetime import date, datetime
from fnmatch import fnmatchcase
from math import inf, isfinite
from pathlib import Path
from typing import Any

from inspector.errors import FileError
from inspector.library import Library
from noiseclassifier.jsontext import from_toml, text_of, toml_shown
from noiseclassifier.labels import UNKNOWN
from noisemodel.atomic import also_reading
from noisemodel.errors import hint

NAME = "expect.toml"
FORMAT = "noise-expect/1"
TOLERANCE = 0.2
"""Of the onset `at`, in [s], unless the file says otherwise; the same as in evaluations."""

KINDS = ("waive", "require", "forbid", "allow", "budget")
"""Kinds of entries; the first that has one for a finding decides."""

SELECTORS = ("class", "runs", "scenario", "joints", "time", "reason")
KEYS = {
    "waive": (*SELECTORS, "at", "tolerance", "until"),
    "require": (*SELECTORS, "at", "tolerance"),
    "forbid": SELECTORS,
    "allow": (*SELECTORS, "at", "tolerance"),
    "budget": (*SELECTORS, "findings", "percent"),
}
"""What an entry may have."""
NEEDED = {"waive": ("reason", "until"), "require": ("class",)}


class ExpectationError(FileError):
    """A file of expectations that is wrong."""


@dataclass(frozen=True)
class Entry:
    """One entry: which findings of which runs, and what is expected of them.

    Attributes:
        kind: One of `KINDS`.
        place: Its number among those of its kind, from 1.
        classes: Classes of the findings, all unless given.
        runs: Patterns of files, all unless given.
        scenario: Patterns of scenarios, all unless given.
        joints: Patterns of joints, any unless given.
        time: From and to, in [s], any time unless given.
        at: The onset, in [s], any unless given.
        tolerance: Of the onset, in [s].
        reason: Why, in a few words.
        until: The last day of a waiver.
        findings: Most findings of a run that a budget allows.
        percent: Largest share of a run's time that they may take, in [%].
    """

    kind: str
    place: int
    classes: tuple[str, ...] = ()
    runs: tuple[str, ...] = ()
    scenario: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()
    time: tuple[float, float] | None = None
    at: float | None = None
    tolerance: float = TOLERANCE
    reason: str = ""
    until: date | None = None
    findings: int | None = None
    percent: float | None = None

    @property
    def name(self) -> str:
        """How messages call it, such as "[[allow]] 2"."""
        return f"[[{self.kind}]] {self.place}"

    @property
    def onset(self) -> tuple[float, float] | None:
        """The earliest and the latest onset, in [s]; None if any."""
        if self.at is not None:
            return self.at - self.tolerance, self.at + self.tolerance
        return self.time

    def expired(self, today: date) -> bool:
        """Whether it is a waiver whose last day is past."""
        return self.until is not None and today > self.until

    def covers(self, run: Path, scenario: str) -> bool:
        """Whether it is about a run.

        Args:
            run: The run, relative to the folder of the file.
            scenario: The scenario that the run names, empty without.
        """
        if self.scenario and not _any(scenario, self.scenario):
            return False
        names = {run.as_posix(), run.name}
        return not self.runs or any(_any(name, self.runs) for name in names)

    def asked_in(self, folder: str) -> bool:
        """Whether runs of a folder may be what it is about: its patterns name no other folder.

        Args:
            folder: The folder, relative to that of the file, with a slash at its end; empty for
                that of the file, and for folders elsewhere.
        """
        for pattern in self.runs or ("*",):
            literal = re.split(r"[*?[]", pattern, maxsplit=1)[0]
            open_end = literal != pattern and folder.startswith(literal)
            if "/" not in pattern or literal.startswith(folder) or open_end:
                return True
        return False

    def matches(self, label: str, start: float, stop: float, joint: str | None) -> bool:
        """Whether it is about a finding of such a run.

        An allowed, required or waived finding lies within `time`, a forbidden one or one that
        counts for a budget overlaps it.

        Args:
            label: The class.
            start: The onset, in [s].
            stop: The end, in [s].
            joint: The joint with the largest share in it; None if that is not known.
        """
        if self.classes and label not in self.classes:
            return False
        if self.joints and (joint is None or not _any(joint, self.joints)):
            return False
        if self.at is not None and abs(start - self.at) > self.tolerance:
            return False
        if self.time is None:
            return True
        first, last = self.time
        if self.kind in ("forbid", "budget"):
            return start < last and stop > first
        return first <= start and stop <= last


@dataclass(frozen=True)
class Expectations:
    """What is expected of the runs below a folder.

    Attributes:
        path: The file.
        entries: Its entries, in the order in which they decide.
        fail_others: Whether findings that no entry is about fail their runs.
    """

    path: Path
    entries: tuple[Entry, ...] = ()
    fail_others: bool = True

    @property
    def by_joint(self) -> bool:
        """Whether findings have to be localised for it."""
        return any(entry.joints for entry in self.entries)

    def of(self, run: Path, scenario: str) -> tuple[Entry, ...]:
        """List the entries about a run."""
        name = relative(run, self.path.parent)
        return tuple(entry for entry in self.entries if entry.covers(name, scenario))

    def remarks(self, today: date) -> tuple[str, ...]:
        """List waivers that have expired, a sentence each.

        Args:
            today: The day that counts.
        """
        return tuple(
            f"{self.path}: {entry.name} expired on {entry.until} ({entry.reason}); its findings"
            " count again: fix them, or move `until`"
            for entry in self.entries
            if entry.expired(today)
        )

    def widened(self, slack: float) -> "Expectations":
        """The same of findings whose times are less exact.

        Args:
            slack: By how much earlier they may begin, and later end, in [s].
        """

        def wider(entry: Entry) -> Entry:
            lies_within = entry.kind not in ("forbid", "budget")
            time = entry.time
            if time is not None and lies_within:
                time = (time[0] - slack, time[1] + slack)
            return replace(entry, time=time, tolerance=entry.tolerance + slack)

        return replace(self, entries=tuple(map(wider, self.entries)))

    def check_classes(self, library: Library) -> None:
        """Refuse entries for a class that cannot be found.

        Args:
            library: The models that are used.

        Raises:
            ExpectationError: If an entry names a class that none of them has.
        """
        possible = classes_found(library)
        for entry in self.entries:
            for name in entry.classes:
                if name not in possible:
                    raise ExpectationError(
                        self.path,
                        f"{entry.name}: no model has the class {name!r}; there are"
                        f" {', '.join(possible)}{hint(name, possible)}",
                    )


def relative(run: Path, folder: Path) -> Path:
    """Give the path of a run relative to a folder; its name alone if it lies elsewhere.

    A run that is a link has the name of the link.
    """
    full, top = run.parent.resolve() / run.name, folder.resolve()
    return full.relative_to(top) if full.is_relative_to(top) else Path(run.name)


def classes_found(library: Library) -> tuple[str, ...]:
    """List the classes that findings of some models can have.

    Args:
        library: The models.
    """
    known = dict.fromkeys(name for model in library.values() for name in model.classes)
    return (*(name for name in known if name != "ok"), UNKNOWN)


def read(path: Path) -> Expectations:
    """Read a file of expectations.

    Args:
        path: The file.

    Raises:
        ExpectationError: If it cannot be read, or holds what is not known.
    """
    also_reading([path])
    try:
        content = from_toml(text_of(path))
    except OSError as error:
        raise ExpectationError(path, f"cannot be read ({error.strerror})") from error
    except ValueError as error:
        raise ExpectationError(path, f"no TOML ({error})") from error
    form = content.pop("format", FORMAT)
    if form != FORMAT:
        raise ExpectationError(path, f"of format {toml_shown(form)}, expected {FORMAT!r}")
    others = content.pop("others", "fail")
    if others not in ("fail", "allow"):
        raise ExpectationError(path, f'others = {toml_shown(others)}, expected "fail" or "allow"')
    _check_keys(path, "the file", content, ("format", "others", *KINDS))
    entries = []
    for kind in KINDS:
        rows = content.get(kind, [])
        if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
            raise ExpectationError(path, f"{kind}: expected entries that begin with [[{kind}]]")
        entries += [_Row(path, kind, place, row).entry() for place, row in enumerate(rows, 1)]
    return Expectations(path, tuple(entries), others == "fail")


def found_for(runs: Iterable[Path]) -> dict[Path, Expectations]:
    """Read the file of expectations of each run that has one.

    It is the nearest ``expect.toml``: beside the run, or in a folder above it. The search ends at
    the top of a repository.

    Args:
        runs: Paths of the runs; those of episodes lie below their data set.

    Returns:
        The expectations of runs that have some.

    Raises:
        ExpectationError: If one of the files is wrong.
    """
    nearest: dict[Path, Path | None] = {}
    known: dict[Path, Expectations] = {}
    found = {}
    for run in runs:
        if run.parent not in nearest:
            nearest[run.parent] = next(_above(run.parent), None)
        path = nearest[run.parent]
        if path is not None:
            if path not in known:
                known[path] = read(path)
            found[run] = known[path]
    return found


def is_nearest(path: Path, run: Path) -> bool:
    """Whether a file is the one that `found_for` reads for a run."""
    found = next(_above(run.parent), None)
    return found is not None and found.resolve() == path.resolve()


def _above(folder: Path) -> Iterator[Path]:
    """List the files for runs of a folder, the nearest first, as people would type their paths."""
    full, here = folder.resolve(), Path.cwd()
    for each in (full, *full.parents):
        path = each / NAME
        if path.is_file():
            yield path.relative_to(here) if path.is_relative_to(here) else path
        if (each / ".git").exists():
            return


def _any(name: str, patterns: Iterable[str]) -> bool:
    return any(fnmatchcase(name, pattern) for pattern in patterns)


def _check_keys(path: Path, where: str, given: Iterable[str], known: Collection[str]) -> None:
    for key in given:
        if key not in known:
            raise ExpectationError(path, f"{where}: no {key!r}; there are {', '.join(known)}")


@dataclass(frozen=True)
class _Row:
    """An entry as TOML has it."""

    path: Path
    kind: str
    place: int
    content: Mapping[str, Any] = field(default_factory=dict)

    def entry(self) -> Entry:
        where = f"[[{self.kind}]] {self.place}"
        _check_keys(self.path, where, self.content, KEYS[self.kind])
        for key in NEEDED.get(self.kind, ()):
            if not self.content.get(key):
                raise self.error(f"needs {key!r}")
        if self.kind == "budget" and not {"findings", "percent"} & set(self.content):
            raise self.error("needs 'findings' or 'percent'")
        at, most = self.number("at"), self.number("findings", low=0.0)
        tolerance = self.number("tolerance", low=0.0)
        if tolerance is not None and at is None:
            raise self.error("a tolerance without 'at'")
        return Entry(
            self.kind,
            self.place,
            self.words("class"),
            self.words("runs"),
            self.words("scenario"),
            self.words("joints"),
            self.time(),
            at,
            TOLERANCE if tolerance is None else tolerance,
            " ".join(self.words("reason")),
            self.until(),
            None if most is None else int(most),
            self.number("percent", low=0.0, high=100.0),
        )

    def error(self, problem: str) -> ExpectationError:
        return ExpectationError(self.path, f"[[{self.kind}]] {self.place}: {problem}")

    def words(self, key: str) -> tuple[str, ...]:
        given = self.content.get(key, [])
        values = given if isinstance(given, list) else [given]
        if key in self.content and not values:
            raise self.error(f"{key} = [], expected one at least, or no {key!r}")
        whole = key == "scenario"  # of our own simulator these are numbers
        if not all(isinstance(value, str) or (whole and type(value) is int) for value in values):
            raise self.error(f"{key} = {toml_shown(given)}, expected a text or a list of them")
        return tuple(map(str, values))

    def number(self, key: str, *, low: float = -inf, high: float = inf) -> float | None:
        value = self.content.get(key)
        if value is None:
            return None
        whole = key == "findings"
        kinds = (int,) if whole else (int, float)
        number = isinstance(value, kinds) and not isinstance(value, bool) and isfinite(value)
        if not number or not low <= value <= high:
            least = f" of {low:g} or more" if low > -inf else ""
            bound = f" from {low:g} to {high:g}" if high < inf else least
            raise self.error(
                f"{key} = {toml_shown(value)}, expected a {'whole ' * whole}number{bound}"
            )
        return float(value)

    def time(self) -> tuple[float, float] | None:
        given = self.content.get("time")
        if given is None:
            return None
        numbers = isinstance(given, list) and all(type(each) in (int, float) for each in given)
        if not numbers or len(given) != 2 or not given[0] < given[1]:
            raise self.error(f"time = {toml_shown(given)}, expected [from, to] in seconds")
        return float(given[0]), float(given[1])

    def until(self) -> date | None:
        given = self.content.get("until")
        if given is None or (isinstance(given, date) and not isinstance(given, datetime)):
            return given
        raise self.error(
            f"until = {toml_shown(given)}, expected a date without quotes, such as 2027-01-31"
        )
