"""Labels of a signal by the shipped model, streamed in chunks and whole, beside real time."""

import time
from collections import defaultdict
from collections.abc import Iterator

import numpy as np

import noiseclassifier as nc
from benchmarks.table import ROOT, Row, used
from noiseclassifier.signals import BY_JOINT, JOINTS, MOTION, NOISE

RATES = (125.0, 1000.0, 10_000.0)  # rates of the signals, in [Hz]
INPUTS = {"joints": (*MOTION, *JOINTS), "norms": MOTION, "noise": (NOISE,)}
MANY = 12  # number of joints, that of a quadruped
SECONDS = 10.0
TURNS = 5
CHUNK = 0.02  # time of a chunk, in [s]
WANTED = 100.0  # times real time, in chunks and whole
MEDIAN, SLOW = 3e-4, 2e-3  # most time of a chunk that completes a frame, median and 99 %, in [s]


def rows(_: object) -> Iterator[Row]:
    """Each input and rate in chunks; of 12 joints at 1 kHz sample by sample, too, and whole."""
    general = nc.load(ROOT / "models" / "general.npz")
    assert isinstance(general, nc.General)
    cases = {
        f"labels by {name}, {rate:g} Hz": general.at(rate, signals)
        for name, signals in INPUTS.items()
        for rate in RATES
    }
    random = np.random.default_rng(0)
    found: dict[str, list[tuple[float, ...]]] = defaultdict(list)
    for _turn in range(TURNS):
        for name, classifier in cases.items():
            rate, count = classifier.rate, round(SECONDS * classifier.rate)
            signals = {
                each: 1.0 + 0.1 * random.standard_normal((MANY,) * (each in BY_JOINT) + (count,))
                for each in classifier.profile.signals
            }
            found[name].append(pushed(classifier, signals, max(1, round(CHUNK * rate))))
            if name == "labels by joints, 1000 Hz":
                found[f"{name}, sample by sample"].append(pushed(classifier, signals, 1))
                whole = used(lambda: classifier.classify(signals, rate))  # noqa: B023
                found[f"{name}, whole"].append((whole,))
    for name, turns in found.items():
        whole, *label = np.median(turns, axis=0).tolist()
        single = name.endswith("sample")
        yield Row(name, whole, "real time", SECONDS, wanted=None if single else WANTED)
        if label and not single:
            yield Row(f"{name}: until a label, median", label[0], most=MEDIAN)
            yield Row(f"{name}: until a label, 99 %", label[1], most=SLOW)


def pushed(
    classifier: nc.Classifier, signals: dict[str, np.ndarray], chunk: int
) -> tuple[float, ...]:
    """Push signals by name, shape (samples,) or (joints, samples).

    Returns:
        CPU times in [s]: in all, and of a chunk that completes a frame, median and 99th percentile.
    """
    stream, labels = nc.Stream(classifier, joints=MANY), []
    count = next(iter(signals.values())).shape[-1]
    start_cpu = time.process_time()
    for first in range(0, count, chunk):
        samples = {name: each[..., first : first + chunk] for name, each in signals.items()}
        start = time.process_time()
        if len(stream.push(samples)):
            labels.append(time.process_time() - start)
    whole = time.process_time() - start_cpu
    return whole, *np.percentile(labels, [50, 99])
