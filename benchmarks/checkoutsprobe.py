"""Results of one checkout: what `checkouts.py` compares. Run by it, in the checkout's own Python.

    python -P checkoutsprobe.py JOB.json

The job names the checkout, what to compute and where results go. Names are those of the newer
version; a job for an older one says what they are called there. Every result is a file
`<output>/<run>/<what>.npz` of plain arrays.
"""

import importlib
import json
import sys
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

KINDS = ("paper", "normal")  # kinds of the extended noise that are computed
# Libraries whose versions may change results.
PACKAGES = ("numpy", "scipy", "scikit-learn", "pin", "mujoco")
RATE = 10000.0  # sample rate of NoisyTest's data set, in [Hz]
CHUNK = 64  # frames whose features are computed at once


def older(name: str, renamed: Mapping[str, str]) -> str:
    """Old name of what a newer version calls by a dotted name."""
    parts = name.split(".")
    for stop in range(len(parts), 0, -1):
        if (head := ".".join(parts[:stop])) in renamed:
            return ".".join((renamed[head], *parts[stop:]))
    return name


def resolve(name: str) -> Any:
    """Module, class, function, attribute or dataclass field of a dotted name."""
    first, *rest = name.split(".")
    found, path = importlib.import_module(first), first
    for part in rest:
        path = f"{path}.{part}"
        fields = getattr(found, "__dataclass_fields__", {})
        if part in fields:
            found = fields[part]
        elif hasattr(found, part) or not hasattr(found, "__path__"):
            found = getattr(found, part)
        else:
            try:
                found = importlib.import_module(path)
            except ModuleNotFoundError as error:
                if error.name != path:
                    raise
                raise AttributeError(f"nothing is called {path}") from error
    return found


@dataclass(frozen=True)
class Names:
    """Names of a newer version, translated for an older checkout."""

    renamed: Mapping[str, str]

    def __call__(self, name: str) -> Any:
        """Return what the checkout has under a new name; what only moved has its own there."""
        packages = {new: old for new, old in self.renamed.items() if "." not in new}
        try:
            return resolve(older(name, packages))
        except (AttributeError, ModuleNotFoundError):
            return resolve(older(name, self.renamed))

    def field(self, name: str, of: Any) -> Any:
        """Value of an attribute of an object, by the new dotted name of class and attribute."""
        return getattr(of, older(name, self.renamed).rpartition(".")[2])


class Probe:
    """One checkout at work."""

    def __init__(self, names: Names, output: Path, models: Mapping[str, str]) -> None:
        """Load the models, by the names of their files."""
        self.names, self.output = names, output
        load = names("noiseclassifier.load")
        self._models = {name: load(path) for name, path in models.items()}

    def keep(self, run: str, what: str, **arrays: Any) -> None:
        """Write one result."""
        folder = self.output / run
        folder.mkdir(parents=True, exist_ok=True)
        np.savez(folder / f"{what}.npz", **arrays)

    def simulate(self, name: str, case: list[Any]) -> None:
        """Simulate robot, scenario and seed for a duration in [s], and write the run file."""
        robot, scenario, seed, duration = case
        run = self.names("noiseclassifier.scenarios.simulate")(
            robot, scenario, seed, duration=duration
        )
        path = self.output / name / "simulated run.npz"
        path.parent.mkdir(parents=True, exist_ok=True)
        self.names("noisemodel.Run.save")(run, path)

    def look_at_run(self, name: str, path: str) -> None:
        """Compute the noises of a run, and what each model decides on it."""
        run = self.names("noisemodel.Run.load")(path)
        read = self.names.field
        velocity = read("noisemodel.Run.velocity", run)
        desired = read("noisemodel.Run.velocity_desired", run)
        motion = read("noisemodel.Run.motion", run)
        noise = self.names("noisemodel.simplified")(motion, desired)
        self.keep(name, "simplified noise", velocity=velocity, noise=noise)
        self._link_noise(name, run)
        for model in self._models:
            self._classify_run(name, run, model)

    def look_at_log(self, name: str, path: str) -> None:
        """Read one of NoisyTest's logs, and classify it by all models of the noise alone."""
        time, noise = self.names("noiseclassifier.read_log")(path)
        rate = self.names("noiseclassifier.nominal_rate")(time)
        self.keep(name, "log", time=time, noise=noise, rate=rate)
        for model in self._models:
            classifier = self._bound(model, rate, (self.names("noiseclassifier.NOISE"),))
            profile = self.names.field("noiseclassifier.Classifier.profile", classifier)
            signals = self.names.field("noiseclassifier.Profile.signals", profile)
            same_rate = (
                abs(rate / self.names.field("noiseclassifier.Profile.rate", profile) - 1) < 1e-3
            )
            if same_rate and tuple(signals) == (self.names("noiseclassifier.NOISE"),):
                self._classify(name, model, classifier, {"noise": noise}, valid=None)

    def train(self, name: str, folder: str) -> None:
        """Train each kind of model on NoisyTest's data set, and classify the validation part."""
        read = self.names("noiseclassifier.Dataset.read")
        profiles = {
            "noisytest-rbf": self.names("noiseclassifier.Profile.noisytest")("rbf"),
            "logbands": self.names("noiseclassifier.LogBands")().at(RATE),
        }
        for what, profile in profiles.items():
            training = read(Path(folder, "training"), profile)
            classifier = self.names("noiseclassifier.Classifier.train")(training, profile)
            for log in sorted(Path(folder, "validation").glob("*.log")):
                _, noise = self.names("noiseclassifier.read_log")(log)
                labels = self.names("noiseclassifier.Classifier.classify")(classifier, noise, RATE)
                self.keep(name, f"{what}, trained, {log.stem}", scores=labels.scores)

    def _link_noise(self, name: str, run: Any) -> None:
        """Compute the extended noise of a run that has a robot and positions."""
        read = self.names.field
        listed, robot_name = self.names("noisemodel.ROBOTS"), read("noisemodel.Run.robot", run)
        if robot_name not in listed or read("noisemodel.Run.position", run) is None:
            return
        floating = True if read("noisemodel.Run.base_pose", run) is not None else None
        robot = self.names("noisemodel.Robot.load")(robot_name, floating_base=floating)
        surface = self.names("noisemodel.Surface.of")(robot)
        q, v = self.names("noisemodel.Robot.configuration")(robot, run)
        desired = self.names("noisemodel.Robot.desired")(robot, run)
        q_desired, v_desired = desired or (None, None)
        for kind in KINDS:
            noise = self.names("noisemodel.extended")(
                robot, surface, q, v, kind, q_desired=q_desired, v_desired=v_desired
            )
            power = read("noisemodel.Noise.power", noise)
            self.keep(name, f"extended noise, {kind}", power=power)

    def _classify_run(self, name: str, run: Any, model: str) -> None:
        """Classify a run, at the lower rate of the model if it has one."""
        own = self.names.field("noisemodel.Run.rate", run)
        classifier = self._bound(model, own, self._signals(run))
        profile = self.names.field("noiseclassifier.Classifier.profile", classifier)
        rate = self.names.field("noiseclassifier.Profile.rate", profile)
        if own < rate * (1 - 1e-3):
            return
        if own > rate * (1 + 1e-3):
            run = self.names("noisemodel.decimated")(run, rate)
        signals = self._signals(run)
        if set(self.names.field("noiseclassifier.Profile.signals", profile)) <= set(signals):
            valid = self.names.field("noisemodel.Run.valid", run)
            self._classify(name, model, classifier, signals, valid=valid)

    def _signals(self, run: Any) -> dict[str, Any]:
        """Norms and velocities joint by joint of a run, by name."""
        return {**self.names("noisemodel.norms")(run), **self.names("noisemodel.by_joint")(run)}

    def _bound(self, model: str, rate: float, signals: Collection[str]) -> Any:
        """A model of one rate as it is, one for any rate bound to one it takes, and to signals."""
        found = self._models[model]
        if not hasattr(found, "recipe"):
            return found
        return found.at(max(rate, self.names("noiseclassifier.profile.LOWEST")), signals)

    def _classify(
        self, name: str, model: str, classifier: Any, signals: Mapping[str, Any], *, valid: Any
    ) -> None:
        """Keep features and decisions of all frames, and scores as `classify` gives them.

        Of a model with a reference, features and decisions are those without it.
        """
        profile = self.names.field("noiseclassifier.Classifier.profile", classifier)
        rate = self.names.field("noiseclassifier.Profile.rate", profile)
        wanted = self.names.field("noiseclassifier.Profile.signals", profile)
        rows = np.vstack([signals[one] for one in wanted])
        frames = self.names("noiseclassifier.frame")(
            rows if len(rows) > 1 else rows[0],
            length=self.names.field("noiseclassifier.Profile.length", profile),
            hop=self.names.field("noiseclassifier.Profile.hop", profile),
        )
        parts = np.split(frames, range(CHUNK, len(frames), CHUNK))
        features = np.concatenate(
            [self.names("noiseclassifier.features")(one, profile) for one in parts]
        )
        decisions = self.names("noiseclassifier.Classifier.decide")(classifier, features)
        given = {one: signals[one] for one in wanted}
        labels = self.names("noiseclassifier.Classifier.classify")(
            classifier, given, rate, valid=valid
        )
        self.keep(
            name,
            model,
            signals=rows,
            features=features,
            decisions=decisions,
            **{
                field: self.names.field(f"noiseclassifier.Labels.{field}", labels)
                for field in ("start", "stop", "scores")
            },
        )


def main() -> None:
    """Do the job that the only argument names."""
    job = json.loads(Path(sys.argv[1]).read_text())
    for package in ("noisemodel", "noiseclassifier", "noiseclassifier.scenarios"):
        name = older(package, job["renamed"])
        found = Path(str(importlib.import_module(name).__file__)).resolve()
        if not found.is_relative_to(Path(job["checkout"]).resolve()):
            raise SystemExit(f"{package} is imported from {found}, not from {job['checkout']}")
    probe = Probe(Names(job["renamed"]), Path(job["output"]), job["models"])
    versions = {package: metadata.version(package) for package in PACKAGES}
    (probe.output / "versions.json").write_text(json.dumps(versions))
    for name, case in job["simulate"].items():
        probe.simulate(name, case)
    for name, path in job["runs"].items():
        probe.look_at_run(name, path)
    for name, path in job["logs"].items():
        probe.look_at_log(name, path)
    for name, folder in job["train"].items():
        probe.train(name, folder)


if __name__ == "__main__":
    main()
