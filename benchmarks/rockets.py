"""Compare ours with classifiers of scikit-learn and of aeon, on the same frames.

    python -m benchmarks.rockets FOLDER [--seeds 8] [--every 2] [--only WORD] [--views]

FOLDER is a data set of `inspector simulate dataset`. Of each robot, the first seeds that are not
in the test set are taken; one half of these groups is for training, the other half for
measuring, at 1 kHz. All get the same frames of 0.4 s of our profiles: *three* signals
(desired, measured, error), or the *noise* only. The classifiers of scikit-learn get our features;
those of aeon the logarithm of the samples, since our features are logarithms too (`--views` takes
other transforms). The settings of the support vectors and of the logistic regression are the best
of a few on these groups, split otherwise; no other was tuned here. Intervals are bootstrapped over
groups. All times are CPU times, on one core.
"""

import argparse
import os
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from typing import Any

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["MKL_NUM_THREADS"] = os.environ["NUMBA_NUM_THREADS"] = "1"

import numpy as np
from sklearn.metrics import roc_auc_score

import noiseclassifier as nc
from benchmarks.contenders import RATE, Contender, contenders
from inspector.training.recordings import of_sample
from noiseclassifier.evaluation.assessment import percent
from noiseclassifier.evaluation.intervals import Resampling

SHARES = (0.001, 0.01)
"""False-positive rates of `ok` frames: 36 and 360 frames in an hour."""
ALONE = 200
"""Number of frames that are classified one by one."""
WARM = 97
"""One of so many frames is for the warm-up, in which code is compiled."""
ADVICE = (
    "MiniRocket and QUANT come from aeon and torch, which are not both installed: run this in an"
    " environment of its own (aeon requires an older NumPy) after `pip install aeon torch`"
)

HEAD = (
    *("signals", "classifier", "balanced accuracy", f"recall of {' / '.join(nc.CLASSES)}, %"),
    *("failure recall", "false alarms", *(f"found at {share:.1%}" for share in SHARES), "AUC"),
    *("training, s", "a frame of many, ms", "a frame alone, ms"),
)


def files(folder: Path, seeds: int) -> tuple[list[Path], list[Path]]:
    """The samples to train on, and those to measure on.

    Args:
        folder: A data set.
        seeds: Seeds of each robot, half of them for each side.
    """
    groups = {
        path: nc.group_of(f"{path.parent.name}/{path.stem}")
        for path in sorted(folder.rglob("*.npz"))
    }
    robots: dict[str, list[str]] = defaultdict(list)
    for group in sorted(set(groups.values())):
        if not nc.held_out(group):
            robots[group.rpartition("-")[0]].append(group)
    taken = {group for each in robots.values() for group in each[:seeds]}
    kept = [path for path, group in groups.items() if group in taken]
    learnt, measured = nc.folds([groups[path] for path in kept], 2)[0]
    return [kept[item] for item in learnt], [kept[item] for item in measured]


def framed(paths: Sequence[Path], profile: nc.Profile, *, training: bool) -> nc.Dataset:
    """Frames of samples; of equal samples, the first counts."""
    found = {one.sha256: one for one in (of_sample(path, RATE) for path in reversed(paths))}
    return nc.Dataset.of(reversed(found.values()), profile, training=training)


def thinned(dataset: nc.Dataset, every: int) -> nc.Dataset:
    """One of so many frames."""
    kept = {name: getattr(dataset, name)[::every] for name in ("frames", "labels", "runs")}
    return replace(dataset, **kept)


def row(contender: Contender, known: nc.Dataset, test: nc.Dataset) -> str:
    """Row of the table of one classifier."""
    if contender.needs_aeon:
        contender.train(thinned(known, WARM))(known.frames[:1])
    decide, learning = timed(lambda: contender.train(known))
    (predicted, scores), deciding = timed(lambda: decide(test.frames))
    some = test.frames[:: max(len(test) // ALONE, 1), None]
    alone = median(timed(lambda frame=frame: decide(frame))[1] for frame in some)
    names = np.array((*nc.CLASSES, nc.UNKNOWN))[predicted]
    frames = nc.Evaluation.of(test.labels, names, nc.CLASSES)
    failure = test.labels != nc.CLASSES[0]
    cells = [
        contender.signals,
        contender.name,
        f"{frames.balanced_accuracy:.1%}",
        " / ".join(f"{100 * recall:.1f}" for recall in frames.recall[: len(nc.CLASSES)]),
        f"{frames.failure_recall:.1%}",
        f"{frames.false_alarm_rate:.2%}",
        *(found(test, scores, share) for share in SHARES),
        f"{roc_auc_score(failure, scores):.4f}",
        f"{learning:.0f}",
        f"{1e3 * deciding / len(test):.2f}",
        f"{1e3 * alone:.1f}",
    ]
    return "| " + " | ".join(cells) + " |"


def timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """Result of a call, and its CPU time, in [s]."""
    start = time.process_time()
    result = work()
    return result, time.process_time() - start


def found(test: nc.Dataset, scores: np.ndarray, share: float) -> str:
    """Recall of failure frames at a threshold with at most this share of `ok` frames above."""
    failure = test.labels != nc.CLASSES[0]
    quiet = np.sort(scores[~failure])[::-1]
    above = failure & (scores > quiet[int(share * len(quiet))])
    runs, run = np.unique(test.runs, return_inverse=True)
    part, whole = (np.bincount(run[one], minlength=len(runs)) for one in (above, failure))
    resampling = Resampling.of([nc.group_of(name) for name in runs.tolist()])
    return percent(resampling.share(part, whole))


def main() -> None:
    """Measure and print."""
    arguments = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    arguments.add_argument("folder", type=Path)
    arguments.add_argument("--seeds", type=int, default=8, help="of each robot")
    arguments.add_argument("--every", type=int, default=2, help="train on one of so many frames")
    arguments.add_argument("--only", default="", help="part of the names of classifiers")
    arguments.add_argument("--views", action="store_true", help="take each transform for aeon")
    given = arguments.parse_args()
    everyone = list(contenders(views=given.views))
    chosen = [one for one in everyone if given.only in one.name]
    if not chosen:
        names = ", ".join(dict.fromkeys(one.name for one in everyone))
        raise SystemExit(f"no classifier {given.only!r}; there are {names}")
    if any(one.needs_aeon for one in chosen) and not all(map(find_spec, ("aeon", "torch"))):
        raise SystemExit(ADVICE)
    known, test = files(given.folder, given.seeds)
    print("| " + " | ".join(HEAD) + " |\n" + "|---" * len(HEAD) + "|", flush=True)
    for profile in dict.fromkeys(one.profile for one in chosen):
        learnt = framed(known, profile, training=True)
        sides = thinned(learnt, given.every), framed(test, profile, training=False)
        for one in chosen:
            if one.profile == profile:
                print(row(one, *sides), flush=True)
    for side, name in zip(sides, ("training", "measured"), strict=True):
        counts = ", ".join(f"{(side.labels == each).sum()} {each}" for each in nc.CLASSES)
        groups = sorted({nc.group_of(run) for run in side.hashes})
        print(f"\n{name}: {len(side.hashes)} runs, {', '.join(groups)}; frames: {counts}")


if __name__ == "__main__":
    main()
