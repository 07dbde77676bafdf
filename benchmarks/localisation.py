"""Accuracy of the fault localisation: stage, limb, joints and band.

    python -m benchmarks.localisation build/localisation [--robots talos,go2,panda] [--seeds 3,4]

Simulates runs whose defects are known, into a folder; existing runs are not simulated
again. For each event that became a label, the localised stage is compared with the one in which the
defect acts, the first three links with the limb on which it acts: the leg whose foot had the
contact, whose sensor or plan jumped, or that alone oscillated; arms have one limb. Events without
a limb of their own are left out of that column. The localised band is compared with that of
commanded oscillations: correct if they overlap.
"""

import argparse
from collections import defaultdict
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import noisemodel as nm
from inspector.localisation import fault_links, localise
from noiseclassifier.scenarios import ROBOTS, ScenarioError, SimulationError, simulate
from noisemodel.noise import LinkNoise, link_noise

SCENARIOS = (
    "obstacle-full",
    "decalibrated",
    "early-height",
    "platform",
    "force-jump",
    "torque-jump",
    "limit-cycle",
    "multisine-30-40",
    "multisine-100-150",
    "reference-jump",
)
# The stage in which each cause acts; jumps of sensors act in the commanded one.
ACTS = {
    "jump of the planned motion": "planned",
    "force control with too high a gain": "commanded",
    "multi-sine on the reference": "desired",
    "unplanned contact": "measured",
    "ground that gives way": "measured",
    "ground that is not there": "measured",
    "partial contact at an edge": "measured",
}
LATE = 0.15  # largest delay of a label after its cause, in [s]


def run_of(folder: Path, robot: str, scenario: str, seed: int, seconds: float) -> nm.Run | None:
    """A run, loaded or simulated; None if the robot has no such scenario, or falls."""
    path = folder / f"{robot}-{scenario}-{seed}.npz"
    if not path.exists():
        try:
            simulate(robot, scenario, seed, duration=seconds).save(path)
        except (ScenarioError, SimulationError) as error:
            print(f"{path.stem}: {error}")
            return None
    return nm.Run.load(path)


def labelled(run: nm.Run) -> Iterator[tuple[dict[str, Any], nm.Block]]:
    """Events that became a label, each with its first block."""
    for event in run.meta["events"]:
        for block in run.blocks:
            near = event["start"] - 0.02 <= block.start < event["stop"] + LATE
            if event["labelled"] > 0.0 and block.label == event["label"] and near:
                yield event, block
                break


def limb_of(robot: str, event: dict[str, Any]) -> tuple[str, ...]:
    """Joints of the limb on which an event acts; empty if it acts on more than one."""
    drives, effectors, facts = ROBOTS[robot].drives.joints, ROBOTS[robot].effectors, event["facts"]
    if len(effectors) == 1:
        return drives
    if "base." in event["cause"]:
        return ()
    alone = [index for index, share in enumerate(facts.get("effectors", ())) if share]
    effector = facts.get("effector", alone[0] if len(alone) == 1 else None)
    if effector is None:
        return ()
    model = nm.Robot.load(robot).model
    carrier = model.frames[model.getFrameId(effectors[effector].frame)].parentJoint
    way = [model.names[joint] for joint in model.supports[carrier]]
    return tuple(name for name in way if name in drives)


def links_of(robot: str, joints: tuple[str, ...]) -> set[str]:
    """Links that the joints of a limb move, by the joint that carries each."""
    known = nm.Robot.load(robot)
    surface = nm.Surface.of(known, "auto")
    carried = zip(surface.names, surface.joint, strict=True)
    return {name for name, index in carried if known.joints[index - 1].name in joints}


def check(run: nm.Run, links: LinkNoise) -> Iterator[dict[str, bool]]:
    """For each event whether stage, limb, joints and band are correct."""
    robot, known = str(run.robot), localise(run, ())
    for event, block in labelled(run):
        found = known[block]
        marks = {"stage": found.stage == ACTS.get(event["cause"], "commanded")}
        joints = limb_of(robot, event)
        if joints:
            named = {link for link, _ in fault_links(links, block, list(known), known=found)}
            marks["limb"] = bool(named & links_of(robot, joints))
            marks["joints"] = any(joint in joints for joint, _ in found.joints)
        if "band" in event["facts"]:
            low, high = event["facts"]["band"]
            marks["band"] = found.band is not None and (
                found.band[0] <= high and found.band[1] >= low
            )
        yield marks


def main() -> None:
    """Simulate, localise, compare and print."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("folder", type=Path)
    arguments.add_argument("--robots", default="talos,go2,panda")
    arguments.add_argument("--seeds", default="3,4")
    arguments.add_argument("--seconds", type=float, default=6.0)
    options = arguments.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    right: dict[tuple[str, str, str], list[bool]] = defaultdict(list)
    for robot in options.robots.split(","):
        # Scenarios of one seed share the run without a defect.
        for seed in options.seeds.split(","):
            for scenario in SCENARIOS:
                run = run_of(options.folder, robot, scenario, int(seed), options.seconds)
                if run is None:
                    continue
                for marks in check(run, link_noise(run)):
                    for column, mark in marks.items():
                        for row in product((scenario, "all"), (robot, "all")):
                            right[(column, *row)].append(mark)
    robots = [*options.robots.split(","), "all"]
    for column in ("stage", "limb", "joints", "band"):
        print(f"\n{column:20}" + "".join(f"{robot:>16}" for robot in robots))
        for scenario in (*SCENARIOS, "all"):
            cells = [right.get((column, scenario, robot), []) for robot in robots]
            if any(cells):
                texts = [f"{sum(c)}/{len(c)} {sum(c) / len(c):.0%}" if c else "-" for c in cells]
                print(f"{scenario:20}" + "".join(f"{text:>16}" for text in texts))


if __name__ == "__main__":
    main()
