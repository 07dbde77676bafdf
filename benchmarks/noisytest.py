"""Time training, a file, a hop and a point of the grid beside NoisyTest 0.0.1, on the same files.

    python -m benchmarks noisytest --noisytest FOLDER [--original PYTHON]

FOLDER holds NoisyTest's `training`, `validation` and `noisytest-config.json`; unless given it is
a stand-in for its data set, where `../shared/tools/standin_lola.py` is at hand. PYTHON is the
interpreter of an environment with the original; without one, only our side is timed. The original
requires a package that Python 3.7 and later cannot install, so that it is installed without its
dependencies:

    python -m venv original
    original/bin/pip install --no-deps noisytest==0.0.1
    original/bin/pip install tensorflow scikit-learn toml

Each side is a process of its own, started anew for each repeat, and the two take turns at each
task, so that a slower machine affects both. CPU time is that of all threads (TensorFlow chooses
their number, BLAS has one); imports are separate. Both sides take their settings from the
configuration, and their results are compared.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Any, TypeAlias

from benchmarks.checkouts import standin
from benchmarks.table import Given, LeftOutError, Row

Found: TypeAlias = dict[str, dict[str, list[dict[str, Any]]]]
"""Results of each repeat, by side and task: ``cpu`` and ``wall``, in [s], and ``answer``."""

REPEATS = 3
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
    """Results of all tasks; the sides take turns."""
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


def rows(given: Given) -> Iterator[Row]:
    """CPU time of each task, beside that of NoisyTest where there is one."""
    pythons = {"original": given.original} if given.original else {}
    with tempfile.TemporaryDirectory() as name:
        folder = given.noisytest or standin(Path(name) / "lola")
        if folder is None:
            raise LeftOutError("needs a data set in NoisyTest's form: --noisytest FOLDER")
        found = race({**pythons, "ours": sys.executable}, folder, REPEATS)
    there = found.get("original", {})
    for task, title in {"import": "import", **TASKS}.items():
        theirs = there.get(INSTEAD.get(task, task))
        name, other = f"NoisyTest's: {title}", theirs and _median(theirs)
        yield Row(name, _median(found["ours"][task]), "NoisyTest 0.0.1", other or None)
    if there:
        print(agreement(found), file=sys.stderr)


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


def _median(repeats: list[dict[str, Any]]) -> float:
    return median(each["cpu"] for each in repeats)
