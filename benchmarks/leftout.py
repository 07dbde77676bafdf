"""Leave robots out in turn: choose estimator, size and alarm threshold on source domains alone.

    python -m benchmarks.leftout LOGS... [--profile joints] [--rate 1000] [--thin 4]
        [--grid rounds=40,100 leaves=4,16] [--alarms 0.5 0.7 0.9] [--novelty 2 4 inf] [--budget 30]

LOGS are annotated run files of source domains, and folders of them; a run of a target domain is
refused. Robots are dealt into folds, those of one line (anymal, anymal_c) together and each family
evenly. Each candidate is trained on all folds but one and predicts the runs of that one as
`inspector classify` does, but for the estimated onset and end of findings. Candidates are the
points of the grid, and logistic regression on the same features.

All measures are computed for each robot while it is left out, and averaged over robots: AUC and
pAUC of runs by the harmonic mean, shares and rates by the mean. The thresholds of a candidate, of
alarm and of novelty, are those that find most felt faults, as long as the mean of the false alarms
per hour is within the budget; of equal ones, those with the fewest false alarms. A novelty limit of
`inf` leaves nothing out of distribution: frames out of it are evidence at any alarm threshold.
"""

import argparse
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, product
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

import models
from inspector.errors import InspectorError
from inspector.progress import progress
from inspector.training.recordings import classified
from inspector.training.training import LeftOut, lacking, profile_at
from models.estimators.calibration import identity
from models.estimators.estimator import ESTIMATORS
from models.estimators.probabilistic import NOVELTY_LIMIT, Probable
from models.estimators.trees import TAIL, Trees
from models.evaluation.intervals import ratio
from models.evaluation.matching import OK, UNCLEAR, Matched
from models.evaluation.outcomes import Outcome
from models.evaluation.predictions import Predictions, within
from models.evaluation.ranking import auc, harmonic_mean, partial_auc
from models.features import standard
from models.framefeatures import frame_features
from models.labels import Labels
from models.splitting import folds, group_of
from models.tuning.grid import Grid
from noisemodel import NoiseModelError
from scenarios.domains.domain import TARGET_BITS, TARGET_CONTROL, TARGET_HOLD
from scenarios.robots import ROBOTS, TARGETS, WIDE

ALARMS = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.93, 0.95, 0.97, 0.98, 0.99, 0.995, 0.998)
"""Alarm thresholds."""
PENALTY = 0.01
"""C of logistic regression."""
COUNTS = (
    *("false_alarms", "ok_hours", "found_felt", "felt", "found", "faults"),
    *("recalled", "failing"),
)
"""Counts of a run: those of its outcome, and failure frames that are flagged, of all of them."""
HEAD = (
    *("candidate", "pAUC", "AUC", "alarm", "novelty", "felt faults found", "all faults found"),
    *("failure frames", "false alarms per hour", "worst robot", "training"),
)


class Threshold(NamedTuple):
    """What makes a frame evidence of a finding."""

    alarm: float
    """Least probability of any failure."""
    novelty: float
    """Novelty score that a frame out of distribution exceeds."""


class TargetError(InspectorError):
    """A run of a target domain, on which nothing is chosen.

    Args:
        name: Of the run.
        what: What of it belongs to the target domains.
    """

    def __init__(self, name: str, what: str) -> None:
        self.name, self.what = name, what
        super().__init__(f"{name}: {what} is of the target domains; nothing is chosen on them")

    def __reduce__(self) -> tuple[Any, ...]:
        """Let it come from another process."""
        return TargetError, (self.name, self.what)


@dataclass(frozen=True, eq=False)
class Known:
    """What is kept of a run.

    Attributes:
        base: The run, without predictions.
        failing: Whether each frame of the whole run is a failure, shape (frames,).
        starts: First sample of each, shape (frames,).
        start: Time of the first sample, in [s].
        whole: Features of these frames, shape (frames, features).
        cut: Features of the frames to train on, shape (cut, features).
        labels: Class of each, shape (cut,).
    """

    base: Predictions
    failing: np.ndarray
    starts: np.ndarray
    start: float
    whole: np.ndarray
    cut: np.ndarray
    labels: np.ndarray

    @property
    def robot(self) -> str:
        """Its robot."""
        return self.base.origin.robot

    def thinned(self, thin: int) -> tuple[np.ndarray, np.ndarray]:
        """Features and classes of the frames to train on, with every ``thin``-th `ok` frame."""
        ok = self.labels == OK
        kept = ~ok | (np.cumsum(ok) % thin == 1 % thin)
        return self.cut[kept], self.labels[kept]


@dataclass(frozen=True, eq=False, kw_only=True)
class Linear(Probable):
    """Multinomial logistic regression with the decisions of our estimators, not calibrated.

    Attributes:
        weights: Shape (features, classes).
        offset: Shape (classes,).
        known: Highest value of each feature in nearly all training frames, shape (features,).
    """

    weights: np.ndarray
    offset: np.ndarray
    known: np.ndarray

    @classmethod
    def fit(cls, scaled: np.ndarray, targets: np.ndarray, alarm: float) -> "Linear":
        """Train it with scikit-learn."""
        from sklearn.linear_model import LogisticRegression

        fitted = LogisticRegression(C=PENALTY, max_iter=300).fit(scaled.astype(np.float32), targets)
        weights, offset = fitted.coef_.T, fitted.intercept_
        if len(offset) == 1:  # of two classes, it has the second alone
            weights, offset = (np.concatenate((0 * each, each), -1) for each in (weights, offset))
        return cls(
            weights=weights.astype(np.float64),
            offset=offset.astype(np.float64),
            known=np.quantile(scaled, 1.0 - TAIL, axis=0),
            calibration=identity(len(offset)),
            frequency=np.bincount(targets) / len(targets),
            alarm=alarm,
        )

    @property
    def maximum(self) -> np.ndarray:
        """Highest value of each feature in nearly all training frames, shape (features,)."""
        return self.known

    def logits(self, features: np.ndarray) -> np.ndarray:
        """Logits of the classes, shape (frames, classes)."""
        return features @ self.weights + self.offset


Fit = Callable[[np.ndarray, np.ndarray, np.ndarray], Sequence[Any]]
"""Trains estimators on standardised features, classes and groups of frames."""


@dataclass(frozen=True)
class Candidates:
    """Candidates that are trained together."""

    names: tuple[str, ...]
    fit: Fit


@dataclass(frozen=True, eq=False)
class Measured:
    """Predictions of a candidate on all runs, each by a model without its robot.

    Attributes:
        name: Of the candidate.
        robots: Of the runs, shape (runs,).
        score: Of the runs, shape (runs,).
        thresholds: All thresholds.
        counts: Counts of each run at each threshold, by name, shape (thresholds, runs).
        seconds: Time that training took with all others that are trained together.
    """

    name: str
    robots: np.ndarray
    score: np.ndarray
    thresholds: Sequence[Threshold]
    counts: Mapping[str, np.ndarray]
    seconds: float

    def ranking(self, measure: Callable[[np.ndarray, np.ndarray], float]) -> float:
        """Harmonic mean over robots of AUC or pAUC."""
        scored, faulty = ~np.isnan(self.score), self.counts["faults"][0] > 0

        def one(robot: str) -> float:
            mine = scored & (self.robots == robot)
            return measure(self.score[mine & ~faulty], self.score[mine & faulty])

        return harmonic_mean([one(robot) for robot in np.unique(self.robots)])

    def per_robot(self, part: str, whole: str) -> np.ndarray:
        """Share or rate of each robot at each threshold, shape (thresholds, robots)."""
        owns = (self.robots[:, None] == np.unique(self.robots)).astype(np.float64)
        return np.asarray(ratio(self.counts[part] @ owns, self.counts[whole] @ owns))

    def mean(self, part: str, whole: str) -> np.ndarray:
        """Mean of the robots for which it is defined, at each threshold, shape (thresholds,)."""
        values = self.per_robot(part, whole)
        known = ~np.isnan(values)
        return np.asarray(ratio(np.where(known, values, 0.0).sum(axis=1), known.sum(axis=1)))

    def chosen(self, budget: float) -> int | None:
        """Number of the threshold that finds most felt faults within a budget, None without one.

        Args:
            budget: Mean false alarms per hour.
        """
        false, found = self.mean("false_alarms", "ok_hours"), self.mean("found_felt", "felt")
        allowed = np.flatnonzero(false <= budget)
        if not len(allowed):
            return None
        return int(allowed[np.lexsort((false[allowed], -found[allowed]))[0]])

    def cells(self, number: int) -> tuple[str, ...]:
        """Measures at a threshold, as the table has them."""
        rates = self.per_robot("false_alarms", "ok_hours")[number]
        worst = int(np.nanargmax(rates)) if not np.isnan(rates).all() else 0
        shares = (("found_felt", "felt"), ("found", "faults"), ("recalled", "failing"))
        return (
            *(f"{value:g}" for value in self.thresholds[number]),
            *(f"{100 * self.mean(*share)[number]:.1f} %" for share in shares),
            f"{self.mean('false_alarms', 'ok_hours')[number]:.1f}",
            f"{np.unique(self.robots)[worst]} {rates[worst]:.0f}",
        )


def main() -> None:
    """Read, train, measure and print."""
    arguments = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    arguments.add_argument("logs", type=Path, nargs="+")
    arguments.add_argument("--profile", default="joints")
    arguments.add_argument("--rate", type=float, default=1000.0)
    arguments.add_argument("--grid", nargs="*", default=[], help="settings and their values")
    arguments.add_argument("--alarms", type=float, nargs="+", default=ALARMS)
    arguments.add_argument("--novelty", type=float, nargs="+", default=(NOVELTY_LIMIT,))
    arguments.add_argument("--budget", type=float, default=30.0, help="false alarms per hour")
    arguments.add_argument("--folds", type=int, default=6)
    arguments.add_argument("--thin", type=int, default=1, help="train on every k-th ok frame")
    arguments.add_argument("--quick", action="store_true", help="trees without calibration")
    arguments.add_argument("--limit", type=int, help="runs of each robot, by default all")
    arguments.add_argument("--jobs", type=int, default=2, help="processes that read")
    arguments.add_argument("--no-logistic", action="store_true", help="without that candidate")
    given = arguments.parse_args()
    try:
        profile = profile_at(given.profile, given.rate)
        several = [*candidates(profile, given.grid)]
        if not given.no_logistic:
            several.append(logistic(profile))
        began = perf_counter()
        runs, left_out = read(files(given.logs, given.limit), profile, jobs=given.jobs)
        print(f"{len(runs)} runs, read in {perf_counter() - began:.0f} s; {left_out}")
        split = robot_folds([run.robot for run in runs], given.folds)
        for number, (_, test) in enumerate(split, start=1):
            robots = sorted({runs[index].robot for index in test})
            print(f"fold {number} leaves out {len(test)} runs of {', '.join(robots)}", flush=True)
        began = perf_counter()
        thresholds = [Threshold(*each) for each in product(given.alarms, given.novelty)]
        shown = progress(split, "fold", total=len(split))
        with threadpool_limits(1):  # a thread that waits for a core keeps all others waiting
            measured = measure(
                runs, shown, several, profile, thresholds, thin=given.thin, quick=given.quick
            )
    except (InspectorError, models.ModelsError) as error:
        sys.exit(str(error))
    print(f"trained and measured in {perf_counter() - began:.0f} s\n")
    print("\n".join(report(measured, given.budget)))


def files(logs: Sequence[Path], limit: int | None = None) -> list[Path]:
    """Run files, at most so many of each folder, spread evenly."""
    found = []
    for path in logs:
        every = sorted(path.rglob("*.npz")) if path.is_dir() else [path]
        for _, group in groupby(every, key=lambda file: file.parent):
            mine = list(group)
            step = max(1, -(-len(mine) // limit)) if limit else 1
            found += mine[::step]
    return found


def read(
    paths: Sequence[Path], profile: models.Profile, *, jobs: int = 1
) -> tuple[list[Known], LeftOut]:
    """Features of runs; only they are kept, and runs that lack a signal are left out.

    Raises:
        TargetError: If a run is of a target domain.
        InspectorError: If a run names no robot, or none is left.
    """
    runs, left_out = [], LeftOut()
    for one in Parallel(n_jobs=jobs)(delayed(known)(path, profile) for path in paths):
        if isinstance(one, Known):
            runs.append(one)
        else:
            left_out.runs.setdefault(one[1], []).append(one[0])
    if not runs:
        raise InspectorError(f"no run to train on; {left_out}")
    return runs, left_out


def known(path: Path, profile: models.Profile) -> Known | tuple[str, str]:
    """Features of a run; its name and a reason if it cannot be used."""
    try:
        return _known(path, profile)
    except TargetError:
        raise
    except (InspectorError, models.ModelsError, NoiseModelError) as error:
        raise InspectorError(str(error)) from None  # not all errors can come from a process


def _known(path: Path, profile: models.Profile) -> Known | tuple[str, str]:
    ((recording, run),) = classified([path], profile.rate, bare_too=True)
    robot = recording.facts.get("robot", "")
    if what := target(robot, run.meta if run else {}):
        raise TargetError(recording.name, what)
    if not robot:
        raise InspectorError(f"{path}: names no robot, of which each is left out in turn")
    if reason := lacking(recording, profile):
        return recording.name, reason
    try:
        return of_recording(recording, profile)
    except models.SignalError:  # too short
        return recording.name, f"shorter than {profile.duration:g} s"


def of_recording(recording: models.Recording, profile: models.Profile) -> Known:
    """Features of a recording."""
    starts, whole = frame_features(recording.signal, profile, recording.valid)
    try:
        examples = models.Examples.of(models.Dataset.of([recording], profile), profile)
        cut, labels = examples.features, examples.labels
    except models.NoFrameError:
        cut, labels = whole[:0], np.array([], dtype=str)
    begin = recording.start + starts / profile.rate
    silent = Labels(
        begin,
        begin + profile.duration,
        np.full(len(starts), OK),
        np.ones((len(starts), 1)),
        (OK,),
    )
    nothing = np.array([], dtype=str)
    base = Predictions(
        recording.name,
        group_of(recording.name),
        1.0 / recording.rate,
        within(recording),
        nothing,
        nothing,
        silent,
        recording.events,
        recording.facts,
    )
    truth = Matched.of([base]).frames.truth
    return Known(
        base,
        (truth != OK) & (truth != UNCLEAR),
        starts,
        recording.start,
        whole.astype(np.float32),
        cut.astype(np.float32),
        labels,
    )


def target(robot: str, meta: Mapping[str, Any]) -> str:
    """What of a run belongs to the target domains; empty if nothing does."""
    if robot in TARGETS:
        return f"robot {robot}"
    if (simulator := meta.get("simulator", "mujoco")) != "mujoco":
        return f"simulator {simulator}"
    domain, logger = meta.get("domain"), meta.get("logger")
    if isinstance(domain, Mapping) and domain.get("control") == TARGET_CONTROL:
        return f"control {TARGET_CONTROL}"
    if logger and (logger["bits"] <= TARGET_BITS or logger["hold"] >= TARGET_HOLD):
        return f"a log of {logger['bits']} bit whose samples are held {logger['hold']} times"
    return ""


def robot_folds(robots: Sequence[str], count: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Split runs so that no line of robots is on both sides, and families are spread evenly.

    Args:
        robots: Robot of each run.
        count: How many folds.

    Returns:
        For each fold, indices of the training runs, and of those left out.
    """
    every = {**ROBOTS, **WIDE}

    def name(robot: str) -> str:
        family = type(every[robot]).__name__ if robot in every else "other"
        return f"{family}-{line_of(robot)}"  # folds are even in what stands before the last hyphen

    return folds([name(robot) for robot in robots], count)


def line_of(robot: str) -> str:
    """Line of robots: its name up to `_`, without digits."""
    return re.sub(r"\d|-", "", robot.partition("_")[0]) or robot


def candidates(profile: models.Profile, grid: Sequence[str]) -> Iterator[Candidates]:
    """Points of a grid; trees that differ in their number of rounds alone are trained together.

    Raises:
        GridError: If the grid is wrong.
    """
    if not grid:
        profiles, points = [profile], [profile.estimator]
    else:
        axes = Grid.of(grid, profile.kernel)
        profiles = axes.profiles(profile)
        points = [", ".join(f"{k} {v:g}" for k, v in point.items()) for point in axes.points()]
    together: dict[models.Profile, list[tuple[str, models.Profile]]] = {}
    for name, one in zip(points, profiles, strict=True):
        key = replace(one, rounds=1) if profile.estimator == "trees" else one
        together.setdefault(key, []).append((name, one))
    for group in together.values():
        names, mine = zip(*group, strict=True)
        yield Candidates(names, _trained(mine))


def _trained(profiles: Sequence[models.Profile]) -> Fit:
    def fit(scaled: np.ndarray, targets: np.ndarray, groups: np.ndarray) -> Sequence[Any]:
        most = max(profiles, key=lambda profile: profile.rounds)
        if most.estimator != "trees":
            return [ESTIMATORS[most.estimator].fit(scaled, targets, groups, most)]
        return Trees.staged(scaled, targets, groups, most, [each.rounds for each in profiles])

    return fit


def logistic(profile: models.Profile) -> Candidates:
    """Logistic regression."""

    def fit(scaled: np.ndarray, targets: np.ndarray, _: np.ndarray) -> Sequence[Any]:
        return [Linear.fit(scaled, targets, profile.alarm)]

    return Candidates(("logistic regression",), fit)


def measure(
    runs: Sequence[Known],
    split: Iterable[tuple[np.ndarray, np.ndarray]],
    several: Sequence[Candidates],
    profile: models.Profile,
    thresholds: Sequence[Threshold],
    *,
    thin: int = 1,
    quick: bool = False,
) -> list[Measured]:
    """Measures of candidates on runs that they were not trained on.

    Args:
        runs: All runs.
        split: Indices of training runs and of those left out, which are each left out once.
        several: The candidates.
        profile: What the features are of.
        thresholds: All thresholds.
        thin: Every ``thin``-th `ok` frame is trained on; the prior of `ok` is corrected for it.
        quick: Whether trees are not calibrated, in a third of the time: to rank candidates, as
            their thresholds are others then.

    Raises:
        DatasetError: If there is one class alone.
    """
    names = [name for each in several for name in each.names]
    counts = np.zeros((len(names), len(COUNTS), len(thresholds), len(runs)))
    score, seconds = np.full((len(names), len(runs)), np.nan), np.zeros(len(names))
    for learn, test in split:
        mean, scale = standard(np.concatenate([runs[each].cut for each in learn]), profile)
        parts = [runs[each].thinned(thin) for each in learn]
        scaled = (np.concatenate([part for part, _ in parts]) - mean) / scale
        labels = np.concatenate([part for _, part in parts])
        groups = np.repeat([runs[each].base.group for each in learn], [len(x) for x, _ in parts])
        if quick:
            groups = np.full(len(labels), "one")  # trees of one group are not calibrated
        classes = tuple(name for name in profile.classes if name in set(labels.tolist()))
        if len(classes) < 2:
            raise models.DatasetError(f"training takes two classes or more, not {len(classes)}")
        targets = np.array([classes.index(label) for label in labels.tolist()])
        whole = (np.concatenate([runs[each].whole for each in test]) - mean) / scale
        stops = np.cumsum([len(runs[each].whole) for each in test])[:-1]
        number = 0
        for each in several:
            began = perf_counter()
            fitted = each.fit(scaled, targets, groups)
            seconds[number : number + len(fitted)] += perf_counter() - began
            for estimator in fitted:
                own = unthinned(estimator, thin)
                classifier = models.Classifier(profile, classes, own, mean, scale)
                decisions = np.split(own.decision(whole), stops)
                for index, values in zip(test.tolist(), decisions, strict=True):
                    found = counted(runs[index], classifier, values, thresholds)
                    score[number, index], counts[number, :, :, index] = found
                number += 1
    robots = np.array([run.robot for run in runs])
    return [
        Measured(name, robots, mine, thresholds, dict(zip(COUNTS, numbers, strict=True)), spent)
        for name, mine, numbers, spent in zip(names, score, counts, seconds.tolist(), strict=True)
    ]


def unthinned(estimator: Any, thin: int) -> Any:
    """An estimator for all frames, of one trained on every ``thin``-th `ok` frame.

    The odds of `ok` are multiplied by ``thin``.
    """
    if thin == 1:
        return estimator
    shift = np.zeros(len(estimator.calibration))
    shift[1] = np.log(thin)
    return replace(estimator, calibration=estimator.calibration + shift)


def counted(
    run: Known,
    classifier: models.Classifier,
    decisions: np.ndarray,
    thresholds: Sequence[Threshold],
) -> tuple[float, np.ndarray]:
    """Score of a run, and its counts at each threshold, shape (counts, thresholds)."""
    known: dict[tuple[bytes, bytes], list[float]] = {}
    counts, score = [], np.nan
    for alarm, novelty in thresholds:
        own = replace(classifier, estimator=replace(classifier.estimator, alarm=alarm))
        shifted = decisions.copy()
        shifted[:, -1] -= novelty - NOVELTY_LIMIT  # the limit is a constant of estimators
        labels = own.labels(shifted, run.starts, own.rate, start=run.start)
        key = labels.flagged.tobytes(), labels.debounced.tobytes()
        if key not in known:  # equal findings have equal outcomes
            found = Outcome.of(replace(run.base, labels=labels))
            recalled = float((labels.flagged & run.failing).sum()), float(run.failing.sum())
            known[key] = [*(found.counts[name] for name in COUNTS[:-2]), *recalled]
            score = found.score
        counts.append(known[key])
    return score, np.transpose(counts)


def report(measured: Sequence[Measured], budget: float) -> Iterator[str]:
    """Lines of a table of the candidates at their thresholds, and of one of all thresholds."""
    yield (
        f"At the thresholds that find most felt faults with {budget:g} false alarms per hour or"
        " fewer, unweighted mean of robots:\n"
    )
    yield from _rows(HEAD)
    for one in measured:
        number = one.chosen(budget)
        at = ("none",) + ("-",) * 6 if number is None else one.cells(number)
        ranks = (f"{one.ranking(each):.3f}" for each in (partial_auc, auc))
        yield _row((one.name, *ranks, *at, f"{one.seconds:.0f} s"))
    yield ""
    yield from _rows(("candidate", *HEAD[3:-1]))
    for one in measured:
        for number in range(len(one.thresholds)):
            yield _row((one.name, *one.cells(number)))


def _rows(head: Sequence[str]) -> Iterator[str]:
    yield _row(head)
    yield "|---" * len(head) + "|"


def _row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    main()
