"""Faults that models/build.py adds to good logs."""

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest

from noisemodel import Block, Run

SPEC = spec_from_file_location("build_models", Path(__file__).parents[1] / "models" / "build.py")
build = module_from_spec(SPEC)
SPEC.loader.exec_module(build)
ADDED, LEVELS = build.ADDED, build.LEVELS
with_faults = build.with_faults


def log(rate=500.0, seconds=7.0, noise=1e-4):
    count = round(rate * seconds)
    velocity = noise * np.random.default_rng(0).standard_normal((count, 3))
    return Run(
        time=np.arange(count) / rate,
        velocity=velocity.astype(np.float32),
        joint_names=("a", "b", "c"),
        blocks=(Block(0.0, seconds, "ok"),),
    )


@pytest.mark.parametrize("kind", ADDED)
@pytest.mark.parametrize("rate", [80.0, 1000.0])
def test_a_fault_has_level_one(kind, rate):
    signal = build.fault(kind, round(rate), 30.0, rate, np.random.default_rng(1))
    assert np.sqrt(np.mean(signal**2)) == pytest.approx(1.0)


def test_a_tone_has_its_frequency():
    signal = build.fault("tone", 1000, 90.0, 1000.0, np.random.default_rng(0))
    assert np.abs(np.fft.rfft(signal)).argmax() == 90


def test_nothing_changes_where_no_fault_is():
    run = log()
    found = with_faults(run, seed=3)
    inside = np.zeros(len(run.time), dtype=bool)
    for event in found.meta["events"]:
        inside |= (run.time >= event["start"] - 0.01) & (run.time <= event["stop"] + 0.01)
    assert np.array_equal(found.velocity[~inside], run.velocity[~inside])
    assert not np.array_equal(found.velocity[inside], run.velocity[inside])


def test_each_fault_that_can_be_seen_has_its_label_and_class():
    found = with_faults(log(), seed=5)
    bad = [block for block in found.blocks if block.label != "ok"]
    events = found.meta["events"]
    assert len(events) == 2  # one every APART, away from the ends
    assert events[1]["start"] - events[0]["start"] == pytest.approx(build.APART)
    assert [(b.start, b.label) for b in bad] == [(e["start"], e["label"]) for e in events]


def test_a_fault_far_below_the_noise_has_no_label():
    found = with_faults(log(noise=100.0 * LEVELS[1]), seed=5)
    assert {block.label for block in found.blocks} == {"ok"}
    assert all(event["labelled"] == 0.0 for event in found.meta["events"])


def test_equal_seeds_add_equal_faults():
    one, same, other = (with_faults(log(), seed=seed).velocity for seed in (1, 1, 2))
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)


def test_a_piece_of_a_log_begins_at_zero_with_what_it_has_of_labels_and_events():
    faulty, begun = with_faults(log(), seed=5), 0
    for seed in range(30):
        piece = build.beginning_anywhere(faulty, seed=seed)
        first, last = piece.meta["piece"]
        assert piece.time[0] == 0.0
        assert last - first <= build.PIECE[1] + 0.01
        where = round(first * faulty.rate)
        part = faulty.velocity[where : where + len(piece.time)]
        np.testing.assert_array_equal(piece.velocity, part)
        for block in piece.blocks:
            assert 0.0 <= block.start < block.stop <= last - first + 0.01
        whole = [b for b in faulty.blocks if b.label != "ok" and b.start < last and b.stop > first]
        assert len(whole) == sum(block.label != "ok" for block in piece.blocks)
        begun += any(block.label != "ok" and block.start == 0.0 for block in piece.blocks)
    assert begun >= 8  # one in two begins in a failure
