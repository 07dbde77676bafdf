"""Leave robots out in turn: choose estimator, size and alarm threshold on source domains alone.

    python -m benchmarks.leftout LOGS... [--profile general] [--rate 1000] [--thin 8]
        [--grid rounds=100,200 leaves=4,8 learning_rate=0.05,0.15] [--without relative joints]
        [--alarms 0.5 0.7 0.9] [--novelty 2 4 inf] [--budget 30]
        [--learn-only LOGS...] [--wildest 0.5]

LOGS are annotated run files of source domains, and folders of them; a run of a target domain is
refused. Robots are dealt into folds, those of one line (anymal, anymal_c) together and each family
evenly. Each candidate is trained on all folds but one and predicts the runs of that one as
`inspector classify` does, but for the estimated onset and end of findings. Candidates are the
points of the grid, and logistic regression on the same features, missing ones at their mean.

The general profile takes logs of any rates, each once with each of the inputs that training takes
of it (`LEARNT`): what is said of runs below holds for each pair of a run and an
input. Other profiles are of one rate. For ablations, features can be left out by name, and domains
above a wildness are measured on but not learnt from. Logs to learn from only, say copies with
added faults, are never measured on.

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
from functools import partial
from itertools import groupby, product
from math import inf
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

import noiseclassifier as nc
from inspector.errors import InspectorError
from inspector.progress import progress
from inspector.train import ANY_RATE, THIN, LeftOut, classified, lacking, profile_at
from noiseclassifier.confusion import ratio
from noiseclassifier.estimators import ESTIMATORS
from noiseclassifier.estimators.decision import NOVELTY_LIMIT, Probable, identity, unthinned
from noiseclassifier.estimators.trees import TAIL, Trees
from noiseclassifier.evaluation.matching import OK, UNCLEAR, Outcome, Predictions, within
from noiseclassifier.evaluation.measures import MOST, auc, harmonic_mean
from noiseclassifier.features import standard
from noiseclassifier.framefeatures import frame_features
from noiseclassifier.general import LEARNT, UNBOUNDED, kept
from noiseclassifier.logbands import ANY, HIGHEST, LOWEST
from noiseclassifier.pooling import RELATIVE, columns
from noiseclassifier.recording import folds
from noiseclassifier.scenarios.domains import TARGET_BITS, TARGET_CONTROL, TARGET_HOLD
from noiseclassifier.scenarios.robots import ROBOTS, TARGETS, WIDE
from noiseclassifier.signals import EFFORT, JOINTS, NOISE, feeds, named
from noiseclassifier.tuning import Grid
from noisemodel import NoiseModelError

ALARMS = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.93, 0.95, 0.97, 0.98, 0.99, 0.995, 0.998)
"""Alarm thresholds."""
PENALTY = 0.01
"""C of logistic regression."""
RATE = 1000.0
"""Rate of a profile of one rate unless another is given, in [Hz]."""
INPUTS = dict(zip(LEARNT, ("motion with efforts", "motion", "measured", "noise"), strict=True))
"""Names of the inputs of the general profile, by their signals."""
WITHOUT = {
    "relative": f"{RELATIVE} ",
    "plain": f"(?!{RELATIVE} )",
    "efforts": f".*{EFFORT}",
    "joints": f".*({'|'.join(JOINTS)})",
}
"""Features of the general profile that can be left out: what their names match."""
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
    """A run of a target domain, on which nothing is chosen."""

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
        failing: Whether each frame of the whole run is a failure, shape (frames,).
        starts: First sample of each, shape (frames,).
        start: Time of the first sample, in [s].
        whole: Features of these frames that there are, shape (frames, there).
        cut: Those of the frames to train on, shape (cut, there).
        labels: Class of each, shape (cut,).
        places: Which of all features they are, shape (there,).
    """

    profile: nc.Profile
    base: Predictions
    failing: np.ndarray
    starts: np.ndarray
    start: float
    whole: np.ndarray
    cut: np.ndarray
    labels: np.ndarray
    places: np.ndarray

    @property
    def robot(self) -> str:
        """Its robot."""
        return self.base.origin.robot

    @property
    def part(self) -> tuple[int, str]:
        """Its rate, in [Hz], and its input."""
        return round(self.profile.rate), INPUTS.get(self.profile.signals, self.profile.name)

    def wide(self, features: np.ndarray, count: int) -> np.ndarray:
        """All features, NaN where they are missing, of those that there are."""
        found = np.full((len(features), count), np.nan, dtype=np.float32)
        found[:, self.places] = features
        return found


@dataclass(frozen=True, eq=False, kw_only=True)
class Linear(Probable):
    """Multinomial logistic regression with the decisions of our estimators, not calibrated.

    Features that are missing are at the mean of those that are not.

    Attributes:
        known: Highest value of each feature in nearly all training frames, shape (features,).
    """

    weights: np.ndarray
    offset: np.ndarray
    known: np.ndarray

    @classmethod
    def fit(cls, scaled: np.ndarray, targets: np.ndarray, alarm: float) -> "Linear":
        """Train it with scikit-learn."""
        from sklearn.linear_model import LogisticRegression

        known = np.nan_to_num(scaled.astype(np.float32), copy=False)
        fitted = LogisticRegression(C=PENALTY, max_iter=300).fit(known, targets)
        weights, offset = fitted.coef_.T, fitted.intercept_
        if len(offset) == 1:  # of two classes, it has the second alone
            weights, offset = (np.concatenate((0 * each, each), -1) for each in (weights, offset))
        return cls(
            weights=weights.astype(np.float64),
            offset=offset.astype(np.float64),
            known=np.nanquantile(scaled, 1.0 - TAIL, axis=0),
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
        return np.nan_to_num(features) @ self.weights + self.offset


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
        robots: Of the runs, shape (runs,).
        score: Of the runs, shape (runs,).
        counts: Counts of each run at each threshold, by name, shape (thresholds, runs).
    """

    name: str
    robots: np.ndarray
    parts: Sequence[tuple[int, str]]
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

    def of(self, part: tuple[int, str]) -> "Measured":
        """The same on runs of one rate and input alone."""
        mine = np.array([each == part for each in self.parts])
        counts = {name: each[:, mine] for name, each in self.counts.items()}
        parts = [part] * int(mine.sum())
        return replace(
            self, robots=self.robots[mine], parts=parts, score=self.score[mine], counts=counts
        )

    def chosen(self, budget: float) -> int | None:
        """Number of the threshold that finds most felt faults within a budget, None without one."""
        false, found = self.mean("false_alarms", "ok_hours"), self.mean("found_felt", "felt")
        allowed = np.flatnonzero(false <= budget)
        if not len(allowed):
            return None
        return int(allowed[np.lexsort((false[allowed], -found[allowed]))[0]])

    def ranked(self, number: int | None) -> tuple[str, ...]:
        """Measures of the ranking of runs, and those at a threshold if there is one."""
        ranks = (f"{self.ranking(each):.3f}" for each in (partial(auc, most=MOST), auc))
        at = ("none",) + ("-",) * 6 if number is None else self.cells(number)
        return (*ranks, *at)

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
    arguments.add_argument("--profile", default=ANY_RATE)
    arguments.add_argument("--rate", type=float, help=f"of other profiles, by default {RATE:g} Hz")
    arguments.add_argument("--without", nargs="+", choices=WITHOUT, default=[], help="features")
    arguments.add_argument("--grid", nargs="*", default=[], help="settings and their values")
    arguments.add_argument("--alarms", type=float, nargs="+", default=ALARMS)
    arguments.add_argument("--novelty", type=float, nargs="+", default=(NOVELTY_LIMIT,))
    arguments.add_argument("--budget", type=float, default=30.0, help="false alarms per hour")
    arguments.add_argument("--learn-only", type=Path, nargs="+", default=[], help="more logs")
    arguments.add_argument("--wildest", type=float, default=inf, help="wildness to learn from")
    arguments.add_argument("--folds", type=int, default=6)
    arguments.add_argument(
        "--thin", type=int, help=f"train on every k-th ok frame; {THIN} or, of one rate, 1"
    )
    arguments.add_argument("--quick", action="store_true", help="trees without calibration")
    arguments.add_argument("--limit", type=int, help="runs of each robot, by default all")
    arguments.add_argument("--jobs", type=int, default=2, help="processes that read")
    arguments.add_argument("--no-logistic", action="store_true", help="without that candidate")
    given = arguments.parse_args()
    try:
        profile, names = wanted(given.profile, given.rate, given.without)
        thin = given.thin or (THIN if names else 1)
        several = [*candidates(profile, given.grid, names)]
        if not given.no_logistic:
            several.append(logistic(profile))
        began = perf_counter()
        paths = files(given.logs, given.limit)
        options = {"thin": thin, "names": names, "wildest": given.wildest, "jobs": given.jobs}
        runs, left_out = read(paths, profile, **options)
        more = files(given.learn_only, given.limit)
        extra = read(more, profile, **options)[0] if more else []
        print(
            f"{len(runs)} pairs of run and input of {len(paths)} runs, and {len(extra)} to learn"
            f" from alone, read in {perf_counter() - began:.0f} s; {left_out}"
        )
        everything = [*runs, *extra]
        split = [
            (learn, test[test < len(runs)])
            for learn, test in robot_folds([run.robot for run in everything], given.folds)
        ]
        for number, (_, test) in enumerate(split, start=1):
            robots = sorted({runs[index].robot for index in test})
            print(f"fold {number} leaves out {len(test)} of {', '.join(robots)}", flush=True)
        began = perf_counter()
        thresholds = [Threshold(*each) for each in product(given.alarms, given.novelty)]
        shown = progress(split, "fold", total=len(split))
        with threadpool_limits(1):  # a thread that waits for a core keeps all others waiting
            measured = measure(
                *(everything, shown, several, profile, thresholds),
                measured=len(runs),
                names=names,
                thin=thin,
                quick=given.quick,
            )
    except (InspectorError, nc.ModelsError) as error:
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


def wanted(
    name: str, rate: float | None = None, without: Sequence[str] = ()
) -> tuple[nc.Profile, tuple[str, ...]]:
    """A profile by its name, and the names of its features if it is the general one.

    Args:
        rate: Of a profile of one rate, in [Hz].
    """
    if name != ANY_RATE:
        if without:
            raise InspectorError(f"profile {name} is of one rate; leave out --without")
        return profile_at(name, RATE if rate is None else rate), ()
    if rate is not None:
        raise InspectorError(f"profile {name} is for any rate; leave out --rate {rate:g}")
    unused = [re.compile(WITHOUT[each]) for each in without]
    names = tuple(
        name
        for number, name in enumerate(ANY.columns)
        if number not in ANY.without_unit and not any(each.match(name) for each in unused)
    )
    if not names:
        raise InspectorError(f"no feature is left without {', '.join(without)}")
    return ANY.bound(HIGHEST), names


def read(
    paths: Sequence[Path],
    profile: nc.Profile,
    *,
    thin: int = 1,
    names: Sequence[str] = (),
    wildest: float = inf,
    jobs: int = 1,
) -> tuple[list[Known], LeftOut]:
    """Features of runs; only they are kept, and runs that lack a signal are left out."""
    runs: list[Known] = []
    left_out = LeftOut()
    each = (delayed(known)(path, profile, thin, names, wildest) for path in paths)
    for found in Parallel(n_jobs=jobs)(each):
        if isinstance(found, list):
            runs += found
        else:
            left_out.runs.setdefault(found[1], []).append(found[0])
    if not runs:
        raise InspectorError(f"no run to train on; {left_out}")
    return runs, left_out


def known(
    path: Path, profile: nc.Profile, thin: int, names: Sequence[str], wildest: float = inf
) -> list[Known] | tuple[str, str]:
    """Features of a run, of each of its inputs; its name and a reason if it cannot be used."""
    try:
        return _known(path, profile, thin, names, wildest)
    except TargetError:
        raise
    except (InspectorError, nc.ModelsError, NoiseModelError) as error:
        raise InspectorError(str(error)) from None  # not all errors can come from a process


def _known(
    path: Path, profile: nc.Profile, thin: int, names: Sequence[str], wildest: float
) -> list[Known] | tuple[str, str]:
    ((recording, run),) = classified([path], None if names else profile.rate, bare_too=True)
    robot = recording.facts.get("robot", "")
    if what := target(robot, run.meta if run else {}):
        raise TargetError(recording.name, what)
    if not robot:
        raise InspectorError(f"{path}: names no robot, of which each is left out in turn")
    if reason := lacking(recording, ANY.bound(LOWEST, (NOISE,)) if names else profile):
        return recording.name, reason
    profiles = [profile]
    if names:
        inputs = [each for each in LEARNT if feeds(named(recording.signal), each)]
        profiles = [ANY.bound(recording.rate, each) for each in inputs]
    domain = run.meta.get("domain") if run else None
    wild = isinstance(domain, Mapping) and domain.get("wildness", 0.0) > wildest
    try:
        found = [
            of_recording(recording, each, thin=thin, names=names, first=each is profiles[0])
            for each in profiles
        ]
        return (
            [replace(each, cut=each.cut[:0], labels=each.labels[:0]) for each in found]
            if wild
            else found
        )
    except nc.SignalError:  # too short
        return recording.name, f"shorter than {profile.duration:g} s"


def of_recording(
    recording: nc.Recording,
    profile: nc.Profile,
    *,
    thin: int = 1,
    names: Sequence[str] = (),
    first: bool = True,
) -> Known:
    """Features of a recording.

    Frames to train on are cut as training cuts them: of the general profile, those that
    classifying cuts, for their features are relative to the recording so far.
    """
    starts, whole = frame_features(recording.signal, profile, recording.valid)
    whole = whole.astype(np.float32)
    base = silent(recording, starts, profile.duration)
    truth = base.whole_truth
    places = np.arange(whole.shape[1])
    if names:
        number = {name: place for place, name in enumerate(names)}
        own = np.array([number.get(name, -1) for name in columns(profile)])
        whole, places = whole[:, own >= 0], own[own >= 0]
        cut, labels = whole, truth
    else:
        try:
            examples = nc.Examples.of(nc.Dataset.of([recording], profile), profile)
            cut, labels = examples.features.astype(np.float32), examples.labels
        except nc.NoFrameError:
            cut, labels = whole[:0], truth[:0]
    learnt = kept(labels, thin, first=first)
    return Known(
        profile,
        base,
        (truth != OK) & (truth != UNCLEAR),
        starts,
        recording.start,
        whole,
        cut[learnt],
        labels[learnt],
        places,
    )


def silent(recording: nc.Recording, starts: np.ndarray, duration: float) -> Predictions:
    """Predictions of nothing but `ok` on frames of a recording, by their first samples."""
    begin, nothing = recording.start + starts / recording.rate, np.array([], dtype=str)
    ok = np.full(len(starts), OK)
    labels = nc.Labels(begin, begin + duration, ok, np.ones((len(starts), 1)), (OK,))
    return Predictions(
        recording.name,
        nc.group_of(recording.name),
        1.0 / recording.rate,
        within(recording),
        nothing,
        nothing,
        labels,
        recording.events,
        recording.facts,
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
    """Split runs so that no line of robots is on both sides, and families are spread evenly."""
    every = {**ROBOTS, **WIDE}

    def name(robot: str) -> str:
        family = type(every[robot]).__name__ if robot in every else "other"
        return f"{family}-{line_of(robot)}"  # folds are even in what stands before the last hyphen

    return folds([name(robot) for robot in robots], count)


def line_of(robot: str) -> str:
    """Line of robots: its name up to `_`, without digits."""
    return re.sub(r"\d|-", "", robot.partition("_")[0]) or robot


def candidates(
    profile: nc.Profile, grid: Sequence[str], names: Sequence[str] = ()
) -> Iterator[Candidates]:
    """Points of a grid; trees that differ in their number of rounds alone are trained together."""
    if not grid:
        profiles, points = [profile], [profile.estimator]
    else:
        axes = Grid.of(grid, profile.kernel)
        profiles = axes.profiles(profile)
        points = [", ".join(f"{k} {v:g}" for k, v in point.items()) for point in axes.points()]
    known = dict(zip(ANY.columns, ANY.rising.tolist(), strict=True))
    rising = np.array([known[name] for name in names]) if names else None
    together: dict[nc.Profile, list[tuple[str, nc.Profile]]] = {}
    for name, one in zip(points, profiles, strict=True):
        key = replace(one, rounds=1) if issubclass(ESTIMATORS[one.estimator], Trees) else one
        together.setdefault(key, []).append((name, one))
    for group in together.values():
        labels, mine = zip(*group, strict=True)
        yield Candidates(labels, _trained(mine, rising))


def _trained(profiles: Sequence[nc.Profile], rising: Any) -> Fit:
    def fit(scaled: np.ndarray, targets: np.ndarray, groups: np.ndarray) -> Sequence[Any]:
        most = max(profiles, key=lambda profile: profile.rounds)
        kind = ESTIMATORS[most.estimator]
        if not issubclass(kind, Trees):
            return [kind.fit(scaled, targets, groups, most)]
        rounds = [each.rounds for each in profiles]
        return kind.staged(scaled, targets, groups, most, rounds, rising)

    return fit


def logistic(profile: nc.Profile) -> Candidates:
    """Logistic regression."""

    def fit(scaled: np.ndarray, targets: np.ndarray, _: np.ndarray) -> Sequence[Any]:
        return [Linear.fit(scaled, targets, profile.alarm)]

    return Candidates(("logistic regression",), fit)


def measure(
    runs: Sequence[Known],
    split: Iterable[tuple[np.ndarray, np.ndarray]],
    several: Sequence[Candidates],
    profile: nc.Profile,
    thresholds: Sequence[Threshold],
    *,
    measured: int | None = None,
    names: Sequence[str] = (),
    thin: int = 1,
    quick: bool = False,
) -> list[Measured]:
    """Measures of candidates on runs that they were not trained on."""
    candidates = [name for each in several for name in each.names]
    own_runs = runs[:measured]
    counts = np.zeros((len(candidates), len(COUNTS), len(thresholds), len(own_runs)))
    score, seconds = np.full((len(candidates), len(own_runs)), np.nan), np.zeros(len(candidates))
    count = len(names) or runs[0].whole.shape[1]
    for learn, test in split:
        features = np.concatenate([runs[each].wide(runs[each].cut, count) for each in learn])
        labels = np.concatenate([runs[each].labels for each in learn])
        groups = np.repeat(
            [runs[each].base.group for each in learn], [len(runs[each].cut) for each in learn]
        )
        if quick:
            groups = np.full(len(labels), "one")  # trees of one group are not calibrated
        classes = tuple(name for name in profile.classes if name in set(labels.tolist()))
        if len(classes) < 2:
            raise nc.DatasetError(f"training takes two classes or more, not {len(classes)}")
        targets = np.array([classes.index(label) for label in labels.tolist()])
        unknown = np.isnan(features).all(axis=0)  # as `General.train` takes them
        features[:, unknown] = 0.0
        mean, scale = (each.astype(np.float32) for each in standard(features, profile))
        features = (features - mean) / scale
        unbounded = unknown | [name.startswith(RELATIVE) for name in names] if names else unknown
        number = 0
        for each in several:
            began = perf_counter()
            fitted = each.fit(features, targets, groups)
            seconds[number : number + len(fitted)] += perf_counter() - began
            for estimator in fitted:
                own = corrected(estimator, thin, unbounded)
                for index in test.tolist():
                    run = runs[index]
                    classifier = nc.Classifier(run.profile, classes, own, mean, scale)
                    decisions = classifier.decide(run.wide(run.whole, count))
                    found = counted(run, classifier, decisions, thresholds)
                    score[number, index], counts[number, :, :, index] = found
                number += 1
    robots, parts = np.array([run.robot for run in own_runs]), [run.part for run in own_runs]
    return [
        Measured(
            *(name, robots, parts, mine, thresholds),
            dict(zip(COUNTS, numbers, strict=True)),
            spent,
        )
        for name, mine, numbers, spent in zip(
            candidates, score, counts, seconds.tolist(), strict=True
        )
    ]


def corrected(estimator: Any, thin: int, unbounded: np.ndarray) -> Any:
    """An estimator for all frames, of one trained on every ``thin``-th `ok` frame.

    Args:
        unbounded: Whether a feature says nothing of novelty, shape (features,).
    """
    if unbounded.any():
        estimator = replace(estimator, known=np.where(unbounded, UNBOUNDED, estimator.known))
    if thin == 1:
        return estimator
    return replace(estimator, calibration=unthinned(estimator.calibration, thin))


def counted(
    run: Known,
    classifier: nc.Classifier,
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
    """Lines of tables: of candidates at their thresholds, of all thresholds, and of each input."""
    yield (
        f"At the thresholds that find most felt faults with {budget:g} false alarms per hour or"
        " fewer, unweighted mean of robots:\n"
    )
    yield from _rows(HEAD)
    for one in measured:
        yield _row((one.name, *one.ranked(one.chosen(budget)), f"{one.seconds:.0f} s"))
    yield ""
    yield from _rows(("candidate", *HEAD[3:-1]))
    for one in measured:
        for number in range(len(one.thresholds)):
            yield _row((one.name, *one.cells(number)))
    parts = sorted(set(measured[0].parts))
    if len(parts) < 2:
        return
    yield "\nAt the same thresholds, by rate and input:\n"
    yield from _rows((HEAD[0], "rate", "input", *HEAD[1:-1]))
    for one in measured:
        number = one.chosen(budget)
        for rate, signals in parts:
            yield _row((one.name, f"{rate} Hz", signals, *one.of((rate, signals)).ranked(number)))


def _rows(head: Sequence[str]) -> Iterator[str]:
    yield _row(head)
    yield "|---" * len(head) + "|"


def _row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    main()
