"""Time training, a file, a hop and a point of the grid beside NoisyTest 0.0.1, on the same files.

    python benchmarks/noisytest.py FOLDER [--original PYTHON] [--repeats 5] [--json FILE]

FOLDER holds NoisyTest's `training`, `validation` and `noisytest-config.json`. PYTHON is the
interpreter of an environment with the original; without one, only our side is timed. The original
requires a package that Python 3.7 and later cannot install, so that it is installed without its
dependencies:

    python -m venv original
    original/bin/pip install --no-deps noisytest==0.0.1
    original/bin/pip install tensorflow scikit-learn toml

Each side is a process of its own, started anew for each repeat, and the two take turns at each
task, so that a slower machine affects both. Printed are medians of CPU time, of all threads
(TensorFlow chooses their number, BLAS has one), and of wall time; imports are separate. Both sides
take their settings from the configuration, and their results are compared.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median
from typing import Any, TypeAlias

Found: TypeAlias = dict[str, dict[str, list[dict[str, Any]]]]
"""Results of each repeat, by side and task: ``cpu`` and ``wall``, in [s], and ``answer``."""

SIDE = Path(__file__).resolve().parent / "noisytestside.py"
TASKS = {
    "train": "train: read, learn, measure",
    "file": "label a file of 10 s",
    "folder": "label 50 files, each",
    "folder, general": "the same by `general`, with onsets, each",
    "hop": "label a hop of 0.1 s",
    "hop, stream": "label a hop of 0.1 s, `Stream`",
    "hop, general": "label a hop of 0.1 s, `Stream` of `general`",
    "point": "a point of the grid by itself",
    "points": "a point of the grid as `inspector tune` does it",
}
"""The timed tasks, by their titles in the table."""
INSTEAD = {
    "folder, general": "folder",
    "hop, stream": "hop",
    "hop, general": "hop",
    "points": "point",
}
"""The task of the original that replaces one that it does not have."""


class Peer:
    """A process that does the tasks of one side."""

    def __init__(self, python: str, side: str, folder: Path) -> None:
        """Start it, without the folder of this file on its path."""
        command = [python, "-I" if side == "original" else "-P", str(SIDE), side, str(folder)]
        self._errors = tempfile.TemporaryFile("w+")  # noqa: SIM115
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
            env=os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
        )
        self.startup = self._result()
        self.tasks: list[str] = self.startup["answer"]

    def do(self, task: str) -> dict[str, Any]:
        """Result of a task."""
        assert self._process.stdin
        self._process.stdin.write(f"{task}\n")
        self._process.stdin.flush()
        return self._result()

    def end(self) -> None:
        """End the process."""
        self._process.communicate()
        self._errors.close()

    def _result(self) -> dict[str, Any]:
        assert self._process.stdout
        line = self._process.stdout.readline()
        if not line:
            self._errors.seek(0)
            raise SystemExit(f"{self._process.args} ended:\n{self._errors.read()[-2000:]}")
        return dict(json.loads(line))


def race(pythons: dict[str, str], folder: Path, repeats: int) -> Found:
    """Results of all tasks; the sides take turns.

    Args:
        pythons: The Python of each side.
        folder: The files.
        repeats: Number of repeats.

    Returns:
        The results.
    """
    found: Found = {side: {} for side in pythons}
    for _ in range(repeats):
        peers = {side: Peer(python, side, folder) for side, python in pythons.items()}
        for side, peer in peers.items():
            found[side].setdefault("import", []).append(peer.startup)
        for task in ("train", "prepare", *list(TASKS)[1:]):
            for side, peer in peers.items():
                if task in peer.tasks:
                    found[side].setdefault(task, []).append(peer.do(task))
        for peer in peers.values():
            peer.end()
    return found


def table(found: Found) -> str:
    """Medians and their ratios, as a table in Markdown."""
    lines = [
        "| | NoisyTest 0.0.1: CPU | wall | ours: CPU | wall | ratio of CPU | of wall |",
        "|---|---|---|---|---|---|---|",
    ]
    for task, title in {"import": "import", **TASKS}.items():
        mine = _medians(found["ours"][task])
        cells = ["-", "-", *map(_time, mine), "-", "-"]
        if there := found.get("original", {}).get(INSTEAD.get(task, task)):
            theirs = _medians(there)
            ratios = [f"{old / new:.3g}" for old, new in zip(theirs, mine, strict=True)]
            cells = [*map(_time, theirs), *map(_time, mine), *ratios]
        lines.append(f"| {title} | {' | '.join(cells)} |")
    return "\n".join(lines)


def agreement(found: Found) -> str:
    """Agreement of the results of both sides, in words."""
    sides = found["original"], found["ours"]
    trained = [side["train"][0]["answer"] for side in sides]
    labels = [side["file"][0]["answer"] for side in sides]
    same = sum(one == other for one, other in zip(*labels, strict=False))
    return (
        f"subset accuracy {trained[0]:.4f} and {trained[1]:.4f}; of {len(labels[0])} and"
        f" {len(labels[1])} frames of the file, {same} have the same class"
    )


def _medians(repeats: list[dict[str, Any]]) -> list[float]:
    return [median(each[what] for each in repeats) for what in ("cpu", "wall")]


def _time(seconds: float) -> str:
    return f"{seconds:.3g} s" if seconds >= 1.0 else f"{1e3 * seconds:.3g} ms"


def main() -> None:
    """Measure and print."""
    arguments = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    arguments.add_argument("folder", type=Path)
    arguments.add_argument("--original", help="Python of an environment with NoisyTest")
    arguments.add_argument("--repeats", type=int, default=5)
    arguments.add_argument("--json", type=Path, help="file for the results of each repeat")
    given = arguments.parse_args()
    pythons = {"original": given.original} if given.original else {}
    found = race({**pythons, "ours": sys.executable}, given.folder, given.repeats)
    if given.json:
        given.json.write_text(json.dumps(found))
    print(f"medians of {given.repeats}\n\n{table(found)}\n")
    if given.original:
        print(agreement(found))
    else:
        print("NoisyTest was not timed: --original takes a Python that has it, see --help")


if __name__ == "__main__":
    main()
