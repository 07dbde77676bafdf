"""Drives report what encoders measure, respond in time and within limits, and have faults."""

from dataclasses import replace

import numpy as np
import pytest

from noiseclassifier.scenarios.arm import PickPlan, Tool, ToolControl
from noiseclassifier.scenarios.domains import Domain
from noiseclassifier.scenarios.drives import DomainDrives, Drives
from noiseclassifier.scenarios.faults import NO_DRIVE_FAULT, DriveFault, Imperfections
from noiseclassifier.scenarios.motions import RATE, STEP, STEPS, TICK, Event, Plan
from noiseclassifier.scenarios.robots import WIDE, Arm, Drivetrain
from noiseclassifier.scenarios.simulation import ON_DRIVES

PANDA = WIDE["panda"]
TWO = Drivetrain(
    joints=("a", "b"), stiffness=(300.0, 200.0), damping=(6.0, 4.0), torque=(40.0, 20.0),
    armature=(0.1, 0.1), friction=(0.5, 0.5), viscous=(0.1, 0.1),
)  # fmt: skip
START = np.array([0.1, -0.2])
LOADS = {"effectors": PANDA.effectors, "payload": 0.0, "force_noise": 1.0}
ROBOT = Arm(name="two", drives=TWO, rest=(0.1, -0.2), **LOADS)
HEALTHY = replace(Imperfections.draw(np.random.default_rng(1), ROBOT, bodies=2), encoder_noise=0.0)
PERFECT = replace(
    HEALTHY, stiffness=1.0, damping=1.0, encoder_bits=22, encoder_bandwidth=500.0, torque_delay=3
)
NOMINAL = Domain(
    wildness=0.0, length=1.0, mass=1.0, payload=0.0, gear=100.0, ripple=0.0, flexibility=0.0,
    backlash=0.0, cogging=0.0, stiction=1.0, friction=1.0, viscous=1.0, rotor=1.0,
    torque_limit=1.0, torque_rise=1e-9, delay=0.0, control="computed-torque", stiffness=1.0,
    damping=1.0, feedforward=1.0, policy_rate=0.0, encoder_bits=20, encoder_bandwidth=400.0,
)  # fmt: skip
FINE = {"encoder_bits": 40}


def perfect(offset=0.0, **changes):
    return Drives(np.zeros(2), TWO, np.full(2, offset), replace(PERFECT, **changes))


def drives(domain=NOMINAL, fault=NO_DRIVE_FAULT):
    settings = {"domain": domain, "fault": fault, "settling": 0, "rng": np.random.default_rng(2)}
    return DomainDrives(START, TWO, np.zeros(2), HEALTHY, **settings)


def fault_of(name, seed=3, duration=3.0):
    places = np.zeros((round(duration / TICK), 1, 3))
    plan = Plan(places=places, effectors=(), torques=TWO.torque)
    return ON_DRIVES[name](np.random.default_rng(seed), plan).drive


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


def test_a_joint_at_rest_reports_no_velocity_and_a_steady_turn_its_speed():
    still, turning = perfect(offset=0.05, **FINE), perfect(**FINE)
    for sample in range(400):
        position, velocity = still.read(np.zeros(2), np.full(2, 0.05))
        _, speed = turning.read(np.full(2, 0.7 * sample * STEP), np.zeros(2))
    assert position == pytest.approx(0.05, abs=1e-9)
    assert np.abs(velocity).max() < 1e-6
    assert speed == pytest.approx(0.7, rel=1e-6)


def test_positions_are_whole_counts_and_noise_does_not_mask_slow_motion():
    count = 2 * np.pi / 2**22
    position, _ = perfect().read(np.full(2, 10.4 * count), np.zeros(2))
    assert position == pytest.approx(10 * count, rel=1e-9)
    drive, rng = perfect(encoder_bits=21), np.random.default_rng(0)
    speeds = [drive.read(np.zeros(2), 1e-6 * rng.standard_normal(2))[1][0] for _ in range(5000)]
    assert 1e-5 < np.std(speeds) < 3e-3


def test_the_filter_passes_half_the_amplitude_at_its_bandwidth():
    drive, time = perfect(encoder_bandwidth=50.0, **FINE), np.arange(4000) * STEP
    wave = 0.1 * np.sin(2 * np.pi * 50 * time)
    speeds = [drive.read(np.full(2, here), np.zeros(2))[1][0] for here in wave]
    # A double pole: 1 / |1 + i|^2 of the true rate.
    assert max(speeds[2000:]) == pytest.approx(0.5 * 0.1 * 2 * np.pi * 50, rel=0.02)


def test_torque_arrives_after_the_delay_and_within_the_limit():
    drive, zero, far = perfect(), np.zeros(2), np.full(2, 1.0)
    torques = [float(drive.torque(zero, zero, far, zero, zero)[1]) for _ in range(5)]
    assert torques == [0, 0, 0, 20, 20]


def tool_follows(path, force):
    """Positions of the tip, tick by tick, of a tool that follows a path and presses."""
    ticks, tool = len(path), Tool(PANDA)
    still = {"yaw": np.zeros(ticks), "keep": np.zeros(ticks)}
    plan = PickPlan(
        places=path[:, None], force=np.full(ticks, force), effectors=PANDA.effectors, **still
    )
    rest = np.array(PANDA.rest)
    control = ToolControl(tool, rest, plan, gain=np.full(ticks, 1e-3), time_constant=0.005)
    references = [control.tick(number, np.zeros(1)) for number in range(ticks)]
    return [tool.place(each.position) for each in references], references[-1]


def test_the_tool_follows_the_plan():
    rest = Tool(PANDA).place(np.array(PANDA.rest))
    path = rest + np.linspace(0, 1, 400)[:, None] * (0.05, -0.08, -0.04)
    tips, last = tool_follows(path, np.nan)
    np.testing.assert_allclose(tips[-1], path[-2], atol=1e-5)
    np.testing.assert_allclose(last.planned, last.velocity, rtol=0.02, atol=1e-3)


def test_the_tool_sinks_at_gain_times_force_and_stays_at_the_force_that_is_desired():
    here = Tool(PANDA).place(np.array(PANDA.rest))
    path = np.tile(here, (500, 1))
    sunk, _ = tool_follows(path, 20.0)
    assert here[2] - sunk[-1][2] == pytest.approx(1e-3 * 20 * 500 * TICK, rel=0.01)
    _, last = tool_follows(path[:100], 0.0)
    np.testing.assert_allclose(last.position, PANDA.rest, rtol=0, atol=1e-9)


def test_drives_of_a_nominal_domain_equal_those_of_the_scenarios():
    np.testing.assert_allclose(
        followed(drives()), followed(Drives(START, TWO, np.zeros(2), HEALTHY)), atol=1e-9
    )


def test_torques_rise_no_faster_than_they_can():
    torque = followed(drives(replace(NOMINAL, torque_rise=0.05)))
    slope = np.abs(np.diff(torque, axis=0)).max(axis=0) / STEP
    assert (slope <= np.array(TWO.torque) / 0.05 * (1 + 1e-9)).all()


def test_an_elastic_gear_without_motion_passes_the_torque_on_but_not_within_its_play():
    steady = followed(drives(replace(NOMINAL, flexibility=30.0)), seconds=1.0)
    stiff = followed(drives(), seconds=1.0)
    np.testing.assert_allclose(steady[5000:].mean(axis=0), stiff[5000:].mean(axis=0), rtol=0.3)
    loose = replace(NOMINAL, flexibility=30.0, backlash=0.02)
    assert not followed(drives(loose), seconds=2e-3).any()


def test_ripple_shakes_the_joint_at_the_order_of_the_gear():
    moving = START + (np.arange(RATE) * STEP)[:, None] * np.ones(2)  # at 1 rad/s
    rough, smooth = (
        followed(drives(replace(NOMINAL, flexibility=50.0, ripple=ripple, gear=60.0)), 1.0, moving)
        for ripple in (0.02, 0.0)
    )
    spectrum = np.abs(np.fft.rfft((rough - smooth)[2000:, 0] * np.hanning(8000)))
    order = np.fft.rfftfreq(8000, STEP)[np.argmax(spectrum)] * 2 * np.pi / 60
    assert min(abs(order - 1), abs(order - 2)) < 0.25


def test_a_policy_holds_its_targets():
    some = drives(replace(NOMINAL, policy_rate=50.0, control="policy"))
    still = np.zeros((STEPS, 2))
    targets = [some.command(START + k * 1e-3 + still, still, np.zeros(2)) for k in range(100)]
    changes = np.flatnonzero(np.diff([target[0, 0] for target, _, _ in targets]))
    assert set(np.diff(changes)) == {round(1 / 50 / TICK)}
    assert not np.any([rates for _, rates, _ in targets])


@pytest.mark.parametrize("name", ON_DRIVES)
def test_faults_begin_and_end_within_the_run(name):
    for seed in range(30):
        event = fault_of(name, seed, 6.0).event
        assert 0.5 < event.start < event.stop <= 6.02


def test_a_dropout_leaves_no_torque():
    event = Event("highaccelerations", "drives without torque", 0.05, 0.1)
    torque = followed(drives(fault=DriveFault(event=event, power=0.0)))
    assert not torque[500:1000].any()
    assert torque[1000:].any()


def test_commands_are_held_lost_or_moved():
    steps = rates = np.zeros((STEPS, 2))

    def commanded(name, ticks=3000):
        fault = fault_of(name)
        times = (np.arange(ticks) * TICK)[:, None] + np.arange(STEPS) * STEP
        found = [fault.command(time, steps + k, rates)[0] for k, time in enumerate(times)]
        return np.array(found) - steps, round(fault.event.start / TICK), fault.event

    still, first, event = commanded("held-command")
    inside = slice(first + 1, round((event.stop - 0.02) / TICK) - 1)
    assert len({float(each[0, 0]) for each in still[inside]}) == 1
    assert still[-1, 0, 0] == 2999
    lost, *_ = commanded("lost-commands")
    again = [k for k in range(1, 3000) if lost[k, 0, 0] != k]
    assert again
    assert all(lost[k, 0, 0] < k for k in again)
    moved, first, event = commanded("target-jump")
    away = np.abs(moved - np.arange(3000)[:, None, None]).max(axis=(1, 2))
    assert not away[: first - 1].any()
    assert away[first + 2] == pytest.approx(event.facts["size"])
    assert away[-1] == pytest.approx(0.0, abs=1e-9) or event.start > 1.2
