"""What adapting a general model does for robots that it has not met.

    python -m benchmarks.adapted FOLDER... [--model FILE] [--alarms 1 5 20] [--rate 1000]

FOLDER holds good and faulty runs of one robot under one controller, annotated. Good runs are left
out in turn, in five parts at most: each is classified by a model that is adapted to the others.
Faulty runs are classified by a model that is adapted to all good runs. Printed are, before adapting
and after, good runs with a finding, the share of ok time that is flagged, false alarms per hour of
it, felt faults found, and faults found by the name of their class, as `inspector evaluate` counts
them but for onset and end, which are those of the frames.
"""

import argparse
import os
from collections.abc import Iterable
from itertools import chain
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import noiseclassifier as nc
from inspector.assets import model_files
from inspector.training.recordings import classified
from noiseclassifier.evaluation.outcomes import Outcome
from noiseclassifier.evaluation.predictions import predict

PARTS = 5
"""Most parts that good runs are left out in."""
COUNTS = ("ok_hours", "ok_hours_flagged", "false_alarms", "felt", "found_felt", "faults", "matched")


def recordings(folder: Path, rate: float) -> list[nc.Recording]:
    """Runs of a folder that have this rate or more."""
    found = (recording for recording, _ in classified([folder], rate))
    return [each for each in found if isinstance(each, nc.Recording)]


def outcomes(model: nc.Classifier, runs: Iterable[nc.Recording]) -> list[Outcome]:
    """Outcomes of runs, as they are reported."""
    return [Outcome.of(predict(model, run)) for run in runs]


def adapted(general: nc.Classifier, good: list[nc.Recording], alarms: float) -> nc.Classifier:
    """The model adapted to good runs."""
    motion = nc.GoodMotion.read(good, general.profile)
    return nc.adapt(general, motion, alarms=alarms).classifier


def row(name: str, good: list[Outcome], faulty: list[Outcome]) -> str:
    """Measures of good and faulty runs, a line of a table."""
    hours, flagged, false, felt, found, faults, named = (
        sum(one.counts[key] for one in (*good, *faulty)) for key in COUNTS
    )
    loud = sum(bool(len(one.kind)) for one in good)
    return (
        f"| {name} | {loud} of {len(good)} | {flagged / hours:.1%} | {false / hours:.0f}"
        f" | {found:.0f} of {felt} | {named:.0f} of {faults} |"
    )


def main() -> None:
    """Measure and print."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("folders", type=Path, nargs="+")
    arguments.add_argument("--model", type=Path, default=model_files()[0])
    arguments.add_argument("--alarms", type=float, nargs="+", default=[1.0, 5.0, 20.0])
    arguments.add_argument("--rate", type=float, default=1000.0)
    options = arguments.parse_args()
    general = nc.load(options.model)
    assert isinstance(general, nc.General)
    print("| | good runs flagged | ok flagged | false/h | felt found | matched |")
    print("|---|---|---|---|---|---|")
    for folder in options.folders:
        runs = recordings(folder, options.rate)
        common = set.intersection(*(set(nc.signals.named(run.signal)) for run in runs))
        model = general.at(options.rate, common)
        faulty = [run for run in runs if run.events or {b.label for b in run.blocks} - {"ok"}]
        good = [run for run in runs if run not in faulty]
        parts = [good[first::PARTS] for first in range(min(PARTS, len(good)))]
        print(row(folder.name, outcomes(model, good), outcomes(model, faulty)))
        for alarms in options.alarms:
            left_out = chain.from_iterable(
                outcomes(adapted(model, [run for run in good if run not in part], alarms), part)
                for part in parts
            )
            found = outcomes(adapted(model, good, alarms), faulty)
            print(row(f"adapted, {alarms:g} per hour", [*left_out], found))


if __name__ == "__main__":
    main()
