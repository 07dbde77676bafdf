"""Repetitions of motions for `inspector.reference`: good runs and faults of simulated robots.

    python -m benchmarks.repetitions make DIR [panda,go2,talos]     # about 5 processor minutes
    python -m benchmarks.repetitions table DIR [panda,go2,talos]
    python -m benchmarks.repetitions pool

Each robot makes two motions; a motion has six good repetitions with other sensor noise, frictions
(by 10 %) and gains (by 2 %), and eight faults. A fault is detectable if the labelling rule says so.
Margins and floors were chosen on panda, go2 and talos; ur10, anymal and arm are measured only. The
arm is one of another simulator, `benchmarks.arm`, with five faults of each motion; the pool are
runs of four of its motions, 15 accepted and 10 others each, as they are and with a chatter.
"""

import sys
from collections.abc import Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np

from benchmarks import arm
from inspector.reference.judging import Comparison, Scenario, compare, margin_of
from inspector.reference.levels import Levels, levels
from inspector.reference.store import calibrated, of_runs
from noiseclassifier.scenarios.drives import Drives
from noiseclassifier.scenarios.faults import Imperfections, no_defect
from noiseclassifier.scenarios.labels import annotate, unplanned
from noiseclassifier.scenarios.motions import RATE, STEP, times
from noiseclassifier.scenarios.robots import ROBOTS
from noiseclassifier.scenarios.simulation import SCENARIOS, recorded
from noiseclassifier.scenarios.world import reduced_model
from noisemodel import Run, decimated

WAYS, GOOD = ("straight", "curve"), 6
DEFECTS = (
    *("obstacle-full", "obstacle-toe", "multisine-20-30", "multisine-60-100"),
    *("multisine-150-250", "force-jump", "limit-cycle", "reference-jump"),
)
# Added faults: root mean square of a tone of 62 Hz and 1 s, and size of a blow, in [rad/s].
TONE, BLOW = 0.05, 0.3
# Runs of each motion of the pool, others, and root mean square of their chatter, in [rad/s].
POOLED, JUDGED, CHATTER = 15, 10, 0.012


def trial(robot: str, way: str, repetition: int, fault: str, seed: int):
    """Motion and events of one run of 5 s; the repetition decides noise, friction and gains."""
    simulated = ROBOTS[robot]
    family = import_module(f"noiseclassifier.scenarios.{simulated.family}")
    motion = SCENARIOS[way].cases[simulated.family].motion
    plan = family.plan(simulated, motion, np.random.default_rng((seed, 1)), 5.0)
    joints = len(simulated.drives.joints)
    bodies = reduced_model(simulated).njoints - 1
    same = Imperfections.draw(np.random.default_rng((seed, 2)), simulated, bodies=bodies)
    rng = np.random.default_rng((seed, 3, repetition))

    def other(values: Sequence[float], spread: float) -> tuple[float, ...]:
        return tuple((np.array(values) * rng.uniform(1 - spread, 1 + spread, len(values))).tolist())

    imperfections = replace(
        same,
        friction=other(same.friction, 0.1),
        viscous=other(same.viscous, 0.1),
        stiffness=other(same.stiffness, 0.02),
        damping=other(same.damping, 0.02),
    )
    defect = SCENARIOS[fault].cases[simulated.family].defect if fault else no_defect
    rng = np.random.default_rng((seed, 4, len(fault)))
    faults = defect(rng, plan)
    scene = family.scene(simulated, plan, faults, imperfections)
    drives = Drives(scene.start[-joints:], simulated.drives, faults.offsets(joints), imperfections)
    noise = np.random.default_rng((seed, 5, repetition))
    found = recorded(scene, drives, plan, faults, imperfections, noise)
    return found, (*faults.events, *scene.events, *unplanned(found.contact, plan.contacts))


def save(motion, robot: str, way: str, path: Path, blocks=()) -> None:
    """Write a run at 1 kHz."""
    stages = {"position": motion.position, "target": motion.position_desired}
    run = Run(
        time=times(len(motion.velocity), STEP),
        joint_names=ROBOTS[robot].drives.joints,
        robot=robot,
        blocks=blocks,
        meta={"scenario": way},
        velocity=motion.velocity,
        velocity_desired=motion.velocity_desired,
        stages=stages,
    )
    run = decimated(run, 1000.0)
    position, target = run.stages["position"], run.stages["target"]
    path.parent.mkdir(parents=True, exist_ok=True)
    replace(run, stages={}, position=position, position_desired=target).save(path, overwrite=True)
    print(path, [block.label for block in blocks], flush=True)


def make_arm(folder: Path) -> None:
    """Simulate the runs of the arm."""
    for place, way in enumerate(WAYS):
        twins = [arm.trial(place, n) for n in range(GOOD)]
        runs = {f"{way}-{n}.npz": twin for n, twin in enumerate(twins, 1)}
        for number, fault in enumerate(arm.FAULTS):
            twin = number % GOOD
            run = arm.trial(place, twin, fault)
            blocks = arm.labelled(run, twins[twin])
            runs[f"faults/{way}-{fault}-{twin + 1}.npz"] = replace(run, blocks=blocks)
        for name, run in runs.items():
            path = folder / "arm" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            run.save(path, overwrite=True)


def pool() -> None:
    """Print what is found among runs of four motions beside 60 accepted ones of all together."""
    accepted, others = [], []
    for motion in range(arm.MOTIONS):
        runs = [arm.trial(motion, number) for number in range(POOLED + JUDGED)]
        accepted += [levels(run, name=f"motion{motion}") for run in runs[:POOLED]]
        others += runs[POOLED:]
    reference = of_runs(accepted)
    found = flagged = 0
    for run in others:
        chatter = CHATTER * np.sqrt(2) * np.sin(2 * np.pi * 62 * run.time)
        velocity = np.array(run.velocity)
        velocity[:, 2] += chatter
        loud = replace(run, velocity=velocity)
        flagged += bool(compare(levels(run), reference).exceedances)
        found += bool(compare(levels(loud), reference).exceedances)
    print(
        f"{len(accepted)} accepted runs of {arm.MOTIONS} motions: {found} of {len(others)} with a"
        f" chatter of {CHATTER:g} rad/s found, {flagged} of {len(others)} good ones flagged"
    )


def make(folder: Path, robots: Sequence[str]) -> None:
    """Simulate all runs."""
    for robot in robots:
        if robot == "arm":
            make_arm(folder)
            continue
        for place, way in enumerate(WAYS):
            twins = [trial(robot, way, n, "", 700 + place)[0] for n in range(GOOD)]
            for number, twin in enumerate(twins, 1):
                save(twin, robot, way, folder / robot / f"{way}-{number}.npz")
            for number, fault in enumerate(DEFECTS):
                twin = number % GOOD
                motion, events = trial(robot, way, twin, fault, 700 + place)
                blocks, _ = annotate(motion.velocity, twins[twin].velocity, events, rate=RATE)
                path = folder / robot / "faults" / f"{way}-{fault}-{twin + 1}.npz"
                save(motion, robot, way, path, blocks)


def slower(run: Run) -> Run:
    """The run at 0.97 of its speed, begun 0.5 s later."""
    at = np.concatenate((np.zeros(500), np.arange(0, len(run.time) - 1, 0.97)))

    def played(values, scale=1.0):
        whole = [np.interp(at, np.arange(len(values)), column) for column in values.T]
        return scale * np.stack(whole, axis=1)

    return replace(
        run,
        time=np.arange(len(at)) / run.rate,
        valid=None,
        blocks=(),
        position=played(run.position),
        position_desired=played(run.position_desired),
        velocity=played(run.velocity, 0.97),
        velocity_desired=played(run.velocity_desired, 0.97),
    )


def with_fault(run: Run, joint: int, kind: str) -> Run:
    """A good run with a fault of a known joint, at 2 s."""
    since = run.time - 2.0
    tone = np.sqrt(2) * TONE * np.sin(2 * np.pi * 45 * since) * ((since > 0) & (since < 1))
    blow = BLOW * np.exp(-np.maximum(since, 0) * 15) * np.sin(2 * np.pi * 45 * since) * (since > 0)
    velocity = np.array(run.velocity, dtype=np.float64)
    velocity[:, joint] += tone if kind == "tone" else blow
    return replace(run, velocity=velocity, blocks=())


def measured(path: Path, change=lambda run: run) -> tuple[Levels, bool]:
    """Levels of a run, and whether it has a detectable fault."""
    run = Run.load(path)
    felt = any(block.label != "ok" for block in run.blocks)
    return levels(change(run), name=path.stem.partition("-")[0]), felt


def beside(run: Levels, twin: int, good: Sequence[Levels], k: int, others) -> Comparison:
    """A run beside k repetitions, not its twin, and other motions."""
    used = tuple(good[(twin + 1 + n) % GOOD] for n in range(k))
    own = [calibrated(Scenario(run.name, used))] if k else []
    return compare(run, [*own, *others])


def table(folder: Path, robots: Sequence[str]) -> None:
    """Print faults found, good runs flagged, and whether the joint and the octave are right."""
    rows = [("3 repetitions", 3, False), ("1 repetition", 1, False), ("5 repetitions", 5, False)]
    rows += [("3 repetitions, 3 % slower, 0.5 s later", 3, True), ("other motions only", 0, False)]
    sides: dict[tuple[str, str], list[Levels]] = {}
    for robot in robots:
        for way in WAYS:
            paths = sorted((folder / robot).glob(f"{way}-*.npz"))
            sides[robot, way] = [measured(path)[0] for path in paths]
    print("| references | faults found | good runs flagged | margin [dB] |\n|---|---|---|---|")
    for title, k, late in rows:
        found = total = flagged = 0
        margins: list[float] = []
        for (robot, way), good in sides.items():
            other = next(each for each in WAYS if each != way)
            others = [calibrated(Scenario(other, tuple(sides[robot, other])))]
            change = slower if late else lambda run: run
            for twin in range(GOOD):
                run, _ = measured(folder / robot / f"{way}-{twin + 1}.npz", change)
                result = beside(run, twin, good, k, others)
                flagged += bool(result.exceedances)
                margins += [margin.db for margin in result.margins.values()]
            for path in sorted((folder / robot / "faults").glob(f"{way}-*.npz")):
                felt = measured(path)[1]
                result = beside(measured(path, change)[0], int(path.stem[-1]) - 1, good, k, others)
                total += felt
                found += felt and bool(result.exceedances)
        span = f"{min(margins):.1f} to {max(margins):.1f}"
        print(
            f"| {title} | {found} of {total} | {flagged} of {GOOD * len(sides)} | {span} |",
            flush=True,
        )
    right = total = found = 0
    for (robot, way), good in sides.items():
        run = Run.load(folder / robot / f"{way}-1.npz")
        for joint, kind in ((j, k) for j in range(len(run.joint_names)) for k in ("tone", "blow")):
            own = levels(with_fault(run, joint, kind), name=way)
            result = beside(own, 0, good, 3, [])
            total += 1
            found += bool(result.exceedances)
            if result.exceedances:
                worst = max(result.exceedances, key=lambda each: each.db)
                right += worst.joint == run.joint_names[joint] and worst.octave[0] == 32.0
    print(f"added tones and blows: {found} of {total} found, joint and octave right in {right}")
    reshuffled(sides)


def reshuffled(sides: dict[tuple[str, str], list[Levels]], draws: int = 1000) -> None:
    """Print how often 3 + 3 good runs, drawn anew, differ as `diff` says it: by their median."""
    rng, worse, count = np.random.default_rng(0), 0, 0
    for good in sides.values():
        for _ in range(draws // len(sides)):
            order = rng.permutation(GOOD)
            before = calibrated(Scenario(good[0].name, tuple(good[n] for n in order[:3])))
            over = [compare(good[n], [before]).worst for n in order[3:]]
            margin = margin_of(before.scores_db, 3).db
            worse += bool(np.median(over) > margin or max(over) > margin + 3.0)
            count += 1
    print(f"same code, 3 + 3 runs drawn anew from six: {worse} of {count} scenarios worse")


if __name__ == "__main__":
    if sys.argv[1] == "pool":
        pool()
    else:
        chosen = sys.argv[3].split(",") if len(sys.argv) > 3 else ("panda", "go2", "talos")
        {"make": make, "table": table}[sys.argv[1]](Path(sys.argv[2]), chosen)
