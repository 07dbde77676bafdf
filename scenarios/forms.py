"""The forms in which a data set keeps its runs: samples of our own, and NoisyTest's files."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from noisemodel import Block, Run
from scenarios import noisytest
from scenarios.sample import Sample
from scenarios.tasks import Task


@dataclass(frozen=True)
class Form:
    """In which form runs are kept.

    Attributes:
        suffix: Of the files.
        place: Path of a run in the folder, without its suffix.
        write: Writes a run, whole or not at all; replaces what is there.
        read: Reads a run's blocks, and how long it lasts, in [s].
    """

    suffix: str
    place: Callable[[Task], str]
    write: Callable[[Run, Path], None]
    read: Callable[[Path], tuple[tuple[Block, ...], float]]


def _write_sample(run: Run, path: Path) -> None:
    Sample.of(run).save(path, overwrite=True)


def _read_sample(path: Path) -> tuple[tuple[Block, ...], float]:
    sample = Sample.load(path, only=())
    return sample.blocks, float(sample.meta["duration"])


def _noisytest_place(task: Task) -> str:
    return f"{noisytest.part(task.seed)}/{task.name.replace('/', '-')}"


FORMS: Mapping[str, Form] = MappingProxyType(
    {
        "samples": Form(".npz", lambda task: task.name, _write_sample, _read_sample),
        "noisytest": Form(".log", _noisytest_place, noisytest.write, noisytest.read),
    }
)
"""By name."""
