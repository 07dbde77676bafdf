"""Excitation motion of any robot without a simulator: slow sines, ripple, two shakes, a jerk.

Every joint follows three slow sines with a small ripple at all frequencies above, as
of real drives. A floating base moves in the same way at a tenth of the speed. There are three
events:

- ``shake-near`` and ``shake-far``: the joint that carries most of the robot and the one at the end
  of the longest chain vibrate, one after the other, equally fast and at one frequency. The
  simplified noise does not distinguish them;
- ``jerk``: the speed of all joints jumps within one sample, and the jump decays.

Positions keep to the limits of the URDF: the motion of a joint with a small range or speed is
scaled down. Limits without any range (lower = upper) or speed are not taken for limits. Joints that
mimic another one follow it; the base's pose does not change the noise and stays at the origin.
"""

from typing import NamedTuple

import numpy as np

from noisemodel.catalog import is_name
from noisemodel.errors import NoiseModelError
from noisemodel.robot import Robot
from noisemodel.run import Block, Run
from noisemodel.types import Array

SECONDS = 6.0
RATE = 4000.0
"""Sample rate unless another is given, in [Hz]."""
NOMINAL_SPEED = {"prismatic": 0.3}
"""Speed of the slow sines in [m/s]; of joints that turn it is 1 rad/s."""
BASE_SPEED = 0.1
"""Speed of a floating base, in [m/s] and [rad/s]."""
SINES_HZ = (0.1, 0.8)
SINES = 3
RIPPLE = 0.01
"""Root mean square of the ripple, as a share of the joint's nominal speed."""
RIPPLE_HZ = 10.0
"""Lowest frequency of the ripple, which has the same power in every octave above, in [Hz]."""
USABLE = 0.9
"""Share of its range and of its speed that a joint uses at most."""
SHAKE = 0.2
"""Amplitude of a shake, in [rad/s]."""
SHAKE_HZ = (40.0, 200.0)
SHAKES = {"shake-near": (1.0, 1.8), "shake-far": (2.6, 3.4)}
JERK = (4.6, 4.8)
JERK_DECAY = 0.03
"""Time constant of the decay of the jump, in [s]."""


class Limits(NamedTuple):
    """Limits of a robot's joints, each of shape (joints,); inf where the URDF has none.

    Attributes:
        centre: Middle of the range, 0 without one, in [rad] or [m].
        range: Width of the range, in [rad] or [m].
        speed: Largest speed, in [rad/s] or [m/s].
    """

    centre: Array
    range: Array
    speed: Array


def excitation(robot: Robot, *, seed: int = 0, rate: float = RATE) -> Run:
    """Motion of a robot that excites every joint, as the module's docstring defines it.

    Args:
        robot: Any robot.
        seed: Random seed.
        rate: Sample rate, in [Hz]; its Nyquist frequency has to be above that of the shakes.

    Returns:
        The run, of 6 s; its blocks are the events.

    Raises:
        NoiseModelError: If the rate is too low or the seed is negative.
    """
    if not 2.0 * SHAKE_HZ[1] < rate < np.inf:
        raise NoiseModelError(
            f"the excitation at {rate:g} Hz, expected above {2.0 * SHAKE_HZ[1]:g} Hz: its shakes"
            f" have up to {SHAKE_HZ[1]:g} Hz"
        )
    if seed < 0:
        raise NoiseModelError(f"seed is {seed}, expected 0 or more")
    random = np.random.default_rng(seed)
    time = np.arange(round(SECONDS * rate)) / rate
    joints = {joint.name: joint for joint in robot.joints if joint.name in robot.joint_names}
    speed = np.array([NOMINAL_SPEED.get(joint.kind, 1.0) for joint in joints.values()])
    velocity = _motion(time, len(joints), random, rate) * speed
    bounds = limits(robot)
    position = np.cumsum(velocity, axis=0) / rate
    low, high = _extent(position)
    scale = np.minimum(1.0, USABLE * bounds.range / (high - low))
    scale = np.minimum(scale, USABLE * bounds.speed / abs(velocity).max(axis=0))
    velocity = velocity * scale
    hertz = random.uniform(*SHAKE_HZ)
    blocks = [Block(*JERK, "jerk")]
    for (label, (start, stop)), joint in zip(SHAKES.items(), ends(robot), strict=False):
        column = robot.joint_names.index(joint)
        velocity[:, column] += SHAKE * _burst(time, start, stop, hertz)
        blocks.append(Block(start, stop, label))
    base = BASE_SPEED * _motion(time, 6, random, rate) if robot.floating_base else None
    return Run(
        time=time,
        velocity=velocity,
        position=bounds.centre + np.cumsum(velocity, axis=0) / rate - scale * (low + high) / 2,
        base_velocity=base,
        joint_names=robot.joint_names,
        robot=robot.name if is_name(robot.name) else str(robot.path),
        blocks=tuple(blocks),
        meta={"scenario": "excitation", "seed": seed},
    )


def limits(robot: Robot) -> Limits:
    """Limits in the URDF or MJCF of each joint that does not mimic another one.

    Args:
        robot: The robot.

    Returns:
        The limits, in the order of ``robot.joint_names``.
    """
    model = robot.model
    rows = []
    kinds = {joint.name: joint.kind for joint in robot.joints}
    for name in robot.joint_names:
        index = model.getJointId(name)
        lower = float(model.lowerPositionLimit[model.idx_qs[index]])
        upper = float(model.upperPositionLimit[model.idx_qs[index]])
        speed = float(model.velocityLimit[model.idx_vs[index]])
        bounded = kinds[name] != "continuous" and 0.0 < upper - lower < np.inf
        centre, width = ((lower + upper) / 2, upper - lower) if bounded else (0.0, np.inf)
        rows.append((centre, width, speed if speed > 0.0 else np.inf))
    return Limits(*np.array(rows, dtype=np.float64).reshape(-1, 3).T)


def ends(robot: Robot) -> tuple[str, ...]:
    """Names of the joint that carries most and the one at the end of the longest chain.

    Args:
        robot: The robot.

    Returns:
        Two joints that turn; one or none where there are no more.
    """
    depth, load = np.zeros((2, len(robot.joints) + 1), dtype=int)
    for index, joint in enumerate(robot.joints, start=1):
        depth[index] = depth[joint.parent] + 1
    for index in range(len(robot.joints), 0, -1):
        load[robot.joints[index - 1].parent] += load[index] + 1
    turning = [
        index
        for index, joint in enumerate(robot.joints, start=1)
        if joint.kind in ("revolute", "continuous") and joint.name not in robot.mimics
    ]
    if not turning:
        return ()
    near = max(turning, key=lambda index: (load[index], -depth[index]))
    far = max(turning, key=lambda index: (depth[index], -load[index]))
    return tuple(dict.fromkeys(robot.joints[index - 1].name for index in (near, far)))


def _motion(time: Array, axes: int, random: "np.random.Generator", rate: float) -> Array:
    """Slow sines, ripple and jerk of each axis at a nominal speed of 1, shape (samples, axes)."""
    slow = _sines(time, axes, random)
    ripple = RIPPLE * _ripple(len(time), axes, random, rate)
    jump = 0.5 * (time >= JERK[0]) * np.exp((JERK[0] - time) / JERK_DECAY)
    velocity: Array = slow + ripple + jump[:, None] * random.choice([-1.0, 1.0], axes)
    return velocity


def _sines(time: Array, axes: int, random: "np.random.Generator") -> Array:
    """Sum slow sines, spread evenly over octaves, to a mean square of 1, shape (samples, axes)."""
    hertz = np.exp(random.uniform(np.log(SINES_HZ[0]), np.log(SINES_HZ[1]), (SINES, axes)))
    phase = random.uniform(0.0, 2.0 * np.pi, (SINES, axes))
    sines: Array = np.sin(2.0 * np.pi * time[:, None, None] * hertz + phase).sum(axis=1)
    return sines * float(np.sqrt(2.0 / SINES))


def _ripple(samples: int, axes: int, random: "np.random.Generator", rate: float) -> Array:
    """Make noise with a mean square of 1, shape (samples, axes)."""
    hertz = np.fft.rfftfreq(samples, 1.0 / rate)
    white = np.fft.rfft(random.standard_normal((samples, axes)), axis=0)
    slope = np.where(hertz < RIPPLE_HZ, 0.0, 1.0 / np.sqrt(np.maximum(hertz, RIPPLE_HZ)))
    pink: Array = np.fft.irfft(white * slope[:, None], n=samples, axis=0)
    ripple: Array = pink / np.sqrt(np.mean(pink**2, axis=0))
    return ripple


def _burst(time: Array, start: float, stop: float, hertz: float) -> Array:
    """A sine with a Hann envelope between two times, shape (samples,)."""
    place = np.clip((time - start) / (stop - start), 0.0, 1.0)
    burst: Array = np.sin(np.pi * place) ** 2 * np.sin(2.0 * np.pi * hertz * time)
    return burst


def _extent(position: Array) -> tuple[Array, Array]:
    return position.min(axis=0), position.max(axis=0)
