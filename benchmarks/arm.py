"""A second simulator for `benchmarks.repetitions`: an arm of our own with six joints, in MuJoCo.

Nothing of it is shared with `noiseclassifier.scenarios`: model, controller, noise and faults are
those of this file. Torques follow from positions and velocities at 1 kHz; gears ripple.
"""

import mujoco
import numpy as np

from noiseclassifier.scenarios.labels import annotate
from noiseclassifier.scenarios.motions import Event
from noisemodel import Block, Run
from noisemodel.types import Array

RATE, MOTIONS = 1000, 4
NAMES = ("base", "shoulder", "elbow", "forearm", "wrist", "flange")
# Length in [m] and mass in [kg] of each link.
LINKS = ((0.15, 5.0), (0.42, 7.0), (0.38, 4.0), (0.12, 1.6), (0.1, 1.2), (0.08, 0.4))
AXES = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0")
STIFFNESS = np.array([4000.0, 5000.0, 3000.0, 700.0, 600.0, 200.0])
DAMPING = np.array([160.0, 190.0, 100.0, 16.0, 14.0, 4.0])
FRICTION = np.array([4.0, 5.0, 3.0, 1.0, 1.0, 0.4])
# Of the torque of a gear, as a share of its friction, and how often per radian.
RIPPLE, TEETH = 0.15, 100.0
FAULTS = ("tone", "whine", "blow", "step", "sticking")


def model() -> mujoco.MjModel:
    """The arm; each link hangs at the end of the one before."""
    body, end = "", ""
    for place, ((length, mass), axis) in enumerate(zip(LINKS, AXES, strict=True)):
        before = LINKS[place - 1][0] if place else 0.3
        body += f"""<body pos="0 0 {before}">
            <joint name="{NAMES[place]}" axis="{axis}" armature="{0.02 * mass}"/>
            <geom type="capsule" size="0.04" fromto="0 0 0 0 0 {length}" mass="{mass}"/>"""
        end += "</body>"
    motors = "".join(f'<motor joint="{name}"/>' for name in NAMES)
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.0005" integrator="implicitfast"/>
        <default><geom contype="0" conaffinity="0"/></default>
        <worldbody>{body}{end}</worldbody><actuator>{motors}</actuator></mujoco>"""
    )


def planned(motion: int, seconds: float = 6.0) -> Array:
    """Desired positions: moves of a second between drawn postures, shape (samples, joints)."""
    rng = np.random.default_rng((81, motion))
    share = np.linspace(0.0, 1.0, RATE)[:, None]
    smooth = share**3 * (10 - 15 * share + 6 * share**2)
    posture, parts = np.zeros(len(NAMES)), []
    for _ in range(int(seconds)):
        aim = rng.uniform(-0.7, 0.7, len(NAMES))
        parts.append(posture + (aim - posture) * smooth)
        posture = aim
    return np.concatenate(parts)


def trial(motion: int, repetition: int, fault: str = "") -> Run:
    """A run; the repetition decides friction, gains and noise, and where a fault comes."""
    rng = np.random.default_rng((82, motion, repetition))
    friction = FRICTION * rng.uniform(0.9, 1.1, len(NAMES))
    stiffness = STIFFNESS * rng.uniform(0.98, 1.02, len(NAMES))
    phase = rng.uniform(0.0, 0.1, len(NAMES))
    arm = model()
    data, desired = mujoco.MjData(arm), planned(motion)
    desired_velocity = np.gradient(desired, 1 / RATE, axis=0)
    shift, rub = np.zeros(len(NAMES)), np.ones(len(NAMES))
    joint, start = 1 + repetition % 4, 2.0 + 0.4 * repetition
    position, velocity = np.empty_like(desired), np.empty_like(desired)
    for sample, aim in enumerate(desired):
        time, torque = sample / RATE, np.zeros(len(NAMES))
        acts = start <= time < start + 1.0
        shift[joint] = 0.015 * (fault == "step" and time >= start)
        rub[joint] = 25.0 if fault == "sticking" and acts else 1.0
        if acts and fault in ("tone", "whine"):
            frequency, share = (45.0, 5.0) if fault == "tone" else (140.0, 5.0)
            torque[joint] = share * FRICTION[joint] * np.sin(2 * np.pi * frequency * time)
        data.xfrc_applied[-1, 0] = 150.0 * (fault == "blow" and start <= time < start + 0.01)
        for _ in range(2):
            turn, speed = data.qpos, data.qvel
            torque_of_friction = rub * friction * np.tanh(speed / 0.02)
            ripple = RIPPLE * friction * np.sin(TEETH * turn + phase) * np.tanh(speed / 0.1)
            data.ctrl[:] = (
                data.qfrc_bias
                + stiffness * (aim + shift - turn)
                + DAMPING * (desired_velocity[sample] - speed)
                + torque
                - torque_of_friction
                - ripple
            )
            mujoco.mj_step(arm, data)
        position[sample], velocity[sample] = data.qpos, data.qvel
    noise = np.random.default_rng((83, motion, repetition))
    return Run(
        time=np.arange(len(desired)) / RATE,
        joint_names=NAMES,
        robot=None,
        position=position + 1e-5 * noise.standard_normal(position.shape),
        velocity=velocity + 2e-3 * noise.standard_normal(velocity.shape),
        position_desired=desired,
        velocity_desired=desired_velocity,
        meta={"fault": fault, "start": start},
    )


def labelled(run: Run, twin: Run) -> tuple[Block, ...]:
    """The blocks of a run with a fault by the labelling rule, beside the run without."""
    word = "impact" if run.meta["fault"] in ("blow", "step") else "oscillations"
    start = float(run.meta["start"])
    stop = start + (0.05 if word == "impact" else 1.0)
    events = [Event(word, run.meta["fault"], start, stop)]
    return annotate(run.velocity, twin.velocity, events, rate=RATE)[0]
