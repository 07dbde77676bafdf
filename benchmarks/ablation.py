"""Ablation of the classifier: measures without a step, or with another one in its place.

    python -m benchmarks.ablation data/ [--rate 1000] [--folds 3] [--seeds 8] [--only whole,svm]

Only the training part of a data set is read. Groups of runs are split into folds; each variant is
trained on all folds but one and measured on that one, in turn. Samples have the extended noise at
10 kHz only, so that its variants require `--rate 10000`.
"""

import argparse
import os
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import numpy as np

import noiseclassifier as nc
from benchmarks.paper import RATE, files, first_seeds
from inspector.training.part import Part
from inspector.training.recordings import recordings
from noiseclassifier.evaluation.assessment import measure
from noiseclassifier.evaluation.predictions import Predictions, predict
from noiseclassifier.examples import Examples
from noiseclassifier.scenarios.sample import Sample
from noiseclassifier.splitting import folds

GENERAL, SCALAR = nc.GENERAL, nc.SCALAR
POWER = "power"
VARIANTS = {
    "the whole": GENERAL,
    "joint by joint": nc.EACH,
    "the noise alone": SCALAR,
    "the noise alone, levels as they are": replace(SCALAR, relative=False),
    "measured alone": replace(GENERAL, signals=("measured",)),
    "desired and measured": replace(GENERAL, signals=("desired", "measured")),
    "levels as they are": replace(GENERAL, relative=False),
    "quiet levels too (floor 3e-5 rad/s)": replace(GENERAL, floor=3e-5),
    "without quick windows": replace(GENERAL, quick=0.0),
    "the noise alone, without quick windows": replace(SCALAR, quick=0.0),
    "support vector machine": replace(GENERAL, estimator="svm", least_deviation=0.5),
    "networks": replace(GENERAL, estimator="networks"),
    "a quarter of the rounds": GENERAL,
    "trees of 4 leaves": GENERAL,
    "with the extended noise": replace(GENERAL, signals=(*GENERAL.signals, POWER)),
    "the extended noise alone": replace(SCALAR, signals=(POWER,)),
}
CHANGES = {"a quarter of the rounds": {"rounds": 25}, "trees of 4 leaves": {"leaves": 4}}
HEAD = ("variant", "balanced", "failure recall", "found at 5/h", "at 20/h", "at 100/h", "CPU-s")


def main() -> None:
    """Measure and print."""
    arguments = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    arguments.add_argument("data", type=Path, nargs="+")
    arguments.add_argument("--rate", type=float, default=1000.0)
    arguments.add_argument("--folds", type=int, default=3)
    arguments.add_argument("--seeds", type=int, help="first ones of each robot; by default all")
    arguments.add_argument("--only", default="", help="parts of names of variants, by commas")
    options = arguments.parse_args()
    chosen = {
        name: variant
        for name, variant in VARIANTS.items()
        if any(part in name for part in options.only.split(","))
        and (options.rate == RATE or POWER not in variant.signals)
    }
    power = any(POWER in variant.signals for variant in chosen.values())
    paths = first_seeds(files(options.data, Part.TRAINING), options.seeds)
    read = _recordings(paths, options.rate, power=power)
    print(f"{len(read)} runs in {len({nc.group_of(one.name) for one in read})} groups")
    print("| " + " | ".join(HEAD) + " |\n" + "|---" * len(HEAD) + "|", flush=True)
    for name, variant in chosen.items():
        start = time.process_time()
        profile = replace(variant.at(options.rate), **CHANGES.get(name, {}))
        found = _measure(read, profile, options.folds)
        print(f"| {name} | {found} | {time.process_time() - start:.0f} |", flush=True)


def _recordings(paths: Sequence[Path], rate: float, *, power: bool) -> list[nc.Recording]:
    found = list(recordings(paths, rate))
    if not power:
        return found
    return [
        replace(one, signal={**one.signal, POWER: _power(path)})
        for one, path in zip(found, paths, strict=True)
    ]


def _power(path: Path) -> np.ndarray:
    """Root of the sound power of all links, measured plus desired motion."""
    signals = Sample.load(path, only=("power", "power_desired")).signals
    return np.sqrt(signals["power"] + signals["power_desired"])


def _measure(read: Sequence[nc.Recording], profile: nc.Profile, count: int) -> str:
    """Measures by cross-validation, as the cells of a row of the table."""
    examples = Examples.read(read, profile)
    predictions: list[Predictions] = []
    for train, test in folds([nc.group_of(one.name) for one in read], count):
        names = {read[item].name for item in train}
        rows = np.array([run in names for run in examples.runs.tolist()])
        hashes = {name: examples.hashes[name] for name in names}
        part = Examples(examples.features[rows], examples.labels[rows], examples.runs[rows], hashes)
        classifier = nc.Classifier.train(part, profile)
        predictions += [predict(classifier, read[item]) for item in test]
    found = measure(predictions)
    shares = [
        found.frames.balanced_accuracy,
        found.frames.failure_recall,
        *(found.at_budgets[budget][1] for budget in (5.0, 20.0, 100.0)),
    ]
    return " | ".join(f"{one.value:.1%} [{one.low:.1%}, {one.high:.1%}]" for one in shares)


if __name__ == "__main__":
    main()
