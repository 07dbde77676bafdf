"""Drives report what their encoders measure, and respond after a delay and within their limits."""

import numpy as np
import pytest

from noiseclassifier.scenarios.arm import Plan, ToolControl
from noiseclassifier.scenarios.drives import Drives
from noiseclassifier.scenarios.faults import Imperfections
from noiseclassifier.scenarios.motions import STEP, TICK
from noiseclassifier.scenarios.robots import WIDE, Drivetrain
from noiseclassifier.scenarios.world import real_model

ONE = Drivetrain(
    joints=("elbow",),
    stiffness=(100.0,),
    damping=(2.0,),
    torque=(5.0,),
    armature=(0.0,),
    friction=(0.0,),
    viscous=(0.0,),
)

PANDA = WIDE["panda"]


def imperfections(**changes: float) -> Imperfections:
    perfect = {
        "stiffness": (1.0,),
        "damping": (1.0,),
        "force_gain": 1.0,
        "mass": (1.0,),
        "payload": 0.0,
        "friction": (1.0,),
        "viscous": (1.0,),
        "encoder_bits": 22,
        "encoder_noise": 0.0,
        "encoder_bandwidth": 500.0,
        "force_noise": 0.0,
        "torque_delay": 3,
    }
    return Imperfections(**(perfect | changes))


def drives(offset: float = 0.0, **changes: float) -> Drives:
    return Drives(
        np.zeros(1),
        drivetrain=ONE,
        offset=np.array([offset]),
        imperfections=imperfections(**changes),
    )


def test_a_joint_at_rest_reports_no_velocity():
    drive = drives(offset=0.05, encoder_bits=40)
    for _ in range(100):
        position, velocity = drive.read(np.zeros(1), np.array([0.05]))
    assert position[0] == pytest.approx(0.05, abs=1e-9)
    assert abs(velocity[0]) < 1e-6


def test_a_steady_turn_is_reported_with_its_speed():
    drive = drives(encoder_bits=40)
    speeds = [drive.read(np.array([0.7 * k * STEP]), np.zeros(1))[1][0] for k in range(400)]
    assert speeds[-1] == pytest.approx(0.7, rel=1e-6)


def test_positions_are_whole_counts():
    count = 2 * np.pi / 2**22
    position, _ = drives().read(np.array([10.4 * count]), np.zeros(1))
    assert position[0] == pytest.approx(10 * count, rel=1e-9)


def test_encoder_noise_does_not_mask_slow_motion():
    drive, rng = drives(encoder_bits=21), np.random.default_rng(0)
    speeds = [drive.read(np.zeros(1), 1e-6 * rng.standard_normal(1))[1][0] for _ in range(5000)]
    assert 1e-5 < np.std(speeds) < 3e-3


def test_the_filter_passes_half_the_amplitude_at_its_bandwidth():
    drive, time = drives(encoder_bits=40, encoder_bandwidth=50.0), np.arange(4000) * STEP
    wave = 0.1 * np.sin(2 * np.pi * 50 * time)
    speeds = [drive.read(np.array([here]), np.zeros(1))[1][0] for here in wave]
    # A double pole: 1 / |1 + i|^2 of the true rate.
    assert max(speeds[2000:]) == pytest.approx(0.5 * 0.1 * 2 * np.pi * 50, rel=0.02)


def test_torque_arrives_after_the_delay_and_within_the_limit():
    drive = drives(torque_delay=3)
    zero, far = np.zeros(1), np.array([1.0])
    torques = [float(drive.torque(zero, zero, far, zero, zero)[0]) for _ in range(5)]
    assert torques == [0, 0, 0, 5, 5]


def test_a_robot_has_the_mass_of_its_imperfections():
    import pinocchio as pin

    model = pin.buildSampleModelManipulator()
    scales = tuple(np.linspace(0.9, 1.1, model.nv))
    real = real_model(
        model, model.frames[-1].name, np.zeros(3), imperfections(mass=scales, payload=0.2)
    )
    masses = [model.inertias[i + 1].mass * scale for i, scale in enumerate(scales)]
    assert pin.computeTotalMass(real) == pytest.approx(sum(masses) + 0.2)
    assert pin.computeTotalMass(model) == pytest.approx(
        sum(inertia.mass for inertia in list(model.inertias)[1:])
    )


def tool_control(plan: Plan) -> tuple[ToolControl, object]:
    from noiseclassifier.scenarios.world import reduced_model

    model = reduced_model(PANDA)
    control = ToolControl(
        model,
        PANDA.tool.frame,
        np.array([0, 0, PANDA.tool.length]),
        np.array(PANDA.rest),
        plan,
        gain=np.full(len(plan.time), 1e-3),
        time_constant=0.005,
    )
    return control, model


def tip(model, joints):
    import pinocchio as pin

    data = model.createData()
    pin.framesForwardKinematics(model, data, joints)
    return data.oMf[model.getFrameId(PANDA.tool.frame)].act(np.array([0, 0, PANDA.tool.length]))


def plan_from(position, force) -> Plan:
    ticks = len(position)
    return Plan(position, np.zeros(ticks), np.full(ticks, force), np.zeros(ticks), (), (), ())


def test_the_tool_follows_the_plan():
    ticks = 400
    share = np.linspace(0, 1, ticks)[:, None]
    _, model = tool_control(plan_from(np.zeros((ticks, 3)), np.nan))
    path = tip(model, np.array(PANDA.rest)) + share * (0.05, -0.08, -0.04)
    control, model = tool_control(plan_from(path, np.nan))
    references = [control.tick(number, np.zeros(1)) for number in range(ticks)]
    np.testing.assert_allclose(tip(model, references[-1].position[1]), path[-2], atol=1e-5)
    np.testing.assert_allclose(
        references[-1].planned[1], references[-1].velocity[1], rtol=0.02, atol=1e-3
    )


def test_the_tool_sinks_at_gain_times_force_while_nothing_pushes_back():
    ticks = 500
    _, model = tool_control(plan_from(np.zeros((ticks, 3)), np.nan))
    here = tip(model, np.array(PANDA.rest))
    control, _ = tool_control(plan_from(np.tile(here, (ticks, 1)), 20.0))
    references = [control.tick(number, np.zeros(1)) for number in range(ticks)]
    sunk = here[2] - tip(model, references[-1].position[1])[2]
    assert sunk == pytest.approx(1e-3 * 20 * ticks * TICK, rel=0.01)


def test_the_tool_stays_while_the_force_is_as_desired():
    ticks = 100
    _, model = tool_control(plan_from(np.zeros((ticks, 3)), np.nan))
    here = tip(model, np.array(PANDA.rest))
    control, _ = tool_control(plan_from(np.tile(here, (ticks, 1)), 0.0))
    for number in range(ticks):
        reference = control.tick(number, np.zeros(1))
    np.testing.assert_allclose(reference.position[1], PANDA.rest, rtol=0, atol=1e-9)
