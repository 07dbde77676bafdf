"""Time the labels of a noise signal, streamed and whole, on one core.

    python benchmarks/stream.py [--seconds 20] [--turns 9]

For the shipped model at three rates, joint by joint with 12 joints, by norms and by the noise
alone, in chunks of a sample, 1 ms, 20 ms and a hop, and whole: the ratio to real time, and the
latency from the sample that completes a frame to its label; of a whole signal, the time that each
label takes. Rows take turns, since a busy machine is half as fast for seconds at a time: printed
are the medians over all turns and, after a slash, those of the best turn.
"""

import argparse
import os
import time
from collections import defaultdict
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import numpy as np

import models
from models.signals import JOINTS, MOTION, NOISE, by_joint

MODEL = Path(__file__).parents[1] / "assets" / "models" / "general.npz"
RATES = (125.0, 1000.0, 10_000.0)
"""Rates of the signals, in [Hz]."""
INPUTS = {"joints": (*MOTION, *JOINTS), "norms": MOTION, "noise": (NOISE,)}
MANY = 12
"""Number of joints, that of a quadruped."""


def measure(
    classifier: models.Classifier, signals: dict[str, np.ndarray], chunk: int
) -> tuple[float, ...]:
    """Push signals by name, shape (samples,) or (joints, samples).

    Returns:
        Total CPU time, then the median and the 99th percentile of the latency, in [s].
    """
    stream, wall = models.Stream(classifier, joints=MANY), []
    count = next(iter(signals.values())).shape[-1]
    start_cpu = time.process_time()
    for first in range(0, count, chunk):
        samples = {name: each[..., first : first + chunk] for name, each in signals.items()}
        start = time.perf_counter()
        if len(stream.push(samples)):
            wall.append(time.perf_counter() - start)
    whole = time.process_time() - start_cpu
    return whole, *np.percentile(wall, [50, 99])


def main() -> None:
    """Measure and print."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--seconds", type=float, default=20.0)
    arguments.add_argument("--turns", type=int, default=9)
    options = arguments.parse_args()
    general = models.load(MODEL)
    assert isinstance(general, models.General)
    classifiers = {
        f"{name}, {rate:g} Hz": general.at(rate, signals)
        for name, signals in INPUTS.items()
        for rate in RATES
    }
    random, found = np.random.default_rng(0), defaultdict(list)
    for _ in range(options.turns):
        for name, classifier in classifiers.items():
            rate, count = classifier.rate, round(options.seconds * classifier.rate)
            signals = {
                signal: 1.0 + 0.1 * random.standard_normal((MANY,) * by_joint(signal) + (count,))
                for signal in classifier.profile.signals
            }
            for chunk in sorted({max(1, round(rate * each)) for each in (0.0, 0.001, 0.02, 0.1)}):
                part = count if chunk > rate / 500 else count // 10
                some = {signal: each[..., :part] for signal, each in signals.items()}
                whole, *times = measure(classifier, some, chunk)
                found[name, chunk].append((part / rate / whole, *(1e3 * each for each in times)))
            start_cpu = time.process_time()
            labels = classifier.classify(signals, rate)
            taken = time.process_time() - start_cpu
            found[name, "whole"].append((options.seconds / taken, 1e3 * taken / len(labels)))
    print(f"{'input':16} {'chunk':>6} {'x real time':>12} {'label: median, 99 % [ms]':>30}")
    for (name, chunk), turns in found.items():
        ratio, *times = np.median(turns, axis=0)
        most, *least = np.max(turns, axis=0)[0], *np.min(turns, axis=0)[1:]
        print(f"{name:16} {chunk:>6} {ratio:5.0f} / {most:4.0f}", end="")
        for typical, best in zip(times, least, strict=True):
            print(f" {typical:7.3f} / {best:5.3f}", end="")
        print()


if __name__ == "__main__":
    main()
