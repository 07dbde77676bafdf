"""Simulated runs show the failures of their scenario, and the same seed gives the same file."""

import json
from dataclasses import replace
from itertools import cycle

import numpy as np
import pytest
from simulated import simulated

from noiseclassifier import scenarios
from noiseclassifier.scenarios import simulation
from noisemodel import Block, Run

SHORT = 3.0
HEALTHY = ("straight", "curve", "directions", "spot")
FAILURE = {
    "obstacle-full": "impact",
    "multisine-60-100": "oscillations",
    "force-jump": "highaccelerations",
    "limit-cycle": "oscillations",
    "reference-jump": "highaccelerations",
}
MORE = {"decalibrated": "impact", "platform": "highaccelerations"}  # simulated on other arms alone
# Where each acts: in the stages before, the run is as without it.
STAGE = {
    "reference-jump": "planned",
    "force-jump": "commanded",
    "limit-cycle": "commanded",
    "multisine-60-100": "desired",
    "obstacle-full": "measured",
}


@pytest.fixture(scope="module")
def runs() -> dict[str, Run]:
    return {
        name: simulated("panda", 5 if name == "obstacle-full" else name, 5, duration=SHORT)
        for name in ("straight", *FAILURE)
    }


def labels(run: Run) -> set[str]:
    return {block.label for block in run.blocks}


def first_difference(one: Run, two: Run, stage: str) -> float:
    """Time at which two runs part in a stage, in [s]."""
    signal = {"desired": "velocity_desired", "measured": "velocity"}.get(stage)
    a, b = (getattr(run, signal) if signal else run.stages[stage] for run in (one, two))
    apart = np.abs(a - b).max(axis=1) > 0.02
    return float(one.time[np.argmax(apart)]) if apart.any() else np.inf


@pytest.mark.parametrize("name", FAILURE)
def test_a_scenario_contains_its_failure_and_ok(runs, name):
    run = runs[name]
    assert {"ok", FAILURE[name]} <= labels(run) <= set(scenarios.SCENARIOS[name].labels)
    assert any(event["labelled"] > 0 for event in run.meta["events"])


def test_a_healthy_robot_is_ok_all_the_time(runs):
    assert runs["straight"].blocks == (Block(0.0, SHORT, "ok"),)


@pytest.mark.slow
def test_runs_of_other_arms_contain_their_failure_too():
    # Runs of one robot, seed and motion follow on each other, since they share their twin.
    for robot, name in reversed(list(zip(cycle(["ur5", "ur10"]), HEALTHY, strict=False))):
        assert labels(simulated(robot, name, 1, duration=SHORT)) == {"ok"}, name
    cases = zip(cycle(["ur5", "ur10"]), (FAILURE | MORE).items())
    for robot, (name, failure) in sorted(cases, key=lambda each: each[0], reverse=True):
        # A limit cycle grows from rounding, which differs between processors: not in every seed is
        # it felt, and in which it is depends on the machine.
        seeds = (2, 3, 1) if name == "limit-cycle" else (1,)
        found = (labels(simulated(robot, name, seed, duration=SHORT)) for seed in seeds)
        assert any(failure in each for each in found), name


@pytest.mark.parametrize(("name", "stage"), STAGE.items())
def test_a_run_is_as_its_twin_until_its_defect_acts_and_first_in_its_stage(runs, name, stage):
    run, healthy = runs[name], runs["straight"]
    onset = int(10_000 * min(event["start"] for event in run.meta["events"]))
    np.testing.assert_array_equal(run.velocity[:onset], healthy.velocity[:onset])
    order = ("planned", "commanded", "desired", "measured")
    before = [first_difference(run, healthy, other) for other in order[: order.index(stage)]]
    assert first_difference(run, healthy, stage) < min([np.inf, *before])


def test_a_run_states_how_it_was_made(runs, tmp_path):
    run = runs["obstacle-full"]
    run.save(tmp_path / "run.npz")
    loaded = Run.load(tmp_path / "run.npz")
    assert dict(loaded.meta) == json.loads(json.dumps(dict(run.meta)))
    assert loaded.blocks == run.blocks
    assert (loaded.meta["scenario"], loaded.meta["seed"]) == ("obstacle-full", 5)
    assert (loaded.rate, loaded.velocity.shape, loaded.robot) == (10_000, (30_000, 7), "panda")
    assert set(loaded.stages) == {"planned", "commanded"}
    assert loaded.meta["number"] == 5
    for signal in (run.position, run.velocity, run.velocity_desired, run.position_desired):
        assert signal.dtype == np.float32


def test_reported_velocities_are_the_slopes_of_reported_positions(runs):
    run = runs["straight"]
    span = 200
    slope = (run.position[span:] - run.position[:-span]).astype(float) / (span * 1e-4)
    mean = np.cumsum(run.velocity.astype(float), axis=0)
    mean = (mean[span:] - mean[:-span]) / span
    assert np.abs(slope - mean).max() < 0.03


def test_an_unplanned_contact_is_recorded_with_its_impulse(runs):
    (contact,) = [e for e in runs["obstacle-full"].meta["events"] if e["label"] == "impact"]
    assert 0.2 < contact["facts"]["impulse"] < 20
    assert contact["facts"]["force"] > 50
    assert not any(event["label"] == "impact" for event in runs["force-jump"].meta["events"])


def test_a_run_that_diverges_is_refused(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    panda = scenarios.ROBOTS["panda"]
    nervous = replace(panda, drives=replace(panda.drives, damping=(-200.0,) * 7))
    monkeypatch.setattr(simulation, "ROBOTS", {"nervous": nervous})
    with pytest.raises(
        scenarios.SimulationError,
        match=r"nervous in scenario 'straight' with seed 10 went out of control at -?\d\.\d{3} s",
    ):
        scenarios.simulate("nervous", "straight", 10, duration=SHORT)
    assert list(tmp_path.iterdir()) == []  # MuJoCo leaves no log either


@pytest.mark.parametrize(
    ("robot", "name", "seed", "options", "problem"),
    [
        ("panda", "sport", 0, {}, r"'sport' \(did you mean 'spot'\?\); there are straight, curve"),
        ("baxter", "straight", 0, {}, "robot 'baxter' cannot be simulated; there are .*panda"),
        ("panda", "straight", -1, {}, "seed -1: expected an integer of at least 0"),
        ("panda", "straight", 0, {"duration": 1.0}, "duration 1 s: expected at least 3 s"),
        ("ur6", "good", 10_000, {"wide": True}, r"'ur6' cannot .*\(did you mean 'ur5'\?\)"),
        ("ur5", "tonne", 10_000, {"wide": True}, "does not exist for 'ur5'; it has good, latency"),
        ("ur5", "good", 3, {"wide": True}, "seed 3: expected at least 10000"),
    ],
)
def test_what_cannot_be_simulated_is_refused(robot, name, seed, options, problem):
    with pytest.raises(scenarios.ScenarioError, match=problem):
        scenarios.simulate(robot, name, seed, **options)


def test_the_table_has_the_papers_numbers_and_a_sentence_for_each_scenario():
    lines = scenarios.SCENARIOS.values()
    assert [line.number for line in lines] == list(range(1, 28))
    assert [line.name for line in lines if line.healthy] == list(HEALTHY)
    for name, line in scenarios.SCENARIOS.items():
        assert line.name == name
        assert line.description.endswith(".")
        assert ". " not in line.description
        assert line.cases
        assert "ok" in line.labels
