"""Compare noises, features and scores of two checkouts bit for bit.

    python benchmarks/checkouts.py --before OLD_CHECKOUT [--after .] [--runs demo my_run.npz …]
        [--python-before PYTHON] [--python-after PYTHON] [--output build/checkouts]

The same probe runs in each checkout, by that checkout's Python: its `.venv`, or this one if it has
none. Inputs are the demo run, simulated runs of four robots (simulated once, in the checkout
AFTER), and the stand-in for NoisyTest's data set, where `../shared/tools/standin_lola.py` is at
hand. Compared are the simplified noise, the extended noise of each link, and, for each model file
that BEFORE ships, which both read, features, decisions and scores of all frames; of two runs also
the simulated run file. On the stand-in, a model of each kind is trained, and its decisions and
scores are compared. Labels and findings are not compared: the rule that makes them of scores
changes from 0.1 to 0.2.

`docs/renamed.csv` says what a checkout that is older than this file calls by another name. Exit
status 1 if anything differs, or if nothing was compared. Noises of all links take about 1 GB in
the output folder; inputs stay there for the next time, results are removed at the end.
"""

import argparse
import csv
import filecmp
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[1]
PROBE = ROOT / "benchmarks" / "checkoutsprobe.py"
RENAMED = ROOT / "docs" / "renamed.csv"
STANDIN = ROOT.parent / "shared" / "tools" / "standin_lola.py"

DEMO = ROOT / "assets" / "runs" / "demo.npz"

# Robot, scenario, seed and duration in [s] of a simulated run.
Case: TypeAlias = tuple[str, str, int, float]
# The simulated runs, by name.
SIMULATED: dict[str, Case] = {
    "talos-straight": ("talos", "straight", 0, 3.0),
    "talos-obstacle-toe": ("talos", "obstacle-toe", 1, 4.0),
    "talos-multisine": ("talos", "multisine-60-100", 2, 3.0),
    "go2-straight": ("go2", "straight", 3, 3.0),
    "go2-force-jump": ("go2", "force-jump", 1, 4.0),
    "go2-reference-jump": ("go2", "reference-jump", 1, 4.0),
    "panda-straight": ("panda", "straight", 0, 3.0),
    "panda-early-height": ("panda", "early-height", 1, 4.0),
    "panda-limit-cycle": ("panda", "limit-cycle", 1, 4.0),
    "solo12-straight": ("solo12", "straight", 1, 3.0),
    "solo12-decalibrated": ("solo12", "decalibrated", 1, 4.0),
    "solo12-multisine": ("solo12", "multisine-30-40", 2, 3.0),
}
SHIPPED = ("demo", "lola", *SIMULATED)  # what is compared unless runs are named
TASKS = ("simulate", "runs", "logs", "train", "models")  # what a probe is given, each by name
AGAIN = ("panda-early-height", "go2-force-jump")  # runs that both checkouts simulate


@dataclass(frozen=True)
class Checkout:
    """A checkout and the Python that runs it."""

    folder: Path
    python: Path
    scratch: Path

    @classmethod
    def of(cls, folder: Path, python: Path | None, scratch: Path) -> "Checkout":
        """Describe a checkout; its Python is that of its `.venv` unless given, or this one.

        What an earlier call has left in its cache is removed: other code may have computed it.
        """
        own = folder.resolve() / ".venv" / "bin" / "python"
        python = python or (own if own.exists() else Path(sys.executable))
        shutil.rmtree(scratch / "cache", ignore_errors=True)
        return cls(folder.resolve(), python.absolute(), scratch)

    @property
    def models(self) -> dict[str, Path]:
        """The model files that it ships, by name."""
        places = ("assets/models/*.npz", "models/*.npz")
        found = (path for place in places for path in self.folder.glob(place))
        return {path.stem: path for path in sorted(found)}

    @property
    def renamed(self) -> dict[str, str]:
        """Its names by those of this version; nothing of a checkout with the new layout."""
        return {} if self._nested else {new: old for old, new in reversed(names()) if new}

    @property
    def _nested(self) -> bool:
        """Whether the classifier is a package of a name of its own, in `models/`."""
        return (self.folder / "models" / "noiseclassifier").is_dir()

    @property
    def _paths(self) -> list[Path]:
        return [self.folder, *([self.folder / "models"] if self._nested else [])]

    @property
    def environment(self) -> dict[str, str]:
        """Variables of its processes: its own code and caches, one thread."""
        return os.environ | {
            "PYTHONPATH": os.pathsep.join(map(str, self._paths)),
            "PYTHONPYCACHEPREFIX": str(self.scratch / "bytecode"),
            "PYTHONDONTWRITEBYTECODE": "",
            "XDG_CACHE_HOME": str(self.scratch / "cache"),
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
        }

    def probe(self, output: Path, **job: Mapping[str, object]) -> None:
        """Compute results in this checkout."""
        output.mkdir(parents=True)
        tasks = {task: job.get(task, {}) for task in TASKS}
        place = {"checkout": self.folder, "output": output, "renamed": self.renamed}
        file = output.with_suffix(".json")
        file.write_text(json.dumps({**place, **tasks}, default=str))
        done = subprocess.run(
            [self.python, "-P", PROBE, file], cwd=self.folder, env=self.environment, check=False
        )
        if done.returncode:
            raise SystemExit(f"the probe failed in {self.folder} (exit {done.returncode})")


@dataclass(frozen=True)
class Comparison:
    """One result of both checkouts."""

    item: str
    contents: str
    differences: tuple[str, ...] = ()

    def __str__(self) -> str:
        word = "different" if self.differences else "same"
        return f"{word:9}  {self.item}: {'; '.join(self.differences) or self.contents}"


def names() -> list[tuple[str, str]]:
    """Old and new dotted name of each row of the list of renamed names."""
    with RENAMED.open(newline="") as file:
        return [(row["old"], row["new"]) for row in csv.DictReader(file)]


def compare(before: Path, after: Path) -> list[Comparison]:
    """Compare two folders of results, file by file."""
    found = {path.relative_to(side) for side in (before, after) for path in side.rglob("*.npz")}
    return [_compare_files(path, before / path, after / path) for path in sorted(found)]


def _compare_files(path: Path, before: Path, after: Path) -> Comparison:
    item = f"{path.parent}, {path.stem}"
    for side, there in (("before", before), ("after", after)):
        if not there.exists():
            return Comparison(item, "", (f"not computed by the checkout {side}",))
    with np.load(before, allow_pickle=False) as old, np.load(after, allow_pickle=False) as new:
        one, other = dict(old), dict(new)
    contents = ", ".join(f"{name} {array.shape}" for name, array in other.items())
    differences = [
        f"array {name} is in one of them only" for name in sorted(one.keys() ^ other.keys())
    ]
    both = {name: difference(array, other[name]) for name, array in one.items() if name in other}
    differences += [f"{name}: {text}" for name, text in both.items() if text]
    if not differences and not filecmp.cmp(before, after, shallow=False):
        differences.append("all arrays are the same, the files are not")
    return Comparison(item, contents, tuple(differences))


def difference(before: NDArray[np.generic], after: NDArray[np.generic]) -> str:
    """Phrase that says how two arrays differ, bit for bit; empty if they do not."""
    if (before.dtype, before.shape) != (after.dtype, after.shape):
        return f"{before.dtype} {before.shape} before, {after.dtype} {after.shape} after"
    if before.tobytes() == after.tobytes():
        return ""
    if before.dtype.kind != "f":
        return f"{np.sum(before != after)} of {before.size} values differ"
    bits = f"u{before.dtype.itemsize}"
    one, other = (np.ascontiguousarray(each) for each in (before, after))
    count = np.sum(one.view(bits) != other.view(bits))
    largest = np.nanmax(np.append(np.abs(one - other).ravel(), 0.0))
    return f"{count} of {before.size} values differ, by at most {largest:.3g}"


def closing(found: Sequence[Comparison]) -> tuple[str, int]:
    """Closing line and exit status: 0 only if something was compared and nothing differs."""
    different = sum(bool(each.differences) for each in found)
    if not found:
        return "nothing was compared", 1
    same = len(found) - different
    return f"{len(found)} compared: {same} the same, {different} different", int(different > 0)


def standin(folder: Path) -> Path | None:
    """Folder of the stand-in for NoisyTest's data set, made if need be; None without its maker."""
    if not folder.exists() and STANDIN.exists():
        fresh = folder.with_suffix(".part")
        shutil.rmtree(fresh, ignore_errors=True)
        subprocess.run([sys.executable, STANDIN, fresh], check=True, stdout=subprocess.DEVNULL)
        fresh.rename(folder)
    return folder if folder.exists() else None


def simulated(checkout: Checkout, folder: Path, cases: Mapping[str, Case]) -> dict[str, Path]:
    """Run files of simulated runs, by name; those that the folder lacks are simulated."""
    files = {name: folder / name / "simulated run.npz" for name in cases}
    for name in [name for name, file in files.items() if not file.exists()]:
        fresh = folder.with_suffix(".part")
        shutil.rmtree(fresh, ignore_errors=True)
        checkout.probe(fresh, simulate={name: cases[name]})
        folder.mkdir(parents=True, exist_ok=True)
        (fresh / name).rename(folder / name)
    return files


def compare_checkouts(
    before: Checkout, after: Checkout, folder: Path, wanted: Sequence[str]
) -> list[Comparison]:
    """Compute everything in both checkouts, and compare it."""
    chosen = {name: case for name, case in SIMULATED.items() if name in wanted}
    runs = simulated(after, folder / "runs", chosen)
    runs |= {"demo": DEMO} if "demo" in wanted else {}
    given = [Path(name).resolve() for name in wanted if name not in SHIPPED]
    runs |= {path.stem: path for path in given}
    logs: dict[str, Path] = {}
    train: dict[str, Path] = {}
    if "lola" in wanted:
        if lola := standin(folder / "lola"):
            paths = sorted(lola.glob("*/*.log"))
            logs = {f"lola/{path.parent.name}/{path.stem}": path for path in paths}
            train = {"lola": lola}
        else:
            print(f"skipped    lola: its maker is not there ({STANDIN})")
    simulate = {name: SIMULATED[name] for name in AGAIN if name in wanted}
    tasks = (simulate, runs, logs, train, before.models)
    for side, checkout in (("before", before), ("after", after)):
        shutil.rmtree(folder / side, ignore_errors=True)
        checkout.probe(folder / side, **dict(zip(TASKS, tasks, strict=True)))
    versions = [(folder / side / "versions.json").read_text() for side in ("before", "after")]
    if versions[0] != versions[1]:
        print(f"caution    not the same packages: {versions[0]} before, {versions[1]} after")
    found = compare(folder / "before", folder / "after")
    for side in ("before", "after"):
        shutil.rmtree(folder / side)
    return found


def main() -> int:
    """Compare, print a line for each item, and return the exit status."""
    arguments = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    arguments.add_argument("--before", type=Path, required=True, metavar="FOLDER")
    arguments.add_argument("--after", type=Path, default=ROOT, metavar="FOLDER")
    arguments.add_argument("--python-before", type=Path, metavar="PYTHON")
    arguments.add_argument("--python-after", type=Path, metavar="PYTHON")
    arguments.add_argument(
        "--runs", nargs="+", default=SHIPPED, help=f"of {', '.join(SHIPPED)}, or run files"
    )
    arguments.add_argument("--output", type=Path, default=ROOT / "build" / "checkouts")
    given = arguments.parse_args()
    if unknown := [name for name in given.runs if name not in SHIPPED and not Path(name).is_file()]:
        arguments.error(f"no run file {', '.join(unknown)}; known by name: {', '.join(SHIPPED)}")
    folder = given.output.resolve()
    before = Checkout.of(given.before, given.python_before, folder / "scratch" / "before")
    after = Checkout.of(given.after, given.python_after, folder / "scratch" / "after")
    found = compare_checkouts(before, after, folder, given.runs)
    line, status = closing(found)
    print(*found, line, sep="\n")
    return status


if __name__ == "__main__":
    sys.exit(main())
