"""Signals of joints on one time base become those of a run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from noisemodel.differentiate import METHOD, base_velocity, joint_velocity
from noisemodel.types import Array, Mask, Real


@dataclass(frozen=True, eq=False)
class Piece:
    """A signal of some joints, or of the base, on the run's time base.

    Attributes:
        signal: One of ``inspector.logs.columns.SIGNALS``.
        joints: The joints of its columns; empty for the base.
        values: Shape (samples, columns).
    """

    signal: str
    joints: tuple[str, ...]
    values: Real


@dataclass(frozen=True, eq=False)
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


def motion_of(pieces: Sequence[Piece], time: Array, valid: Mask) -> Motion:
    """Sort pieces by signal and joint; differentiate what velocities are missing.

    A signal that some of the joints lack, and that cannot be had otherwise, is left out.

    Args:
        pieces: The signals.
        time: Uniform, shape (samples,), in [s].
        valid: False in gaps, shape (samples,).
    """
    signals: dict[str, Any] = {}
    differentiated: dict[str, str] = {}
    remarks: list[str] = []
    held = {
        signal: _together([piece for piece in pieces if piece.signal == signal])
        for signal in dict.fromkeys(piece.signal for piece in pieces)
    }
    for suffix, names in (("", "joint_names"), ("_desired", "desired_joint_names")):
        velocity, position = f"velocity{suffix}", f"position{suffix}"
        known = [held[signal] for signal in (velocity, position) if signal in held]
        joints = tuple(dict.fromkeys(joint for piece in known for joint in piece.joints))
        if not joints:
            continue
        logged = held[velocity].joints if velocity in held else ()
        missing = tuple(joint for joint in joints if joint not in logged)
        if missing:
            slopes = joint_velocity(time, _ordered(held[position], missing), valid)
            added = Piece(velocity, missing, slopes)
            held[velocity] = _together([held[velocity], added] if velocity in held else [added])
            of_whom = f" of {', '.join(missing)}" if logged else ""
            differentiated[velocity] = METHOD + of_whom
            remarks.append(f"{velocity}{of_whom}: differentiated from positions ({METHOD})")
        signals[names] = joints
        for signal in (velocity, position) if suffix else (velocity, position, "effort"):
            if signal not in held:
                continue
            lacking = [joint for joint in joints if joint not in held[signal].joints]
            if not lacking:
                signals[signal] = _ordered(held[signal], joints)
            else:
                remarks.append(f"{signal}: left out, there is none of {', '.join(lacking)}")
    signals |= {name: held[name].values for name in ("base_pose", "base_velocity") if name in held}
    if "base_pose" in signals and "base_velocity" not in signals:
        signals["base_velocity"] = base_velocity(time, signals["base_pose"], valid)
        differentiated["base_velocity"] = METHOD
        remarks.append(f"base_velocity: differentiated from poses ({METHOD})")
    return Motion(signals, differentiated, tuple(remarks))


def _together(pieces: Sequence[Piece]) -> Piece:
    if len(pieces) == 1:
        return pieces[0]
    joints = tuple(joint for piece in pieces for joint in piece.joints)
    return Piece(pieces[0].signal, joints, np.hstack([piece.values for piece in pieces]))


def _ordered(piece: Piece, joints: Sequence[str]) -> Real:
    """Take the columns of some joints; all of them in their own order as they are."""
    if tuple(joints) == piece.joints:
        return piece.values
    return piece.values[:, [piece.joints.index(joint) for joint in joints]]
