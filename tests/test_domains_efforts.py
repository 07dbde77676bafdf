"""Efforts of wide domains: drives show the torques that physics asks for, and pushes of hands."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from simulated import PLAIN, simulated

from noiseclassifier import scenarios
from noiseclassifier.scenarios.faults import Imperfections
from noiseclassifier.scenarios.logs import logged, visible
from noiseclassifier.scenarios.motions import PUSH
from noiseclassifier.scenarios.robots import WIDE
from noiseclassifier.scenarios.simulation import FAULTS, GOOD, Start, _setup
from noiseclassifier.scenarios.world import configuration, real_model, reduced_model

SECONDS = 1.5
STANDS = 10_004  # a seed of which the Panda stands for so long, on elastic gears
TORQUE = replace(PLAIN, effort="torque", noise=0.001)


@pytest.fixture(scope="module")
def twin():
    return simulated("panda", GOOD, STANDS, duration=SECONDS, wide=True)


@pytest.fixture(scope="module")
def pushed():
    return simulated("panda", "push", STANDS, duration=SECONDS, wide=True)


def test_the_same_seed_gives_the_same_file_in_another_process(tmp_path):
    here, there = tmp_path / "here.npz", tmp_path / "there.npz"
    code = (
        "import sys; from noiseclassifier.scenarios import simulate;"
        f"simulate('panda', 'good', {STANDS}, duration=0.2, wide=True).save(sys.argv[1])"
    )
    scenarios.simulate("panda", GOOD, STANDS, duration=0.2, wide=True).save(here)
    subprocess.run([sys.executable, "-c", code, str(there)], check=True)
    assert here.read_bytes() == there.read_bytes()


def real_panda():
    """The Panda of the seed with its real masses, and the Coulomb friction of its joints."""
    drawn = _setup(Start("panda", STANDS))
    model = reduced_model(drawn.robot)
    imperfections = Imperfections.draw(
        drawn.body, drawn.robot, bodies=model.njoints - 1, domain=drawn.domain
    )
    tool = drawn.robot.tool
    model = real_model(model, tool.frame, np.array(tool.point), imperfections)
    friction = np.array(drawn.robot.drives.friction) * imperfections.friction
    return model, friction * drawn.domain.stiction


def test_efforts_are_those_of_the_drives_in_the_runs_form_and_may_be_missing(twin):
    assert (twin.effort.dtype, twin.effort.shape) == (np.float32, twin.velocity.shape)
    limit = np.array(WIDE["panda"].drives.torque) * twin.meta["domain"]["torque_limit"]
    assert twin.meta["effort_limit"] == pytest.approx(limit)
    assert (np.abs(twin.effort) <= limit * 1.001).all()
    without = replace(twin, effort=None, meta={**twin.meta, "recipe": "domains 1"})
    assert logged(without, without, TORQUE, seed=1).effort is None


def test_the_effort_of_a_standing_arm_is_its_gravity_torque_within_friction(twin):
    model, friction = real_panda()
    late = twin.time > 1.0
    assert np.abs(twin.velocity[late]).max() < 0.02
    position = twin.position[late].astype(np.float64).mean(axis=0)
    gravity = pin.computeGeneralizedGravity(
        model, model.createData(), configuration(model, position)
    )
    off = np.abs(twin.effort[late].mean(axis=0) - gravity)
    assert (off < friction + 0.01 * np.abs(gravity)).all()
    assert np.abs(gravity).max() > 10 * friction.max()


def test_a_push_shows_in_the_efforts_as_the_torque_that_holds_its_force(twin, pushed):
    model, friction = real_panda()
    (event,) = pushed.meta["events"]
    (load,) = pushes(pushed)
    middle = load.start + load.rise + (load.stop - load.fall - load.start - load.rise) / 2
    now = np.abs(pushed.time - middle) < 0.01
    body = 1 + round(load.along * (model.njoints - 2))
    data, position = model.createData(), pushed.position[now].astype(np.float64).mean(axis=0)
    pin.computeJointJacobians(model, data, configuration(model, position))
    jacobian = pin.getJointJacobian(model, data, body, pin.LOCAL_WORLD_ALIGNED)
    lever = data.oMi[body].rotation @ model.inertias[body].lever
    torque = (jacobian[:3] - pin.skew(lever) @ jacobian[3:]).T @ np.array(load.force)
    shown = (pushed.effort - twin.effort)[now].mean(axis=0)
    assert (np.abs(shown + torque) < 2 * friction).all()
    assert np.abs(torque).max() > 3 * friction.max()
    assert event["cause"] == PUSH
    assert event["label"] == "impact"
    assert np.linalg.norm(load.force) == pytest.approx(event["facts"]["force"])


def pushes(run):
    from noiseclassifier.scenarios.arm import plan

    drawn = _setup(Start("panda", STANDS))
    planned = plan(drawn.robot, drawn.motion, drawn.planned, SECONDS)
    return FAULTS["arm"]["push"](drawn.faulty, planned).loads


@pytest.mark.slow
def test_a_blow_from_outside_is_not_among_the_torques_of_the_drives():
    blow = simulated("panda", "blow", STANDS, duration=3.0, wide=True)
    twin = simulated("panda", GOOD, STANDS, duration=3.0, wide=True)
    (event,) = blow.meta["events"]
    size = event["facts"]["share"] * np.array(blow.meta["effort_limit"])
    begun = (blow.time > event["start"]) & (blow.time < event["start"] + 1e-3)
    hit = np.array(event["facts"]["joints"]) > 0
    shown = np.abs(blow.effort - twin.effort)[begun][:, hit]
    assert (shown.max(axis=0) < 0.2 * size[hit]).all()


def test_a_push_that_velocities_do_not_show_has_a_label_where_efforts_show_it(twin, pushed):
    (event,) = pushed.meta["events"]
    found = logged(pushed, twin, TORQUE, seed=1)
    labels = [block for block in found.blocks if block.label == "impact"]
    assert sum(block.stop - block.start for block in labels) > 0.3 * (
        event["stop"] - event["start"]
    )
    assert all(event["start"] <= b.start < b.stop <= event["stop"] for b in labels)
    assert found.meta["events"][0]["labelled"] > 0
    blind = logged(pushed, twin, replace(TORQUE, effort="missing"), seed=1)
    assert blind.effort is None
    assert {block.label for block in blind.blocks} == {"ok"}
    assert blind.meta["events"][0]["labelled"] == 0
    noisy = logged(pushed, twin, replace(TORQUE, effort_noise=2.0), seed=1)
    assert noisy.blocks == blind.blocks


def test_a_logger_of_efforts_leaves_velocities_as_they_are_and_repeats_itself_by_seed(twin):
    rough = replace(TORQUE, jitter=0.1, lost=0.02, repeated=0.02, hold=3, velocity="filtered")
    plain = logged(twin, twin, replace(rough, effort="missing"), seed=4)
    for kind in ("torque", "current"):
        logger = replace(rough, effort=kind, current=8.0, effort_noise=0.01)
        found, again, other = (logged(twin, twin, logger, seed=seed) for seed in (4, 4, 5))
        assert np.array_equal(found.velocity, plain.velocity)
        assert np.array_equal(found.velocity_desired, plain.velocity_desired)
        assert np.array_equal(found.effort, again.effort)
        assert not np.array_equal(found.effort, other.effort)


def test_efforts_have_steps_and_noise_are_held_and_as_currents_by_each_joint_s_constant(twin):
    limit = np.array(twin.meta["effort_limit"])
    step = 2 * limit / 2**8
    fine, coarse, noisy, held, current = (
        logged(twin, twin, replace(TORQUE, **changes), seed=1).effort
        for changes in (
            *({}, {"effort_bits": 8}, {"effort_noise": 0.01}, {"hold": 10}),
            {"effort": "current", "current": 10.0},
        )
    )
    np.testing.assert_allclose(coarse / step, np.rint(coarse / step), atol=1e-3)
    assert (np.abs(coarse - fine) <= 0.51 * step).all()
    np.testing.assert_allclose((noisy - fine).std(axis=0), 0.01 * limit, rtol=0.1)
    assert np.array_equal(held[::10], held[9::10])
    np.testing.assert_allclose(current * limit / 10.0, fine, atol=1e-3)


def test_a_slow_change_is_visible_beside_a_weight_only_where_means_are_left_out():
    time = np.arange(2000) / 1000
    weight = 40.0 + 0.01 * np.random.default_rng(1).normal(size=(2000, 1))
    push = 2.0 * np.clip(time - 0.5, 0, 1)[:, None]
    assert not visible(push, weight, rate=1000.0).any()
    assert not visible(push, weight, rate=1000.0, lowest=1.0).any()
    seen = visible(push, weight, rate=1000.0, lowest=1.0, centred=True)
    starts = 0.1 * np.arange(len(seen))
    assert seen[(starts > 0.45) & (starts < 1.05)].all()
    assert not seen[starts < 0.05].any()
    assert not seen[starts > 1.55].any()  # a force that does not change
