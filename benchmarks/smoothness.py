"""Which score of smoothness separates chattering from clean rollouts of policies, at 50 Hz.

    python -m benchmarks.smoothness [--episodes 40] [--amplitude 1]

Scripted policies move three robots in MuJoCo: two arms in the air and a quadruped that sways on its
feet. A policy reads noisy encoders 50 times a second and answers with position targets, which the
drives hold until the next: the reference, and a correction of what it sees, as a policy with
feedback has it. A chattering policy is the same one with one of three defects. All amplitudes are
constants below; they were fixed before any score was computed, and so was the choice: the default
order of `inspector smoothness` is by the score whose area under the ROC curve, chattering (all
defects) against clean, is largest on its worst robot.
"""

import argparse
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypeAlias

import mujoco
import numpy as np

from benchmarks.elsewhere.references import KINDS, Reference, draw
from inspector.smoothness.measures import sparc, speed_of
from inspector.smoothness.scores import SCORES, scored
from noiseclassifier.evaluation.ranking import auc
from noiseclassifier.scenarios.mujoco_model import build
from noiseclassifier.scenarios.physics import Physics
from noiseclassifier.scenarios.quadruped.standing import stand
from noiseclassifier.scenarios.reduced import reduced_model
from noiseclassifier.scenarios.robots import ROBOTS
from noiseclassifier.scenarios.shapes import Box
from noisemodel import Run
from noisemodel.types import Array

RATE, STEPS = 50.0, 20
"""Of the policy and of the log, in [Hz]; steps of the simulation in between."""
SETTLING, DURATION = 1.0, 6.0
"""Before the log begins, and of the log, in [s]."""
POSITION_NOISE, VELOCITY_NOISE = 1e-4, 5e-3
"""Standard deviations of what encoders tell: about 16 bits, in [rad], and what a drive that
differentiates and filters them leaves, in [rad/s]."""
FURTHEST = 0.05
"""Largest correction of an action, three degrees: actions of policies are bounded, in [rad]."""

NOISE = (0.003, 0.02)
"""Standard deviation of noise on each action, from a fifth of a degree, which is just visible, to a
degree, which nobody would deploy, in [rad]. Drawn for each episode, evenly in its logarithm."""
DELAY = (2, 4)
"""Further delay of observations: 40 to 80 ms, the latency of inference, in ticks."""
JUMP, CHUNK = (0.01, 0.04), (10, 25)
"""Standard deviation of the jump of each joint where an action chunk begins, from half a degree to
two, in [rad], drawn as that of noise; and the length of chunks, 0.2 to 0.5 s, in ticks. The offset
decays linearly to 0 at the end of its chunk, where the next one jumps."""
CLEAN, DEFECTS, ALL = "clean", ("noise", "delay", "chunk jumps"), "all"
Areas: TypeAlias = dict[str, dict[tuple[str, str], float]]
"""Area under the ROC curve by score, and by robot and defect."""


@dataclass(frozen=True)
class Rig:
    """A robot with the drives that a policy commands.

    Attributes:
        robot: Name of the robot.
        stiffness: Of each joint's drive, in [N m/rad].
        damping: Of each joint's drive, in [N m s/rad].
        reach: Furthest reference from the posture at rest, in [rad].
        fastest: Highest speed of a reference, in [rad/s].
        gain: Of the policy's correction: half of the largest gain at which a push dies away without
            delay, the rule of Ziegler and Nichols (1942), found by simulation.
    """

    robot: str
    stiffness: tuple[float, ...]
    damping: tuple[float, ...]
    reach: float
    fastest: float
    gain: float


RIGS = (
    # Joint impedance as in the examples of libfranka.
    Rig(
        "panda",
        stiffness=(600.0,) * 4 + (250.0, 150.0, 50.0),
        damping=(50.0,) * 4 + (30.0, 25.0, 15.0),
        reach=0.6,
        fastest=1.2,
        gain=4.5,
    ),
    # Stiff drives of an industrial arm: those of the scenarios.
    Rig(
        "ur5",
        stiffness=(4000.0,) * 3 + (1000.0,) * 3,
        damping=(80.0,) * 3 + (15.0,) * 3,
        reach=0.6,
        fastest=1.2,
        gain=0.9,
    ),
    # Soft drives, as policies for legs are trained with.
    Rig("go2", stiffness=(60.0,) * 12, damping=(2.0,) * 12, reach=0.15, fastest=0.5, gain=2.6),
)
SWAY = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, -2.0], [0.0, 1.0, 0.0]])
"""Hip, thigh and calf of each leg when the body goes sideways, up and down, or to and fro."""


def rollout(rig: Rig, defect: str, seed: int, amplitude: float = 1.0) -> Run:
    """One episode of a policy.

    Args:
        rig: The robot.
        defect: One of ``DEFECTS``, or ``CLEAN``.
        seed: Random seed.
        amplitude: Of noise and jumps, times the constants.

    Returns:
        The log: measured positions and velocities, and actions as desired positions, at 50 Hz.
    """
    random = np.random.default_rng((seed, [CLEAN, *DEFECTS].index(defect), _number(rig)))
    model, start, joints = _world(rig.robot)
    for index, (stiffness, damping) in enumerate(zip(rig.stiffness, rig.damping, strict=True)):
        model.actuator_gainprm[index, 0] = stiffness
        model.actuator_biasprm[index, 1:3] = -stiffness, -damping
    data = mujoco.MjData(model)
    data.qpos[:] = start
    home = start[-joints:]
    data.ctrl[:] = home
    mujoco.mj_step(model, data, nstep=round(SETTLING * RATE) * STEPS)
    rest = data.qpos[-joints:].copy()
    reference = _reference(rig, rest, random)
    disturbed = amplitude * _disturbance(defect, len(reference.position), joints, random)
    late = random.integers(*DELAY, endpoint=True) if defect == "delay" else 0
    seen: list[Array] = []
    actions = []
    for position, offset in zip(reference.position, disturbed, strict=True):
        noise = random.standard_normal((2, joints)) * ((POSITION_NOISE,), (VELOCITY_NOISE,))
        seen.append(np.array((data.qpos[-joints:], data.qvel[-joints:])) + noise)
        known = seen[max(0, len(seen) - 1 - late)]
        correction = np.clip(rig.gain * (position - known[0]), -FURTHEST, FURTHEST)
        action = position + (home - rest) + correction + offset
        actions.append(action)
        data.ctrl[:] = action
        mujoco.mj_step(model, data, nstep=STEPS)
    measured = np.array(seen)
    return Run(
        time=np.arange(len(actions)) / RATE,
        velocity=measured[:, 1],
        position=measured[:, 0],
        position_desired=np.array(actions),
        joint_names=ROBOTS[rig.robot].drives.joints,
        robot=rig.robot,
        meta={"defect": defect, "seed": seed, "reference": reference.kind},
    )


def rollouts(rig: Rig, defect: str, episodes: int, amplitude: float = 1.0) -> Iterator[Run]:
    """Episodes of a policy, with seeds from 0 on."""
    return (rollout(rig, defect, seed, amplitude) for seed in range(episodes))


def _reference(rig: Rig, rest: Array, random: np.random.Generator) -> Reference:
    """A motion around rest; all legs of a quadruped move alike."""
    legs = ROBOTS[rig.robot].family == "quadruped"
    kind = KINDS[random.integers(len(KINDS))]
    drawn = draw(
        random,
        kind,
        np.zeros(3) if legs else rest,
        reach=rig.reach,
        duration=DURATION,
        rate=RATE,
        fastest=rig.fastest,
    )
    if not legs:
        return drawn
    return Reference(
        kind, rest + np.tile(drawn.position @ SWAY, 4), np.tile(drawn.velocity @ SWAY, 4)
    )


def _disturbance(defect: str, ticks: int, joints: int, random: np.random.Generator) -> Array:
    """What a defect adds to actions, shape (ticks, joints), in [rad]."""
    if defect == "noise":
        return _size(NOISE, random) * random.standard_normal((ticks, joints))
    added = np.zeros((ticks, joints))
    if defect == "chunk jumps":
        size, first = _size(JUMP, random), 0
        while first < ticks:
            length = int(random.integers(*CHUNK, endpoint=True))
            ramp = np.linspace(1.0, 0.0, length)[:, None] * random.standard_normal(joints)
            added[first : first + length] = size * ramp[: ticks - first]
            first += length
    return added


def _size(between: tuple[float, float], random: np.random.Generator) -> float:
    return float(np.exp(random.uniform(*np.log(between))))


def _number(rig: Rig) -> int:
    return RIGS.index(rig)


@lru_cache(maxsize=1)
def _world(name: str) -> tuple[Any, Array, int]:
    """MuJoCo model with position drives, its configuration at rest, and the number of joints.

    Arms have no weight, as if their drives bore it.
    """
    robot = ROBOTS[name]
    physics = Physics(
        timestep=1 / (RATE * STEPS),
        armature=np.array(robot.drives.armature),
        damping=np.array(robot.drives.viscous),
        friction=np.array(robot.drives.friction),
    )
    joints = len(robot.drives.joints)
    if robot.family == "quadruped":
        ground = Box(centre=(0.0, 0.0, -0.5), half=(5.0, 5.0, 0.5))
        model = build(reduced_model(robot), physics, effectors=robot.feet, boxes=(ground,))
        start = stand(robot).configuration.copy()
        start[3:7] = start[[6, 3, 4, 5]]  # MuJoCo has w first
    else:
        model = build(reduced_model(robot), physics)
        model.opt.gravity[:] = 0.0
        start = np.array(robot.rest)
    model.actuator_biastype[:] = mujoco.mjtBias.mjBIAS_AFFINE
    model.actuator_forcelimited[:] = True
    model.actuator_forcerange[:] = np.outer(robot.drives.torque, (-1.0, 1.0))
    return model, start, joints


WIDER = "sparc to 25 Hz"
"""SPARC without its cut-off, beside the scores that the command has."""


def scores_of(run: Run) -> dict[str, float | None]:
    """Roughness by each score, higher is rougher; None where the run has none."""
    episode = scored(run, "")
    found = {
        name: None if value is None else -SCORES[name].smooth * value
        for name, value in episode.scores.items()
    }
    wider = sparc(speed_of(run.velocity), run.rate, cutoff=run.rate / 2)
    return found | {WIDER: None if wider is None else -wider}


def areas(episodes: int, amplitude: float = 1.0) -> Areas:
    """Area under the ROC curve by score, and by robot and defect; "all" are all defects."""
    found: Areas = {}
    for rig in RIGS:
        scores = {
            defect: [scores_of(run) for run in rollouts(rig, defect, episodes, amplitude)]
            for defect in (CLEAN, *DEFECTS)
        }
        for name in scores[CLEAN][0]:
            columns = {defect: [row[name] for row in rows] for defect, rows in scores.items()}
            if any(value is None for column in columns.values() for value in column):
                continue
            values = {defect: np.array(column, float) for defect, column in columns.items()}
            values[ALL] = np.concatenate([values[defect] for defect in DEFECTS])
            for defect in (*DEFECTS, ALL):
                found.setdefault(name, {})[rig.robot, defect] = auc(values[CLEAN], values[defect])
    return found


def tables(found: Areas) -> Iterator[str]:
    """Lines of two tables in Markdown, the score that is best on its worst robot first."""

    def overall(name: str) -> list[float]:
        return [found[name][rig.robot, ALL] for rig in RIGS]

    def row(cells: Iterable[str]) -> str:
        return f"| {' | '.join(cells)} |"

    robots = [rig.robot for rig in RIGS]
    each = [(robot, defect) for robot in robots for defect in DEFECTS]
    names = sorted(found, key=lambda name: -min(overall(name)))
    yield row(["all defects", *robots, "mean", "worst robot"])
    yield "|" + "---|" * (len(robots) + 3)
    for name in names:
        values = overall(name)
        numbers = [*values, float(np.mean(values)), min(values)]
        yield row([f"`{name}`", *(f"{number:.3f}" for number in numbers)])
    yield ""
    yield row(["by defect", *(f"{robot}, {defect}" for robot, defect in each), "worst"])
    yield "|" + "---|" * (len(each) + 2)
    for name in names:
        numbers = [found[name][cell] for cell in each]
        yield row([f"`{name}`", *(f"{number:.3f}" for number in [*numbers, min(numbers)])])


def main() -> None:
    """Print the table."""
    arguments = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    arguments.add_argument("--episodes", type=int, default=40, help="of each robot and policy")
    arguments.add_argument(
        "--amplitude", type=float, default=1.0, help="of noise and jumps, times the constants"
    )
    given = arguments.parse_args()
    print("\n".join(tables(areas(given.episodes, given.amplitude))))


if __name__ == "__main__":
    main()
