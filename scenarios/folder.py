"""The folder of a data set: what it is made of, what is in it, what fell, what is missing.

``dataset.json`` says how it is made. Samples lie at ``<robot>/<scenario>-<seed>.npz``; in the form
of NoisyTest, runs lie at ``training/<robot>-<scenario>-<seed>.log`` or in ``validation``. A run in
which the robot fell leaves ``….fallen.json`` instead. ``times.csv`` gets a line with each run: its
name, and the processor time that it took, in [s].
"""

import json
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from noisemodel import Block, Run
from noisemodel.atomic import replacing
from scenarios.errors import DatasetError, SampleError, SimulationError
from scenarios.forms import FORMS
from scenarios.robots import ROBOTS
from scenarios.simulation import RECIPE, SHORTEST
from scenarios.table import SCENARIOS
from scenarios.tasks import Task

FORMAT = "noise-dataset/1"
MANIFEST = "dataset.json"
TIMES = "times.csv"
FALLEN = ".fallen.json"
_NAMES = re.compile(rf"({'|'.join(ROBOTS)})[/-]({'|'.join(SCENARIOS)})-(\d{{3,}})")


@dataclass(frozen=True)
class Folder:
    """The folder of a data set.

    Attributes:
        path: Where it is.
        form: A name in ``FORMS``.
        duration: How long each run lasts, in [s]; as its motion says if None.
    """

    path: Path
    form: str = "samples"
    duration: float | None = None

    @classmethod
    def opened(
        cls, path: str | Path, *, form: str = "samples", duration: float | None = None
    ) -> Self:
        """Open a folder, or make it.

        Args:
            path: An empty folder, one that is to be made, or one that was made in the same way.
            form: A name in ``FORMS``.
            duration: How long each run is to last, in [s]; as its motion says unless given.

        Returns:
            The folder.

        Raises:
            DatasetError: If it was made in another way, holds something else, or cannot be made,
                or the duration is too short.
        """
        path = Path(path)
        if form not in FORMS:
            raise DatasetError(f"no form {form!r} of data sets; there are {', '.join(FORMS)}")
        if duration is not None and not duration >= SHORTEST:
            raise DatasetError(f"duration {duration:g} s: expected at least {SHORTEST:g} s")
        way = {"format": FORMAT, "recipe": RECIPE, "form": form, "duration": duration}
        try:
            if path.exists() and not path.is_dir():
                raise DatasetError(f"{path}: is a file; name a folder")
            if (path / MANIFEST).exists():
                _compare(path, _read_json(path / MANIFEST), way)
            elif path.is_dir() and any(path.iterdir()):
                raise DatasetError(
                    f"{path}: holds something else (it has no {MANIFEST}); name an empty folder"
                )
            else:
                path.mkdir(parents=True, exist_ok=True)
                _write_json(path / MANIFEST, way)
        except OSError as error:
            raise DatasetError(f"{path}: cannot be made ({error.strerror or error})") from error
        return cls(path, form, duration)

    def file(self, task: Task) -> Path:
        """Say where a run is kept."""
        form = FORMS[self.form]
        return self.path / f"{form.place(task)}{form.suffix}"

    def keep(self, task: Task, run: Run) -> None:
        """Write a run; what is there is replaced.

        Raises:
            OutputError: If it cannot be written.
        """
        FORMS[self.form].write(run, self._room(task))

    def keep_fall(self, task: Task, fall: SimulationError) -> None:
        """Write when and why a run is no sample.

        Raises:
            OutputError: If it cannot be written.
        """
        facts = {"robot": task.robot, "scenario": task.scenario, "seed": task.seed}
        record = {**facts, "time": fall.time, "problem": fall.problem, "recipe": RECIPE}
        _write_json(self._room(task).with_suffix(FALLEN), {**record, "duration": self.duration})

    def keep_time(self, task: Task, seconds: float) -> None:
        """Note the processor time that a run took, in [s].

        Raises:
            DatasetError: If it cannot be written.
        """
        path = self.path / TIMES
        try:
            with path.open("a", encoding="utf-8") as times:
                times.write(f"{task.name},{seconds:.2f}\n")
        except OSError as error:
            raise DatasetError(f"{path}: cannot be written ({error.strerror})") from error

    def read(self, task: Task) -> tuple[tuple[Block, ...], float]:
        """Read a run's blocks, and how long it lasts, in [s].

        Raises:
            SampleError: If its file is damaged.
        """
        return FORMS[self.form].read(self.file(task))

    def kept(self) -> list[Task]:
        """List the runs that are there, in order."""
        return self._found(FORMS[self.form].suffix)

    def fallen(self) -> list[Task]:
        """List the runs in which the robot fell, in order."""
        return self._found(FALLEN)

    def times(self) -> dict[Task, float]:
        """Read the processor time of each run that it was noted of, in [s]."""
        path, times = self.path / TIMES, {}
        for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
            name, _, seconds = line.partition(",")
            if (found := _NAMES.fullmatch(name)) and re.fullmatch(r"\d+\.\d\d", seconds):
                times[_task(found)] = float(seconds)
        return times

    def missing(self, tasks: Iterable[Task]) -> list[Task]:
        """List those runs that are neither there nor known to fall."""
        done = {*self.kept(), *self.fallen()}
        return [task for task in tasks if task not in done]

    def clear(self, *, overwrite: bool) -> None:
        """Check what is there, and make room for what is to be made again.

        Args:
            overwrite: Whether damaged files are removed.

        Raises:
            SampleError: If a file is damaged and may not be removed.
        """
        for task in self.kept():
            try:
                self.read(task)
            except SampleError as error:
                if not overwrite:
                    raise SampleError(
                        error.path, f"{error.problem}; --overwrite makes it again"
                    ) from error
                self.file(task).unlink()

    def _room(self, task: Task) -> Path:
        """Make the folder of a run, without what a run that was killed has left there."""
        path = self.file(task)
        try:
            path.parent.mkdir(exist_ok=True)
        except OSError as error:
            raise DatasetError(f"{path.parent}: cannot be made ({error.strerror})") from error
        for rest in path.parent.glob(f".{path.stem}.*"):
            rest.unlink(missing_ok=True)
        return path

    def _found(self, suffix: str) -> list[Task]:
        paths = (path.relative_to(self.path).as_posix() for path in self.path.rglob(f"*{suffix}"))
        plain = (re.sub("^(training|validation)/", "", path) for path in paths)
        matches = (_NAMES.fullmatch(name.removesuffix(suffix)) for name in plain)
        return sorted(_task(found) for found in matches if found)


def _task(found: re.Match[str]) -> Task:
    return Task(found[1], found[2], int(found[3]))


def _compare(path: Path, made: Any, way: dict[str, Any]) -> None:
    for key, wanted in way.items():
        found = made.get(key) if isinstance(made, dict) else None
        if found != wanted:
            raise DatasetError(
                f"{path}: made with {key} {json.dumps(found)}, now it is {json.dumps(wanted)};"
                " name another folder"
            )


def _read_json(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise DatasetError(f"{path}: damaged ({error}); name another folder") from error


def _write_json(path: Path, content: dict[str, Any]) -> None:
    with replacing(path, overwrite=True) as temporary:
        temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
