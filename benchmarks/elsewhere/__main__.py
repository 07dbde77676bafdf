"""Runs of robots, simulators and controllers that are not ours, with faults at known times.

    python -m benchmarks.elsewhere OUT [--seeds 5] [--domains drake-ur5,...] [--duration 10]

For measuring only: nothing is trained on these runs, and nothing of ours is tuned to them.

Writes run files `OUT/<domain>/<robot>/<scenario>-<90000 + seed>.npz`: for each seed and domain a
good run and two with faults, of one kind each, at 1 kHz; for every other seed also a good run at
the simulator's own rate, and for the first one a run with faults. Files that exist are kept. A run
in which the robot falls or the simulation diverges is named, and leaves its reason in
`<scenario>-<seed>.dropped.txt` instead.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from benchmarks.elsewhere import domains
from benchmarks.elsewhere.domains import DOMAINS, Domain
from benchmarks.elsewhere.faults import KINDS
from benchmarks.elsewhere.recorded import DroppedError

# Added to seeds in names: no run is taken for one of the same robot and seed that is ours.
FIRST = 90_000


@dataclass(frozen=True)
class Task:
    """One run of the set."""

    domain: Domain
    kind: str
    seed: int
    rate: float

    @property
    def name(self) -> str:
        """Name of its file, without a suffix."""
        rate = "" if self.rate == 1000 else f"-{self.rate:.0f}hz"
        return f"{self.domain.folder}/{self.kind}{rate}-{FIRST + self.seed}"


def tasks(names: list[str], seeds: int) -> Iterator[Task]:
    """The runs of the set, those that share a twin next to each other."""
    for number, name in enumerate(names):
        domain = DOMAINS[name]
        kinds = [kind for kind in KINDS if kind != "throw" or domain.package == "pybullet"]
        for seed in range(seeds):
            two = [kinds[(2 * seed + each + number) % len(kinds)] for each in (0, 1)]
            for kind in ("good", *two):
                yield Task(domain, kind, seed, 1000.0)
            if seed % 2 == 0:
                yield Task(domain, "good", seed, domain.native)
            if seed == 0:
                yield Task(domain, two[0], seed, domain.native)


def main() -> None:
    """Make the runs that are missing."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("output", type=Path)
    arguments.add_argument("--seeds", type=int, default=5)
    arguments.add_argument("--domains", default=",".join(DOMAINS))
    arguments.add_argument("--duration", type=float, default=10.0, help="in seconds, at least 3")
    options = arguments.parse_args()
    names = options.domains.split(",")
    unknown = [name for name in names if name not in DOMAINS]
    if unknown:
        arguments.error(f"no domain {unknown[0]!r}; there are {', '.join(DOMAINS)}")
    if options.duration < 3:
        arguments.error(f"duration {options.duration:g} s: expected at least 3 s")
    missing = {DOMAINS[name].package for name in names} - installed()
    if missing:
        raise SystemExit(
            f"{' and '.join(sorted(missing))} not installed;"
            " run `pip install 'noise-inspector[elsewhere]'`"
        )
    for task in tasks(names, options.seeds):
        make(task, options.output, options.duration)


def installed() -> set[str]:
    """The simulators that are there."""
    modules = {"pybullet": "pybullet", "drake": "pydrake"}
    return {package for package, module in modules.items() if find_spec(module)}


def make(task: Task, output: Path, duration: float) -> None:
    """Simulate and write a run, unless that is done."""
    path, dropped = (output / f"{task.name}{suffix}" for suffix in (".npz", ".dropped.txt"))
    if path.exists() or dropped.exists():
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        run = domains.make(task.domain, task.kind, task.seed, rate=task.rate, duration=duration)
    except DroppedError as error:
        print(f"dropped {task.name}: {error}", flush=True)
        dropped.write_text(f"{error}\n")
    else:
        run.save(path)


if __name__ == "__main__":
    main()
