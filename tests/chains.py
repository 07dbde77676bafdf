"""Robots that are chains of simple shapes, and random motions for robots."""

import numpy as np
import pinocchio as pin

from noisemodel import Robot, Run
from noisemodel.noise import chunk_speeds

BAR = '<visual><origin xyz="0.1 0 0.3"/><geometry><box size="0.2 0.1 0.6"/></geometry></visual>'


def chain(folder, *kinds, shapes=None, axis="0 0 1", follow="", branch=1, **options):
    """A robot with a joint of each kind; ``branch`` is at the base, those after it may follow."""
    shapes = [BAR] * len(kinds) if shapes is None else shapes
    text = '<robot name="chain"><link name="link0"/>'
    for number, (kind, shape) in enumerate(zip(kinds, shapes, strict=True), start=1):
        text += f"""
          <link name="link{number}">{shape}</link>
          <joint name="joint{number}" type="{kind}">
            <parent link="link{0 if number == branch else number - 1}"/><child link="link{number}"/>
            <origin xyz="0.1 0.2 0.6" rpy="0.3 0.5 0.7"/><axis xyz="{axis}"/>
            <limit lower="-9" upper="9" effort="1" velocity="1"/>{follow if number > branch else ""}
          </joint>"""
    path = folder / "chain.urdf"
    path.write_text(text + "</robot>")
    return Robot.load(path, **options)


def motion(robot, samples=40, seed=1):
    """Configurations far from neutral, and velocities."""
    random = np.random.default_rng(seed)
    if robot.mimics:
        return random.standard_normal((2, samples, robot.nv))
    neutral = pin.neutral(robot.model)
    steps = 2 * random.standard_normal((samples, robot.nv))
    q = np.array([pin.integrate(robot.model, neutral, step) for step in steps])
    return q, random.standard_normal((samples, robot.nv))


def as_run(robot, q, v, rate=1000.0, /, **changes):
    """A run of these configurations and velocities."""
    base = 6 * robot.floating_base
    fields = {
        "time": np.arange(len(q)) / rate,
        "velocity": v[:, base:],
        "position": q[:, base + robot.floating_base :],
        "base_pose": q[:, :7] if base else None,
        "base_velocity": v[:, :6] if base else None,
        "joint_names": robot.joint_names,
        "robot": "panda" if robot.name == "panda" else str(robot.path),
    }
    return Run(**(fields | changes))


def surface_speed(robot, surface, q, v, kind):
    """Mean speed of the surface of every link, shape (samples, links)."""
    return chunk_speeds(robot, surface, q, v, kind).T
