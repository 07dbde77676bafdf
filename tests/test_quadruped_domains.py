"""Quadrupeds of wide domains: robots, gaits, poses, sizes, faults, soft drives."""

import numpy as np
import pinocchio as pin
import pytest

from scenarios import drives, simulation
from scenarios.case import Case
from scenarios.motions import Trot
from scenarios.quadruped import domains, robots, scene
from scenarios.quadruped.posing import SHIFT, TILT, poses
from scenarios.quadruped.robots import A1, ANYMAL_C, GO2, HYQ, QUADRUPEDS
from scenarios.quadruped.standing import GRAVITY, stand
from scenarios.reduced import reduced_model
from scenarios.tasks import Motion

SIMILAR = [robot for robot in QUADRUPEDS if robot.name not in ("go2", "solo12", "anymal")]


def plan(robot=GO2, seed=1, duration=5.0, **motion):
    return scene.plan(robot, Trot(**motion), np.random.default_rng(seed), duration)


def run(robot, motion, seed=1, duration=3.0):
    return simulation._trial(robot, Case(motion), seed, duration)


def upright(trial):
    _, x, y, _ = trial.motion.base_pose[:, 3:].T
    return 2 * np.hypot(x, y).max() < 0.2


def touchdowns(trial, planned):
    """Vertical speeds of the feet where they are planned to touch, in [m/s]."""
    force = trial.motion.contact
    return [
        force[round(contact.start * 1e4) :][:800, contact.effector].max() / planned.weight
        for contact in planned.contacts
        if 0 < contact.start < planned.duration - 0.1
    ]
