"""A simulated arm, and what may happen to its code: `python simulate.py runs/ [CHANGE]`.

Four joints make three motions: pick, place and wave, three times each. CHANGE is one of harmless
(another order of the same noise, begun 0.2 s later), chatter, chatter-all, impact, improvement,
missing.
"""

import sys
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

import noisemodel as nm

RATE, JOINTS = 1000.0, ("shoulder", "upperarm", "elbow", "wrist")
SCENARIOS = {"pick": 1, "place": 2, "wave": 3}
CHANGES = ("harmless", "chatter", "chatter-all", "impact", "improvement", "missing")


def planned(scenario: str) -> np.ndarray:
    """Desired positions: six smooth moves between drawn postures, shape (samples, joints)."""
    rng = np.random.default_rng(SCENARIOS[scenario])
    share = np.linspace(0, 1, int(0.9 * RATE))[:, None]
    smooth = share**3 * (10 - 15 * share + 6 * share**2)
    posture, parts = np.zeros(len(JOINTS)), []
    for _ in range(6):
        aim = rng.uniform(-0.8, 0.8, len(JOINTS))
        parts += [posture + (aim - posture) * smooth, np.repeat(aim[None], int(0.1 * RATE), axis=0)]
        posture = aim
    return np.concatenate(parts)


def run(scenario: str, repetition: int, change: str = "") -> nm.Run:
    """One run; the repetition decides noise and friction."""
    rng = np.random.default_rng((SCENARIOS[scenario], repetition, change == "harmless"))
    desired = planned(scenario)
    if change == "harmless":
        desired = np.concatenate((np.repeat(desired[:1], int(0.2 * RATE), axis=0), desired))
    time = np.arange(len(desired)) / RATE
    lag = np.exp(-1.0 / (0.02 * RATE))  # drives follow with 20 ms
    position = lfilter([1 - lag], [1, -lag], desired - desired[0], axis=0) + desired[0]
    velocity = np.gradient(position, 1 / RATE, axis=0)
    ripple = 0.01 * rng.uniform(0.9, 1.1, len(JOINTS)) * (0.5 if change == "improvement" else 1.0)
    velocity += ripple * velocity * np.sin(100 * position)  # gears: the faster, the louder
    velocity += 0.002 * rng.standard_normal(velocity.shape)
    if change == "chatter-all" or (change == "chatter" and scenario == "pick"):
        velocity[:, 2] += 0.03 * np.sin(2 * np.pi * 62 * time)
    if change == "impact" and scenario == "place":
        since = np.maximum(time - 2.5, 0.0)
        velocity[:, 1] += 1.5 * np.exp(-since / 0.05) * np.sin(2 * np.pi * 35 * since)
    return nm.Run(
        time=time,
        joint_names=JOINTS,
        velocity=velocity,
        position=position,
        velocity_desired=np.gradient(desired, 1 / RATE, axis=0),
        position_desired=desired,
    )


def write(folder: Path, change: str = "") -> None:
    """Write the runs of all scenarios."""
    folder.mkdir(parents=True, exist_ok=True)
    for scenario in SCENARIOS:
        if change == "missing" and scenario == "wave":
            continue
        for repetition in (1, 2, 3):
            target = folder / f"{scenario}-{repetition}.npz"
            run(scenario, repetition, change).save(target, overwrite=True)


if __name__ == "__main__":
    write(Path(sys.argv[1]), sys.argv[2] if len(sys.argv) > 2 else "")
