"""Time the extended noise against a loop over Pinocchio, on TALOS with a floating base.

Run from the checkout: ``python -m benchmarks.extended [samples]``. One process on one core; the
variants take turns, so that a slower machine affects all of them; CPU time. The chunked
variants follow with ten times the samples, which shows whether time is linear in their number.
"""

import argparse
import os
import time
import tracemalloc
from collections.abc import Callable
from statistics import median
from typing import TypeAlias

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"  # before NumPy is there

import numpy as np
import pinocchio as pin

from benchmarks.twists import states
from noisemodel import Robot, Surface, extended
from noisemodel.types import Array

REPEATS = 3
KINDS = ("normal", "rms", "paper", "mean")
LONG = ("normal", "paper")
"""The kinds that are also timed with ten times the samples."""

LOOP = "loop, normal"
IMPEDANCE = 1.204 * 343.2

Variant: TypeAlias = Callable[[Array, Array], object]


def main() -> None:
    """Print medians, ratios and memory."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("samples", nargs="?", type=int, default=100_000, help="states of TALOS")
    samples = parser.parse_args().samples
    robot = Robot.load("talos")
    for when in ("first", "again"):
        start = time.process_time()
        surface = Surface.of(robot)
        print(f"surface of {robot.name}, {when}: {time.process_time() - start:.2f} s CPU")
    q, v = states(robot, 10 * samples)
    few = (q[:samples], v[:samples])
    variants = {kind: variant_of(robot, surface, kind) for kind in KINDS}
    times = race(variants | {LOOP: lambda q, v: loop(robot, surface, q, v)}, *few)
    print(f"{samples} states, {len(surface.links)} links, median of {REPEATS}")
    for name, seconds in times.items():
        print(f"{name:24} {seconds:8.3f} s CPU {times[LOOP] / seconds:8.1f} x")
    for kind, seconds in race({kind: variants[kind] for kind in LONG}, q, v).items():
        print(
            f"{kind + ', 10 times as many':24} {seconds:8.3f} s CPU: {seconds / times[kind]:.1f} x"
        )
    for kind in LONG:
        tracemalloc.start()
        variants[kind](*few)
        peak = tracemalloc.get_traced_memory()[1] / 1e6
        tracemalloc.stop()
        print(f"{kind:24} {peak:8.1f} MB above the inputs at most")


def variant_of(robot: Robot, surface: Surface, kind: str) -> Variant:
    """`extended` with one kind."""
    return lambda q, v: extended(robot, surface, q, v, kind)


def race(variants: dict[str, Variant], q: Array, v: Array) -> dict[str, float]:
    """Median CPU time of each variant, in [s]; they take turns."""
    times: dict[str, list[float]] = {name: [] for name in variants}
    for _ in range(REPEATS):
        for name, variant in variants.items():
            start = time.process_time()
            variant(q, v)
            times[name].append(time.process_time() - start)
    return {name: median(seconds) for name, seconds in times.items()}


def loop(robot: Robot, surface: Surface, q: Array, v: Array) -> Array:
    """Power of all links in a loop over samples, with twists from Pinocchio."""
    model, data = robot.model, robot.model.createData()
    forms, power = surface.mean_square_normal, np.empty((len(q), len(surface.links)))
    for sample in range(len(q)):
        pin.forwardKinematics(model, data, q[sample], v[sample])
        twists = np.array([motion.vector for motion in data.v])[surface.joint]
        power[sample] = np.einsum("li,lij,lj->l", twists, forms, twists)
    return IMPEDANCE * surface.area * power


if __name__ == "__main__":
    main()
