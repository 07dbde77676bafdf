"""The extended noise beside a loop over Pinocchio, on TALOS with a floating base."""

import tracemalloc
from collections.abc import Iterator
from functools import partial

import numpy as np
import pinocchio as pin

from benchmarks.table import Row, in_turns, used
from noisemodel import Robot, Surface, extended
from noisemodel.types import Array

SAMPLES = 20_000
REPEATS = 3
LOOP = "loop over Pinocchio"
MOST = {"normal": 0.35, "paper": 1.5}  # most CPU time of 100,000 states, in [s]
MEMORY = 300.0  # most memory above the inputs of 100,000 states, in [MB]
IMPEDANCE = 1.204 * 343.2


def rows(_: object) -> Iterator[Row]:
    """Each kind of noise; ten times the samples, which shows whether time is linear; memory."""
    robot = Robot.load("talos")
    surface = Surface.of(robot)
    q, v = states(robot, 10 * SAMPLES)
    few = q[:SAMPLES], v[:SAMPLES]

    def of(kind: str, q: Array, v: Array) -> object:
        return extended(robot, surface, q, v, kind)

    sides = {kind: partial(of, kind, *few) for kind in ("normal", "rms", "paper", "mean")}
    sides[LOOP] = partial(loop, robot, surface, *few)
    times = in_turns({name: partial(used, work) for name, work in sides.items()}, REPEATS)
    for kind in ("normal", "rms", "paper", "mean"):
        name = f"noise of TALOS, `{kind}`, {SAMPLES:,} states"
        most = MOST[kind] * SAMPLES / 1e5 if kind in MOST else None
        yield Row(name, times[kind], f"{LOOP}, `normal`", times[LOOP], most=most)
    for kind in MOST:
        long = in_turns({kind: partial(used, partial(of, kind, q, v))}, REPEATS)[kind]
        yield Row(
            f"`{kind}`, {10 * SAMPLES:,} states", long, "ten times the above", 10 * times[kind]
        )
        tracemalloc.start()
        of(kind, q[: 5 * SAMPLES], v[: 5 * SAMPLES])
        peak = tracemalloc.get_traced_memory()[1] / 1e6
        tracemalloc.stop()
        yield Row(f"`{kind}`, 100,000 states: memory", peak, most=MEMORY, unit="MB")


def states(robot: Robot, samples: int) -> tuple[Array, Array]:
    """Random configurations, shape (samples, nq), and velocities, shape (samples, nv)."""
    random = np.random.default_rng(0)
    q = random.uniform(-1.0, 1.0, (samples, robot.nq))
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
    return q, random.standard_normal((samples, robot.nv))


def loop(robot: Robot, surface: Surface, q: Array, v: Array) -> Array:
    """Power of all links in a loop over samples, with twists from Pinocchio."""
    model, data = robot.model, robot.model.createData()
    forms, power = surface.mean_square_normal, np.empty((len(q), len(surface.links)))
    for sample in range(len(q)):
        pin.forwardKinematics(model, data, q[sample], v[sample])
        twists = np.array([motion.vector for motion in data.v])[surface.joint]
        power[sample] = np.einsum("li,lij,lj->l", twists, forms, twists)
    return IMPEDANCE * surface.area * power
