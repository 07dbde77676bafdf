"""Domains are drawn by seed; equal seeds give equal runs, faults act in time, errors are named."""

import json
from dataclasses import replace

import mujoco
import numpy as np
import pinocchio
import pytest
from simulated import PLAIN, simulated, stub

from noiseclassifier import scenarios
from noiseclassifier.scenarios.dataset import (
    Folder,
    Task,
    described,
    make,
    side_of,
    statistics,
    wide_tasks,
    write_logs,
)
from noiseclassifier.scenarios.domains import RATES, SETTINGS, Domain, Limits, Logger
from noiseclassifier.scenarios.motions import SimulationError
from noiseclassifier.scenarios.robots import WIDE
from noiseclassifier.scenarios.simulation import (
    GOOD,
    THROUGHOUT,
    _changed,
    _refuse_rattling,
    faults_of,
)
from noisemodel import Run

GO2 = WIDE["go2"]

SECONDS = 3.0
# Every second robot; the others move in the tests of their families.
REST = [
    name
    for family in ("arm", "quadruped", "humanoid")
    for name in [name for name, robot in WIDE.items() if robot.family == family][1::2]
]


def drawn(seed=1, **changes):
    domain = Domain.draw(np.random.default_rng(seed), Limits())
    return replace(domain, **changes)


@pytest.fixture(scope="module")
def good():
    return simulated("ur5", GOOD, 10_001, duration=SECONDS, wide=True)


def test_a_good_run_has_no_event_and_nothing_but_ok(good):
    assert good.meta["events"] == []
    assert {block.label for block in good.blocks} == {"ok"}
    assert good.duration == pytest.approx(SECONDS, abs=0.01)
    assert good.meta["domain"]["name"].startswith("mujoco-")


def test_a_run_and_a_data_set_name_the_software_that_they_depend_on(good, tmp_path):
    versions = {each.__name__: each.__version__ for each in (mujoco, pinocchio, np)}
    assert good.meta["versions"] == versions
    manifest = Folder.opened(tmp_path / "set", wide=True).path / "dataset.json"
    made = json.loads(manifest.read_text())
    assert made["versions"] == versions
    manifest.write_text(json.dumps({**made, "versions": {"mujoco": "1"}}))
    assert Folder.opened(tmp_path / "set", wide=True).path == tmp_path / "set"  # it is continued
    manifest.write_text(json.dumps({**made, "recipe": 3}))  # with other quadrupeds
    with pytest.raises(scenarios.DatasetError, match="made with recipe 3, now it is 4"):
        Folder.opened(tmp_path / "set", wide=True)


def test_a_run_names_the_recipe_that_last_changed_its_family(good):
    legged = simulated("go2", GOOD, 10_000, duration=0.5, wide=True)
    assert (legged.meta["recipe"], good.meta["recipe"]) == ("domains 4", "domains 2")


def test_a_run_equals_its_twin_until_its_fault_begins(good):
    tone = simulated("ur5", "tone", 10_001, duration=SECONDS, wide=True)
    start = tone.meta["events"][0]["start"]
    before = tone.time < start - 0.02  # the low-pass of what is kept is not causal
    np.testing.assert_allclose(tone.velocity[before], good.velocity[before], atol=1e-4)
    assert np.abs(tone.velocity - good.velocity).max() > 1e-3


def test_a_fault_of_a_whole_run_is_there_from_its_first_sample(good):
    run = simulated("ur5", "throughout-filter", 10_001, duration=SECONDS, wide=True)
    (event,) = run.meta["events"]
    assert (event["start"], event["stop"]) == (0.0, SECONDS)
    assert (run.meta["recipe"], good.meta["recipe"]) == ("domains 3", "domains 2")
    first = round(0.2 * run.rate)
    assert np.abs(run.velocity - good.velocity)[:first].max() > 1e-3
    assert event["labelled"] > 1.0


def test_a_robot_that_rattles_without_a_fault_is_no_good_run():
    time = np.arange(20_000) / 10_000
    smooth = np.sin(2 * np.pi * 0.5 * time)[:, None] * np.ones(3)
    _refuse_rattling(smooth)
    with pytest.raises(SimulationError, match="it rattles without a fault, at .* rad/s"):
        _refuse_rattling(smooth + np.sin(2 * np.pi * 90 * time)[:, None])


def test_delays_are_no_longer_than_gains_bear_and_gains_lower_where_filters_leave_no_margin():
    fast = drawn(delay=0.05, stiffness=1.0, damping=1.0, encoder_bandwidth=700.0)
    soft, slow = replace(fast, stiffness=0.1, damping=0.3), replace(fast, encoder_bandwidth=30.0)
    (one, late), (_, later), (other, _) = (_changed(GO2, each) for each in (fast, soft, slow))
    assert 0 <= late.delay < later.delay < 0.05
    assert other.drives.damping[0] < 0.5 * one.drives.damping[0]


def test_tasks_are_drawn_by_seed_and_those_of_whole_runs_are_added():
    chosen, more = (wide_tasks(["ur5", "go2"], seeds=2, throughout=count) for count in (0, 2))
    assert chosen == wide_tasks(["ur5", "go2"], seeds=2, faults=2)
    assert len(chosen) == 2 * 2 * 3
    assert sum(task.scenario == GOOD for task in chosen) == 4
    for task in chosen:
        assert task.scenario == GOOD or task.scenario in faults_of(task.robot, task.seed)
    assert set(chosen) < set(more)
    assert len(more) == len(chosen) + 2 * 2 * 2
    assert {task.scenario for task in set(more) - set(chosen)} <= set(THROUGHOUT)


def test_what_fell_is_counted_by_robot_and_its_faulty_runs_have_no_log(monkeypatch, tmp_path):
    def fall(robot, fault, seed, **_):
        if fault == GOOD and seed == 10_001:
            raise SimulationError(1.0, "it fell")
        made, meta = stub(robot, fault, seed), {"domain": drawn(control="pd").as_dict()}
        return replace(made, stages={"planned": made.velocity}, meta={**meta, "events": []})

    monkeypatch.setattr("noiseclassifier.scenarios.dataset.simulate", fall)
    folder = Folder.opened(tmp_path / "data", wide=True)
    wanted = [Task("ur5", name, seed) for seed in (10_000, 10_001) for name in (GOOD, "tone")]
    assert sorted(make(folder, wanted)) == sorted(wanted)
    assert folder.missing(wanted) == []
    text = described(statistics(folder))
    assert "4 runs, 1 of which fell" in text
    names = [name for name, _ in write_logs(folder, tmp_path / "logs", rate=500.0)]
    assert names == ["ur5/good-10000", "ur5/tone-10000"]
    assert Run.load(tmp_path / "logs/ur5/tone-10000.npz").rate == pytest.approx(500.0)


def test_a_folder_without_runs_has_no_logs(tmp_path):
    folder = Folder.opened(tmp_path, wide=True)
    with pytest.raises(scenarios.DatasetError, match="holds no run; `inspector simulate domains`"):
        next(write_logs(folder, tmp_path))


def test_targets_are_robots_domains_and_loggers_apart():
    domain = drawn(control="pd")
    assert side_of("ur5", domain, PLAIN) == "source"
    assert side_of("xarm7", domain, PLAIN) == "target"
    assert side_of("ur5", replace(domain, control="impedance"), PLAIN) == "target"
    assert side_of("ur5", domain, replace(PLAIN, bits=12)) == "logger"
    assert side_of("ur5", domain, replace(PLAIN, hold=5)) == "logger"


@pytest.mark.slow
@pytest.mark.parametrize("robot", REST)
def test_robots_that_move_in_no_other_test_have_a_good_run_among_their_first_seeds(robot):
    for seed in range(10_000, 10_006):
        try:
            run = scenarios.simulate(robot, GOOD, seed, duration=SECONDS, wide=True)
        except SimulationError:
            continue
        assert np.isfinite(run.velocity).all()
        assert run.joint_names == WIDE[robot].drives.joints
        return
    pytest.fail("it fell in all of them")


FREE = Limits()


def domains(count=200, limits=FREE):
    return [Domain.draw(np.random.default_rng(seed), limits) for seed in range(count)]


def loggers(count=200):
    return [
        Logger.draw(np.random.default_rng(seed), domain, most=10_000.0)
        for seed, domain in enumerate(domains(count))
    ]


def test_values_lie_between_the_ends():
    for name, drawn in (
        *((name, domains()) for name in ("payload", "gear", "torque_limit", "torque_rise")),
        *((name, loggers()) for name in ("noise", "jitter", "gear")),
    ):
        ends, values = SETTINGS[name]["ends"], [getattr(one, name) for one in drawn]
        assert min(ends) <= min(values) <= max(values) <= max(ends), name


def test_the_far_ends_are_drawn_by_wild_runs_only():
    mild = [d.stiffness for d in domains(500) if d.wildness < 0.2 and d.control != "impedance"]
    wild = [d.stiffness for d in domains(500) if d.wildness > 0.8]
    assert min(mild) > 0.5
    assert min(wild) < 0.15


def test_every_kind_of_control_and_of_log_is_drawn():
    assert {d.control for d in domains()} == {"pd", "computed-torque", "impedance", "policy"}
    assert {log.velocity for log in loggers()} == {"measured", "filtered", "differentiated"}
    assert {log.desired for log in loggers()} == {"commanded", "planned", "zero", "missing"}
    assert {log.rate for log in loggers(500)} == set(RATES)
    assert {log.hold > 1 for log in loggers()} == {True, False}


def test_some_logs_have_efforts_and_of_these_half_are_currents():
    drawn = loggers(500)
    kinds = [log.effort for log in drawn]
    assert kinds.count("missing") / 500 == pytest.approx(0.4, abs=0.06)
    assert kinds.count("current") / 500 == pytest.approx(0.3, abs=0.06)
    for log in drawn:
        assert (log.current > 0) == (log.effort == "current")
        assert 9 <= log.effort_bits <= 16
        assert 0.0003 <= log.effort_noise <= 0.01


def test_what_a_family_does_not_bear_is_not_drawn():
    limits = Limits(stiffness=(0.5, 1.0), damping=(0.6, 1.1), delay=2e-3, hold=0.01)
    for domain in domains(limits=limits):
        assert 0.5 <= domain.stiffness <= 1.0
        assert 0.6 <= domain.damping <= 1.1
        assert domain.delay <= 2e-3
        assert domain.policy_rate == 0 or domain.policy_rate >= 100 - 1e-9


def test_a_part_of_the_domains_is_never_learnt_from():
    assert {d.target for d in domains()} == {True, False}
    assert all(d.target == (d.control == "impedance") for d in domains())
    shares = np.mean([log.target for log in loggers(500)])
    assert 0.05 < shares < 0.4
