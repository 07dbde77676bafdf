"""Whether ripple of the drives is told apart: found by its level, and what else is called ripple.

    python -m benchmarks.ripple [DATA] [--cases 2000] [--first-seed 50000]

Robots of one to seven joints make random motions (minimum jerk, trapezoids, sines) of up to 0.5 to
5 rad/s; each second motion is a run of DATA instead, a folder of `inspector simulate domains`, of
which those are used whose drives have neither ripple nor cogging. The logs
(`scenarios.domains.logs`) are of the loggers that models learn from. In one half of the cases the
log has ripple of gears of 30 to 160 at all joints, 0.2 to 20 % of their speed, and the finding is
some time of it. In the other half something is put into one joint: a tone, one that wanders, one
that grows and decays, three tones, blows, white noise, noise that goes with the joint's speed, or
nothing; half of these logs have a ripple that is less than half as strong at that time, else the
case is listed as faint. An order counts as right within 2 % of one of the ripple's.
"""

import argparse
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.signal import butter, sosfiltfilt

from inspector.localisation.order import LEAST, MARGIN, best_lines
from noiseclassifier.scenarios.domains import logged
from noiseclassifier.scenarios.domains.distribution import DISTRIBUTION
from noiseclassifier.scenarios.domains.logs import HARMONICS
from noiseclassifier.scenarios.limits import Limits
from noisemodel import Block, Run
from noisemodel.types import Array

RATE, SECONDS = 2000.0, 6.0
"""Of the motions, in [Hz] and [s]; logs have up to this rate."""
DURATION = (0.1, 4.0)
"""Of the findings, in [s]."""
AMPLITUDE = (0.03, 3.0)
"""Of what is put in, in [rad/s]."""
RIPPLE = (0.002, 0.2)
"""Of velocities, by the joint's speed."""
BITS = 23
"""Of encoders: the counts of coarse ones are a ripple too."""
TOLERANCE = 0.02
"""Of an order that is right."""
LEVELS = (-np.inf, -10.0, -5.0, 0.0, 5.0, 10.0, 20.0, np.inf)
"""Edges of the levels of ripple above the rest of the log above 10 Hz, in [dB]."""
PERIODS, RANGE = 16.0, 1.5
"""Periods at the gear's ratio, and range of the speed, with which ripple can be told."""
FAULTS = ("tone", "wandering", "decaying", "tones", "blows", "white", "rough", "nothing")


@dataclass(frozen=True)
class Case:
    """What was found in a part of a log.

    Attributes:
        kind: "ripple", or what was put in.
        rate: Of the log, in [Hz].
        over_angle: Share that the best order explains.
        over_time: Share that the best frequency explains.
        right: Whether that order is one of the ripple's.
        level: Power of the ripple of that joint by the rest, above 10 Hz, in [dB].
        range: Fastest by slowest speed of the joint, over the middle 80 % of the time.
        periods: Periods of the ripple at the gear's ratio.
    """

    kind: str
    rate: float
    over_angle: float
    over_time: float
    right: bool = False
    level: float = -np.inf
    range: float = np.inf
    periods: float = 0.0

    @property
    def found(self) -> bool:
        """Whether an order is stated."""
        return self.over_angle >= max(LEAST, self.over_time + MARGIN)


def main() -> None:
    """Print both tables."""
    arguments = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    arguments.add_argument("data", type=Path, nargs="?", help="folder of simulated runs")
    arguments.add_argument("--cases", type=int, default=2000)
    arguments.add_argument("--first-seed", type=int, default=50000)
    given = arguments.parse_args()
    files = sorted(given.data.glob("*/*.npz")) if given.data else []
    files = [path for path in files if smooth(loaded(path))]
    seeds = range(given.first_seed, given.first_seed + given.cases)
    cases = [one(seed, files) for seed in seeds]
    print("\n".join([*false_shares(cases), "", *found_shares(cases)]))


def one(seed: int, files: Sequence[Path] = ()) -> Case:
    """Make a log and look at a part of it; ripple if the seed is even."""
    rng = np.random.default_rng(seed)
    run = loaded(files[rng.integers(len(files))]) if files and seed // 2 % 2 else motion(rng)
    duration = min(DURATION[0] * (DURATION[1] / DURATION[0]) ** rng.uniform(), run.duration - 0.5)
    start = rng.uniform(0.2, run.duration - duration - 0.2)
    finding = Block(start, start + duration, "oscillations")
    domain = DISTRIBUTION.domain(rng, Limits())
    drawn = DISTRIBUTION.logger(rng, domain, most=run.rate)
    size = RIPPLE[0] * (RIPPLE[1] / RIPPLE[0]) ** rng.uniform()
    logger = replace(drawn, ripple=size, bits=BITS)
    plain = replace(logger, ripple=0.0)
    positions = rng.uniform() < 0.5
    if seed % 2:
        kind = FAULTS[rng.integers(len(FAULTS))]
        faulty = with_fault(run, kind, finding, rng)
        logger = plain if kind == "nothing" or rng.uniform() < 0.5 else replace(drawn, bits=BITS)
        found = with_positions(logged(faulty, faulty, logger, seed=seed), faulty, positions)
        order, over_angle, over_time = best_lines(found, finding)
        if order is not None and logger.ripple:
            without = logged(faulty, faulty, plain, seed=seed)
            joint = found.joint_names.index(order.joint)
            fault = fast((faulty.velocity - run.velocity)[:, joint], run.rate)
            ripple = fast((found.velocity - without.velocity)[:, joint], logger.rate)
            if rms(fault, faulty, finding) < np.sqrt(2) * rms(ripple, found, finding):
                kind = "faint"
        return Case(kind, logger.rate, over_angle, over_time)
    found = with_positions(logged(run, run, logger, seed=seed), run, positions)
    without = logged(run, run, plain, seed=seed)
    order, over_angle, over_time = best_lines(found, finding)
    if order is None:
        return Case("ripple", logger.rate, 0.0, 0.0)
    inside = (found.time >= finding.start) & (found.time < finding.stop)
    joint = found.joint_names.index(order.joint)
    rest = without.velocity[:, joint].astype(np.float64)
    if without.velocity_desired is not None:
        rest = rest - without.velocity_desired[:, joint]
    ripple = (found.velocity - without.velocity)[:, joint]
    below, above = (np.square(fast(each, logger.rate))[inside].sum() for each in (rest, ripple))
    speeds = np.abs(run.velocity[_inside(run, finding), joint])
    turned = speeds.sum() / run.rate
    speed = np.percentile(speeds, (10, 90))
    ratio = order.periods_per_turn / (logger.gear * np.array(HARMONICS))
    return Case(
        "ripple",
        logger.rate,
        over_angle,
        over_time,
        bool(np.abs(ratio - 1.0).min() <= TOLERANCE),
        float(10 * np.log10((above + 1e-20) / (below + 1e-20))),
        float(speed[1] / max(speed[0], 1e-3)),
        float(logger.gear * turned / (2 * np.pi)),
    )


def false_shares(cases: Sequence[Case]) -> list[str]:
    """Of what is no ripple, the share that is called so."""
    by_kind: Mapping[str, list[Case]] = defaultdict(list)
    for case in cases:
        if case.kind != "ripple":
            by_kind[case.kind].append(case)
        if case.kind not in ("ripple", "faint"):
            by_kind["all"].append(case)
    rows = [
        f"| {kind} | {len(group)} | {sum(case.found for case in group)} |"
        for kind, group in sorted(by_kind.items())
    ]
    return ["| put in | cases | called ripple |", "|---|---|---|", *rows]


def found_shares(cases: Sequence[Case]) -> list[str]:
    """Of ripple, the share that is found by its level, and of those found, the share right."""
    rows = []
    for low, high in pairwise(LEVELS):
        group = [c for c in cases if c.kind == "ripple" and low <= c.level < high]
        long = [case for case in group if case.periods >= PERIODS and case.range >= RANGE]
        found = [case for case in group if case.found]
        right = sum(case.right for case in found)
        rows.append(
            f"| {low:g} to {high:g} | {len(found)} of {len(group)} |"
            f" {sum(case.found for case in long)} of {len(long)} | {right} of {len(found)} |"
        )
    periods = f"{PERIODS:g} periods or more, speed varies by {RANGE:g} or more"
    head = f"| ripple by rest [dB] | found | {periods} | of those found, right |"
    return [head, "|---" * 4 + "|", *rows]


def motion(rng: np.random.Generator) -> Run:
    """A robot of one to seven joints that moves to random places, with a lag and noise."""
    time = np.arange(round(RATE * SECONDS)) / RATE
    joints = int(rng.integers(1, 8))
    fastest = 0.5 * 10.0 ** rng.uniform()
    planned = np.stack([_planned(rng, time) for _ in range(joints)], axis=1)
    planned *= fastest / np.abs(planned).max() * rng.uniform(0.3, 1.0, joints)
    lag = round(rng.uniform(0.001, 0.02) * RATE)
    measured = np.concatenate((planned[:lag], planned[: len(time) - lag]))
    position = rng.uniform(-2, 2, joints) + np.cumsum(measured, axis=0) / RATE
    return Run(
        time=time,
        velocity=measured,
        velocity_desired=planned,
        position=position,
        stages={"planned": planned},
        joint_names=tuple(f"joint{number}" for number in range(joints)),
    )


def _planned(rng: np.random.Generator, time: Array) -> Array:
    if rng.uniform() < 0.3:  # sines, as of legs
        frequencies, phases = rng.uniform(0.2, 2.0, (2, 1)), rng.uniform(0, 6, (2, 1))
        return np.asarray(np.sin(2 * np.pi * frequencies * time + phases).sum(axis=0))
    velocity, start, blunt = np.zeros(len(time)), 0.0, rng.uniform() < 0.5
    while start < time[-1]:
        last = rng.uniform(0.5, 3.0)
        phase = np.clip((time - start) / last, 0.0, 1.0)
        shape = 16 * (phase * (1 - phase)) ** 2  # minimum jerk, or a trapezoid
        shape = np.minimum(1.0, 4.0 * np.minimum(phase, 1 - phase)) if blunt else shape
        velocity += rng.choice((-1.0, 1.0)) * rng.uniform(0.3, 1.0) * shape
        start += last + rng.choice((0.0, 0.3))
    return velocity


@cache
def loaded(path: Path) -> Run:
    """A simulated run."""
    return Run.load(path)


def smooth(run: Run) -> bool:
    """Whether the drives of a simulated run add nothing that goes with their angle."""
    return not run.meta["domain"]["ripple"] and not run.meta["domain"]["cogging"]


def with_fault(run: Run, kind: str, finding: Block, rng: np.random.Generator) -> Run:
    """A run with something in one joint, at the time of a finding."""
    inside = _inside(run, finding)
    time = run.time[inside] - finding.start
    size = AMPLITUDE[0] * (AMPLITUDE[1] / AMPLITUDE[0]) ** rng.uniform()
    frequency = 12.0 * 20.0 ** rng.uniform()
    joint = int(rng.integers(len(run.joint_names)))
    velocity = run.velocity.astype(np.float64)
    cycles = frequency * time + rng.uniform()
    if kind == "wandering":
        cycles = cycles + frequency * 0.1 * np.cumsum(_planned(rng, run.time)[inside]) / run.rate
    wave = np.sin(2 * np.pi * cycles)
    if kind == "decaying":
        wave *= np.exp(-((time - rng.uniform() * time[-1]) ** 2) / rng.uniform(0.05, 0.5) ** 2)
    if kind == "tones":
        for other in 12.0 * 20.0 ** rng.uniform(size=2):
            wave += np.sin(2 * np.pi * other * time + rng.uniform(0, 6))
    if kind == "blows":
        wave = np.zeros(len(time))
        for moment in rng.uniform(0, time[-1], rng.integers(1, 4)):
            after = np.maximum(time - moment, 0.0)
            ring = np.cos(2 * np.pi * frequency * after) * rng.integers(2) + 1.0
            wave += (time >= moment) * ring * np.exp(-after / rng.uniform(0.005, 0.1))
    if kind in ("white", "rough"):
        wave = rng.standard_normal(len(time))
        wave = wave * velocity[inside, joint] if kind == "rough" else wave
    if kind != "nothing":
        velocity[inside, joint] += size * wave
    position = run.position + np.cumsum(velocity - run.velocity, axis=0) / run.rate
    return replace(run, velocity=velocity, position=position)


def with_positions(log: Run, run: Run, wanted: bool) -> Run:
    """A log with the positions of its run, or without."""
    if not wanted or run.position is None:
        return log
    columns = [np.interp(log.time, run.time, column) for column in run.position.T]
    return replace(log, position=np.stack(columns, axis=1))


def fast(signal: Array, rate: float) -> Array:
    """A signal above 10 Hz, for levels."""
    sections = butter(4, 10.0, "highpass", fs=rate, output="sos")
    return np.asarray(sosfiltfilt(sections, signal))


def rms(signal: Array, run: Run, finding: Block) -> float:
    """Root mean square of a signal of a run during a finding."""
    return float(np.sqrt(np.mean(np.square(signal[_inside(run, finding)]))))


def _inside(run: Run, finding: Block) -> Array:
    return np.asarray((run.time >= finding.start) & (run.time < finding.stop))


if __name__ == "__main__":
    main()
