"""Time labels of a noise signal that comes in, on one core.

    python benchmarks/stream.py [--seconds 60]

For each model that ships and several sizes of chunks: how much faster than real time signals are
taken, and how long it takes from the sample that completes a frame to the frame's label, in wall
time and in CPU time (the one that a busy machine does not stretch).
"""

import argparse
import os
import time
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import numpy as np

import models

MODELS = Path(__file__).parents[1] / "assets" / "models"


def measure(classifier: models.Classifier, signals: np.ndarray, chunk: int) -> tuple[float, ...]:
    """Push signals, shape (signals, samples).

    CPU time in all, then medians and 99th percentiles for a label, in [s].
    """
    stream, wall, cpu = models.Stream(classifier), [], []
    begun = time.process_time()
    for first in range(0, signals.shape[1], chunk):
        piece = signals[:, first : first + chunk]
        samples = dict(zip(classifier.profile.signals, piece, strict=True))
        start, used = time.perf_counter(), time.thread_time()
        if len(stream.push(samples)):
            wall.append(time.perf_counter() - start)
            cpu.append(time.thread_time() - used)
    whole = time.process_time() - begun
    return whole, *np.percentile(wall, [50, 99]), *np.percentile(cpu, [50, 99])


def main() -> None:
    """Measure and print."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--seconds", type=float, default=60.0)
    seconds = arguments.parse_args().seconds
    print(f"{'model':14} {'chunk':>6} {'x real time':>11} {'label: wall median, 99 %':>26}", end="")
    print(f" {'CPU median, 99 % [ms]':>24}")
    for path in sorted(MODELS.glob("*.npz")):
        classifier = models.Classifier.load(path)
        rate, random = classifier.rate, np.random.default_rng(0)
        names = classifier.profile.signals
        signals = 1.0 + 0.1 * random.standard_normal((len(names), round(seconds * rate)))
        for chunk in sorted({1, round(rate / 100), classifier.profile.hop}):
            part = signals if chunk > 1 else signals[:, : signals.shape[1] // 10]
            whole, *times = measure(classifier, part, chunk)
            ratio = part.shape[1] / rate / whole
            wall, late, cpu, most = (1e3 * each for each in times)
            print(f"{path.stem:14} {chunk:6} {ratio:11.0f} {wall:19.3f} {late:6.3f}", end="")
            print(f" {cpu:17.3f} {most:6.3f}")
        begun = time.process_time()
        classifier.classify(dict(zip(names, signals, strict=True)), rate)
        print(f"{path.stem:14}  whole {seconds / (time.process_time() - begun):11.0f}")


if __name__ == "__main__":
    main()
