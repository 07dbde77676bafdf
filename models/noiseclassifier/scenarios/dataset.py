"""Data sets: their runs, their folder, what is missing of it, logs and statistics.

A folder has ``dataset.json``, its settings and the versions of the software that began it (those of
each run are in its own ``meta``), and a run file ``<robot>/<scenario>-<seed>.npz`` for each run. A
run in which the robot fell leaves ``….fallen.json`` instead. ``times.csv`` has a line per run: its
name and its processor time, in [s].
"""

import json
import re
import time
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.util import find_spec
from itertools import count
from pathlib import Path
from typing import Any, Literal, Self, TypeAlias, get_args
from zlib import crc32

import numpy as np

from noiseclassifier.scenarios.domains import DISTRIBUTION, Distribution, Domain, Logger
from noiseclassifier.scenarios.errors import DatasetError, ScenarioError, SimulationError, unknown
from noiseclassifier.scenarios.faults import THROUGHOUT
from noiseclassifier.scenarios.logs import logged
from noiseclassifier.scenarios.motions import RATE
from noiseclassifier.scenarios.robots import ROBOTS, TARGETS, WIDE
from noiseclassifier.scenarios.simulation import (
    FIRST,
    GOOD,
    RECIPE,
    SHORTEST,
    WIDE_RECIPE,
    digest,
    faults_of,
    look_up,
    simulate,
    software,
)
from noiseclassifier.scenarios.table import SCENARIOS
from noisemodel import Block, NoiseModelError, Run, decimated
from noisemodel.files import replacing
from noisemodel.parallel import DIED, Jobs, as_done
from noisemodel.runfile import ArchiveError, read_text

FORMAT, MANIFEST, TIMES, FALLEN = "noise-dataset/1", "dataset.json", "times.csv", ".fallen.json"
LEAST_RUNS = 20  # number of runs from which too many falls are an error
FAULTY_RUNS = 2  # faulty runs of each robot and seed in wide domains
FRAME, HOP = 0.4, 0.1
"""Length of a frame, and time from one to the next (paper, Sec. III-A), in [s]."""
FEW = 8  # robots up to which each has a column, and scenarios named at most
_NAMES = re.compile(r"([a-z0-9_]+)/(.+)-(\d{3,})")

Choice: TypeAlias = Mapping[str, tuple[str, ...]]  # names of the scenarios of each robot
Side: TypeAlias = Literal["all", "source", "target", "logger"]
"""All logs; those that are learnt from; those of robots and domains that never are; and of robots
and domains that are, those of loggers that never are."""


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

    @property
    def motion(self) -> Any:
        """Motion of a run of the scenarios; None in wide domains, where a seed draws it."""
        entry, robot = SCENARIOS.get(self.scenario), ROBOTS.get(self.robot)
        if entry is None or robot is None or robot.family not in entry.cases:
            return None
        return entry.cases[robot.family].motion


def choose(
    robots: Sequence[str], scenarios: Sequence[str] = (), *, healthy: bool = False
) -> dict[str, tuple[str, ...]]:
    """Scenarios of each robot."""
    if not robots:
        raise DatasetError(f"no robot is named; there are {', '.join(ROBOTS)}")
    chosen = {}
    for robot in robots:
        every = [name for name in SCENARIOS if _has(robot, name)]
        asked = {look_up(robot, name)[0].name for name in scenarios if _has(robot, name)}
        names = [name for name in every if name in asked or not scenarios]
        chosen[robot] = tuple(name for name in names if SCENARIOS[name].healthy or not healthy)
        if not chosen[robot]:
            of_list = f"of {', '.join(scenarios)} " if scenarios else ""
            ok = " without a failure" if healthy else ""
            raise DatasetError(
                f"no scenario {of_list}is left for {robot!r}{ok}; it has {', '.join(every)}"
            )
    return chosen


def _has(robot: str, scenario: str) -> bool:
    """Whether a robot has a scenario; both must be known."""
    if robot not in ROBOTS:
        raise unknown(f"robot {robot!r} cannot be simulated", robot, ROBOTS)
    numbers = {str(entry.number): entry for entry in SCENARIOS.values()}
    entry = SCENARIOS.get(scenario) or numbers.get(scenario)
    if entry is None:
        raise unknown(f"no scenario {scenario!r}", scenario, SCENARIOS)
    return ROBOTS[robot].family in entry.cases


@dataclass(frozen=True, kw_only=True)
class DatasetSpec:
    """The size of a data set of scenarios: a number of seeds, or of hours."""

    choice: Choice
    first: int = 0
    seeds: int | None = None
    hours: float | None = None  # total duration of all runs, in [h]

    def __post_init__(self) -> None:
        """Check the numbers."""
        if self.seeds is not None and self.hours is not None:
            raise DatasetError(
                f"{self.seeds} seeds and {self.hours:g} hours; expected one of the two"
            )
        if self.first < 0:
            raise DatasetError(f"the first seed is {self.first}, expected 0 or more")
        if self.seeds is not None and self.seeds < 1:
            raise DatasetError(f"{self.seeds} seeds, expected 1 or more")
        if self.hours is not None and not 0 < self.hours < float("inf"):
            raise DatasetError(f"{self.hours:g} hours, expected more than 0")

    def tasks(self, *, duration: float | None = None, fallen: Collection[Task] = ()) -> list[Task]:
        """The runs, seed by seed; those that fell do not count towards the hours."""
        if self.hours is None:
            last = self.first + (8 if self.seeds is None else self.seeds)
            seeds = range(self.first, last)
            return [
                task for seed in seeds for robot in self.choice for task in self._seed(robot, seed)
            ]
        share = 3600 * self.hours / len(self.choice)
        filling = [self._fill(robot, share, duration, set(fallen)) for robot in self.choice]
        return sorted((task for tasks in filling for task in tasks), key=lambda task: task.seed)

    def _seed(self, robot: str, seed: int) -> list[Task]:
        return [Task(robot, scenario, seed) for scenario in self.choice[robot]]

    def _fill(
        self, robot: str, seconds: float, duration: float | None, fallen: set[Task]
    ) -> list[Task]:
        """The runs of as many seeds as a duration takes."""
        tasks: list[Task] = []
        filled, lost = 0.0, 0
        for seed in count(self.first):
            if filled >= seconds:
                break
            if lost > len(tasks) / 2 and len(tasks) >= LEAST_RUNS:
                raise DatasetError(
                    f"{robot} fell in {lost} of {len(tasks)} runs, so that {seconds:.0f} s cannot"
                    " be reached; take other scenarios"
                )
            for task in self._seed(robot, seed):
                tasks.append(task)
                if task in fallen:
                    lost += 1
                else:
                    filled += duration or task.motion.duration
        return tasks


def wide_tasks(
    robots: Sequence[str] = (),
    *,
    first: int = FIRST,
    seeds: int = 8,
    faults: int = FAULTY_RUNS,
    always: Sequence[str] = (),
    throughout: int = 0,
) -> list[Task]:
    """The runs of a data set of wide domains, seed by seed."""
    known = {robot: faults_of(robot) for robot in robots or WIDE}
    if first < FIRST:
        raise DatasetError(f"the first seed is {first}, expected {FIRST} or more")
    if seeds < 1 or faults < 0 or not 0 <= throughout <= len(THROUGHOUT):
        raise DatasetError(
            f"{seeds} seeds with {faults} faults each and {throughout} of whole runs, expected 1 or"
            f" more, 0 or more, and up to {len(THROUGHOUT)}"
        )
    for name in always:
        if not any(name in own for own in known.values()):
            raise DatasetError(f"no fault {name!r} of {', '.join(robots or ('any robot',))}")
    return [
        Task(robot, name, seed)
        for seed in range(first, first + seeds)
        for robot in known
        for name in (
            *(GOOD, *_faults(robot, seed, faults, always)),
            *_whole_runs(robot, seed, throughout),
        )
    ]


def _whole_runs(robot: str, seed: int, count: int) -> list[str]:
    """Names of faults that are there from the first sample to the last."""
    rng = np.random.default_rng((seed, crc32(robot.encode()), 4))
    return sorted(rng.choice(list(THROUGHOUT), count, replace=False).tolist())


def _faults(robot: str, seed: int, count: int, always: Sequence[str]) -> list[str]:
    suited = faults_of(robot, seed)
    names = [name for name in suited if name not in always]
    rng = np.random.default_rng((seed, crc32(robot.encode()), 2))
    chosen = rng.choice(len(names), min(count, len(names)), replace=False)
    drawn = [names[index] for index in sorted(chosen.tolist())]
    return drawn + [name for name in always if name in suited]


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
        any_recipe: bool = False,
    ) -> Self:
        """Open a folder, or create it."""
        path = Path(path)
        if duration is not None and not duration >= SHORTEST:
            raise DatasetError(f"duration {duration:g} s: expected at least {SHORTEST:g} s")
        if not 0 < rate <= RATE:
            raise DatasetError(f"rate {rate:g} Hz: expected at most {RATE:g} Hz")
        form: dict[str, Any] = {"form": "domains"} if wide else {"form": "scenarios", "rate": rate}
        recipe = WIDE_RECIPE if wide else RECIPE
        settings = {"format": FORMAT, "recipe": recipe, **form, "duration": duration}
        try:
            if path.exists() and not path.is_dir():
                raise DatasetError(f"{path}: is a file; name a folder")
            if (path / MANIFEST).exists():
                # The latest recipe of wide domains only adds to those before.
                free = any_recipe or (wide and _made(path).get("recipe") in range(2, recipe))
                compared = {k: v for k, v in settings.items() if k != "recipe" or not free}
                _compare(path, compared)
            elif path.is_dir() and any(path.iterdir()):
                raise DatasetError(
                    f"{path}: holds other files (it has no {MANIFEST}); name an empty folder"
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
        # What is left out is made again by `reproduce`, and compared by the hash of all of it.
        part = replace(run, position_desired=None, effort=None, stages={})
        part = decimated(part, self.rate) if self.rate < run.rate else part
        signals = ("velocity", "velocity_desired", "position", "base_pose", "base_velocity")
        single = {
            name: getattr(part, name).astype(np.float32)
            for name in signals
            if getattr(part, name) is not None
        }
        return replace(part, **single, meta={**run.meta, "sha256": digest(run)})

    def file(self, task: Task) -> Path:
        """Path of the file of a run."""
        return self.path / f"{task.name}.npz"

    def save(self, task: Task, run: Run) -> None:
        """Write a run; an existing file is replaced."""
        run.save(self._prepared(task), overwrite=True)

    def save_fall(self, task: Task, fall: SimulationError) -> None:
        """Record when and why a robot fell."""
        facts = {"robot": task.robot, "scenario": task.scenario, "seed": task.seed}
        recipe = WIDE_RECIPE if self.wide else RECIPE
        record = {**facts, "time": fall.time, "problem": fall.problem, "recipe": recipe}
        _write_json(self._prepared(task).with_suffix(FALLEN), {**record, "duration": self.duration})

    def save_time(self, task: Task, seconds: float) -> None:
        """Record the processor time of a run, in [s]."""
        path = self.path / TIMES
        try:
            with path.open("a", encoding="utf-8") as times:
                times.write(f"{task.name},{seconds:.2f}\n")
        except OSError as error:
            raise DatasetError(f"{path}: cannot be written ({error.strerror})") from error

    def read(self, task: Task) -> tuple[tuple[Block, ...], float]:
        """Blocks of a run, and its duration, in [s]."""
        try:
            run = Run.load(self.file(task))
        except NoiseModelError as error:
            raise DatasetError(str(error)) from error
        return run.blocks, run.duration

    def kept(self) -> list[Task]:
        """The runs in the folder, in order."""
        return self._found(".npz")

    def fallen(self) -> list[Task]:
        """The runs in which the robot fell, in order."""
        return self._found(FALLEN)

    def times(self) -> dict[Task, float]:
        """Processor times of the runs, as far as they were recorded, in [s]."""
        path, times = self.path / TIMES, {}
        for line in _text(path).splitlines() if path.exists() else ():
            name, _, seconds = line.partition(",")
            task = self._task(name)
            if task and re.fullmatch(r"\d+\.\d\d", seconds):
                times[task] = float(seconds)
        return times

    def missing(self, tasks: Iterable[Task]) -> list[Task]:
        """Those of the runs that are neither in the folder nor recorded as falls."""
        done = {*self.kept(), *self.fallen()}
        return [task for task in tasks if task not in done]

    def clear(self, *, overwrite: bool) -> None:
        """Check all files, and remove damaged ones."""
        for task in self.kept():
            try:
                self.read(task)
            except DatasetError as error:
                if not overwrite:
                    raise DatasetError(f"{error}; --overwrite replaces it") from error
                self.file(task).unlink()

    def _prepared(self, task: Task) -> Path:
        """Path of a run in an existing folder, without temporary files of a killed process."""
        path = self.file(task)
        try:
            path.parent.mkdir(exist_ok=True)
        except OSError as error:
            raise DatasetError(f"{path.parent}: cannot be made ({error.strerror})") from error
        for temporary in path.parent.glob(f".{path.stem}.*"):
            temporary.unlink(missing_ok=True)
        return path

    def _task(self, name: str) -> Task | None:
        """The run of a name; None if it cannot be one of this data set."""
        found = _NAMES.fullmatch(name)
        if not found or found[1] not in (WIDE if self.wide else ROBOTS):
            return None
        return (
            Task(found[1], found[2], int(found[3])) if self.wide or found[2] in SCENARIOS else None
        )

    def _found(self, suffix: str) -> list[Task]:
        paths = (path.relative_to(self.path).as_posix() for path in self.path.rglob(f"*{suffix}"))
        tasks = (self._task(name.removesuffix(suffix)) for name in paths)
        return sorted(task for task in tasks if task)


def _made(path: Path) -> dict[str, Any]:
    """The settings that a folder was made with."""
    try:
        made = json.loads(_text(path / MANIFEST))
    except (ValueError, RecursionError) as error:
        raise DatasetError(f"{path / MANIFEST}: damaged ({error}); name another folder") from error
    return made if isinstance(made, dict) else {}


def _compare(path: Path, settings: dict[str, Any]) -> None:
    made = _made(path)
    for key, wanted in settings.items():
        found = made.get(key)
        if found != wanted:
            raise DatasetError(
                f"{path}: made with {key} {json.dumps(found)}, now it is {json.dumps(wanted)};"
                " name another folder"
            )


def _text(path: Path) -> str:
    try:
        return read_text(path)
    except (OSError, ArchiveError) as error:
        raise DatasetError(f"{path}: cannot be read ({error})") from error


def _write_json(path: Path, content: dict[str, Any]) -> None:
    with replacing(path, overwrite=True) as temporary:
        temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def make(folder: Folder, tasks: Sequence[Task], *, jobs: Jobs = 1) -> Iterator[Task]:
    """Simulate the missing runs of a data set.

    Each run is written at once, so that a killed process loses only the runs in work.
    """
    groups = grouped_by_twin(folder.missing(tasks), wide=folder.wide)
    if groups and find_spec("mujoco") is None:
        software()  # says what to install
    if jobs == 1:
        for group in groups:
            yield from _make(folder, group)
    else:
        yield from _make_at_once(folder, groups, jobs)


def grouped_by_twin(tasks: Iterable[Task], *, wide: bool = False) -> list[tuple[Task, ...]]:
    """Runs in groups that share their twin: one robot, one seed, one motion."""
    groups: dict[object, list[Task]] = {}
    for task in tasks:
        motion = None if wide else task.motion
        groups.setdefault((task.robot, task.seed, motion), []).append(task)
    return [tuple(group) for group in groups.values()]


def _make_at_once(folder: Folder, groups: Sequence[tuple[Task, ...]], jobs: Jobs) -> Iterator[Task]:
    """Simulate each group in one process, so that its twin is simulated once."""
    pending = {task for group in groups for task in group}
    dead: list[Task] = []
    while groups:
        rest = []
        for found in as_done(partial(_make_all, folder), groups, jobs=jobs, died=_died):
            made = pending - set(folder.missing(pending))
            pending -= made
            yield from sorted(made)
            if not found[1]:
                first, *others = folder.missing(groups[found[0]])
                dead.append(first)
                rest.append(tuple(others))
        groups = [group for group in rest if group]
    if dead:
        names = ", ".join(task.name for task in dead)
        raise DatasetError(f"{names}: {DIED}; the same command tries again")


def _make_all(folder: Folder, group: Sequence[Task]) -> bool:
    """Simulate a group, but for what was made of it by a worker that died."""
    for _ in _make(folder, folder.missing(group)):
        pass
    return True


def _died(_: Sequence[Task]) -> bool:
    return False


def _make(folder: Folder, group: Sequence[Task]) -> Iterator[Task]:
    for task in group:
        start = time.process_time()
        try:
            try:
                run = folder.simulate(task)
            except SimulationError as fall:
                folder.save_fall(task, fall)
            else:
                folder.save(task, run)
            folder.save_time(task, time.process_time() - start)
        except (ScenarioError, NoiseModelError) as error:
            # Only a text, since errors with attributes of their own do not pass between processes.
            raise DatasetError(f"{error}; the same command resumes there") from error
        yield task


def logs(
    folder: Folder,
    *,
    copies: int = 1,
    rate: float | None = None,
    side: Side = "all",
    distribution: Distribution = DISTRIBUTION,
) -> Iterator[tuple[str, Run]]:
    """Logs of the runs of wide domains, each with its name: ``<robot>/<fault>[.copy]-<seed>``."""
    if side not in get_args(Side):
        raise DatasetError(f"no side {side!r}; there are {', '.join(get_args(Side))}")
    kept = set(folder.kept())
    if not kept:
        raise DatasetError(f"{folder.path}: holds no run; `inspector simulate domains` makes them")
    twin: tuple[Task | None, Run | None] = (None, None)
    for task in sorted(kept, key=lambda task: (task.robot, task.seed, task.scenario)):
        good = Task(task.robot, GOOD, task.seed)
        if good not in kept:  # its twin fell
            continue
        if twin[0] != good:
            twin = good, Run.load(folder.file(good))
        reference = twin[1]
        assert reference is not None
        run = reference if task == good else Run.load(folder.file(task))
        domain = _domain(run)
        if run.rate < (rate or 0.0) * (1 - 1e-6):
            continue
        for copy in range(copies):
            draw = np.random.default_rng((task.seed, crc32(task.name.encode()), copy))
            logger = distribution.logger(draw, domain, most=run.rate, rate=rate)
            if side not in ("all", side_of(task.robot, domain, logger)):
                continue
            noise = int(np.random.default_rng((task.seed, copy, 3)).integers(2**32))
            name = f"{task.scenario}.{copy}" if copy else task.scenario
            found = logged(run, reference, logger, seed=noise)
            if found.blocks or found.meta["events"]:  # else nothing of it can be measured
                yield f"{task.robot}/{name}-{task.seed:03d}", found


def side_of(robot: str, domain: Domain, logger: Logger) -> Side:
    """What a log is for: to learn from, or to measure on only, by what of it is a target."""
    if robot in TARGETS or domain.target:
        return "target"
    return "logger" if logger.target else "source"


def write_logs(logs: Iterator[tuple[str, Run]], output: Path) -> Iterator[tuple[str, Run]]:
    """Write logs as run files in a folder."""
    for name, run in logs:
        path = output / f"{name}.npz"
        path.parent.mkdir(parents=True, exist_ok=True)
        run.save(path, overwrite=True)
        yield name, run


def _domain(run: Run) -> Domain:
    facts: dict[str, Any] = dict(run.meta["domain"])
    del facts["name"]
    return Domain(**facts)


@dataclass(frozen=True)
class Statistics:
    """Statistics of a data set.

    Attributes:
        upright: Runs that stood, and all runs, by robot and scenario.
        amounts: Blocks, their seconds and frames, by robot and class.
        costs: Processor time and duration of the runs of each robot, in [s].
    """

    upright: Mapping[str, Mapping[str, tuple[int, int]]]
    amounts: Mapping[str, Mapping[str, Mapping[str, float]]]
    costs: Mapping[str, Mapping[str, float]]
    motion: float  # total duration of all runs, in [s]
    size: int  # of all files, in [B]

    @classmethod
    def of(cls, folder: Folder) -> Self:
        """Statistics of a folder."""
        kept, fallen, times = folder.kept(), folder.fallen(), folder.times()
        stood = Counter((task.robot, task.scenario) for task in kept)
        fell = Counter((task.robot, task.scenario) for task in fallen)
        known = WIDE if folder.wide else ROBOTS
        robots = [robot for robot in known if any(robot == key[0] for key in stood + fell)]
        names = dict.fromkeys((*SCENARIOS, *(name for _, name in sorted(stood + fell))))
        amounts: dict[str, dict[str, dict[str, float]]] = {robot: {} for robot in robots}
        costs = {robot: {"seconds": 0.0, "simulated": 0.0} for robot in robots}
        motion = 0.0
        for task in kept:
            blocks, duration = folder.read(task)
            motion += duration
            for block in blocks:
                zero = {"blocks": 0, "seconds": 0.0, "frames": 0}
                mine = amounts[task.robot].setdefault(block.label, zero)
                seconds = block.stop - block.start
                mine["blocks"] += 1
                mine["seconds"] += seconds
                # Blocks start and stop on samples, up to rounding.
                mine["frames"] += 1 + int(max(seconds - FRAME, 0.0) / HOP + 1e-6)
            if task in times:
                costs[task.robot]["seconds"] += times[task]
                costs[task.robot]["simulated"] += duration
        upright = {
            robot: {
                name: (stood[robot, name], stood[robot, name] + fell[robot, name])
                for name in names
                if (robot, name) in stood + fell
            }
            for robot in robots
        }
        size = sum(path.stat().st_size for path in folder.path.rglob("*") if path.is_file())
        return cls(upright, amounts, costs, motion, size)

    def as_dict(self) -> dict[str, Any]:
        """All numbers as plain data."""
        return {
            "format": "noise-balance/1",
            "upright": {
                robot: {name: {"upright": up, "runs": runs} for name, (up, runs) in mine.items()}
                for robot, mine in self.upright.items()
            },
            "classes": {robot: dict(sorted(mine.items())) for robot, mine in self.amounts.items()},
            "cpu": dict(self.costs),
            "motion": self.motion,
            "bytes": self.size,
        }

    def __str__(self) -> str:
        pairs = [pair for mine in self.upright.values() for pair in mine.values()]
        runs, fell = sum(all_ for _, all_ in pairs), sum(all_ - up for up, all_ in pairs)
        first = (
            f"{runs} runs, {fell} of which fell and are left out; {self.motion / 3600:.2f} h of"
            f" motion, {self.size / 1e6:.0f} MB"
        )
        return "\n\n".join((first, self._upright(), self._amounts(), self._costs()))

    def _upright(self) -> str:
        if len(self.upright) > FEW:
            return self._upright_by_robot()
        lines = [f"{'upright':26}" + "".join(f"{robot:>10}" for robot in self.upright)]
        for name in {name: None for mine in self.upright.values() for name in mine}:
            shares = (mine.get(name) for mine in self.upright.values())
            cells = (f"{share[0]}/{share[1]}" if share else "-" for share in shares)
            number = f"{SCENARIOS[name].number:>2}" if name in SCENARIOS else "  "
            lines.append(f"{number} {name:23}" + "".join(f"{cell:>10}" for cell in cells))
        return "\n".join(lines)

    def _upright_by_robot(self) -> str:
        """One line per robot, with the scenarios in which it fell most."""
        lines = [f"{'upright':26}{'runs':>10}   fell in"]
        for robot, mine in self.upright.items():
            up, runs = (sum(pair[side] for pair in mine.values()) for side in (0, 1))
            fell = sorted(((n - u, name) for name, (u, n) in mine.items() if n > u), reverse=True)
            most = ", ".join(f"{name} ({count})" for count, name in fell[:FEW])
            lines.append(f"{robot:26}{f'{up}/{runs}':>10}   {most or 'none'}")
        return "\n".join(lines)

    def _amounts(self) -> str:
        lines = [f"{'class':26}{'blocks':>10}{'seconds':>10}{'frames':>10}{'of time':>10}"]
        for robot, mine in self.amounts.items():
            whole = sum(amount["seconds"] for amount in mine.values())
            for label, amount in sorted(mine.items(), key=lambda item: -item[1]["seconds"]):
                seconds = amount["seconds"]
                lines.append(
                    f"{robot:8} {label:17}{amount['blocks']:>10}{seconds:>10.1f}"
                    f"{amount['frames']:>10}{seconds / whole:>10.1%}"
                )
        return "\n".join(lines)

    def _costs(self) -> str:
        lines = [f"{'processor time':26}{'seconds':>10}{'per simulated second':>22}"]
        for robot, cost in self.costs.items():
            each = f"{cost['seconds'] / cost['simulated']:.2f}" if cost["simulated"] else "-"
            lines.append(f"{robot:26}{cost['seconds']:>10.0f}{each:>22}")
        return "\n".join(lines)
