"""Link twists beside the loop over Pinocchio that they replace, on TALOS."""

from collections.abc import Iterator
from functools import partial

import numpy as np
import pinocchio as pin

from benchmarks.table import Row, in_turns, used
from noisemodel import Robot, link_twists
from noisemodel.types import Array

SAMPLES = 20_000
REPEATS = 5
LOOP = "loop over Pinocchio"


def rows(_: object) -> Iterator[Row]:
    """Twists of all links, beside a loop that reads them sample by sample."""
    robot = Robot.load("talos")
    motion = states(robot, SAMPLES)
    sides = {"ours": link_twists, LOOP: loop_by_sample}
    works = {name: partial(used, partial(each, robot, *motion)) for name, each in sides.items()}
    times = in_turns(works, REPEATS)
    what = f"twists of TALOS, {SAMPLES:,} states"
    yield Row(what, times["ours"], LOOP, times[LOOP], wanted=30.0)


def states(robot: Robot, samples: int) -> tuple[Array, Array]:
    """Random configurations, shape (samples, nq), and velocities, shape (samples, nv)."""
    random = np.random.default_rng(0)
    q = random.uniform(-1.0, 1.0, (samples, robot.nq))
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
    return q, random.standard_normal((samples, robot.nv))


def loop_by_sample(robot: Robot, q: Array, v: Array) -> Array:
    """Twists of all links, written sample by sample."""
    model, data = robot.model, robot.model.createData()
    twists = np.empty((len(q), model.njoints, 6))
    for sample in range(len(q)):
        pin.forwardKinematics(model, data, q[sample], v[sample])
        twists[sample] = [motion.vector for motion in data.v]
    return twists
