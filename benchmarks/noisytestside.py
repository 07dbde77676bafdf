"""One side of `noisytest.py`: does the tasks named on standard input, and times them.

    python -I benchmarks/noisytestside.py original FOLDER

It has tasks for NoisyTest 0.0.1 and for ours, and imports only the one given. The folder of this
file must not be on the path (``-I``, ``-P``): a module there has the name of its package.
"""

import json
import os
import sys
import time
from collections.abc import Callable
from itertools import cycle, islice
from pathlib import Path
from typing import Any

FILE = "earlycontacttoe.log"  # the file of the validation set that is labelled; a recording of 10 s
HOPS = 100
POINTS = 3  # points of the grid that are trained and measured by themselves
FILES = 50  # files of a folder; NoisyTest's data set has 32, the first ones come twice
TIMES = {
    "hop": HOPS,
    "hop, stream": HOPS,
    "hop, general": HOPS,
    "point": POINTS,
    "folder": FILES,
    "folder, general": FILES,
}
"""Repetitions of a task per call."""


def files(folder: Path) -> list[Path]:
    """The logs of all sets, in order, `FILES` of them."""
    return list(islice(cycle(sorted(folder.glob("*/*.log"))), FILES))


class Original:
    """NoisyTest 0.0.1, through its own pipeline, as its command line uses it."""

    def __init__(self, folder: Path) -> None:
        """Import the modules that its commands import."""
        os.environ["TF_CPP_MIN_LOG_LEVEL"] = "3"
        from copy import deepcopy

        import tensorflow
        from noisytest.pipeline import DefaultPipeline

        self._tensor, self._copied, self._folder = tensorflow.constant, deepcopy, folder
        with (folder / "noisytest-config.json").open() as config:
            self._pipeline = DefaultPipeline(config)

    def tasks(self) -> dict[str, Callable[[], Any]]:
        """The tasks, by name."""
        return {
            "train": self._train,
            "prepare": self._prepare,
            "file": self._label,
            "folder": self._label_all,
            "hop": self._hop,
            "point": self._point,
        }

    def _train(self) -> float:
        paths = [str(self._folder / name) for name in ("training", "validation")]
        self._sets = self._pipeline.load_training_data(*paths)
        return self._point(1)

    def _prepare(self) -> None:
        read = self._pipeline.load_prediction_data(str(self._folder / "validation" / FILE))
        self._windows = read.noise_estimate.numpy()
        self._hop(1)

    def _label(self) -> list[int]:
        _, labels = self._pipeline.test(str(self._folder / "validation" / FILE))
        return [round(label) for label in labels.tolist()]

    def _label_all(self) -> int:
        return sum(len(self._pipeline.test(str(path))[1]) for path in files(self._folder))

    def _hop(self, count: int = HOPS) -> None:
        for index in range(count):
            window = self._tensor(self._windows[index % len(self._windows)][None])
            features = self._pipeline.feature_preprocessor.prepare_data(window)
            self._pipeline.model.predict(features)

    def _point(self, count: int = POINTS) -> float:
        for _ in range(count):  # training changes its input, so that its search copies it too
            error = self._pipeline.learn(*self._copied(self._sets))
        return float(error.subset_accuracy)


class Ours:
    """The profile that follows NoisyTest decision by decision."""

    def __init__(self, folder: Path) -> None:
        """Import the modules that training and labelling import."""
        import sklearn.svm  # noqa: F401

        import noiseclassifier as nc

        self._models, self._folder = nc, folder
        self._profile = nc.Profile.noisytest()

    def tasks(self) -> dict[str, Callable[[], Any]]:
        """The tasks, by name."""
        return {
            "train": self._train,
            "prepare": self._prepare,
            "file": self._label,
            "folder": lambda: self._label_all({"trained": self._classifier}),
            "folder, general": lambda: self._label_all({"general": self._shipped}),
            "hop": self._hop,
            "hop, stream": lambda: self._push(self._classifier),
            "hop, general": lambda: self._push(self._general),
            "point": self._point,
            "points": self._points,
        }

    def _train(self) -> float:
        read, profile = self._models.Dataset.read, self._profile
        self._sets = [
            read(self._folder / name, profile, training=name == "training")
            for name in ("training", "validation")
        ]
        return self._point(1)

    def _prepare(self) -> None:
        nc, profile = self._models, self._profile
        shipped = Path(__file__).parents[1] / "models" / "general.npz"
        self._shipped = nc.load(shipped)
        self._general = self._shipped.at(profile.rate)
        _, self._noise = nc.read_log(self._folder / "validation" / FILE)
        self._windows = nc.frame(self._noise[1:], length=profile.length, hop=profile.hop)
        self._recordings = [
            list(nc.noisytest.read_folder(self._folder / name, rate=profile.rate))
            for name in ("training", "validation")
        ]
        self._hop(1)

    def _label(self) -> list[int]:
        _, noise = self._models.read_log(self._folder / "validation" / FILE)
        labels = self._classifier.classify(noise, self._profile.rate)
        return [self._classifier.classes.index(label) for label in labels.label.tolist()]

    def _hop(self, count: int = HOPS) -> None:
        for index in range(count):
            self._classifier.predict(self._windows[index % len(self._windows)][None])

    def _label_all(self, library: dict[str, Any]) -> int:
        """What `inspector classify` does: findings with onset and end."""
        from inspector.verdict import classify_files

        verdicts = list(classify_files(files(self._folder), library))
        assert all(verdict.model for verdict in verdicts)
        return sum(len(verdict.events) for verdict in verdicts)

    def _push(self, classifier: Any) -> None:
        """Push hops; those before the first complete frame cost less."""
        stream, hop = self._models.Stream(classifier), classifier.profile.hop
        for index in range(HOPS):
            first = index * hop % (len(self._noise) - hop)
            stream.push(self._noise[first : first + hop])

    def _point(self, count: int = POINTS) -> float:
        known, fresh = self._sets
        for _ in range(count):
            self._classifier = self._models.Classifier.train(known, self._profile, validation=fresh)
        return float(self._classifier.metrics["validation"]["subset_accuracy"])

    def _points(self) -> int:
        """Measure all points of the paper's grid with one stride; their number."""
        from noiseclassifier.tuning import Grid, Trial, measure

        grid = Grid.of(["paper"], self._profile.kernel).profiles(self._profile)
        points = [point for point in grid if point.stride == self._profile.stride]
        return len(measure(points, Trial.against(*self._recordings)))


def serve(side: type[Original] | type[Ours], folder: Path) -> None:
    """Do the tasks named on standard input, line by line."""
    output, sys.stdout = sys.stdout, sys.stderr  # a library may print

    def report(started: tuple[float, float], times: int, answer: Any) -> None:
        wall, cpu = time.perf_counter() - started[0], time.process_time() - started[1]
        print(json.dumps({"wall": wall / times, "cpu": cpu / times, "answer": answer}), file=output)
        output.flush()

    started = time.perf_counter(), time.process_time()
    tasks = side(folder).tasks()
    report(started, 1, sorted(tasks))
    for line in sys.stdin:
        name = line.strip()
        started = time.perf_counter(), time.process_time()
        answer = tasks[name]()
        report(started, answer if name == "points" else TIMES.get(name, 1), answer)


if __name__ == "__main__":
    serve({"original": Original, "ours": Ours}[sys.argv[1]], Path(sys.argv[2]))
