"""Measure how well onset and end of findings are estimated.

    inspector simulate dataset --robots talos,go2,panda --first-seed 100 --seeds 8 -o data/
    python benchmarks/extent.py data/

Reads the samples of a data set and classifies each at 1 kHz by norms and single joints, and at
10 kHz by the scalar noise. Findings that overlap an annotated block of their class count: the
onset is compared with the start of the first such block, the end with the stop of the last.
Parameters were chosen on odd seeds.
"""

import argparse
import os
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import numpy as np

import noisemodel as nm
from inspector.analysis.analyse import extents
from inspector.library import load_library
from noiseclassifier.scenarios.sample import DECIMATED, Sample
from noiseclassifier.signals import JOINTS, MOTION, NOISE

WITHIN = (0.05, 0.1, 0.2)
"""Errors that are counted, in [s]."""
CLASSES = ("impact", "highaccelerations", "oscillations", "all")
GENERAL = load_library()["general"]
LIBRARY = {
    "joints at 1 kHz": GENERAL.at(DECIMATED, (*MOTION, *JOINTS)),
    "noise at 10 kHz": GENERAL.at(10_000.0, (NOISE,)),
}
"""The shipped model, bound to what is measured."""


def run_of(sample: Sample, model: str) -> nm.Run:
    """Make a run of what a sample keeps: joints at 1 kHz, or the noise."""
    if model.startswith("noise"):
        time = np.arange(len(sample.noise)) / sample.rate
        return nm.Run(time=time, velocity=sample.noise[:, None], joint_names=("noise",))
    measured, desired = (sample.joints[f"{name}_joints"].T for name in ("measured", "desired"))
    return nm.Run(
        time=np.arange(len(measured)) / DECIMATED,
        velocity=measured,
        velocity_desired=desired,
        joint_names=tuple(f"joint{number}" for number in range(measured.shape[1])),
    )


def errors(sample: Sample, model: str) -> Iterator[tuple[str, str, tuple[float, float]]]:
    """Class of each finding, "onset" or "end", and errors of the frames and of the estimate."""
    signals = {"noise": sample.noise, **sample.decimated, **sample.joints}
    run = run_of(sample, model)
    classifier = LIBRARY[model].at(run.rate, signals)
    profile = classifier.profile
    labels = classifier.classify(
        {name: signals[name] for name in profile.signals}, classifier.rate, start=0.0
    )
    for event, found in zip(*extents(run, labels), strict=True):
        blocks = [
            block
            for block in sample.blocks
            if block.label == event.label and block.stop > event.start and block.start < event.stop
        ]
        if blocks:
            onset, end = blocks[0].start, blocks[-1].stop
            yield event.label, "onset", (event.start - onset, found.start - onset)
            yield event.label, "end", (event.stop - end, found.stop - end)


def main() -> None:
    """Measure, and print a table for each model."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("folder", type=Path)
    arguments.add_argument("--odd", action="store_true", help="odd seeds, not even ones")
    options = arguments.parse_args()
    paths = sorted(options.folder.glob("*/*.npz"))
    chosen = [path for path in paths if int(path.stem.rpartition("-")[2]) % 2 == options.odd]
    for model in LIBRARY:
        found: dict[tuple[str, str], list[tuple[float, float]]] = defaultdict(list)
        for path in chosen:
            for label, which, error in errors(Sample.load(path), model):
                found[which, label].append(error)
                found[which, "all"].append(error)
        print(f"\n{model}: |error| <= {WITHIN} s and median, of frames and of the estimate")
        for which in ("onset", "end"):
            for label in CLASSES:
                if len(both := np.array(found[which, label])):
                    cells = [
                        " ".join(f"{np.mean(np.abs(error) <= most):4.0%}" for most in WITHIN)
                        + f" {np.median(error):+.3f} s"
                        for error in both.T
                    ]
                    print(f"{which:6}{label:18}{len(both):4}   {'   '.join(cells)}")


if __name__ == "__main__":
    main()
