"""Time commands of two checkouts in turns, each as a process of its own.

    python -m benchmarks.commands --before OLD_CHECKOUT [--after .] [--repeats 7]
        [--only help classify …] [--python-before PYTHON] [--python-after PYTHON]

Commands: `inspector --help`, `classify` and `report` of 10 s of a simulated Panda at 10 kHz, and
`view --save` of the demo. After a warm-up, which compiles modules and fills caches, the checkouts
take turns (before, after, before, after …), so that a machine that slows down slows both. Each
process has one thread for BLAS. Given are medians of CPU and wall time, and their ratios, after by
before: below 1, the checkout AFTER takes less.
"""

import argparse
import resource
import subprocess
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from statistics import median
from typing import TypeAlias

from benchmarks.checkouts import DEMO, ROOT, Checkout, simulated

CASE = {"panda-10s": ("panda", "early-height", 1, 10.0)}
"""The run that is classified and reported."""
COMMANDS = ("--help", "classify", "report", "view")

Times: TypeAlias = tuple[float, float]
"""CPU and wall time, in [s]."""


def arguments_of(command: str, run: Path, output: Path) -> list[str]:
    """Arguments of `inspector` for a command.

    Args:
        command: One of `COMMANDS`.
        run: The run file.
        output: Folder of what is written.
    """
    page, recording = str(output / "report.html"), str(output / "demo.rrd")
    return {
        "--help": ["--help"],
        "classify": ["classify", str(run)],
        "report": ["report", str(run), "--output", page, "--overwrite"],
        "view": ["view", str(DEMO), "--save", recording, "--overwrite"],
    }[command]


def measure(checkout: Checkout, arguments: list[str]) -> Times:
    """CPU and wall time of one call of `inspector`, in [s].

    Raises:
        SystemExit: If the command failed; findings are no failure.
    """
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run(
        [checkout.python, "-m", "inspector", *arguments],
        cwd=checkout.folder,
        env=checkout.environment,
        capture_output=True,
        text=True,
        check=False,
    )
    wall = time.perf_counter() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    findings = done.returncode == 1 and done.stdout  # a module that is not there exits by 1, too
    if done.returncode and not findings:
        called = " ".join(arguments)
        raise SystemExit(
            f"inspector {called} failed in {checkout.folder} (exit {done.returncode}):\n"
            f"{done.stderr[-2000:]}"
        )
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return cpu, wall


def in_turns(
    checkouts: Mapping[str, Checkout], arguments: Mapping[str, list[str]], repeats: int
) -> dict[str, list[Times]]:
    """Times of one command by checkout, measured in turns after a warm-up.

    Args:
        checkouts: The checkouts, by name.
        arguments: Arguments of `inspector` in each.
        repeats: How often each is measured.
    """
    found: dict[str, list[Times]] = {side: [] for side in checkouts}
    for repeat in range(repeats + 1):
        for side, checkout in checkouts.items():
            times = measure(checkout, arguments[side])
            if repeat:
                found[side].append(times)
    return found


def row(command: str, before: Iterable[Times], after: Iterable[Times]) -> str:
    """One line of the table: medians in [s], and their ratios."""
    old, new = ([median(each) for each in zip(*times, strict=True)] for times in (before, after))
    cells = [f"{each:.2f}" for each in (*old, *new)]
    cells += [f"{mine / theirs:.2f}" for theirs, mine in zip(old, new, strict=True)]
    return f"| {command} | {' | '.join(cells)} |"


def main() -> None:
    """Measure and print."""
    arguments = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    arguments.add_argument("--before", type=Path, required=True, metavar="FOLDER")
    arguments.add_argument("--after", type=Path, default=ROOT, metavar="FOLDER")
    arguments.add_argument("--python-before", type=Path, metavar="PYTHON")
    arguments.add_argument("--python-after", type=Path, metavar="PYTHON")
    arguments.add_argument("--repeats", type=int, default=7)
    arguments.add_argument("--only", nargs="+", choices=["help", *COMMANDS[1:]], metavar="COMMAND")
    arguments.add_argument("--output", type=Path, default=ROOT / "build" / "checkouts")
    given = arguments.parse_args()
    folder = given.output.resolve()
    sides = {
        "before": Checkout.of(given.before, given.python_before, folder / "scratch" / "before"),
        "after": Checkout.of(given.after, given.python_after, folder / "scratch" / "after"),
    }
    wanted = [name for name in COMMANDS if not given.only or name.strip("-") in given.only]
    run = Path()
    if {"classify", "report"} & set(wanted):
        (run,) = simulated(sides["after"], folder / "runs", CASE).values()
    print("| inspector … | before: CPU [s] | wall | after: CPU [s] | wall | CPU ratio | wall |")
    print("|---" * 7 + "|", flush=True)
    for command in wanted:
        calls = {side: arguments_of(command, run, each.scratch) for side, each in sides.items()}
        found = in_turns(sides, calls, given.repeats)
        print(row(command, found["before"], found["after"]), flush=True)


if __name__ == "__main__":
    main()
