"""The limits of joints, read from a robot's URDF without importing Pinocchio, which takes long."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from math import inf, isfinite
from pathlib import Path
from types import MappingProxyType
from xml.etree import ElementTree as ET

from noisemodel import urdf
from noisemodel.robot import Robot, locate

SINGLE = ("revolute", "continuous", "prismatic")
"""The types of joints that a run can name."""


@dataclass(frozen=True)
class Limits:
    """The limits of one joint; infinite where the robot states none.

    Attributes:
        lower: Lowest position, in [rad] or [m].
        upper: Highest position, in [rad] or [m].
        velocity: Highest speed, in [rad/s] or [m/s].
        turns: Whether it turns; a prismatic joint slides.
    """

    lower: float = -inf
    upper: float = inf
    velocity: float = inf
    turns: bool = True


def joint_limits(name: str | Path) -> Mapping[str, Limits]:
    """Limits of the joints that a run can name, by name, in the order of the robot's file.

    Args:
        name: A listed robot, or the path of a robot's file.

    Raises:
        UnknownRobotError: If there is neither such a name nor such a file.
        RobotError: If the file cannot be read.
    """
    path = locate(name)
    modified = path.stat().st_mtime_ns if path.is_file() else 0
    return _of_file(str(name), path, modified)


@lru_cache(maxsize=32)
def _of_file(name: str, path: Path, modified: int) -> Mapping[str, Limits]:
    if path.suffix.lower() == ".urdf":
        urdf.read(path)
        joints = ET.parse(path).getroot().findall("joint")  # noqa: S314
        found = {
            joint.get("name", ""): _of_element(joint)
            for joint in joints
            if joint.get("type") in SINGLE
        }
    else:
        found = of_model(Robot.load(name))
    return MappingProxyType(found)


def _of_element(joint: ET.Element) -> Limits:
    limit = joint.find("limit")
    known = {} if limit is None else limit.attrib
    endless = joint.get("type") == "continuous"
    return _limits(
        -inf if endless else _number(known.get("lower"), 0.0),
        inf if endless else _number(known.get("upper"), 0.0),
        _number(known.get("velocity"), inf),
        turns=joint.get("type") != "prismatic",
    )


def of_model(robot: Robot) -> dict[str, Limits]:
    """Limits of a robot's joints as Pinocchio has read them, by name."""
    model, found = robot.model, {}
    for joint in robot.joints:
        if joint.kind in SINGLE:
            endless = joint.kind == "continuous"
            found[joint.name] = _limits(
                -inf if endless else float(model.lowerPositionLimit[joint.first_q]),
                inf if endless else float(model.upperPositionLimit[joint.first_q]),
                float(model.velocityLimit[joint.first_v]),
                turns=joint.kind != "prismatic",
            )
    return found


def _limits(lower: float, upper: float, velocity: float, *, turns: bool) -> Limits:
    """Limits without those that are none: an empty range, or no speed at all."""
    if not lower < upper or max(abs(lower), abs(upper)) > 1e6:
        lower, upper = -inf, inf
    return Limits(lower, upper, velocity if 0 < velocity < 1e6 else inf, turns)


def _number(text: str | None, default: float) -> float:
    try:
        value = default if text is None else float(text)
    except ValueError:
        return default
    return value if isfinite(value) else default
