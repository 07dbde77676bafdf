"""Runs of other simulators; those that simulate need the extra `elsewhere`."""

from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture
def domains(monkeypatch):
    monkeypatch.syspath_prepend(ROOT)
    from benchmarks.elsewhere import domains

    return domains


def faulty(domains, name, kind, seed):
    return domains.make(domains.DOMAINS[name], kind, seed, duration=3.0)


@pytest.mark.parametrize(
    ("name", "module"), [("pybullet-panda", "pybullet"), ("drake-ur5", "pydrake")]
)
def test_the_labels_of_a_run_hold_its_fault(domains, name, module):
    pytest.importorskip(module, reason="needs the extra elsewhere")
    run = faulty(domains, name, "chatter", 1)
    (event,) = run.meta["events"]
    (block,) = [block for block in run.blocks if block.label != "ok"]
    assert block.label == event["label"] == "oscillations"
    assert event["start"] - 0.05 < block.start < event["stop"]
    assert run.rate == 1000
    assert run.meta["simulator"].split()[0] == name.split("-")[0]


def test_references_start_at_rest_and_are_their_velocity_s_integral(domains):
    for kind in domains.references.KINDS:
        rng = np.random.default_rng(3)
        motion = domains.references.draw(
            rng, kind, np.ones(3), reach=0.5, duration=4.0, rate=1000.0
        )
        np.testing.assert_allclose(motion.position[0], 1.0)
        assert np.abs(motion.velocity[0]).max() < 1e-3
        moved = np.cumsum(motion.velocity, axis=0) / 1000 + 1.0
        np.testing.assert_allclose(moved, motion.position, atol=2e-3)


def test_a_fault_below_the_sensor_s_noise_loses_its_label(domains):
    from noisemodel import Block

    time = np.arange(1000) / 1000
    noise = 0.02 * np.random.default_rng(0).standard_normal((1000, 1))
    tone = np.sin(2 * np.pi * 45 * time)[:, None]
    blocks = (Block(0.0, 0.2, "ok"), Block(0.3, 0.6, "oscillations"))
    assert domains.visible(blocks, 0.05 * tone, noise, 1000.0) == blocks
    assert domains.visible(blocks, 0.0005 * tone, noise, 1000.0) == blocks[:1]
    assert domains.visible(blocks, 0.0005 * tone, 0 * noise, 1000.0) == blocks


def test_a_run_that_is_dropped_is_named_and_not_tried_again(domains, monkeypatch, tmp_path, capsys):
    from benchmarks.elsewhere import __main__ as script
    from benchmarks.elsewhere.recorded import DroppedError

    def fall(*_, **__):
        raise DroppedError("fell after 1.00 s")

    monkeypatch.setattr(domains, "make", fall)
    (task, *_) = script.tasks(["pybullet-a1"], 1)
    for _ in range(2):
        script.make(task, tmp_path, 3.0)
    assert capsys.readouterr().out == "dropped pybullet-a1/a1/good-90000: fell after 1.00 s\n"
    reason = tmp_path / "pybullet-a1" / "a1" / "good-90000.dropped.txt"
    assert reason.read_text() == "fell after 1.00 s\n"
