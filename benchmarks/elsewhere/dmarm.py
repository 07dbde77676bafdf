"""The Jaco arm of dm_control with its velocity servos, in MuJoCo."""

import os
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.elsewhere.faults import Control
from benchmarks.elsewhere.recorded import Recorded

JOINTS = tuple(f"joint_{number}" for number in range(1, 7))
HOME = (0.0, 3.1, 1.6, 0.0, 3.1, 0.0)
CHATTER_GAIN, CHATTER_LAG = 20.0, 0.004  # of the loop of a joint that chatters, in [1/s] and [s]


@dataclass(frozen=True)
class Servos:
    """Settings of the loop around the servos, and of the arm."""

    gain: float  # of the position loop, in [1/s]
    servo: float
    lag: int
    armature: float  # reflected inertia of the rotors, in [kg m²]
    friction: float  # coulomb friction of the joints, in [N m]
    payload: float  # mass added to the last link, in [kg]

    @classmethod
    def draw(cls, rng: np.random.Generator) -> "Servos":
        """Draw all settings."""
        return cls(
            gain=rng.uniform(4.0, 20.0),
            servo=10 ** rng.uniform(-1.3, 0.0),
            lag=int(rng.integers(1, 4)),
            armature=rng.uniform(0.02, 0.2),
            friction=rng.uniform(0.0, 0.5),
            payload=float(rng.choice((0.0, rng.uniform(0.2, 0.8)))),
        )


def model_of(servos: Servos, rate: float) -> Any:
    """The model of dm_control with these settings."""
    import mujoco

    os.environ.setdefault("MUJOCO_GL", "off")  # nothing is rendered
    from dm_control.entities.manipulators.kinova import JacoArm

    mjcf = JacoArm().mjcf_model
    model = mujoco.MjModel.from_xml_string(mjcf.to_xml_string(), mjcf.get_assets())
    model.opt.timestep = 1 / rate
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model.actuator_gainprm[:, 0] *= servos.servo
    model.actuator_biasprm[:, 2] *= servos.servo
    model.dof_armature[:] = servos.armature
    model.dof_frictionloss[:] = servos.friction
    model.body_mass[-1] += servos.payload
    return model


def simulate(servos: Servos, control: Control, rate: float) -> Recorded:
    """The motion of the arm under a control."""
    import mujoco

    model = model_of(servos, rate)
    data = mujoco.MjData(model)
    data.qpos[:] = control.position[0]
    position, velocity, effort = (np.zeros(control.position.shape) for _ in range(3))
    for tick in range(len(position)):
        position[tick], velocity[tick] = data.qpos, data.qvel
        seen = max(0, tick - servos.lag - int(control.delay[tick]))
        now = max(0, tick - int(control.late[tick]))
        error = control.position[now] - position[seen] - control.offset[tick]
        high = control.gain[tick] > 1
        older = position[max(0, tick - round(CHATTER_LAG * rate))]
        chatter = control.gain[tick] * CHATTER_GAIN * (control.position[now] - older)
        correction = np.where(high, chatter, servos.gain * error)
        data.ctrl[:] = control.velocity[now] + correction
        data.xfrc_applied[:] = 0.0
        for push in control.pushes:
            if push.start <= tick < push.stop:
                data.xfrc_applied[push.link, :3] = push.at(tick)
        mujoco.mj_step(model, data)
        effort[tick] = data.actuator_force
    return Recorded(position, velocity, effort).checked(rate)
