"""Data sets: their runs, their folder, what is missing of it, logs and statistics.

A folder has ``dataset.json``, its settings and the versions of the software that began it (those of
each run are in its own ``meta``), and a run file ``<robot>/<scenario>-<seed>.npz`` for each run. A
run in which the robot fell leaves ``….fallen.json`` instead.
"""

import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal, Self, TypeAlias
from zlib import crc32

import numpy as np

from noiseclassifier.scenarios.domains import Domain, Logger
from noiseclassifier.scenarios.logs import logged
from noiseclassifier.scenarios.motions import RATE, DatasetError, ScenarioError, SimulationError
from noiseclassifier.scenarios.robots import ROBOTS, TARGETS, WIDE
from noiseclassifier.scenarios.simulation import (
    FIRST,
    GOOD,
    RECIPE,
    SCENARIOS,
    THROUGHOUT,
    WIDE_RECIPE,
    faults_of,
    robot_of,
    scenario_of,
    simulate,
    software,
)
from noisemodel import NoiseModelError, Run, decimated
from noisemodel.files import replacing
from noisemodel.parallel import DIED, Jobs, as_done
from noisemodel.runfile import ArchiveError, read_text

FORMAT, MANIFEST, FALLEN = "noise-dataset/1", "dataset.json", ".fallen.json"
FEW = 8  # scenarios in which a robot fell that are named at most
_NAMES = re.compile(r"([a-z0-9_]+)/(.+)-(\d{3,})")

# All logs; logs to train on; logs of robots and domains that are never trained on; and logs of the
# other robots and domains, from loggers that are never trained on.
Side: TypeAlias = Literal["all", "source", "target", "logger"]


@dataclass(frozen=True, order=True)
class Task:
    """A run of a data set."""

    robot: str
    scenario: str
    seed: int

    @property
    def name(self) -> str:
        """Robot, scenario and seed: the name of its file."""
        return f"{self.robot}/{self.scenario}-{self.seed:03d}"


def scenario_tasks(
    robots: Sequence[str],
    scenarios: Sequence[str] = (),
    *,
    first: int = 0,
    seeds: int = 8,
) -> list[Task]:
    """The runs of a data set, seed by seed: all scenarios that a robot has, or those named."""
    if not robots:
        raise DatasetError(f"no robot is named; there are {', '.join(ROBOTS)}")
    asked = {scenario_of(name).name for name in scenarios} or set(SCENARIOS)
    chosen = {}
    for robot in robots:
        family = robot_of(robot).family
        own = [name for name, entry in SCENARIOS.items() if family in entry.cases]
        chosen[robot] = [name for name in own if name in asked]
        if not chosen[robot]:
            raise DatasetError(f"no scenario is left for {robot!r}; it has {', '.join(own)}")
    return [
        Task(robot, scenario, seed)
        for seed in range(first, first + seeds)
        for robot, names in chosen.items()
        for scenario in names
    ]


def wide_tasks(
    robots: Sequence[str] = (),
    *,
    first: int = FIRST,
    seeds: int = 8,
    faults: int = 2,
    throughout: int = 0,
) -> list[Task]:
    """The runs of a data set of wide domains, seed by seed."""
    return [
        Task(robot, name, seed)
        for seed in range(first, first + seeds)
        for robot in robots or WIDE
        for name in (GOOD, *_faults(robot, seed, faults, throughout))
    ]


def _faults(robot: str, seed: int, count: int, throughout: int) -> list[str]:
    """Names of the faults of a seed: some that suit its motion, and some of whole runs."""
    names = faults_of(robot, seed)
    number = crc32(robot.encode())
    rng, other = (np.random.default_rng((seed, number, stream)) for stream in (2, 4))
    chosen = rng.choice(len(names), min(count, len(names)), replace=False)
    whole = other.choice(list(THROUGHOUT), throughout, replace=False)
    return [*(names[index] for index in sorted(chosen.tolist())), *sorted(whole.tolist())]


@dataclass(frozen=True)
class Folder:
    """The folder of a data set."""

    path: Path
    wide: bool = False  # whether its runs are of wide domains
    duration: float | None = None  # duration of each run, in [s]; None is that of its motion
    rate: float = RATE  # highest rate of the runs of scenarios, in [Hz]

    @classmethod
    def opened(
        cls,
        path: str | Path,
        *,
        wide: bool = False,
        duration: float | None = None,
        rate: float = RATE,
    ) -> Self:
        """Open a folder, or create it."""
        path = Path(path)
        form: dict[str, Any] = {"form": "domains"} if wide else {"form": "scenarios", "rate": rate}
        recipe = WIDE_RECIPE if wide else RECIPE
        settings = {"format": FORMAT, "recipe": recipe, **form, "duration": duration}
        try:
            if (path / MANIFEST).exists():
                made = _made(path / MANIFEST)
                for key, wanted in settings.items():
                    if (found := made.get(key)) != wanted:
                        raise DatasetError(
                            f"{path}: made with {key} {json.dumps(found)}, now it is"
                            f" {json.dumps(wanted)}; name another folder"
                        )
            elif path.exists() and (not path.is_dir() or any(path.iterdir())):
                raise DatasetError(
                    f"{path}: no folder of a data set (it has no {MANIFEST}); name an empty folder"
                )
            else:
                begun = {**settings, "versions": software()}
                path.mkdir(parents=True, exist_ok=True)
                _write_json(path / MANIFEST, begun)
        except OSError as error:
            raise DatasetError(f"{path}: cannot be made ({error.strerror or error})") from error
        return cls(path, wide, duration, rate)

    def simulate(self, task: Task) -> Run:
        """Simulate a run as the folder keeps it."""
        robot, scenario, seed = task.robot, task.scenario, task.seed
        if self.wide:
            return simulate(robot, scenario, seed, duration=self.duration, wide=True)
        run = simulate(robot, scenario, seed, duration=self.duration)
        # `simulate` makes again what is left out.
        run = replace(run, position_desired=None, effort=None, stages={})
        run = decimated(run, self.rate) if self.rate < run.rate else run
        signals = ("velocity", "velocity_desired", "position", "base_pose", "base_velocity")
        there = {name: getattr(run, name) for name in signals}
        single = {name: s.astype(np.float32) for name, s in there.items() if s is not None}
        return replace(run, **single)

    def file(self, task: Task) -> Path:
        """Path of the file of a run."""
        return self.path / f"{task.name}.npz"

    def make(self, task: Task) -> None:
        """Simulate a run and write it, or when and why the robot fell."""
        path = self.file(task)
        path.parent.mkdir(exist_ok=True)
        try:
            self.simulate(task).save(path, overwrite=True)
        except SimulationError as fall:
            facts = {"robot": task.robot, "scenario": task.scenario, "seed": task.seed}
            recipe = WIDE_RECIPE if self.wide else RECIPE
            facts |= {"time": fall.time, "problem": fall.problem, "recipe": recipe}
            _write_json(path.with_suffix(FALLEN), {**facts, "duration": self.duration})

    def kept(self) -> list[Task]:
        """The runs in the folder, in order."""
        return self._found(".npz")

    def fallen(self) -> list[Task]:
        """The runs in which the robot fell, in order."""
        return self._found(FALLEN)

    def missing(self, tasks: Iterable[Task]) -> list[Task]:
        """Those of the runs that are neither in the folder nor recorded as falls."""
        done = {*self.kept(), *self.fallen()}
        return [task for task in tasks if task not in done]

    def _found(self, suffix: str) -> list[Task]:
        """Runs by their files; others, which are not of this data set, are left alone."""
        found = []
        for path in self.path.rglob(f"*{suffix}"):
            name = _NAMES.fullmatch(path.relative_to(self.path).as_posix().removesuffix(suffix))
            known = WIDE if self.wide else ROBOTS
            if name and name[1] in known and (self.wide or name[2] in SCENARIOS):
                found.append(Task(name[1], name[2], int(name[3])))
        return sorted(found)


def _made(manifest: Path) -> dict[str, Any]:
    """The settings that a folder was made with."""
    try:
        made = json.loads(read_text(manifest))
    except (ArchiveError, ValueError, RecursionError) as error:
        raise DatasetError(f"{manifest}: damaged ({error}); name another folder") from error
    return made if isinstance(made, dict) else {}


def _write_json(path: Path, content: dict[str, Any]) -> None:
    with replacing(path, overwrite=True) as temporary:
        temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def make(folder: Folder, tasks: Sequence[Task], *, jobs: Jobs = 1) -> Iterator[Task]:
    """Simulate the missing runs of a data set, each group that shares its twin in one process.

    Each run is written at once, so that a killed process loses only the runs in work.
    """
    groups = grouped_by_twin(folder.missing(tasks), wide=folder.wide)
    if groups:
        software()  # says what to install
    dead: list[Task] = []
    for place, alive in as_done(partial(_make, folder), groups, jobs=jobs, died=lambda _: False):
        left = folder.missing(groups[place])
        yield from (task for task in groups[place] if task not in left)
        if not alive:  # the first one that is missing killed the worker
            dead += left[:1]
    if dead:
        names = ", ".join(task.name for task in dead)
        raise DatasetError(f"{names}: {DIED}; the same command tries again")


def grouped_by_twin(tasks: Iterable[Task], *, wide: bool = False) -> list[list[Task]]:
    """Runs in groups that share their twin: one robot, one seed, one motion."""
    groups: dict[object, list[Task]] = {}
    for task in tasks:
        family = WIDE[task.robot].family
        motion = None if wide else SCENARIOS[task.scenario].cases[family].motion
        groups.setdefault((task.robot, task.seed, motion), []).append(task)
    return list(groups.values())


def _make(folder: Folder, group: Sequence[Task]) -> bool:
    """Simulate a group, but for what was made of it by a worker that died."""
    for task in folder.missing(group):
        try:
            folder.make(task)
        except (ScenarioError, NoiseModelError, OSError) as error:
            # Only a text, since errors with attributes of their own do not pass between processes.
            raise DatasetError(f"{error}; the same command resumes there") from error
    return True


def write_logs(
    folder: Folder,
    output: Path,
    *,
    copies: int = 1,
    rate: float | None = None,
    side: Side = "all",
) -> Iterator[tuple[str, Run]]:
    """Write logs of wide domains, each by name: ``<robot>/<fault>[.copy]-<seed>``."""
    kept = set(folder.kept())
    if not kept:
        raise DatasetError(f"{folder.path}: holds no run; `inspector simulate domains` makes them")
    twin: tuple[Task, Run] | None = None
    for task in sorted(kept, key=lambda task: (task.robot, task.seed, task.scenario)):
        good = Task(task.robot, GOOD, task.seed)
        if good not in kept:  # its twin fell
            continue
        if twin is None or twin[0] != good:
            twin = good, Run.load(folder.file(good))
        reference = twin[1]
        run = reference if task == good else Run.load(folder.file(task))
        facts = run.meta["domain"]
        domain = Domain(**{name: value for name, value in facts.items() if name != "name"})
        if run.rate < (rate or 0.0) * (1 - 1e-6):
            continue
        for copy in range(copies):
            draw = np.random.default_rng((task.seed, crc32(task.name.encode()), copy))
            logger = Logger.draw(draw, domain, most=run.rate, rate=rate)
            if side not in ("all", side_of(task.robot, domain, logger)):
                continue
            noise = int(np.random.default_rng((task.seed, copy, 3)).integers(2**32))
            scenario = f"{task.scenario}.{copy}" if copy else task.scenario
            found = logged(run, reference, logger, seed=noise)
            if found.blocks or found.meta["events"]:  # else nothing of it can be measured
                name = Task(task.robot, scenario, task.seed).name
                path = output / f"{name}.npz"
                path.parent.mkdir(parents=True, exist_ok=True)
                found.save(path, overwrite=True)
                yield name, found


def side_of(robot: str, domain: Domain, logger: Logger) -> Side:
    """What a log is for: to learn from, or to measure on only, by what of it is a target."""
    if robot in TARGETS or domain.target:
        return "target"
    return "logger" if logger.target else "source"


def statistics(folder: Folder) -> dict[str, Any]:
    """What a data set has, as plain data: runs and classes of each robot."""
    upright: dict[str, dict[str, dict[str, int]]] = {}
    classes: dict[str, dict[str, dict[str, float]]] = {}
    kept, motion = folder.kept(), 0.0
    for task in sorted((*kept, *folder.fallen())):
        mine = upright.setdefault(task.robot, {})
        mine.setdefault(task.scenario, {"upright": 0, "runs": 0})["runs"] += 1
    for task in kept:
        upright[task.robot][task.scenario]["upright"] += 1
        try:
            run = Run.load(folder.file(task))
        except NoiseModelError as error:
            raise DatasetError(f"{error}; delete it, and the same command makes it") from error
        motion += run.duration
        own = classes.setdefault(task.robot, {})
        for block in run.blocks:
            amount = own.setdefault(block.label, {"blocks": 0, "seconds": 0.0})
            amount["blocks"] += 1
            amount["seconds"] += block.stop - block.start
    return {
        "format": "noise-balance/2",
        "upright": upright,
        "classes": classes,
        "motion": motion,
        "bytes": sum(path.stat().st_size for path in folder.path.rglob("*") if path.is_file()),
    }


def described(found: dict[str, Any]) -> str:
    """Statistics as text, with the scenarios in which each robot fell most."""
    whole = Counter[str]()
    upright = [f"{'upright':26}{'runs':>10}   fell in"]
    for robot, mine in found["upright"].items():
        up, runs = (sum(each[key] for each in mine.values()) for key in ("upright", "runs"))
        lost = Counter({name: each["runs"] - each["upright"] for name, each in mine.items()})
        most = ", ".join(f"{name} ({count})" for name, count in lost.most_common(FEW) if count)
        upright.append(f"{robot:26}{f'{up}/{runs}':>10}   {most or 'none'}")
        whole.update(runs=runs, fell=runs - up)
    classes = [f"{'class':26}{'blocks':>10}{'seconds':>10}{'of time':>10}"]
    for robot, mine in found["classes"].items():
        time = sum(amount["seconds"] for amount in mine.values())
        for label, amount in sorted(mine.items(), key=lambda item: -item[1]["seconds"]):
            blocks, seconds = amount["blocks"], amount["seconds"]
            name = f"{robot:8} {label:17}"
            classes.append(f"{name}{blocks:>10}{seconds:>10.1f}{seconds / time:>10.1%}")
    first = (
        f"{whole['runs']} runs, {whole['fell']} of which fell and are left out;"
        f" {found['motion'] / 3600:.2f} h of motion, {found['bytes'] / 1e6:.0f} MB"
    )
    return "\n\n".join((first, "\n".join(upright), "\n".join(classes)))
