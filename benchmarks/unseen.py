"""Leave one robot out: the measures of models on an unseen robot.

    python -m benchmarks.unseen DATA … --output build/unseen
        [--profiles norms noisytest-rbf] [--robots go2] [--seeds 10] [--rate 1000]

Each profile is trained on the training part of all robots but one, and measured on the test part of
that one. Profiles of NoisyTest and of the paper exist at 10 kHz only; since the time of libsvm
grows with the square of the frames, `--seeds` limits the seeds of each robot. Existing models in
the output are not trained again.
"""

import argparse
import os
from collections.abc import Sequence
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import noiseclassifier as nc
from benchmarks.paper import files, first_seeds
from inspector.training import recordings, training
from inspector.training.part import Part
from noiseclassifier.evaluation.assessment import number, percent

BUDGET = 20.0
"""False-alarm budget, per hour."""
HEAD = (
    *("profile", "left out", "runs trained on", "runs measured, groups"),
    *("failure recall at ≤ 20 per h", "failures found at ≤ 20 per h"),
    *("at its threshold: found", "false alarms per hour", "balanced accuracy"),
)


def main() -> None:
    """Train, measure and print."""
    arguments = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    arguments.add_argument("data", type=Path, nargs="+")
    arguments.add_argument("--output", type=Path, required=True, help="folder of the models")
    arguments.add_argument("--profiles", nargs="*", default=["norms"])
    arguments.add_argument("--robots", nargs="*", help="to leave out, in turn; by default all")
    arguments.add_argument("--seeds", type=int, help="of each robot, to train on; by default all")
    arguments.add_argument("--rate", type=float, default=10_000.0)
    given = arguments.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    known = first_seeds(files(given.data, Part.TRAINING), given.seeds)
    robots = sorted({path.parent.name for path in known})
    print("| " + " | ".join(HEAD) + " |\n" + "|---" * len(HEAD) + "|", flush=True)
    for profile in given.profiles:
        for robot in given.robots or robots:
            path = given.output / f"{profile}-{given.rate:g}hz-without-{robot}.npz"
            others = [one for one in known if one.parent.name != robot]
            print(measured(profile, robot, path, others, given.data, given.rate), flush=True)


def measured(
    profile: str, robot: str, path: Path, known: Sequence[Path], data: Sequence[Path], rate: float
) -> str:
    """Row of the table of a model, trained unless it exists, on an unseen robot."""
    if not path.exists():
        training.train(known, profile, rate, path)
    classifier = nc.Classifier.load(path)
    test = files([folder / robot for folder in data], Part.TEST)
    found = nc.assess(classifier, recordings.recordings(test, classifier.rate))
    recall, events = found.at_budgets[BUDGET]
    cells = (
        *(profile, robot, str(len(classifier.runs)), f"{found.runs}, {found.groups}"),
        *(percent(recall), percent(events), percent(found.events.all_found)),
        *(number(found.events.false_alarms_per_hour), percent(found.frames.balanced_accuracy)),
    )
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    main()
