"""The store of accepted runs: ``reference/reference.toml``, and an .npz of levels per scenario.

People read and edit the TOML in a review: what is required, wanted and waived. The levels are in
the .npz files, whose hashes the TOML holds: a file that was changed is refused.
"""

import fcntl
import hashlib
import json
import os
import re
import zipfile
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from datetime import date
from functools import lru_cache, partial
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from inspector.audit.signals import without_placeholder
from inspector.errors import FileError, InspectorError
from inspector.logs.read import Reading, open_source, sources
from inspector.reference.judging import (
    Comparison,
    Expected,
    Margin,
    Scenario,
    compare,
    leave_one_moment_out,
    leave_one_out,
    margin_of,
    robot_fits,
    share_of_motion,
)
from inspector.reference.levels import (
    BINS,
    HOP,
    LEAST_DB,
    SIGNALS,
    STEP_DB,
    Levels,
    decoded,
    encoded,
    levels,
    octaves,
)
from inspector.text import counted, natural, toml_shown
from noiseclassifier import Event
from noiseclassifier.jsontext import from_toml, text_of
from noiseclassifier.matching import union
from noisemodel import NoiseModelError, OutputError, Run, runfile
from noisemodel.files import replacing

FOLDER, NAME = "reference", "reference.toml"
FORMAT = "noise-reference/1"
ARRAYS = ("level", "guide", "pace")  # of each repetition, with its number
NEWEST = 10  # repetitions that are kept of a scenario
MOST_SCENARIOS = 5000
TOLERANCE = 0.2  # by how much earlier or later an accepted finding may come, in [s]
CALIBRATED = 3  # repetitions from which the margin beside other motions is taken
# Name of a file that is one of several: ``walk-1``, ``walk_run2``, ``walk-seed-003``.
REPETITION = re.compile(r"(?P<name>.+?)[-_./](?:run|rep|take|seed)?[-_.]?\d+")
# Kinds of values by key; a kind in brackets stands for lists of such values.
Keys = Mapping[str, type | tuple[type]]
TEXTS, NUMBERS, TABLES = (str,), (float,), (dict,)
SCENARIO: Keys = {
    **dict.fromkeys(("name", "robot", "by", "reason", "levels", "sha256"), str),
    "joints": TEXTS,
    **dict.fromkeys(("duration_s", "scores_db", "elsewhere_db", "loudest_db"), NUMBERS),
    **dict.fromkeys(("repetition", "wanted", "waive"), TABLES),
    "required": bool,
    "at_least": int,
    "accepted": date,
    "margin_db": float,
}
FACTS = ("required", "at_least", "accepted", "by", "reason")  # that are kept as they are
# Keys of a repetition with the fields of its levels, and their kinds.
MEASURED = {"rate_hz": "rate", "start_s": "start", "duration_s": "duration"}
REPEATED = {"run": "run", "sha256": "sha256", **MEASURED, "guided_by": "guided_by"}
REPETITION_KEYS: Keys = {
    **{key: float if key in MEASURED else str for key in REPEATED},
    "joints": TEXTS,
}
# What a scenario of the store wants and waives.
EXPECTED: Keys = {
    "class": str,
    "time_s": NUMBERS,
    "joints": TEXTS,
    "loudest_db": float,
    "required": bool,
    "until": date,
    "reason": str,
}
KINDS = {
    str: "a text",
    float: "a number",
    int: "a whole number",
    bool: "true or false",
    date: "a date such as 2027-01-31",
    dict: "a table",
}


class StoreError(FileError):
    """A store of references that is wrong."""


@dataclass(frozen=True, eq=False)
class Reference:
    """Accepted runs: what is normal for a robot's scenarios."""

    path: Path  #: the store, or the folder of good runs
    scenarios: tuple[Scenario, ...] = ()  #: in order of their names
    stored: bool = False  #: whether it is a store

    @classmethod
    def load(cls, path: str | Path, reading: Reading | None = None) -> "Reference":
        """Read a store, or measure a folder of good runs.

        Args:
            path: A store, its ``reference.toml``, a folder of runs, or a run.

        Raises:
            StoreError: If the store is damaged or of a later version.
            InspectorError: If a run cannot be read.
        """
        path = Path(path).parent if Path(path).name == NAME else Path(path)
        if os.path.lexists(path / NAME):
            return _read(path)
        if not path.exists():
            raise StoreError(path, "no such file or folder")
        return cls(path, of_runs(measured([path], reading)))

    def compare(self, run: Run | Levels) -> Comparison:
        """Compare a run, or levels that a live session kept of one, with what is normal."""
        if isinstance(run, Run):
            name = str(run.meta.get("scenario", ""))
            run = levels(without_placeholder(run)[0], name=name)
        return compare(run, self.scenarios)

    def named(self, name: str) -> Scenario | None:
        """The scenario of a name; None without."""
        return next((each for each in self.scenarios if each.name == name), None)


# --- runs by scenario


@lru_cache(maxsize=4096)
def _nearest(folder: Path) -> Path | None:
    here = Path.cwd()
    for each in (folder, *folder.parents):
        beside = each / FOLDER
        if beside.is_symlink() and not beside.exists():
            raise StoreError(beside, "a link that leads nowhere")
        if os.path.lexists(beside / NAME):
            return beside.relative_to(here) if beside.is_relative_to(here) else beside
        if (each / ".git").exists():
            break
    return None


def find(run: Path) -> Path | None:
    """The store that is nearest to a run: beside it, or beside a folder above it.

    The search ends at the top of a repository.
    """
    return _nearest((run if run.is_dir() else run.parent).resolve())


def scenario_of(run: Run, path: Path, root: Path | None = None) -> str:
    """Name of the scenario of a run: from its meta, or its file without a number at the end.

    Below the root in which it was found, its folders belong to the name.
    """
    known = run.meta.get("scenario")
    if isinstance(known, str) and known.strip() and not known.strip().isdigit():
        return known.strip()
    inside = path.relative_to(root) if root and path.is_relative_to(root) else Path()
    name = (inside if inside.parts else Path(path.name)).with_suffix("").as_posix()
    match = REPETITION.fullmatch(name)
    return match["name"] if match else name


def measured(paths: Sequence[Path], reading: Reading | None = None) -> list[Levels]:
    """Measure the levels of runs."""
    found = []
    try:
        for path in paths:
            root = path if path.is_dir() else None
            for source in sources([path], reading)[0]:
                opened = open_source(source, reading)
                name = scenario_of(opened.run, source.shown, root)
                run, file = without_placeholder(opened.run)[0], str(source.shown)
                found.append(levels(run, name=name, file=file, sha256=opened.sha256))
    except NoiseModelError as error:
        raise InspectorError(str(error)) from error
    return found


def by_motion(runs: Sequence[Levels], known: Iterable[Scenario] = ()) -> list[Levels]:
    """Runs with the names of their scenarios, of which some are known.

    Two motions of one name are two scenarios: the second one has the name of its first file.
    """
    newest = {each.name: each.repetitions[-1] for each in known}
    motions: dict[str, dict[str, Levels]] = defaultdict(dict)  # of each name, by scenario
    for name, last in newest.items():
        match = REPETITION.fullmatch(name)
        motions[name][name] = motions[match["name"] if match else name][name] = last
    found: list[Levels] = []
    for run in runs:
        own = motions[run.name]
        names = (run.apart, run.name, *own)
        same = (each for each in names if each in own and share_of_motion(run, own[each]) >= 0.5)
        other = run.apart in newest or own.get(run.name) is not newest.get(run.name)
        # The first run of a name that makes another motion replaces what is known by the name.
        name = next(same, run.apart if other else run.name)
        own[name] = run
        found.append(replace(run, name=name))
    return found


def of_runs(runs: Sequence[Levels]) -> tuple[Scenario, ...]:
    """Group runs by name and motion into scenarios, in order of their names."""
    groups: dict[str, list[Levels]] = defaultdict(list)
    for run in by_motion(runs):
        groups[run.name].append(run)
    return tuple(
        calibrated(Scenario(name, tuple(sorted(each, key=lambda run: natural(run.run))[-NEWEST:])))
        for name, each in sorted(groups.items())
    )


def calibrated(scenario: Scenario) -> Scenario:
    """Add the scores from which margins follow."""
    runs = scenario.repetitions
    both = leave_one_out(runs), leave_one_moment_out(runs[-CALIBRATED:])
    scores_db, elsewhere_db = (tuple(round(db, 2) for db in each) for each in both)
    return replace(scenario, scores_db=scores_db, elsewhere_db=elsewhere_db)


# --- accepting


def kept_in(folder: Path) -> tuple[Scenario, ...]:
    """The scenarios of a store; none if there is none."""
    if not os.path.lexists(folder / NAME):
        return ()
    with _alone_in(folder) as scenarios:
        return scenarios


def accept_into(
    folder: Path,
    runs: Sequence[Levels],
    *,
    events: Mapping[str, Sequence[Event]],
    reason: str,
    by: str,
) -> tuple[Reference, list[tuple[str, str]]]:
    """Accept runs into a store, and tell what changed by the names of scenarios; all others stay.

    Runs of an accepted scenario that are as it is join its repetitions, of which the newest ten
    stay; runs that differ replace them. Findings in runs, by their files, are wanted from then on.
    """
    home = folder.absolute().parent
    for each in runs:
        if f"{each.name}{each.run}" != f"{each.name}{each.run}".encode(errors="ignore").decode():
            raise InspectorError(f"{each.run}: its name is no text in UTF-8; rename it")
        if not each.joints:
            problem = "the run has no joints, and a reference holds levels of joints"
            raise InspectorError(f"{each.run}: {problem}")
        if not len(each.guide):
            problem = f"{each.duration:.3g} s is too short, a reference needs {BINS * HOP:g} s"
            raise InspectorError(f"{each.run}: {problem}")
    with _alone_in(folder) as scenarios:
        kept = {each.name: each for each in scenarios}
        named = by_motion(runs, kept.values())
        wanted = wanted_in(named, events)
        found = of_runs([replace(each, run=_within(each.run, home)) for each in named])
        changes = []
        for new in found:
            facts: dict[str, Any] = {"accepted": date.today(), "by": by, "reason": reason}
            facts["wanted"] = tuple(wanted.get(new.name, ()))
            old = kept.get(new.name)
            if old is None:
                words = f"new, {counted(len(new.repetitions), 'repetition')}"
                kept[new.name] = replace(new, **facts)
            else:
                kept[new.name], words = _updated(old, new, facts)
            changes.append((new.name, words))
        after = Reference(folder, tuple(kept[name] for name in sorted(kept)), stored=True)
        save(after, folder)
    return after, changes


@contextmanager
def _alone_in(folder: Path) -> Iterator[tuple[Scenario, ...]]:
    """Make a folder, and accept into it while nobody else does; the scenarios that it has."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        held = os.open(folder, os.O_RDONLY)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written ({error.strerror})") from error
    try:
        with suppress(OSError):  # a file system without locks
            fcntl.flock(held, fcntl.LOCK_EX)
        yield Reference.load(folder).scenarios if os.path.lexists(folder / NAME) else ()
    finally:
        os.close(held)


def _within(run: str, home: Path) -> str:
    """Path of a run relative to the folder that the store is in, so that it moves with it."""
    path = Path(run).absolute()
    return path.relative_to(home).as_posix() if path.is_relative_to(home) else run


def _updated(old: Scenario, new: Scenario, facts: Mapping[str, Any]) -> tuple[Scenario, str]:
    """An accepted scenario with new runs, which join its repetitions or replace them, in words."""
    fresh = [run for run in new.repetitions if not any(_same(run, e) for e in old.repetitions)]
    again = {each.sha256 for each in fresh if each.sha256}  # files that are read in another way
    kept = [each for each in old.repetitions if each.sha256 not in again]
    if not fresh:
        return old, "unchanged, these runs are accepted already"
    over, margin = [compare(each, (old,)) for each in fresh], margin_of(old.scores_db).db
    same = all(not e.exceedances and e.repetitions and e.quieter <= margin for e in over)
    repetitions = (*kept, *fresh)[-NEWEST:] if same else new.repetitions
    # What people wrote stays; what an earlier `accept` heard does not.
    by_hand = (e for e in old.wanted if e.required or e.reason or e.loudest_db is None)
    own = {**facts, "wanted": old.wanted if same else (*by_hand, *facts["wanted"])}
    changed = calibrated(replace(old, repetitions=repetitions, **own))
    worst = max((each.worst for each in over if isfinite(each.worst)), default=float("nan"))
    words = f"{counted(len(fresh), 'repetition')} {'added' if same else 'replace the accepted'}"
    told = f", {worst:+.1f} dB over the reference at most" if isfinite(worst) else ""
    if not any(set(each.joints) & set(old.repetitions[-1].joints) for each in fresh):
        told = ", of a robot with other joints"
    return changed, f"{words}{told}, {len(repetitions)} kept"


def _same(run: Levels, accepted: Levels) -> bool:
    """Whether runs are one: with the same joints, motion and levels, but for rounding."""
    one, two = ((e.robot, e.joints, e.guided_by, e.level.shape) for e in (run, accepted))
    close = partial(np.allclose, rtol=0.0, equal_nan=True)
    alike = one == two and close(decoded(encoded(run.level)), accepted.level, atol=STEP_DB)
    return bool(alike and close(run.guide, accepted.guide, atol=1e-3))


def wanted_in(
    runs: Sequence[Levels], events: Mapping[str, Sequence[Event]]
) -> dict[str, list[Expected]]:
    """Findings in runs that are accepted, as wanted from then on, by scenario."""
    heard: dict[tuple[str, str], list[tuple[float, float, str, float]]] = defaultdict(list)
    for run in runs:
        for event in events.get(run.run, ()):
            inside = (run.time >= event.start - TOLERANCE) & (run.time <= event.stop + TOLERANCE)
            level = run.level[inside]
            tops = np.fmax.reduce(level, axis=(0, 2, 3), initial=LEAST_DB)
            joint = run.joints[int(tops.argmax())] if level.size else ""
            start, stop = event.start - run.start - TOLERANCE, event.stop - run.start + TOLERANCE
            heard[run.name, event.label].append((start, stop, joint, float(tops.max())))
    found: dict[str, list[Expected]] = defaultdict(list)
    for (name, label), every in heard.items():
        for start, stop in union(np.array([each[:2] for each in every])).tolist():
            own = [each for each in every if each[0] >= start and each[1] <= stop]
            joints = tuple(sorted({joint for _, _, joint, _ in own if joint}))
            loudest = round(max(top for *_, top in own), 1)
            found[name].append(Expected(label, round(start, 2), round(stop, 2), joints, loudest))
    return found


def who() -> str:
    """The name of the user; empty if the system has none."""
    import getpass

    with suppress(OSError, KeyError, ImportError):
        return getpass.getuser()
    return ""


# --- writing


def save(reference: Reference, folder: Path) -> None:
    """Write a store: first the levels, then the TOML that names them, each whole or not at all."""
    lines = [
        "# What is normal for each scenario, written by `inspector accept`; the levels are in the",
        "# .npz files. People may edit what is required, wanted and waived.",
        f"format = {_toml(FORMAT)}",
    ]
    names: set[str] = set()
    for scenario in reference.scenarios:
        plain = re.sub(r"[^\w.-]+", "-", scenario.name, flags=re.ASCII).strip("-.")
        slug = plain[:80] or "scenario"
        name = f"{slug}.npz"
        if slug != scenario.name or name.lower() in {each.lower() for each in names}:
            name = f"{slug}~{hashlib.sha256(scenario.name.encode()).hexdigest()[:8]}.npz"
        names.add(name)
        sha256 = _write_levels(folder / name, scenario)
        newest = scenario.repetitions[-1]
        alike = [each for each in reference.scenarios if robot_fits(newest, each)]
        margin = margin_of([db for each in alike for db in each.scores_db])
        lines += ["", *_lines(scenario, margin, name, sha256)]
    with replacing(folder / NAME, overwrite=True) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
    _nearest.cache_clear()  # runs that were asked about before have it now
    for path in folder.glob("*.npz"):  # of scenarios that people removed
        if path.name not in names and _holds_levels(path):
            path.unlink(missing_ok=True)


def _holds_levels(path: Path) -> bool:
    """Whether a file is one of `_write_levels`: runs may lie in the folder, too."""
    try:
        with zipfile.ZipFile(path) as archive:
            return {"level_0.npy", "guide_0.npy"} <= set(archive.namelist())
    except (OSError, zipfile.BadZipFile):
        return False


def _write_levels(path: Path, scenario: Scenario) -> str:
    """Write the levels of the repetitions, and give the SHA-256 of the file."""
    arrays: dict[str, Any] = {}
    for number, each in enumerate(scenario.repetitions):
        own = encoded(each.level), each.guide, each.pace
        arrays |= {f"{name}_{number}": array for name, array in zip(ARRAYS, own, strict=True)}
    with replacing(path, overwrite=_holds_levels(path)) as temporary:
        with temporary.open("wb") as stream:
            np.savez_compressed(stream, **arrays)
        return hashlib.sha256(temporary.read_bytes()).hexdigest()


def _lines(scenario: Scenario, margin: Margin, file: str, sha256: str) -> list[str]:
    """A scenario as TOML."""
    newest = scenario.repetitions[-1]
    top = np.fmax.reduce(newest.level, axis=(0, 2, 3), initial=LEAST_DB)
    facts = {
        "name": scenario.name,
        "robot": newest.robot,
        **{key: getattr(scenario, key) for key in FACTS},
        "accepted": scenario.accepted or date.today(),
        "duration_s": [round(each, 3) for each in scenario.duration],
        "margin_db": round(margin.db, 1),
        "scores_db": list(scenario.scores_db),
        "elsewhere_db": list(scenario.elsewhere_db),
        "joints": list(newest.joints),
        "loudest_db": [round(each, 1) for each in top.tolist()],
        "levels": file,
        "sha256": sha256,
    }
    lines = _table("scenario", facts)
    for each in scenario.repetitions:
        joints = list(each.joints) if each.joints != newest.joints else None
        facts = {key: getattr(each, name) for key, name in REPEATED.items()}
        lines += _table("scenario.repetition", {**facts, "joints": joints})
    for name, entries in (("wanted", scenario.wanted), ("waive", scenario.waive)):
        for entry in entries:
            bounded = isfinite(entry.start) or isfinite(entry.stop)
            facts = {
                "class": entry.label or None,
                "time_s": [entry.start, entry.stop] if bounded else None,
                "joints": list(entry.joints) or None,
                "loudest_db": entry.loudest_db,
                "required": entry.required or None,
                "until": entry.until,
                "reason": entry.reason or None,
            }
            lines += _table(f"scenario.{name}", facts)
    return lines


def _table(name: str, facts: Mapping[str, object]) -> list[str]:
    """A table of an array as lines of TOML, without what is None."""
    known = {key: value for key, value in facts.items() if value is not None}
    return [f"[[{name}]]", *(f"{key} = {_toml(value)}" for key, value in known.items())]


def _toml(value: object) -> str:
    """A value as TOML."""
    if isinstance(value, bool | date | float | int):
        return toml_shown(round(value, 6) if isinstance(value, float) else value)
    if isinstance(value, list):
        return f"[{', '.join(map(_toml, value))}]"
    # A text of JSON is one of TOML, but for a control character that JSON takes as it is.
    text: str = json.dumps(str(value), ensure_ascii=False)
    return text.replace("\x7f", "\\u007f")


# --- reading


def _read(folder: Path) -> Reference:
    """Read a store."""
    path = folder / NAME
    try:
        content = from_toml(text_of(path))
    except (OSError, RuntimeError) as error:
        told = getattr(error, "strerror", None) or str(error)
        raise StoreError(path, f"cannot be read ({told})") from error
    except ValueError as error:
        raise StoreError(path, f"no store of references ({error})") from error
    form = content.pop("format", None)
    if form != FORMAT:
        reads = f"this version reads {FORMAT!r}; update the program"
        raise StoreError(path, f"of format {toml_shown(form)}, {reads}")
    rows = content.pop("scenario", [])
    if content or not isinstance(rows, list) or len(rows) > MOST_SCENARIOS:
        raise StoreError(path, "expected a format and entries [[scenario]] alone")
    every = enumerate(rows, 1)
    scenarios = tuple(_scenario(path, f"[[scenario]] {place}", row) for place, row in every)
    if len({each.name for each in scenarios}) < len(scenarios):
        raise StoreError(path, "two scenarios have one name")
    return Reference(folder, scenarios, stored=True)


def _checked(path: Path, where: str, row: Any, keys: Keys, needed: Sequence[str]) -> dict[str, Any]:
    """A table of the store, whose keys are known and whose values have their kinds."""
    if not isinstance(row, dict):
        raise StoreError(path, f"{where}: expected a table")
    for key, value in row.items():
        if key not in keys:
            raise StoreError(path, f"{where}: no {key!r}; there are {', '.join(keys)}")
        kind = keys[key]
        of, values = (kind[0], value) if isinstance(kind, tuple) else (kind, [value])
        kinds = (int, float) if of is float else (of,)
        known = isinstance(values, list) and all(type(each) in kinds for each in values)
        if not known or (kind is float and not isfinite(value)):
            expected = f"{'a list, each of it ' * isinstance(kind, tuple)}{KINDS[of]}"
            problem = f"{key} = {toml_shown(value)}, expected {expected}"
            raise StoreError(path, f"{where}: {problem}")
    if missing := [key for key in needed if key not in row]:
        raise StoreError(path, f"{where}: {missing[0]} is missing")
    return dict(row)


def _scenario(path: Path, where: str, given: Any) -> Scenario:
    row = _checked(path, where, given, SCENARIO, ("name", "levels", "sha256", "joints"))
    known = {key: row[key] for key in FACTS if key in row}
    known |= {key: tuple(map(float, row.get(key, ()))) for key in ("scores_db", "elsewhere_db")}
    for key, needed in (("wanted", ()), ("waive", ("until", "reason"))):
        entry = f"{where}, [[scenario.{key}]]"
        known[key] = tuple(_expected(path, entry, each, needed) for each in row.get(key, ()))
    return Scenario(row["name"], _levels(path, where, row), **known)


def _expected(path: Path, where: str, given: Any, needed: Sequence[str]) -> Expected:
    anything = {"class": "", "time_s": [float("-inf"), float("inf")], "joints": []}
    row = anything | _checked(path, where, given, EXPECTED, needed)
    label, span, joints = (row.pop(key) for key in anything)
    if len(span) != 2 or not span[0] < span[1]:
        shown = toml_shown(span)
        raise StoreError(path, f"{where}: time_s = {shown}, expected [from, to] in seconds")
    return Expected(label, float(span[0]), float(span[1]), tuple(joints), **row)


def _levels(path: Path, where: str, row: Mapping[str, Any]) -> tuple[Levels, ...]:
    """Levels of the repetitions, from the .npz, whose hash is checked."""
    file, rows = path.parent / row["levels"], row.get("repetition", [])
    if not re.fullmatch(r"[\w.~-]+\.npz", row["levels"], re.ASCII):
        shown = toml_shown(row["levels"])
        raise StoreError(path, f"{where}: levels = {shown}, expected the name of an .npz beside it")
    if not 1 <= len(rows) <= NEWEST:
        raise StoreError(path, f"{where}: {len(rows)} repetitions, expected 1 to {NEWEST}")
    again = f"{NAME}; accept the runs again"
    try:
        if not file.is_file():
            raise StoreError(file, "no such file, or no regular one; accept the runs again")
        with file.open("rb") as stream:
            sha256 = hashlib.file_digest(stream, "sha256").hexdigest()
        if sha256 != row["sha256"]:
            raise StoreError(file, f"was changed, or does not belong to {again}")
        arrays = runfile.read_npz(file)
    except (OSError, runfile.ArchiveError) as error:
        raise StoreError(file, f"cannot be read ({error})") from error
    found = []
    for number, given in enumerate(rows):
        where_of = f"{where}, [[scenario.repetition]] {number + 1}"
        each = _checked(path, where_of, given, REPETITION_KEYS, ("rate_hz", "duration_s"))
        own, rate = tuple(each.get("joints") or row["joints"]), each["rate_hz"]
        if not 0 < rate < 1e7:
            raise StoreError(path, f"{where_of}: rate_hz = {rate:g}, expected a rate")
        bands = octaves(rate)
        names = (f"{name}_{number}" for name in ARRAYS)
        level, guide, pace = (np.asarray(arrays.get(name, np.empty(0))) for name in names)
        shape = (pace.size, len(own), len(SIGNALS), len(bands))
        fit = (level.shape, guide.shape, pace.shape) == (shape, shape[:2], shape[:1])
        fit = fit and level.dtype.kind + guide.dtype.kind + pace.dtype.kind == "uff"
        finite = fit and bool(np.isfinite(guide).all() and np.isfinite(pace).all())
        if not finite or len(set(own)) < len(own):
            raise StoreError(file, f"its arrays do not belong to {again}")
        known = {name: each.get(key, "") for key, name in REPEATED.items()}
        known |= {name: float(each.get(key, 0.0)) for key, name in MEASURED.items()}
        known |= {"name": row["name"], "robot": row.get("robot", ""), "octaves": bands}
        known |= {"guide": guide.astype(np.float32), "pace": pace.astype(np.float32)}
        found.append(Levels(**known, joints=own, level=decoded(level.astype(np.uint8))))
    return tuple(found)
