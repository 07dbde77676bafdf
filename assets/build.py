"""Make the files that ship: simulate arms, train the models, measure them, cut the demo run.

    python assets/build.py [--folder build] [--jobs 2]

Each run is kept twice: as simulated, and with a noisier log, since the velocities of real robots
are up to ten times noisier than a good encoder's. Good runs are kept a third time without any
sensor noise, as other simulators have it, and standstill is added. Runs stay in the folder;
started again, this makes what is missing and redoes nothing.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed
from scipy.signal import butter, sosfilt

import scenarios
from inspector.training import evaluate, train
from noisemodel import Block, Run

HERE = Path(__file__).parent
ROBOT = "panda"
SEEDS = {"train": range(48), "test": range(100, 148)}
WITH_DEFECTS = {"train": range(20), "test": range(100, 110)}
"""Every seed gives a good run; these give one of each scenario."""
SCENARIOS = (
    "straight",
    "obstacle-full",
    "decalibrated",
    "reference-jump",
    "force-jump",
    "limit-cycle",
    "faint-oscillation",
)
RATES = {"arm-10khz": 10_000.0, "arm-1khz": 1000.0}
DEMO = ("obstacle-full", 100, 4.0)


def main() -> None:
    """Make everything."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--folder", type=Path, default=HERE.parent / "build")
    arguments.add_argument("--jobs", type=int, default=2)
    options = arguments.parse_args()
    for kind, seeds in SEEDS.items():
        folder = options.folder / kind
        folder.mkdir(parents=True, exist_ok=True)
        Parallel(n_jobs=options.jobs, verbose=5)(
            delayed(_simulate)(folder, seed, defects=seed in WITH_DEFECTS[kind]) for seed in seeds
        )
    for name, rate in RATES.items():
        model = HERE / "models" / f"{name}.npz"
        train([options.folder / "train"], "logbands", rate, model, overwrite=True)
        print(f"\n{name} on seeds that it was not trained on:")
        print(evaluate(model, [options.folder / "test"]))
    demo().save(HERE / "runs" / "demo.npz", overwrite=True)


def _simulate(folder: Path, seed: int, *, defects: bool) -> None:
    """Simulate the scenarios of one seed, which share their twin; keep the velocities alone."""
    for scenario in SCENARIOS if defects else SCENARIOS[:1]:
        path = folder / f"{scenario}-{seed:03d}.npz"
        if path.exists():
            continue
        try:
            run = scenarios.simulate(ROBOT, scenario, seed)
        except scenarios.SimulationError as error:
            print(f"left out: {error}")
            continue
        slim = replace(run, position=None, position_desired=None, effort=None, stages={})
        slim.save(path)
    for path in sorted(folder.glob(f"*-{seed:03d}.npz")):
        noisier = path.with_stem(f"{path.stem}-noisy")
        if not noisier.exists():
            _noisier(Run.load(path), seed).save(noisier)
    clean = folder / f"straight-{seed:03d}-clean.npz"
    if not clean.exists():
        run = Run.load(folder / f"straight-{seed:03d}.npz")
        assert run.velocity_desired is not None
        replace(run, velocity=run.velocity_desired).save(clean)
    still = folder / "standstill.npz"
    if not still.exists():
        run = Run.load(clean)
        silence = np.zeros_like(run.velocity)
        replace(run, velocity=silence, velocity_desired=silence).save(still, overwrite=True)


def _noisier(run: Run, seed: int) -> Run:
    """Log the measured velocities through a noisier, slower estimator than the drive's own."""
    generator = np.random.default_rng(seed)
    level = np.exp(generator.uniform(np.log(5e-4), np.log(1e-2)))  # [rad/s]
    corner = np.exp(generator.uniform(np.log(50.0), np.log(2000.0)))  # [Hz]
    sections = butter(1, corner, fs=run.rate, output="sos")
    noise = sosfilt(sections, generator.normal(size=run.velocity.shape), axis=0)
    noise *= level / noise.std()
    return replace(run, velocity=(run.velocity + noise).astype(np.float32))


def demo() -> Run:
    """Cut the demo from a run: what the inspector shows, no more."""
    scenario, seed, seconds = DEMO
    run = scenarios.simulate(ROBOT, scenario, seed)
    kept = slice(0, int(np.searchsorted(run.time, seconds)))
    assert run.position is not None
    assert run.velocity_desired is not None
    return Run(
        time=run.time[kept],
        velocity=run.velocity[kept],
        position=run.position[kept],
        velocity_desired=run.velocity_desired[kept],
        joint_names=run.joint_names,
        robot=run.robot,
        blocks=tuple(
            Block(block.start, min(block.stop, seconds), block.label)
            for block in run.blocks
            if block.start < seconds
        ),
        meta=run.meta,
    )


if __name__ == "__main__":
    main()
