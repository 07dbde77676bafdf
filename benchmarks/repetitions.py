"""Repetitions of motions for `inspector.reference`: good runs and faults of simulated robots.

    python -m benchmarks.repetitions make /tmp/dev        # about 20 processor minutes
    python -m benchmarks.repetitions table /tmp/dev

Each robot makes two motions; a motion has six good repetitions with other sensor noise, frictions
and gains, and faults of its scenarios. A fault is detectable if the labelling rule says so: it is
at least 3 dB above the same run without it.
"""

import sys
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np

from noiseclassifier.scenarios.drives import Drives
from noiseclassifier.scenarios.faults import NO_DEFECT, Imperfections, drawn
from noiseclassifier.scenarios.labels import annotate, unplanned
from noiseclassifier.scenarios.motions import RATE, STEP, times
from noiseclassifier.scenarios.robots import ROBOTS
from noiseclassifier.scenarios.simulation import recorded
from noiseclassifier.scenarios.table import SCENARIOS
from noiseclassifier.scenarios.world import reduced_model
from noisemodel import Run, decimated

WAYS, GOOD = ("straight", "curve"), 6
DEFECTS = (
    "obstacle-full",
    "obstacle-toe",
    "multisine-20-30",
    "multisine-60-100",
    "multisine-150-250",
    "force-jump",
    "limit-cycle",
    "reference-jump",
)


def trial(robot, way, repetition, defect, seed, duration=5.0):
    """Motion and events of one run; the repetition decides noise, friction and gains."""
    simulated = ROBOTS[robot]
    family = import_module(f"noiseclassifier.scenarios.{simulated.family}")
    motion = SCENARIOS[way].cases[simulated.family].motion
    plan = family.plan(simulated, motion, np.random.default_rng((seed, 1)), duration)
    joints = len(simulated.drives.joints)
    same = Imperfections.draw(
        np.random.default_rng((seed, 2)),
        joints,
        bodies=reduced_model(simulated).njoints - 1,
        payload=simulated.payload,
        force=simulated.force_noise,
    )
    rng = np.random.default_rng((seed, 3, repetition))

    def other(values, spread):
        return tuple((np.array(values) * rng.uniform(1 - spread, 1 + spread, len(values))).tolist())

    imperfections = replace(
        same,
        friction=other(same.friction, 0.1),
        viscous=other(same.viscous, 0.1),
        stiffness=other(same.stiffness, 0.02),
        damping=other(same.damping, 0.02),
    )
    fault = SCENARIOS[defect].cases[simulated.family].defect if defect else NO_DEFECT
    faults = drawn(fault, np.random.default_rng((seed, 4, len(defect))), plan, simulated.drives)
    scene = family.scene(simulated, plan, faults, imperfections)
    noise = np.random.default_rng((seed, 5, repetition))
    drives = Drives(
        scene.start[-joints:],
        drivetrain=simulated.drives,
        offset=faults.offsets(joints),
        imperfections=imperfections,
    )
    motion = recorded(scene, drives, plan, faults, imperfections, noise)
    return motion, faults.events + unplanned(motion.contact, plan.contacts) + scene.events


def run_of(motion, robot, scenario, blocks=()):
    """The run, at 1 kHz."""
    names = ("velocity", "velocity_desired", "position_desired")
    signals = {name: getattr(motion, name).astype(np.float32) for name in names}
    signals["position"] = motion.position.astype(np.float32)
    run = Run(
        time=times(len(motion.velocity), STEP),
        joint_names=ROBOTS[robot].drives.joints,
        robot=robot,
        blocks=blocks,
        meta={"scenario": scenario},
        velocity=signals["velocity"],
        velocity_desired=signals["velocity_desired"],
        stages={"position": signals["position"], "target": signals["position_desired"]},
    )
    run = decimated(run, 1000.0)
    stages = dict(run.stages)
    return replace(run, stages={}, position=stages["position"], position_desired=stages["target"])


def make(folder, robots=("panda", "go2", "talos")):
    """Simulate what is missing."""
    for robot in robots:
        for place, way in enumerate(WAYS):
            seed = 700 + place
            twins = {}
            for repetition in range(GOOD):
                path = folder / robot / f"{way}-{repetition + 1}.npz"
                try:
                    twins[repetition] = trial(robot, way, repetition, "", seed)[0]
                except Exception as error:
                    print(path, "failed:", error)
                    continue
                path.parent.mkdir(parents=True, exist_ok=True)
                run_of(twins[repetition], robot, way).save(path, overwrite=True)
                print(path, flush=True)
            for number, defect in enumerate(DEFECTS):
                repetition = number % GOOD
                path = folder / robot / "faults" / f"{way}-{defect}-{repetition + 1}.npz"
                if path.exists() or repetition not in twins:
                    continue
                try:
                    motion, events = trial(robot, way, repetition, defect, seed)
                except Exception as error:
                    print(path, "failed:", error)
                    continue
                twin = twins[repetition]
                blocks, _ = annotate(motion.velocity, twin.velocity, events, rate=RATE)
                path.parent.mkdir(parents=True, exist_ok=True)
                run_of(motion, robot, way, blocks).save(path, overwrite=True)
                print(path, [block.label for block in blocks], flush=True)


if __name__ == "__main__":
    if sys.argv[1] == "make":
        make(
            Path(sys.argv[2]),
            sys.argv[3].split(",") if len(sys.argv) > 3 else ("panda", "go2", "talos"),
        )
