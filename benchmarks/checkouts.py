"""Compare noises, features and scores of two checkouts bit for bit.

    python benchmarks/checkouts.py --before OLD_CHECKOUT [--after .] [--runs demo my_run.npz …]
        [--output build/checkouts]

Each checkout computes by its own code, in the Python of its `.venv`, or in this one. Inputs are the
demo run and simulated runs of four robots, which the checkout AFTER simulates once. Compared are
the simplified noise, the extended noise of each link, and, for each model file that BEFORE ships,
features, decisions and scores of all frames; of two runs also the simulated run file. Labels and
findings are not compared: the rule that makes them of scores changes from 0.6 to 0.7.

Exit status 1 if anything differs, or if nothing was compared. Noises of all links take about 1 GB
in the output folder; simulated runs stay there for the next time.
"""

import argparse
import filecmp
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[1]
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
SHIPPED = ("demo", *SIMULATED)  # what is compared unless runs are named
AGAIN = ("panda-early-height", "go2-force-jump")  # runs that both checkouts simulate
KINDS = ("paper", "normal")  # kinds of the extended noise that are compared
CHUNK = 64  # frames whose features are computed at once


# --- a checkout, and what it computes


@dataclass(frozen=True)
class Checkout:
    """A checkout and where its processes keep their caches."""

    folder: Path
    scratch: Path

    @classmethod
    def of(cls, folder: Path, scratch: Path) -> "Checkout":
        """A checkout without what an earlier call left in its cache: other code computed it."""
        shutil.rmtree(scratch / "cache", ignore_errors=True)
        return cls(folder.resolve(), scratch)

    @property
    def python(self) -> Path:
        """The Python of its `.venv`, or this one."""
        own = self.folder / ".venv" / "bin" / "python"
        return own if own.exists() else Path(sys.executable)

    @property
    def models(self) -> dict[str, Path]:
        """The model files that it ships, by name."""
        places = ("assets/models/*.npz", "models/*.npz")
        found = (path for place in places for path in self.folder.glob(place))
        return {path.stem: path for path in sorted(found)}

    @property
    def environment(self) -> dict[str, str]:
        """Variables of its processes: its own code and caches, one thread."""
        paths = [self.folder]
        if (self.folder / "models" / "noiseclassifier").is_dir():  # from 0.7 on
            paths.append(self.folder / "models")
        return os.environ | {
            "PYTHONPATH": os.pathsep.join(map(str, paths)),
            "PYTHONPYCACHEPREFIX": str(self.scratch / "bytecode"),
            "PYTHONDONTWRITEBYTECODE": "",
            "XDG_CACHE_HOME": str(self.scratch / "cache"),
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
        }

    def compute(
        self,
        output: Path,
        *,
        cases: Mapping[str, Case],
        runs: Mapping[str, Path] | None = None,
        models: Mapping[str, Path] | None = None,
    ) -> None:
        """Simulate cases and look at runs in this checkout."""
        output.mkdir(parents=True)
        job = {"checkout": self.folder, "output": output, "cases": cases}
        job |= {"runs": runs or {}, "models": models or {}}
        file = output.with_suffix(".json")
        file.write_text(json.dumps(job, default=str))
        command = [self.python, "-P", __file__, "--compute", file]
        done = subprocess.run(command, cwd=self.folder, env=self.environment, check=False)
        if done.returncode:
            raise SystemExit(f"{self.folder} computes nothing (exit {done.returncode})")


def computed(job: Mapping[str, Any]) -> None:
    """Do a job in the process of a checkout: a file `<output>/<run>/<what>.npz` of each result."""
    folder = Path(job["checkout"])
    names = ("noisemodel", "models", "scenarios")  # up to 0.6
    if (folder / "models" / "noiseclassifier").is_dir():
        names = ("noisemodel", "noiseclassifier", "noiseclassifier.scenarios")
    for name in names:
        found = Path(str(import_module(name).__file__)).resolve()
        if not found.is_relative_to(folder):
            raise SystemExit(f"{name} is {found}, not of {folder}")
    nm, nc, scenarios = map(import_module, names)
    output = Path(job["output"])
    for name, (robot, scenario, seed, duration) in job["cases"].items():
        (output / name).mkdir(parents=True, exist_ok=True)
        run = scenarios.simulate(robot, scenario, seed, duration=duration)
        run.save(output / name / "simulated run.npz")
    models = {name: nc.load(path) for name, path in job["models"].items()}
    for name, path in job["runs"].items():
        run = nm.Run.load(path)
        results = {"simplified noise": {"noise": nm.simplified(run.motion, run.velocity_desired)}}
        results |= _link_noise(nm, run)
        for model, found in models.items():
            results[model] = _scores(nm, nc, run, found)
        (output / name).mkdir(parents=True, exist_ok=True)
        for what, arrays in results.items():
            if arrays:
                np.savez(output / name / f"{what}.npz", **arrays)


def _link_noise(nm: Any, run: Any) -> dict[str, dict[str, Any]]:
    """The extended noise of a run that has a robot and positions."""
    if run.robot not in nm.ROBOTS or run.position is None:
        return {}
    floating = True if run.base_pose is not None else None
    robot = nm.Robot.load(run.robot, floating_base=floating)
    surface, (q, v) = nm.Surface.of(robot), robot.configuration(run)
    q_desired, v_desired = robot.desired(run) or (None, None)
    return {
        f"extended noise, {kind}": {
            "power": nm.extended(
                robot, surface, q, v, kind, q_desired=q_desired, v_desired=v_desired
            ).power
        }
        for kind in KINDS
    }


def _scores(nm: Any, nc: Any, run: Any, model: Any) -> dict[str, Any]:
    """Features and decisions of all frames, and scores as `classify` gives them.

    The run is decimated to the rate of a model of one rate; a run that is slower, or lacks signals,
    has none. Of a model with a reference, features and decisions are those without it.
    """
    signals = {**nm.norms(run), **nm.by_joint(run)}
    classifier = model.at(run.rate, signals) if hasattr(model, "recipe") else model
    profile = classifier.profile
    if run.rate < profile.rate * (1 - 1e-3):
        return {}
    if run.rate > profile.rate * (1 + 1e-3):
        run = nm.decimated(run, profile.rate)
        signals = {**nm.norms(run), **nm.by_joint(run)}
    if not set(profile.signals) <= set(signals):
        return {}
    given = {one: signals[one] for one in profile.signals}
    rows = np.vstack(list(given.values()))
    signal = rows if len(rows) > 1 else rows[0]
    frames = nc.frame(signal, length=profile.length, hop=profile.hop)
    parts = np.split(frames, range(CHUNK, len(frames), CHUNK))
    features = np.concatenate([nc.features(one, profile) for one in parts])
    labels = classifier.classify(given, profile.rate, valid=run.valid)
    kept = {"signals": rows, "features": features, "decisions": classifier.decide(features)}
    return kept | {"start": labels.start, "stop": labels.stop, "scores": labels.scores}


# --- two folders of results


def compare(before: Path, after: Path) -> list[str]:
    """A line for each file of two folders of results: "same" or "different", and in what."""
    found = {path.relative_to(side) for side in (before, after) for path in side.rglob("*.npz")}
    return [_compare_files(path, before / path, after / path) for path in sorted(found)]


def _compare_files(path: Path, before: Path, after: Path) -> str:
    item = f"{path.parent}, {path.stem}"
    for side, there in (("before", before), ("after", after)):
        if not there.exists():
            return f"different  {item}: not computed by the checkout {side}"
    with np.load(before, allow_pickle=False) as old, np.load(after, allow_pickle=False) as new:
        one, other = dict(old), dict(new)
    differences = [
        f"array {name} is in one of them only" for name in sorted(one.keys() ^ other.keys())
    ]
    both = {name: difference(array, other[name]) for name, array in one.items() if name in other}
    differences += [f"{name}: {text}" for name, text in both.items() if text]
    if not differences and not filecmp.cmp(before, after, shallow=False):
        differences.append("all arrays are the same, the files are not")
    if differences:
        return f"different  {item}: {'; '.join(differences)}"
    contents = ", ".join(f"{name} {array.shape}" for name, array in other.items())
    return f"same       {item}: {contents}"


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


def closing(found: Sequence[str]) -> tuple[str, int]:
    """Closing line and exit status: 0 only if something was compared and nothing differs."""
    different = sum(line.startswith("different") for line in found)
    if not found:
        return "nothing was compared", 1
    same = len(found) - different
    return f"{len(found)} compared: {same} the same, {different} different", int(different > 0)


def compare_checkouts(
    before: Checkout, after: Checkout, folder: Path, wanted: Sequence[str]
) -> list[str]:
    """Compute everything in both checkouts, and compare it."""
    runs = {Path(name).stem: Path(name).resolve() for name in wanted if name not in SHIPPED}
    runs |= {"demo": DEMO} if "demo" in wanted else {}
    for name in (name for name in SIMULATED if name in wanted):
        runs[name] = folder / "runs" / name / "simulated run.npz"
        if not runs[name].exists():
            shutil.rmtree(folder / "fresh", ignore_errors=True)
            after.compute(folder / "fresh", cases={name: SIMULATED[name]})
            (folder / "runs").mkdir(exist_ok=True)
            (folder / "fresh" / name).rename(folder / "runs" / name)
    cases = {name: SIMULATED[name] for name in AGAIN if name in wanted}
    sides = {before: folder / "before", after: folder / "after"}
    for checkout, output in sides.items():
        shutil.rmtree(output, ignore_errors=True)
        checkout.compute(output, cases=cases, runs=runs, models=before.models)
    found = compare(*sides.values())
    for output in sides.values():
        shutil.rmtree(output)
    return found


def main() -> int:
    """Compare, print a line for each item, and return the exit status."""
    arguments = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    arguments.add_argument("--before", type=Path, metavar="FOLDER")
    arguments.add_argument("--after", type=Path, default=ROOT, metavar="FOLDER")
    arguments.add_argument(
        "--runs", nargs="+", default=SHIPPED, help=f"of {', '.join(SHIPPED)}, or run files"
    )
    arguments.add_argument("--output", type=Path, default=ROOT / "build" / "checkouts")
    arguments.add_argument("--compute", type=Path, help=argparse.SUPPRESS)  # in a checkout
    given = arguments.parse_args()
    if given.compute:
        computed(json.loads(given.compute.read_text()))
        return 0
    if given.before is None:
        arguments.error("name the older checkout with --before")
    if unknown := [name for name in given.runs if name not in SHIPPED and not Path(name).is_file()]:
        arguments.error(f"no run file {', '.join(unknown)}; known by name: {', '.join(SHIPPED)}")
    folder = given.output.resolve()
    before = Checkout.of(given.before, folder / "scratch" / "before")
    after = Checkout.of(given.after, folder / "scratch" / "after")
    found = compare_checkouts(before, after, folder, given.runs)
    line, status = closing(found)
    print(*found, line, sep="\n")
    return status


if __name__ == "__main__":
    sys.exit(main())
