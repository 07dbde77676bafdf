"""The defects of the benchmark of `inspector diff`."""

from pathlib import Path

import numpy as np
import pytest

from noisemodel import Block, Run

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def benchmark():
    """The benchmark as a module; that it limits threads is for its own process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(ROOT)
        patch.setenv("OMP_NUM_THREADS", "1")
        patch.setenv("OPENBLAS_NUM_THREADS", "1")
        from benchmarks import regression

        yield regression


def run(value, blocks=()):
    time = np.arange(2000) / 1000
    signal = np.full((2000, 1), value)
    return Run(
        time=time,
        velocity=signal,
        velocity_desired=signal,
        position=signal,
        joint_names=("elbow",),
        blocks=blocks,
    )


def test_a_defect_acts_within_annotated_failures_and_scales(benchmark):
    good, faulty = run(1.0), run(3.0, (Block(0.5, 1.0, "impact"), Block(1.5, 1.9, "ok")))
    none, twice = (benchmark.with_defect(good, faulty, factor) for factor in (0.0, 2.0))
    np.testing.assert_array_equal(none.velocity, good.velocity)
    inside = (good.time >= 0.5) & (good.time <= 1.0)
    near = (good.time > 0.5 - benchmark.TAPER) & (good.time < 1.0 + benchmark.TAPER)
    np.testing.assert_allclose(twice.velocity[inside], 5.0)
    np.testing.assert_allclose(twice.velocity[~near], 1.0)


def test_every_defect_of_every_robot_is_frozen(benchmark):
    keys = {(robot, defect) for robot in benchmark.ROBOTS for defect in benchmark.DEFECTS}
    assert benchmark.FROZEN.keys() == keys
    assert not set(benchmark.FREEZING) & set(benchmark.MEASURING)


def test_shares_have_the_interval_of_clopper_and_pearson(benchmark):
    assert benchmark.interval(0, 1000) == "0/1000 = 0.0% (0.0% to 0.4%)"
    assert benchmark.interval(20, 20) == "20/20 = 100.0% (83.2% to 100.0%)"
