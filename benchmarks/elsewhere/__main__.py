"""Runs of robots, simulators and controllers that are not ours, with faults at known times.

    python -m benchmarks.elsewhere OUT [--seeds 5] [--domains drake-ur5,...] [--duration 10]

For measuring only: nothing is trained on these runs, and nothing of ours is tuned to them.

Writes run files `OUT/<domain>/<robot>/<scenario>-<90000 + seed>.npz`: for each seed and domain a
good run and two with faults, of one kind each, at 1 kHz; for every other seed also a good run at
the simulator's own rate, and for the first one a run with faults. Files that exist are kept. A run
in which the robot falls or the simulation diverges is named, and leaves
`<scenario>-<seed>.dropped.json` instead.
"""

import argparse
import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from benchmarks.elsewhere import domains
from benchmarks.elsewhere.domains import DOMAINS, Domain
from benchmarks.elsewhere.faults import KINDS
from benchmarks.elsewhere.recorded import DroppedError
from noisemodel import Run

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
    """Make the runs that are missing, and print the table."""
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
    every = list(tasks(names, options.seeds))
    for task in every:
        make(task, options.output, options.duration)
    report(every, options.output)


def installed() -> set[str]:
    """The simulators that are there."""
    modules = {"pybullet": "pybullet", "drake": "pydrake"}
    return {package for package, module in modules.items() if find_spec(module)}


def make(task: Task, output: Path, duration: float) -> None:
    """Simulate and write a run, unless that is done."""
    path, dropped = (output / f"{task.name}{suffix}" for suffix in (".npz", ".dropped.json"))
    if path.exists() or dropped.exists():
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        run = domains.make(task.domain, task.kind, task.seed, rate=task.rate, duration=duration)
    except DroppedError as error:
        print(f"dropped {task.name}: {error}", flush=True)
        dropped.write_text(json.dumps({"problem": str(error)}))
    else:
        run.save(path)


def report(every: list[Task], output: Path) -> None:
    """Print what there is, what was dropped, and how many faults the robots felt."""
    print(
        f"{'domain':18}{'good':>6}{'faulty':>8}{'dropped':>9}{'faults':>8}{'felt':>6}{'masked':>8}"
    )
    kinds: Counter[str] = Counter()
    felt: Counter[str] = Counter()
    dropped: list[str] = []
    for domain in dict.fromkeys(task.domain for task in every):
        own = [task for task in every if task.domain == domain]
        runs = {
            task: Run.load(path) for task in own if (path := output / f"{task.name}.npz").exists()
        }
        dropped += [f"{task.name} ({problem(task, output)})" for task in own if task not in runs]
        events = [(task.kind, event) for task, run in runs.items() for event in run.meta["events"]]
        kinds.update(kind for kind, _ in events)
        felt.update(kind for kind, event in events if event["labelled"] > 0)
        good = sum(task.kind == "good" for task in runs)
        print(
            f"{domain.name:18}{good:6}{len(runs) - good:8}{len(own) - len(runs):9}{len(events):8}"
            f"{sum(event['labelled'] > 0 for _, event in events):6}"
            f"{sum(event['masked'] for _, event in events):8}"
        )
    print("\nfelt by kind: " + ", ".join(f"{kind} {felt[kind]} of {kinds[kind]}" for kind in kinds))
    if dropped:
        print("dropped: " + ", ".join(dropped))


def problem(task: Task, output: Path) -> str:
    """Why a run was dropped."""
    return str(json.loads((output / f"{task.name}.dropped.json").read_text())["problem"])


if __name__ == "__main__":
    main()
