"""Drives of wide domains: nominal ones equal those at home, gears and faults do what they say."""

from dataclasses import replace

import numpy as np
import pytest

from noiseclassifier.scenarios.domains import Domain
from noiseclassifier.scenarios.drives import DomainDrives, Drives
from noiseclassifier.scenarios.faults import (
    NO_DRIVE_FAULT,
    ON_DRIVES,
    DriveFault,
    Held,
    Imperfections,
    Lost,
    TargetJump,
)
from noiseclassifier.scenarios.motions import RATE, STEP, STEPS, TICK, Event
from noiseclassifier.scenarios.robots import Drivetrain

NOMINAL = Domain(
    wildness=0.0, length=1.0, mass=1.0, payload=0.0, gear=100.0, ripple=0.0, flexibility=0.0,
    backlash=0.0, cogging=0.0, stiction=1.0, friction=1.0, viscous=1.0, rotor=1.0,
    torque_limit=1.0, torque_rise=1e-9, delay=0.0, control="computed-torque", stiffness=1.0,
    damping=1.0, feedforward=1.0, policy_rate=0.0, encoder_bits=20, encoder_bandwidth=400.0,
)  # fmt: skip
TWO = Drivetrain(
    joints=("a", "b"),
    stiffness=(300.0, 200.0),
    damping=(6.0, 4.0),
    torque=(40.0, 20.0),
    armature=(0.1, 0.1),
    friction=(0.5, 0.5),
    viscous=(0.1, 0.1),
)
HEALTHY = replace(
    Imperfections.draw(np.random.default_rng(1), 2, bodies=2, payload=0.0, force=1.0),
    encoder_noise=0.0,
)
START = np.array([0.1, -0.2])


def drives(domain=NOMINAL, fault=NO_DRIVE_FAULT):
    return DomainDrives(
        START,
        domain=domain,
        drivetrain=TWO,
        imperfections=HEALTHY,
        fault=fault,
        offset=np.zeros(2),
        settling=0.0,
        rng=np.random.default_rng(2),
    )


def followed(some, seconds=0.2, positions=None):
    """Torques of drives that follow sines while the joints do not move, or move as given."""
    out = []
    time = np.arange(round(seconds * RATE)) * STEP
    wanted = START + 0.01 * np.sin(2 * np.pi * 3 * time)[:, None]
    rates = 0.01 * 6 * np.pi * np.cos(2 * np.pi * 3 * time)[:, None] * np.ones(2)
    for first in range(0, len(time), STEPS):
        tick = slice(first, first + STEPS)
        targets, speeds, torque = some.command(wanted[tick], rates[tick], np.array([1.0, 2.0]))
        for step in range(STEPS):
            joints = START if positions is None else positions[first + step]
            read = some.read(joints, np.zeros(2))
            out.append(some.torque(*read, targets[step], speeds[step], torque))
    return np.array(out)


def test_drives_of_a_nominal_domain_equal_those_at_home():
    home = Drives(
        START,
        drivetrain=TWO,
        offset=np.zeros(2),
        imperfections=HEALTHY,
    )
    np.testing.assert_allclose(followed(drives()), followed(home), atol=1e-9)


def test_torques_rise_no_faster_than_they_can():
    torque = followed(drives(replace(NOMINAL, torque_rise=0.05)))
    slope = np.abs(np.diff(torque, axis=0)).max(axis=0) / STEP
    assert (slope <= np.array(TWO.torque) / 0.05 * (1 + 1e-9)).all()


def test_an_elastic_gear_without_motion_passes_the_torque_on():
    soft = replace(NOMINAL, flexibility=30.0)
    steady = followed(drives(soft), seconds=1.0)
    stiff = followed(drives(), seconds=1.0)
    np.testing.assert_allclose(steady[5000:].mean(axis=0), stiff[5000:].mean(axis=0), rtol=0.3)


def test_play_passes_no_torque_on_within_it():
    loose = replace(NOMINAL, flexibility=30.0, backlash=0.02)
    assert not followed(drives(loose), seconds=2e-3).any()


def test_ripple_shakes_the_joint_at_the_order_of_the_gear():
    speed = 1.0
    time = np.arange(RATE) * STEP
    moving = START + speed * time[:, None] * np.ones(2)
    rough, smooth = (
        drives(replace(NOMINAL, flexibility=50.0, ripple=ripple, gear=60.0))
        for ripple in (0.02, 0.0)
    )
    difference = followed(rough, 1.0, moving) - followed(smooth, 1.0, moving)
    spectrum = np.abs(np.fft.rfft(difference[2000:, 0] * np.hanning(8000)))
    peak = np.fft.rfftfreq(8000, STEP)[np.argmax(spectrum)]
    orders = peak * 2 * np.pi / speed / 60
    assert min(abs(orders - 1), abs(orders - 2)) < 0.25


def test_a_policy_holds_its_targets():
    some = drives(replace(NOMINAL, policy_rate=50.0, control="policy"))
    targets = [
        some.command(START + tick * 1e-3 * np.ones((STEPS, 2)), np.zeros((STEPS, 2)), np.zeros(2))
        for tick in range(100)
    ]
    values = np.array([target[0, 0] for target, _, _ in targets])
    changes = np.flatnonzero(np.diff(values))
    assert set(np.diff(changes)) == {round(1 / 50 / TICK)}
    assert not np.any([rates for _, rates, _ in targets])


@pytest.mark.parametrize("name", ON_DRIVES)
def test_faults_begin_and_end_within_the_run(name):
    for seed in range(30):
        fault = ON_DRIVES[name].kind(np.random.default_rng(seed), TWO, 6.0)
        assert fault.event is not None
        assert 0.5 < fault.event.start < fault.event.stop <= 6.02
        assert fault.event.label in ("impact", "highaccelerations", "oscillations")


@pytest.mark.slow
@pytest.mark.parametrize("name", ON_DRIVES)
def test_drives_are_nominal_until_the_fault_begins(name):
    fault = ON_DRIVES[name].kind(np.random.default_rng(3), TWO, 3.0)
    first = round(fault.event.start * RATE)
    good, faulty = (followed(drives(fault=each), 3.0) for each in (NO_DRIVE_FAULT, fault))
    np.testing.assert_array_equal(good[:first], faulty[:first])
    assert np.abs(good - faulty).max() > 0 or name == "latency"


def test_a_dropout_leaves_no_torque():
    event = Event("highaccelerations", "drives without torque", 0.05, 0.1)
    torque = followed(drives(fault=DriveFault(event=event, power=0.0)))
    assert not torque[500:1000].any()
    assert torque[1000:].any()


def test_commands_are_held_lost_or_moved():
    time = np.arange(STEPS) * STEP
    targets = np.arange(STEPS)[:, None] * np.ones(2)
    held = Held(0.0, 1.0)
    assert (held(time, targets, targets)[0] == targets[0]).all()
    assert (held(time + 0.5, targets + 5, targets)[0] == targets[0]).all()
    assert (held(time + 1.5, targets + 5, targets)[0] == targets + 5).all()
    always = Lost(0.01, 1.0, share=1.0, seed=1)
    always(time, targets, targets)
    assert (always(time + 0.5, targets + 5, targets)[0] == targets[-1]).all()
    jump = TargetJump(0.5, 0.6, np.array([0.1, 0.0]))
    assert (jump(time, targets, targets)[0] == targets).all()
    np.testing.assert_allclose(jump(time + 0.55, targets, targets)[0] - targets, [[0.1, 0]] * STEPS)
    np.testing.assert_allclose(jump(time + 2.0, targets, targets)[0], targets)
