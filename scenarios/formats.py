"""The file formats of a data set: samples, and the files of NoisyTest."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from noisemodel import Block, Run
from scenarios import noisytest
from scenarios.sample import Sample
from scenarios.tasks import Task


@dataclass(frozen=True)
class Format:
    """A file format of runs.

    Attributes:
        suffix: Suffix of the files.
        stem: Path of a run in the folder, without its suffix.
        write: Writes a run atomically; replaces an existing file.
        read: Reads the blocks of a run, and its duration, in [s].
    """

    suffix: str
    stem: Callable[[Task], str]
    write: Callable[[Run, Path], None]
    read: Callable[[Path], tuple[tuple[Block, ...], float]]


def _write_sample(run: Run, path: Path) -> None:
    Sample.of(run).save(path, overwrite=True)


def _read_sample(path: Path) -> tuple[tuple[Block, ...], float]:
    sample = Sample.load(path, only=())
    return sample.blocks, float(sample.meta["duration"])


def _noisytest_stem(task: Task) -> str:
    return f"{noisytest.part(task.seed)}/{task.name.replace('/', '-')}"


FORMATS: Mapping[str, Format] = MappingProxyType(
    {
        "samples": Format(".npz", lambda task: task.name, _write_sample, _read_sample),
        "noisytest": Format(".log", _noisytest_stem, noisytest.write, noisytest.read),
    }
)
"""By name."""
