"""The kinds of data sets: samples or files of NoisyTest of the scenarios, and wide domains."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from noiseclassifier.scenarios import domains, noisytest
from noiseclassifier.scenarios.errors import SampleError
from noiseclassifier.scenarios.robots import ROBOTS, WIDE
from noiseclassifier.scenarios.sample import Sample
from noiseclassifier.scenarios.simulation import RECIPE, simulate
from noiseclassifier.scenarios.table import SCENARIOS
from noiseclassifier.scenarios.tasks import Task, motion_of
from noisemodel import Block, NoiseModelError, Run


@dataclass(frozen=True)
class Format:
    """A kind of data set.

    Attributes:
        read: Reads the blocks of a run, and its duration, in [s].
    """

    recipe: object
    suffix: str
    stem: Callable[[Task], str]
    write: Callable[[Run, Path], None]
    read: Callable[[Path], tuple[tuple[Block, ...], float]]
    simulate: Callable[[Task, float | None], Run]
    motion: Callable[[Task], object]
    robots: Collection[str]
    scenarios: Collection[str] = ()

    def holds(self, task: Task) -> bool:
        """Whether a run may belong to it."""
        return task.robot in self.robots and task.scenario in (self.scenarios or (task.scenario,))


def _write_sample(run: Run, path: Path) -> None:
    Sample.of(run).save(path, overwrite=True)


def _read_sample(path: Path) -> tuple[tuple[Block, ...], float]:
    sample = Sample.load(path, only=())
    return sample.blocks, float(sample.meta["duration"])


def _noisytest_stem(task: Task) -> str:
    return f"{noisytest.part(task.seed)}/{task.name.replace('/', '-')}"


def _write_run(run: Run, path: Path) -> None:
    run.save(path, overwrite=True)


def _read_run(path: Path) -> tuple[tuple[Block, ...], float]:
    try:
        run = Run.load(path)
    except NoiseModelError as error:
        raise SampleError(path, str(error)) from error
    return run.blocks, run.duration


def _simulate(task: Task, duration: float | None) -> Run:
    return simulate(task.robot, task.scenario, task.seed, duration=duration)


def _simulate_domain(task: Task, duration: float | None) -> Run:
    return domains.simulate(task.robot, task.scenario, task.seed, duration=duration)


FORMATS: Mapping[str, Format] = MappingProxyType(
    {
        "samples": Format(
            RECIPE,
            ".npz",
            lambda task: task.name,
            _write_sample,
            _read_sample,
            _simulate,
            motion_of,
            ROBOTS,
            SCENARIOS,
        ),
        "noisytest": Format(
            RECIPE,
            ".log",
            _noisytest_stem,
            noisytest.write,
            noisytest.read,
            _simulate,
            motion_of,
            ROBOTS,
            SCENARIOS,
        ),
        "domains": Format(
            domains.RECIPE,
            ".npz",
            lambda task: task.name,
            _write_run,
            _read_run,
            _simulate_domain,
            lambda _: None,
            WIDE,
        ),
    }
)
"""By name."""
