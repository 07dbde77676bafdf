"""Time labels of a noise signal that comes in, on one core.

    python benchmarks/stream.py [--seconds 20] [--turns 9]

For each model that ships and several sizes of chunks: how much faster than real time signals are
taken, and how long it takes from the sample that completes a frame to the frame's label. Rows take
turns, since a machine with other work to do is half as fast for seconds at a time: given are the
medians over all turns and, behind a slash, those of the best turn.
"""

import argparse
import os
import time
from collections import defaultdict
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import numpy as np

import models

MODELS = Path(__file__).parents[1] / "assets" / "models"


def measure(classifier: models.Classifier, signals: np.ndarray, chunk: int) -> tuple[float, ...]:
    """Push signals, shape (signals, samples).

    CPU time in all, then the median and the 99th percentile for a label, in [s].
    """
    stream, wall = models.Stream(classifier), []
    begun = time.process_time()
    for first in range(0, signals.shape[1], chunk):
        piece = signals[:, first : first + chunk]
        samples = dict(zip(classifier.profile.signals, piece, strict=True))
        start = time.perf_counter()
        if len(stream.push(samples)):
            wall.append(time.perf_counter() - start)
    whole = time.process_time() - begun
    return whole, *np.percentile(wall, [50, 99])


def main() -> None:
    """Measure and print."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--seconds", type=float, default=20.0)
    arguments.add_argument("--turns", type=int, default=9)
    options = arguments.parse_args()
    classifiers = {path.stem: models.Classifier.load(path) for path in sorted(MODELS.glob("*.npz"))}
    random, found = np.random.default_rng(0), defaultdict(list)
    for _ in range(options.turns):
        for name, classifier in classifiers.items():
            rate, shape = classifier.rate, (len(classifier.profile.signals), -1)
            noise = random.standard_normal(round(options.seconds * rate) * shape[0])
            signals = 1.0 + 0.1 * noise.reshape(shape)
            for chunk in sorted({1, round(rate / 100), classifier.profile.hop}):
                part = signals if chunk > 1 else signals[:, : signals.shape[1] // 10]
                whole, *times = measure(classifier, part, chunk)
                ratio = part.shape[1] / rate / whole
                found[name, chunk].append((ratio, *(1e3 * each for each in times)))
            begun = time.process_time()
            classifier.classify(dict(zip(classifier.profile.signals, signals, strict=True)), rate)
            ratio = options.seconds / (time.process_time() - begun)
            found[name, "whole"].append((ratio, np.nan, np.nan))
    print(f"{'model':14} {'chunk':>6} {'x real time':>12} {'label: median, 99 % [ms]':>30}")
    for (name, chunk), turns in found.items():
        ratio, *times = np.median(turns, axis=0)
        most, *least = np.max(turns, axis=0)[0], *np.min(turns, axis=0)[1:]
        print(f"{name:14} {chunk:>6} {ratio:5.0f} / {most:4.0f}", end="")
        for usual, best in zip(times, least, strict=True):
            print("" if np.isnan(best) else f" {usual:7.3f} / {best:5.3f}", end="")
        print()


if __name__ == "__main__":
    main()
