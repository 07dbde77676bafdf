"""Standing posture of a quadruped before a trot."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import pinocchio as pin

from noiseclassifier.scenarios.quadruped.robots import Quadruped
from noiseclassifier.scenarios.reduced import reduced_model
from noiseclassifier.scenarios.shapes import Ball
from noiseclassifier.scenarios.wholebody import WholeBody
from noisemodel.types import Array

GRAVITY = 9.81
"""In [m/s²]."""


@dataclass(frozen=True, eq=False)
class Standing:
    """A robot that stands on the ground, its centre of mass over the middle of its feet.

    Attributes:
        configuration: As Pinocchio has it, shape (nq,).
        feet: Centres of its feet, the middle between them in the origin, shape (feet, 3), in [m].
        height: Of its centre of mass, in [m].
        weight: In [N].
    """

    configuration: Array
    feet: Array
    height: float
    weight: float


def stand(robot: Quadruped) -> Standing:
    """Standing posture with the joints near their rest positions."""
    return _stand(robot.name, robot.rest, robot.feet, reduced_model(robot))


@lru_cache(maxsize=8)
def _stand(name: str, rest: tuple[float, ...], feet: tuple[Ball, ...], model: Any) -> Standing:
    configuration = pin.neutral(model)
    configuration[7:] = rest
    data = model.createData()
    pin.framesForwardKinematics(model, data, configuration)
    places = np.array([data.oMf[model.getFrameId(foot.frame)].translation for foot in feet])
    middle = places.mean(axis=0) - (0.0, 0.0, feet[0].radius)
    places[:, :2] -= middle[:2]
    places[:, 2] = feet[0].radius
    configuration[:3] -= middle
    height = float(pin.centerOfMass(model, data, configuration)[2])
    body = WholeBody(model, feet, configuration)
    standing = body.follow(places, (), np.array([0.0, 0.0, height]), np.eye(3), steps=10)
    weight = float(pin.computeTotalMass(model)) * GRAVITY
    return Standing(standing, places, height, weight)
