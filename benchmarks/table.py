"""Rows of the table of speed benchmarks, and how their times are taken.

What is compared takes turns, so that a machine that slows down slows down all of it; the median of
the turns counts. Times are CPU times of one core, in [s], unless a row has another unit.
"""

import os
import resource
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

ROOT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Row:
    """A line of the table."""

    name: str
    ours: float
    against: str = ""
    other: float | None = None
    wanted: float | None = None
    most: float | None = None
    unit: str = "s"

    @property
    def ratio(self) -> float | None:
        """The other by ours: above 1, ours takes less."""
        return self.other / self.ours if self.other is not None else None

    @property
    def missed(self) -> bool:
        """Whether it is known that less was reached than is wanted."""
        slow = self.most is not None and self.ours > self.most
        return slow or bool(self.wanted and self.ratio is not None and self.ratio < self.wanted)

    def __str__(self) -> str:
        limits = [] if self.wanted is None else [f"≥ {self.wanted:g}"]
        limits += [] if self.most is None else [f"≤ {_shown(self.most, self.unit)}"]
        wanted = ", ".join(limits)
        cells = [
            self.name,
            self.against or "–",  # noqa: RUF001
            _shown(self.ours, self.unit),
            "–" if self.other is None else _shown(self.other, self.unit),  # noqa: RUF001
            "–" if self.ratio is None else f"{self.ratio:.3g}",  # noqa: RUF001
            f"{wanted} (missed)" if self.missed else wanted,
        ]
        return f"| {' | '.join(cells)} |"


HEAD = "| what | compared with | ours | other | ratio | wanted |\n|---|---|---|---|---|---|"


def _shown(value: float, unit: str) -> str:
    if unit == "s" and value < 1.0:
        value, unit = 1e3 * value, "ms"
    return f"{value:.0f} {unit}" if value >= 100.0 else f"{value:.3g} {unit}"


def in_turns(
    sides: Mapping[str, Callable[[], float]], repeats: int, *, warm: int = 0
) -> dict[str, float]:
    """Medians of what each side returns; they take turns."""
    found: dict[str, list[float]] = {side: [] for side in sides}
    for turn in range(-warm, repeats):
        for side, work in sides.items():
            taken = work()
            if turn >= 0:
                found[side].append(taken)
    return {side: median(times) for side, times in found.items()}


def used(work: Callable[[], object]) -> float:
    """CPU time of a call in this process, in [s]."""
    start = time.process_time()
    work()
    return time.process_time() - start


def of_process(
    command: Sequence[str | Path],
    *,
    folder: Path = ROOT,
    environment: Mapping[str, str] | None = None,
    stdin: Path | None = None,
) -> float:
    """CPU time of a process and its children, in [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with (stdin or Path(os.devnull)).open("rb") as stream:
        done = subprocess.run(
            command,
            cwd=folder,
            env=None if environment is None else dict(environment),
            stdin=stream,
            capture_output=True,
            text=True,
            check=False,
        )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode and not (done.returncode == 1 and done.stdout):  # a missing module: 1, too
        called = " ".join(map(str, command))
        raise SystemExit(
            f"{called} failed in {folder} (exit {done.returncode}):\n{done.stderr[-2000:]}"
        )
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
