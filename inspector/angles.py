"""Degrees, told from radians and turned into them."""

from dataclasses import replace

import numpy as np

from inspector.csvlog import Log
from inspector.errors import LogError
from noisemodel import Robot

LARGEST = {"position": 4 * np.pi, "velocity": 100.0}
"""What a joint that turns hardly exceeds, in [rad] and [rad/s]."""

TURNING = ("revolute", "continuous")


def to_radians(log: Log, robot: Robot | None) -> Log:
    """Convert the positions and velocities of all joints but those that are known to slide."""
    kinds = _kinds(robot)
    turns = [
        column.signal != "effort" and kinds.get(column.joint, "revolute") in TURNING
        for column in log.columns
    ]
    return replace(log, table=np.where(turns, np.deg2rad(log.table), log.table))


def refuse_degrees(log: Log, robot: Robot | None) -> None:
    """Refuse a log with angles or rates that no joint reaches in radians.

    Raises:
        LogError: Naming row and column.
    """
    kinds = _kinds(robot)
    for place, column in enumerate(log.columns):
        quantity = column.signal.removesuffix("_desired")
        kind = kinds.get(column.joint, "revolute")
        endless = kind == "continuous" and quantity == "position"
        if quantity not in LARGEST or kind not in TURNING or endless:
            continue
        beyond = np.abs(log.table[:, place]) > LARGEST[quantity]
        if beyond.any():
            sample = int(np.argmax(beyond))
            raise LogError(
                log.path,
                f"column {column.name!r} holds {log.table[sample, place]:g}, too much for radians;"
                " if it is in degrees, say --degrees; if the joint slides or turns without end,"
                " say which robot it is (--robot)",
                log.rows[sample],
            )


def unwrapped(log: Log) -> Log:
    """Make angles that wrap continuous, as interpolation needs them."""
    angles = [column.signal.startswith("position") for column in log.columns]
    return replace(log, table=np.where(angles, np.unwrap(log.table, axis=0), log.table))


def _kinds(robot: Robot | None) -> dict[str, str]:
    return {joint.name: joint.kind for joint in robot.joints} if robot else {}
