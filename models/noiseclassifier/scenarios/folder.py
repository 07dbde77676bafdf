"""The folder of a data set: its settings, its runs, and those that are missing.

``dataset.json`` has the settings, and the versions of the software that began it; those of each run
are in its own ``meta``. Samples lie at ``<robot>/<scenario>-<seed>.npz``; in the format
of NoisyTest, runs lie at ``training/<robot>-<scenario>-<seed>.log`` or in ``validation``. A run in
which the robot fell leaves ``….fallen.json`` instead. ``times.csv`` has a line per run: its name
and its processor time, in [s].
"""

import json
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from noiseclassifier.scenarios.errors import DatasetError, SampleError, SimulationError
from noiseclassifier.scenarios.formats import FORMATS, Format
from noiseclassifier.scenarios.simulation import SHORTEST, software
from noiseclassifier.scenarios.tasks import Task
from noisemodel import Block, Run
from noisemodel.archive import ArchiveError, read_text
from noisemodel.atomic import replacing

FORMAT = "noise-dataset/1"
MANIFEST = "dataset.json"
TIMES = "times.csv"
FALLEN = ".fallen.json"
_NAMES = re.compile(r"([a-z0-9_]+)[/-](.+)-(\d{3,})")


@dataclass(frozen=True)
class Folder:
    """The folder of a data set.

    Attributes:
        duration: Duration of each run, in [s]; None is that of its motion.
    """

    path: Path
    format_name: str = "samples"
    duration: float | None = None

    @classmethod
    def opened(
        cls,
        path: str | Path,
        *,
        format_name: str = "samples",
        duration: float | None = None,
        any_recipe: bool = False,
    ) -> Self:
        """Open a folder, or create it.

        Args:
            duration: Duration of each run, in [s]; by default that of its motion.
        """
        path = Path(path)
        if format_name not in FORMATS:
            known = ", ".join(FORMATS)
            raise DatasetError(f"no format {format_name!r} of data sets; there are {known}")
        if duration is not None and not duration >= SHORTEST:
            raise DatasetError(f"duration {duration:g} s: expected at least {SHORTEST:g} s")
        recipe = FORMATS[format_name].recipe
        settings = {"format": FORMAT, "recipe": recipe, "form": format_name, "duration": duration}
        try:
            if path.exists() and not path.is_dir():
                raise DatasetError(f"{path}: is a file; name a folder")
            if (path / MANIFEST).exists():
                compared = {k: v for k, v in settings.items() if k != "recipe" or not any_recipe}
                _compare(path, _read_json(path / MANIFEST), compared)
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
        return cls(path, format_name, duration)

    @property
    def format(self) -> Format:
        """Its kind."""
        return FORMATS[self.format_name]

    def file(self, task: Task) -> Path:
        """Path of the file of a run."""
        return self.path / f"{self.format.stem(task)}{self.format.suffix}"

    def save(self, task: Task, run: Run) -> None:
        """Write a run; an existing file is replaced."""
        self.format.write(run, self._prepared(task))

    def save_fall(self, task: Task, fall: SimulationError) -> None:
        """Record when and why a robot fell."""
        facts = {"robot": task.robot, "scenario": task.scenario, "seed": task.seed}
        record = {**facts, "time": fall.time, "problem": fall.problem, "recipe": self.format.recipe}
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
        return self.format.read(self.file(task))

    def kept(self) -> list[Task]:
        """The runs in the folder, in order."""
        return self._found(self.format.suffix)

    def fallen(self) -> list[Task]:
        """The runs in which the robot fell, in order."""
        return self._found(FALLEN)

    def times(self) -> dict[Task, float]:
        """Processor time of each run, where it was recorded, in [s]."""
        path, times = self.path / TIMES, {}
        for line in _text(path).splitlines() if path.exists() else ():
            name, _, seconds = line.partition(",")
            found = _NAMES.fullmatch(name)
            if found and self.format.holds(_task(found)) and re.fullmatch(r"\d+\.\d\d", seconds):
                times[_task(found)] = float(seconds)
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
            except SampleError as error:
                if not overwrite:
                    raise SampleError(
                        error.path, f"{error.problem}; --overwrite replaces it"
                    ) from error
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

    def _found(self, suffix: str) -> list[Task]:
        paths = (path.relative_to(self.path).as_posix() for path in self.path.rglob(f"*{suffix}"))
        plain = (re.sub("^(training|validation)/", "", path) for path in paths)
        matches = (_NAMES.fullmatch(name.removesuffix(suffix)) for name in plain)
        return sorted(filter(self.format.holds, (_task(found) for found in matches if found)))


def _task(found: re.Match[str]) -> Task:
    return Task(found[1], found[2], int(found[3]))


def _compare(path: Path, made: Any, settings: dict[str, Any]) -> None:
    for key, wanted in settings.items():
        found = made.get(key) if isinstance(made, dict) else None
        if found != wanted:
            raise DatasetError(
                f"{path}: made with {key} {json.dumps(found)}, now it is {json.dumps(wanted)};"
                " name another folder"
            )


def _read_json(path: Path) -> Any:
    try:
        return json.loads(_text(path))
    except (ValueError, RecursionError) as error:
        raise DatasetError(f"{path}: damaged ({error}); name another folder") from error


def _text(path: Path) -> str:
    try:
        return read_text(path)
    except (OSError, ArchiveError) as error:
        raise DatasetError(f"{path}: cannot be read ({error})") from error


def _write_json(path: Path, content: dict[str, Any]) -> None:
    with replacing(path, overwrite=True) as temporary:
        temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
