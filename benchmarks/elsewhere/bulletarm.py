"""PyBullet's arms with PyBullet's motors: constraints that reach a position or a velocity."""

from dataclasses import dataclass

import numpy as np

from benchmarks.elsewhere.bulletworld import World
from benchmarks.elsewhere.faults import Control
from benchmarks.elsewhere.recorded import Recorded
from noisemodel.types import Array

# Of the loop of a joint that chatters, in [1/s] and [s]: unstable from a product of 1.6 on.
CHATTER_GAIN, CHATTER_LAG = 20.0, 0.003


@dataclass(frozen=True)
class BulletArm:
    """An arm of ``pybullet_data``."""

    urdf: str
    joints: tuple[str, ...]
    force: tuple[float, ...]  # greatest torque of each motor, in [N m]
    home: tuple[float, ...]  # posture around which it moves, in [rad]
    payload: str
    links: tuple[int, ...]


@dataclass(frozen=True)
class Motors:
    """Settings of the motors, and the load."""

    mode: str
    gain: float  # position gain: of the motor's constraint, or of the loop around it in [1/s]
    lag: int
    payload: float  # mass added to the last link, in [kg]
    damping: float  # viscous friction of the joints, in [N m s]
    feedforward: bool

    @classmethod
    def draw(cls, rng: np.random.Generator) -> "Motors":
        """Draw all settings."""
        mode = str(rng.choice(("position", "velocity")))
        gain = 10 ** rng.uniform(-1.7, -0.7) if mode == "position" else rng.uniform(8.0, 40.0)
        payload = rng.choice((0.0, rng.uniform(0.3, 2.0)))
        return cls(
            mode,
            float(gain),
            lag=int(rng.integers(1, 4)),
            payload=float(payload),
            damping=rng.uniform(0.0, 0.5),
            feedforward=mode == "velocity" or bool(rng.random() < 0.5),
        )


def simulate(arm: BulletArm, motors: Motors, control: Control, rate: float) -> Recorded:
    """The motion of an arm under a control."""
    world = World(arm.urdf, rate)
    client, robot = world.client, world.robot
    joints = [world.names[name] for name in arm.joints]
    link = world.names[arm.payload]
    client.changeDynamics(robot, link, mass=client.getDynamicsInfo(robot, link)[0] + motors.payload)
    for joint, angle in zip(joints, control.position[0], strict=True):
        client.changeDynamics(robot, joint, jointDamping=motors.damping)
        client.resetJointState(robot, joint, angle)
    ticks, count = control.position.shape
    position, velocity, effort = (np.zeros((ticks, count)) for _ in range(3))
    gains = np.full(count, motors.gain).tolist()
    ones = np.ones(count).tolist()
    force = np.array(arm.force)
    chatters = (control.gain > 1).any(axis=1)

    def loop(tick: int, which: Array, now: int) -> None:
        """Velocity motors, and a loop around them with the age of its measurements."""
        seen = max(0, tick - motors.lag - int(control.delay[tick]))
        error = control.position[now] - position[seen] - control.offset[tick]
        speed = control.velocity[now] + motors.gain * error
        high = control.gain[tick] > 1
        older = max(0, tick - round(CHATTER_LAG * rate))
        chatter = control.gain[tick] * CHATTER_GAIN * (control.position[now] - position[older])
        speed = np.where(high, control.velocity[now] + chatter, speed)
        client.setJointMotorControlArray(
            robot,
            np.array(joints)[which].tolist(),
            client.VELOCITY_CONTROL,
            targetVelocities=speed[which].tolist(),
            forces=(np.where(control.gain[tick] > 1, 0.4, 1.0) * force)[which].tolist(),
        )

    everyone = np.ones(count, dtype=bool)
    for tick in range(ticks):
        position[tick], velocity[tick], effort[tick] = world.states(joints)
        now = max(0, tick - int(control.late[tick]))
        if motors.mode == "velocity":
            loop(tick, everyone, now)
        else:
            client.setJointMotorControlArray(
                robot,
                joints,
                client.POSITION_CONTROL,
                targetPositions=(control.position[now] - control.offset[tick]).tolist(),
                targetVelocities=control.velocity[now].tolist(),
                forces=force.tolist(),
                positionGains=gains,
                velocityGains=ones,
            )
            if chatters[tick]:  # such a constraint cannot chatter; the loop can
                loop(tick, control.gain[tick] > 1, now)
        world.step(tick, control.pushes, control.throws)
    events = world.contacts()
    world.close()
    return Recorded(position, velocity, effort, events).checked(rate)
