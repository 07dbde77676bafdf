"""The columns of a log become the signals of a run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from inspector.columns import Column
from noisemodel.differentiate import METHOD, joint_velocity
from noisemodel.types import Array, Mask


@dataclass(frozen=True)
class Motion:
    """Signals of a run.

    Attributes:
        signals: What ``noisemodel.Run`` takes, by its names.
        differentiated: By the name of each velocity that was missing, how it was had.
        remarks: What was differentiated or left out, a sentence each.
    """

    signals: Mapping[str, Any]
    differentiated: Mapping[str, str]
    remarks: tuple[str, ...]


def motion_of(columns: Sequence[Column], table: Array, time: Array, valid: Mask) -> Motion:
    """Sort columns by signal and joint; differentiate what velocities are missing.

    A signal that some of the joints lack, and that cannot be had otherwise, is left out.

    Args:
        columns: What each column holds.
        table: The columns, shape (samples, columns).
        time: Uniform, shape (samples,), in [s].
        valid: False in gaps, shape (samples,).
    """
    held: dict[str, dict[str, Array]] = {}
    for column, values in zip(columns, table.T, strict=True):
        held.setdefault(column.signal, {})[column.joint] = values
    signals: dict[str, Any] = {}
    differentiated: dict[str, str] = {}
    remarks: list[str] = []
    for suffix, names in (("", "joint_names"), ("_desired", "desired_joint_names")):
        velocity, position = f"velocity{suffix}", f"position{suffix}"
        velocities, positions = held.get(velocity, {}), held.get(position, {})
        joints = tuple(dict.fromkeys([*velocities, *positions]))
        if not joints:
            continue
        missing = [joint for joint in joints if joint not in velocities]
        if missing:
            slopes = joint_velocity(time, np.stack([positions[j] for j in missing], axis=1), valid)
            velocities = velocities | dict(zip(missing, slopes.T, strict=True))
            of_whom = "" if len(missing) == len(joints) else f" of {', '.join(missing)}"
            differentiated[velocity] = METHOD + of_whom
            remarks.append(f"{velocity}{of_whom}: differentiated from positions ({METHOD})")
        signals[names] = joints
        signals[velocity] = np.stack([velocities[joint] for joint in joints], axis=1)
        for signal in (position,) if suffix else (position, "effort"):
            known = held.get(signal, {})
            lacking = [joint for joint in joints if joint not in known]
            if not lacking:
                signals[signal] = np.stack([known[joint] for joint in joints], axis=1)
            elif known:
                remarks.append(f"{signal}: left out, there is none of {', '.join(lacking)}")
    return Motion(signals, differentiated, tuple(remarks))
