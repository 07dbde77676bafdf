"""Faults added to good runs: how loud one has to be for a finding.

    python benchmarks/sensitivity.py [--trials 2] [--seed 9000]

Prints the exit status of `inspector classify` for tones on one joint of a Panda and of a TALOS, by
frequency and amplitude. Then the share of faults that are found on a Panda, a Go2 and a TALOS, at
10 kHz and 1 kHz, by kind and level: tones, noise of an octave, and decaying sines, on joints drawn
at random. The level is the root mean square of the run above the model's lowest band, but at least
`FELT`, times a factor; that of a decaying sine is taken over its first 0.1 s.
"""

import argparse
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

import noisemodel as nm
from inspector.analysis.analyse import analyse
from inspector.analysis.status import EXIT
from inspector.library import load_library, signals_of
from noiseclassifier import scenarios

JOINTS = {"panda": "panda_joint3", "talos": "leg_left_4_joint"}
TONES, AMPLITUDES = (35.0, 90.0, 180.0), (0.1, 0.3, 1.0, 3.0, 10.0, 100.0)
FREQUENCIES = (20.0, 35.0, 60.0, 100.0, 180.0, 300.0, 400.0, 900.0)
KINDS, FACTORS = ("tone", "noise", "decaying sine"), (1, 3, 10, 100, 1000)
FELT = 0.02
"""Level of the faintest fault, in [rad/s]."""
LIBRARY = load_library()


def with_fault(run: nm.Run, joint: int, fault: np.ndarray) -> nm.Run:
    """Add a fault, shape (samples,), to the measured velocity of a joint."""
    velocity = run.velocity.astype(np.float64)
    velocity[:, joint] += fault
    return replace(run, velocity=velocity)


def statuses(run: nm.Run, joint: int, frequency: float) -> Iterator[int]:
    """Exit statuses for a tone of 1.5 s, by rising amplitude."""
    time = run.time - run.time[0]
    tone = np.sin(2 * np.pi * frequency * time) * ((time > 2.0) & (time < 3.5))
    for amplitude in AMPLITUDES:
        yield EXIT[analyse(with_fault(run, joint, amplitude * tone), LIBRARY).status]


def fault_of(run: nm.Run, kind: str, frequency: float, random: np.random.Generator) -> np.ndarray:
    """A fault of level 1 that starts after 1 s, shape (samples,)."""
    time = run.time - run.time[0]
    if kind == "decaying sine":
        since = np.maximum(time - 1.0, 0.0)
        fault = np.exp(-since * frequency / 3.0) * np.sin(2 * np.pi * frequency * since)
        return fault / np.sqrt(np.mean(fault[(time >= 1.0) & (time < 1.1)] ** 2))
    during = (time > 1.0) & (time < 2.0)
    if kind == "tone":
        return np.sqrt(2.0) * np.sin(2 * np.pi * frequency * time) * during
    waves = np.fft.rfft(random.normal(size=len(time)))
    place = np.fft.rfftfreq(len(time), 1 / run.rate)
    waves[(place < frequency / np.sqrt(2.0)) | (place > frequency * np.sqrt(2.0))] = 0.0
    noise = np.fft.irfft(waves, len(time))
    return noise / noise.std() * during


def level_of(run: nm.Run, low: float, high: float) -> float:
    """Root mean square of all joints between two frequencies, in [rad/s]."""
    waves = np.fft.rfft(run.velocity.astype(np.float64), axis=0)
    place = np.fft.rfftfreq(len(run.time), 1 / run.rate)
    inside = (place > low) & (place < high)
    return float(np.sqrt(2 * np.sum(np.abs(waves[inside]) ** 2)) / len(run.time))


def found(run: nm.Run, trials: int, random: np.random.Generator) -> dict[str, np.ndarray]:
    """Whether each fault is found, by kind, shape (faults, factors)."""
    good = analyse(run, LIBRARY)
    profile = LIBRARY[good.model].at(run.rate, signals_of(run)).profile
    low, high = (profile.edges[place] for place in (0, -1))
    level = max(level_of(run, low, high), FELT)
    rows: dict[str, list[list[bool]]] = {kind: [] for kind in KINDS}
    for kind in KINDS:
        for frequency in (each for each in FREQUENCIES if each < 0.95 * high):
            for _ in range(trials):
                joint = int(random.integers(run.velocity.shape[1]))
                fault = level * fault_of(run, kind, frequency, random)
                loud = (with_fault(run, joint, factor * fault) for factor in FACTORS)
                rows[kind].append([bool(analyse(each, LIBRARY).findings) for each in loud])
    return {kind: np.array(each) for kind, each in rows.items()}


def main() -> None:
    """Print both tables."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--trials", type=int, default=2, help="joints for each fault")
    arguments.add_argument("--seed", type=int, default=9000, help="of the good runs")
    options = arguments.parse_args()
    random = np.random.default_rng(options.seed)
    runs = {
        robot: scenarios.simulate(robot, "straight", options.seed)
        for robot in ("panda", "go2", "talos")
    }
    print(f"exit statuses at {', '.join(f'{each:g}' for each in AMPLITUDES)} rad/s")
    for robot, name in JOINTS.items():
        joint = runs[robot].joint_names.index(name)
        for frequency in TONES:
            codes = " ".join(map(str, statuses(runs[robot], joint, frequency)))
            print(f"{robot:8}{frequency:5.0f} Hz   {codes}")
    every = []
    print(f"\nshare of faults found at {', '.join(map(str, FACTORS))} times the level")
    for robot, run in runs.items():
        for each in (run, nm.decimated(run, 1000.0)):
            for kind, hits in found(each, options.trials, random).items():
                shares = " ".join(f"{share:5.0%}" for share in hits.mean(axis=0))
                print(f"{robot:8}{each.rate:6.0f} Hz  {kind:14}{len(hits):4}  {shares}")
                every.append(hits)
    hits = np.concatenate(every)
    shares = " ".join(f"{share:5.0%}" for share in hits.mean(axis=0))
    print(f"{'all':32}{len(hits):4}  {shares}")
    fainter = int((hits[:, 1:] < hits[:, :-1]).sum())
    print(
        f"{fainter} louder faults of {hits[:, 1:].size} are missed where the fainter one is found"
    )


if __name__ == "__main__":
    main()
