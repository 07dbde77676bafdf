"""Logs of simulated runs: sensing changes what is seen, and labels follow what can be seen.

Efforts among it: drives show the torques that physics asks for, and pushes of hands.
"""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from simulated import PLAIN, simulated

from noiseclassifier import scenarios
from noiseclassifier.scenarios.arm import plan
from noiseclassifier.scenarios.faults import Imperfections
from noiseclassifier.scenarios.logs import logged, visible
from noiseclassifier.scenarios.motions import PUSH
from noiseclassifier.scenarios.robots import WIDE
from noiseclassifier.scenarios.simulation import FAULTS, GOOD, Start, _setup
from noiseclassifier.scenarios.world import configuration, real_model, reduced_model
from noisemodel import Block, Run

RATE = 2000.0
QUICK = replace(PLAIN, rate=RATE)
FAULT = (2.0, 3.0)


def run_with(fault=0.0, frequency=60.0, joints=2):
    """A slow motion, and an oscillation of the first joint for a second."""
    time = np.arange(round(5 * RATE)) / RATE
    smooth = np.stack([np.sin(2 * np.pi * 0.4 * time + joint) for joint in range(joints)], axis=1)
    position = -np.cos(2 * np.pi * 0.4 * time[:, None] + np.arange(joints)) / (2 * np.pi * 0.4)
    inside = (time >= FAULT[0]) & (time < FAULT[1])
    velocity = smooth.copy()
    velocity[:, 0] += fault * inside * np.sin(2 * np.pi * frequency * time)
    events = [{"label": "oscillations", "start": FAULT[0], "stop": FAULT[1], "labelled": 1.0}]
    blocks = (Block(0.0, 1.9, "ok"), Block(*FAULT, "oscillations"), Block(3.2, 5.0, "ok"))
    smooth, velocity, position = map(np.float32, (smooth, velocity, position))
    signals = {"velocity": velocity, "position": position, "velocity_desired": smooth}
    signals |= {"joint_names": tuple("ab"[:joints]), "stages": {"planned": smooth}}
    if not fault:
        events, blocks = [], (Block(0.0, 5.0, "ok"),)
    return Run(time=time, blocks=blocks, meta={"events": events}, **signals)


TWIN = run_with()


def labelled(fault, logger, frequency=60.0):
    found = logged(run_with(fault, frequency), TWIN, logger, seed=1)
    return sum(b.stop - b.start for b in found.blocks if b.label == "oscillations")


def test_a_perfect_logger_changes_nothing():
    run = run_with(0.3)
    found = logged(run, TWIN, QUICK, seed=1)
    np.testing.assert_allclose(found.velocity, run.velocity, atol=1e-6)
    np.testing.assert_allclose(found.velocity_desired, run.velocity_desired, atol=1e-6)
    assert found.blocks == run.blocks


@pytest.mark.parametrize("noise", [1e-4, 1e-3, 1e-2])
def test_a_louder_fault_never_loses_a_label_that_a_fainter_one_has(noise):
    times = [labelled(fault, replace(QUICK, noise=noise)) for fault in np.geomspace(1e-5, 1, 9)]
    assert times == sorted(times)
    assert times[0] == 0.0
    assert times[-1] == pytest.approx(1.0)


@pytest.mark.parametrize(("fault", "labelled"), [(3e-4, 0.0), (0.3, 1.0)])
def test_a_fault_below_the_noise_has_no_label_and_its_event_says_so(fault, labelled):
    found = logged(run_with(fault), TWIN, replace(QUICK, noise=0.02), seed=1)
    assert ({block.label for block in found.blocks} == {"ok"}) == (labelled == 0.0)
    assert found.meta["events"][0]["labelled"] == pytest.approx(labelled)


def test_a_fault_above_the_log_s_bandwidth_has_no_label():
    slow = replace(QUICK, velocity="filtered", cutoff=20.0, noise=0.005)
    assert labelled(0.01, slow, frequency=300.0) == 0.0
    assert labelled(0.01, replace(QUICK, noise=0.005), frequency=300.0) == pytest.approx(1.0)


def test_ripple_has_its_share_of_the_speed_at_its_order():
    speed, gear, share = 0.5, 100.0, 0.02
    time = np.arange(round(8 * RATE)) / RATE
    steady = np.full((len(time), 1), speed)
    signals = {"velocity": steady, "velocity_desired": steady, "stages": {"planned": steady}}
    run = Run(time=time, joint_names=("a",), position=speed * time[:, None], **signals)
    found = logged(run, run, replace(QUICK, ripple=share, gear=gear), seed=3)
    spectrum = np.abs(np.fft.rfft(found.velocity[:, 0] - speed)) / len(time) * 2
    frequencies = np.fft.rfftfreq(len(time), 1 / RATE)
    peak = np.argmax(spectrum)
    assert frequencies[peak] == pytest.approx(gear * speed / (2 * np.pi), abs=0.2)
    assert 0.15 * share * speed < spectrum[peak] < 1.05 * share * speed


def test_differentiated_velocities_have_the_steps_of_the_encoder():
    coarse = replace(QUICK, velocity="differentiated", bits=12, cutoff=800.0)
    error = logged(TWIN, TWIN, coarse, seed=1).velocity - TWIN.velocity
    step = 2 * np.pi / 2**12 * RATE
    assert 0.1 * step < np.sqrt(np.mean(error[10:] ** 2)) < step


def test_lower_rates_have_fewer_samples_and_blocks_within_them():
    found = logged(run_with(0.3), TWIN, replace(QUICK, rate=125.0), seed=1)
    assert found.rate == pytest.approx(125.0)
    assert len(found.time) == 625
    assert max(block.stop for block in found.blocks) <= 5.0


def test_desired_velocities_may_be_zero_or_missing_and_held_samples_repeat():
    held = logged(TWIN, TWIN, replace(QUICK, hold=10), seed=1).velocity
    assert np.array_equal(held[::10], held[9::10])
    assert not logged(TWIN, TWIN, replace(QUICK, desired="zero"), seed=1).velocity_desired.any()
    assert logged(TWIN, TWIN, replace(QUICK, desired="missing"), seed=1).velocity_desired is None


def test_visible_is_three_decibels_in_a_band():
    time = np.arange(4000) / 1000
    tone = np.sin(2 * np.pi * 50 * time)[:, None]
    assert not visible(1.3 * tone, tone, rate=1000.0).any()
    assert visible(1.5 * tone, tone, rate=1000.0).all()
    assert visible(0.01 * tone, np.sin(2 * np.pi * 200 * time)[:, None], rate=1000.0).all()
    assert not visible(0 * tone, 0 * tone, rate=1000.0).any()


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
