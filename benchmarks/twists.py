"""Time link_twists against the loop over Pinocchio that it replaces, on TALOS.

Run from the checkout: ``python -m benchmarks.twists [samples]``. One process; the variants take
turns, so that a slower machine affects all of them; CPU time.
"""

import argparse
import time
from collections.abc import Callable
from statistics import median

import numpy as np
import pinocchio as pin

from noisemodel import Robot, link_twists
from noisemodel.types import Array

REPEATS = 5


def main() -> None:
    """Print medians and ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("samples", nargs="?", type=int, default=100_000, help="states of TALOS")
    samples = parser.parse_args().samples
    robot = Robot.load("talos")
    q, v = states(robot, samples)
    variants: dict[str, Callable[[Robot, Array, Array], Array]] = {
        "link_twists": link_twists,
        "loop, twist by twist": loop_by_twist,
        "loop, sample by sample": loop_by_sample,
    }
    times: dict[str, list[float]] = {name: [] for name in variants}
    for _ in range(REPEATS):
        for name, variant in variants.items():
            start = time.process_time()
            variant(robot, q, v)
            times[name].append(time.process_time() - start)
    ours = median(times["link_twists"])
    print(f"{samples} states of {robot.name}, nq {robot.nq}, nv {robot.nv}, median of {REPEATS}")
    for name, seconds in times.items():
        print(f"{name:24} {median(seconds):8.3f} s CPU {median(seconds) / ours:8.1f} x")


def states(robot: Robot, samples: int) -> tuple[Array, Array]:
    """Random configurations, shape (samples, nq), and velocities, shape (samples, nv)."""
    random = np.random.default_rng(0)
    q = random.uniform(-1.0, 1.0, (samples, robot.nq))
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
    return q, random.standard_normal((samples, robot.nv))


def loop_by_twist(robot: Robot, q: Array, v: Array) -> Array:
    """Twists of all links, written one by one."""
    model, data = robot.model, robot.model.createData()
    twists = np.empty((len(q), model.njoints, 6))
    for sample in range(len(q)):
        pin.forwardKinematics(model, data, q[sample], v[sample])
        for joint in range(model.njoints):
            twists[sample, joint] = data.v[joint].vector
    return twists


def loop_by_sample(robot: Robot, q: Array, v: Array) -> Array:
    """Twists of all links, written sample by sample."""
    model, data = robot.model, robot.model.createData()
    twists = np.empty((len(q), model.njoints, 6))
    for sample in range(len(q)):
        pin.forwardKinematics(model, data, q[sample], v[sample])
        twists[sample] = [motion.vector for motion in data.v]
    return twists


if __name__ == "__main__":
    main()
