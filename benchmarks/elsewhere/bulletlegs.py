"""PyBullet's quadrupeds, which trot by soft joint PD around open-loop foot paths."""

from dataclasses import dataclass

import numpy as np

from benchmarks.elsewhere.bulletworld import World
from benchmarks.elsewhere.faults import Control
from benchmarks.elsewhere.recorded import DroppedError, Recorded
from benchmarks.elsewhere.references import Reference
from noisemodel.types import Array

LEGS = ("FR", "FL", "RR", "RL")
PHASES = np.array([0.0, 0.5, 0.5, 0.0])
SIDES = np.array([-1.0, 1.0, -1.0, 1.0])
SETTLING = 0.8  # time to stand before a run, in [s]
CHATTER_LAG = 0.004  # age of the measurements of a joint that chatters, in [s]


@dataclass(frozen=True)
class BulletLegs:
    """A quadruped of ``pybullet_data``."""

    urdf: str
    joints: tuple[str, str, str]
    names: tuple[str, str, str]
    signs: tuple[float, float, float, float]
    # Joint angles of hip, thigh and calf at the zero of the URDF, in [rad].
    zeros: tuple[float, float, float]
    lengths: tuple[float, float, float]  # lateral offset of a leg, thigh and calf, in [m]
    stance: float  # height of the hips over the feet, in [m]
    # Ranges of stiffness in [N m/rad] and damping in [N m s/rad].
    gains: tuple[tuple[float, float], tuple[float, float]]
    torque: float  # greatest torque of a joint, in [N m]
    links: tuple[int, ...]


@dataclass(frozen=True)
class Gait:
    """A trot, and the gains of the joints."""

    period: float  # duration of two steps, in [s]
    lift: float  # height of the swings, in [m]
    speed: float  # speed ahead, in [m/s]
    turn: float  # difference of the speeds of both sides, in [m/s]
    rest: float  # time after which it stops, in [s]
    stiffness: float  # in [N m/rad]
    damping: float  # in [N m s/rad]
    rotor: float  # inertia added to the links for that of the rotors, in [kg m²]
    payload: float  # mass added to the trunk, in [kg]

    @classmethod
    def draw(cls, rng: np.random.Generator, legs: BulletLegs, duration: float) -> "Gait":
        """Draw all settings."""
        return cls(
            period=rng.uniform(0.35, 0.55),
            lift=rng.uniform(0.03, 0.07),
            speed=rng.uniform(-0.15, 0.4),
            turn=rng.uniform(-0.05, 0.05),
            rest=float(rng.choice((duration, rng.uniform(0.6, 0.9) * duration))),
            stiffness=rng.uniform(*legs.gains[0]),
            damping=rng.uniform(*legs.gains[1]),
            rotor=rng.uniform(0.002, 0.01),
            payload=float(rng.choice((0.0, rng.uniform(0.5, 2.0)))),
        )


def reference(legs: BulletLegs, gait: Gait, duration: float, rate: float) -> Reference:
    """Joint angles of a trot, in the order and axes of the listed robot."""
    time = np.arange(round(duration * rate))[:, None] / rate
    going = np.clip(np.minimum(time, gait.rest - time), 0.0, 1.0)
    phase = (time / gait.period + PHASES) % 1.0
    swing = np.clip(2 * phase - 1, 0.0, 1.0)
    ahead = np.where(phase < 0.5, 0.5 - 2 * phase, -0.5 * np.cos(np.pi * swing))
    speed = gait.speed + gait.turn * SIDES
    x = going * ahead * speed * gait.period / 2
    z = -legs.stance + going * gait.lift * np.sin(np.pi * swing) ** 2
    y = np.broadcast_to(SIDES * legs.lengths[0], x.shape)
    position = angles(legs, x, y, z).reshape(len(time), 12)
    return Reference("trot", position, np.gradient(position, 1 / rate, axis=0))


def angles(legs: BulletLegs, x: Array, y: Array, z: Array) -> Array:
    """Joint angles that bring feet to places relative to their hips.

    Args:
        x: Places ahead of the hips, shape (samples, legs), in [m].
        y: Places to the left of the hips, same shape.
        z: Places above the hips, same shape.

    Returns:
        Angles of hip, thigh and calf, shape (samples, legs, 3), in [rad].
    """
    lateral, thigh, calf = SIDES * legs.lengths[0], *legs.lengths[1:]
    depth = np.sqrt(y**2 + z**2 - lateral**2)
    hip = np.arctan2(y, -z) - np.arctan2(lateral, depth)
    cosine = (x**2 + depth**2 - thigh**2 - calf**2) / (2 * thigh * calf)
    knee = -np.arccos(np.clip(cosine, -1.0, 1.0))
    upper = np.arctan2(-x, depth) - np.arctan2(calf * np.sin(knee), thigh + calf * np.cos(knee))
    return np.stack((hip, upper, knee), axis=2)


def simulate(legs: BulletLegs, gait: Gait, control: Control, rate: float) -> Recorded:
    """The motion of a quadruped under a control."""
    world = World(legs.urdf, rate, height=legs.stance + 0.05)
    client, robot = world.client, world.robot
    joints = [world.names[name.format(leg)] for leg in LEGS for name in legs.joints]
    signs = np.array([sign for hip in legs.signs for sign in (hip, 1.0, 1.0)])
    zeros = np.tile(legs.zeros, 4)
    client.changeDynamics(robot, -1, mass=client.getDynamicsInfo(robot, -1)[0] + gait.payload)
    client.setJointMotorControlArray(robot, joints, client.VELOCITY_CONTROL, forces=[0.0] * 12)
    for joint, angle in zip(joints, (control.position[0] - zeros) * signs, strict=True):
        client.resetJointState(robot, joint, angle)
        inertia = np.array(client.getDynamicsInfo(robot, joint)[2]) + gait.rotor
        client.changeDynamics(
            robot, joint, jointDamping=0.05, localInertiaDiagonal=inertia.tolist()
        )
    ticks, settling = len(control.position), round(SETTLING * rate)
    position, velocity, effort = (np.zeros((ticks, 12)) for _ in range(3))
    past: list[tuple[Array, Array]] = []
    for tick in range(-settling, ticks):
        now = max(0, tick)
        angle, speed, _ = world.states(joints)
        past.append((angle * signs + zeros, speed * signs))
        seen = past[max(0, tick + settling - 1 - int(control.delay[now]))]
        torque = gait.stiffness * (control.position[now] - seen[0] - control.offset[now])
        torque += gait.damping * (control.velocity[now] - seen[1])
        if (control.gain[now] > 1).any():
            older = past[max(0, tick + settling - round(CHATTER_LAG * rate))]
            extra = gait.stiffness * (control.position[now] - older[0])
            extra += gait.damping * (control.velocity[now] - older[1])
            torque += np.clip((control.gain[now] - 1) * extra, -legs.torque / 2, legs.torque / 2)
        torque = np.clip(torque, -legs.torque, legs.torque)
        if tick >= 0:
            (position[tick], velocity[tick]), effort[tick] = past[-1], torque
        client.setJointMotorControlArray(
            robot, joints, client.TORQUE_CONTROL, forces=(torque * signs).tolist()
        )
        world.step(tick, control.pushes, control.throws)
        if tick % 20 == 0:
            place, turn = client.getBasePositionAndOrientation(robot)
            upright = client.getMatrixFromQuaternion(turn)[8]
            if not (place[2] > 0.5 * legs.stance and upright > 0.6):
                world.close()
                raise DroppedError(f"fell after {tick / rate:.2f} s")
    events = world.contacts()
    world.close()
    return Recorded(position, velocity, effort, events).checked(rate)
