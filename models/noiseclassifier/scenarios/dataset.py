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
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal, Self, TypeAlias, get_args
from zlib import crc32

import numpy as np

from noiseclassifier.scenarios.domains import Domain, Logger
from noiseclassifier.scenarios.errors import DatasetError, ScenarioError, SimulationError
from noiseclassifier.scenarios.labels import FRAME, HOP
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
    robot_of,
    scenario_of,
    simulate,
    software,
)
from noiseclassifier.scenarios.table import SCENARIOS, THROUGHOUT
from noisemodel import Block, NoiseModelError, Run, decimated
from noisemodel.files import replacing
from noisemodel.parallel import DIED, Jobs, as_done
from noisemodel.runfile import ArchiveError, read_text

FORMAT, MANIFEST, TIMES, FALLEN = "noise-dataset/1", "dataset.json", "times.csv", ".fallen.json"
FEW = 8  # scenarios in which a robot fell that are named at most
_NAMES = re.compile(r"([a-z0-9_]+)/(.+)-(\d{3,})")

Choice: TypeAlias = Mapping[str, tuple[str, ...]]  # names of the scenarios of each robot
Side: TypeAlias = Literal["all", "source", "target", "logger"]
"""All logs; logs to train on; logs of robots and domains that are never trained on; and logs of the
other robots and domains, from loggers that are never trained on."""


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
) -> Choice:
    """Scenarios of each robot, by names or numbers; those that it does not have are left out."""
    if not robots:
        raise DatasetError(f"no robot is named; there are {', '.join(ROBOTS)}")
    asked = {scenario_of(name).name for name in scenarios}
    chosen = {}
    for robot in robots:
        family = robot_of(robot).family
        every = [name for name, entry in SCENARIOS.items() if family in entry.cases]
        chosen[robot] = tuple(
            name
            for name in every
            if (name in asked or not scenarios) and (SCENARIOS[name].healthy or not healthy)
        )
        if not chosen[robot]:
            of_list = f"of {', '.join(scenarios)} " if scenarios else ""
            ok = " without a failure" if healthy else ""
            raise DatasetError(
                f"no scenario {of_list}is left for {robot!r}{ok}; it has {', '.join(every)}"
            )
    return chosen


def scenario_tasks(choice: Choice, *, first: int = 0, seeds: int = 8) -> list[Task]:
    """The runs of a data set of scenarios, seed by seed."""
    if first < 0:
        raise DatasetError(f"the first seed is {first}, expected 0 or more")
    if seeds < 1:
        raise DatasetError(f"{seeds} seeds, expected 1 or more")
    return [
        Task(robot, scenario, seed)
        for seed in range(first, first + seeds)
        for robot, scenarios in choice.items()
        for scenario in scenarios
    ]


def wide_tasks(
    robots: Sequence[str] = (),
    *,
    first: int = FIRST,
    seeds: int = 8,
    faults: int = 2,
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
        for name in (GOOD, *_faults(robot, seed, faults, always, throughout))
    ]


def _faults(robot: str, seed: int, count: int, always: Sequence[str], throughout: int) -> list[str]:
    """Names of the faults of a seed: some that suit its motion, those asked for, of whole runs."""
    suited = faults_of(robot, seed)
    names = [name for name in suited if name not in always]
    number = crc32(robot.encode())
    rng, other = (np.random.default_rng((seed, number, stream)) for stream in (2, 4))
    chosen = rng.choice(len(names), min(count, len(names)), replace=False)
    whole = other.choice(list(THROUGHOUT), throughout, replace=False)
    return [
        *(names[index] for index in sorted(chosen.tolist())),
        *(name for name in always if name in suited),
        *sorted(whole.tolist()),
    ]


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
                made = _made(path)
                # The latest recipe of wide domains only adds to those before.
                if any_recipe or (wide and made.get("recipe") in range(2, recipe)):
                    settings["recipe"] = made.get("recipe")
                for key, wanted in settings.items():
                    if (found := made.get(key)) != wanted:
                        raise DatasetError(
                            f"{path}: made with {key} {json.dumps(found)}, now it is"
                            f" {json.dumps(wanted)}; name another folder"
                        )
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
    folder: Folder, *, copies: int = 1, rate: float | None = None, side: Side = "all"
) -> Iterator[tuple[str, Run]]:
    """Logs of the runs of wide domains, each with its name: ``<robot>/<fault>[.copy]-<seed>``."""
    if side not in get_args(Side):
        raise DatasetError(f"no side {side!r}; there are {', '.join(get_args(Side))}")
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


def statistics(folder: Folder) -> dict[str, Any]:
    """What a data set has, as plain data: by robot, runs, classes and processor times."""
    kept, fallen, times = folder.kept(), folder.fallen(), folder.times()
    stood = Counter((task.robot, task.scenario) for task in kept)
    fell = Counter((task.robot, task.scenario) for task in fallen)
    runs = stood + fell
    known = {robot for robot, _ in runs}
    robots = [robot for robot in (WIDE if folder.wide else ROBOTS) if robot in known]
    names = dict.fromkeys((*SCENARIOS, *(name for _, name in sorted(runs))))
    classes: dict[str, dict[str, dict[str, float]]] = {robot: {} for robot in robots}
    cpu = {robot: {"seconds": 0.0, "simulated": 0.0} for robot in robots}
    motion = 0.0
    for task in kept:
        blocks, duration = folder.read(task)
        motion += duration
        for block in blocks:
            zero = {"blocks": 0, "seconds": 0.0, "frames": 0}
            mine = classes[task.robot].setdefault(block.label, zero)
            seconds = block.stop - block.start
            mine["blocks"] += 1
            mine["seconds"] += seconds
            # Blocks start and stop on samples, up to rounding.
            mine["frames"] += 1 + int(max(seconds - FRAME, 0.0) / HOP + 1e-6)
        if task in times:
            cpu[task.robot]["seconds"] += times[task]
            cpu[task.robot]["simulated"] += duration
    return {
        "format": "noise-balance/1",
        "upright": {
            robot: {
                name: {"upright": stood[robot, name], "runs": runs[robot, name]}
                for name in names
                if (robot, name) in runs
            }
            for robot in robots
        },
        "classes": {robot: dict(sorted(mine.items())) for robot, mine in classes.items()},
        "cpu": cpu,
        "motion": motion,
        "bytes": sum(path.stat().st_size for path in folder.path.rglob("*") if path.is_file()),
    }


def described(found: Mapping[str, Any]) -> str:
    """Statistics as text, with the scenarios in which each robot fell most."""
    upright, all_runs, all_fell = [f"{'upright':26}{'runs':>10}   fell in"], 0, 0
    for robot, mine in found["upright"].items():
        up, runs = (sum(pair[key] for pair in mine.values()) for key in ("upright", "runs"))
        lost = {name: pair["runs"] - pair["upright"] for name, pair in mine.items()}
        fell = sorted(((count, name) for name, count in lost.items() if count), reverse=True)
        most = ", ".join(f"{name} ({count})" for count, name in fell[:FEW])
        upright.append(f"{robot:26}{f'{up}/{runs}':>10}   {most or 'none'}")
        all_runs, all_fell = all_runs + runs, all_fell + runs - up
    classes = [f"{'class':26}{'blocks':>10}{'seconds':>10}{'frames':>10}{'of time':>10}"]
    for robot, mine in found["classes"].items():
        whole = sum(amount["seconds"] for amount in mine.values())
        for label, amount in sorted(mine.items(), key=lambda item: -item[1]["seconds"]):
            seconds = amount["seconds"]
            classes.append(
                f"{robot:8} {label:17}{amount['blocks']:>10}{seconds:>10.1f}"
                f"{amount['frames']:>10}{seconds / whole:>10.1%}"
            )
    costs = [f"{'processor time':26}{'seconds':>10}{'per simulated second':>22}"]
    for robot, cost in found["cpu"].items():
        each = f"{cost['seconds'] / cost['simulated']:.2f}" if cost["simulated"] else "-"
        costs.append(f"{robot:26}{cost['seconds']:>10.0f}{each:>22}")
    first = (
        f"{all_runs} runs, {all_fell} of which fell and are left out;"
        f" {found['motion'] / 3600:.2f} h of motion, {found['bytes'] / 1e6:.0f} MB"
    )
    return "\n\n".join((first, *("\n".join(lines) for lines in (upright, classes, costs))))
