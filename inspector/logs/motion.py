"""Signals of a run, assembled from resampled tracks and differentiated where missing."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from noisemodel.differentiate import METHOD, base_velocity, joint_velocity
from noisemodel.types import Array, Mask, Real


@dataclass(frozen=True, eq=False)
class ResampledTrack:
    """One signal of some joints, or of the base, on the run's time base.

    Attributes:
        signal: One of ``inspector.logs.signals.SIGNALS``.
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
        signals: Arguments of ``noisemodel.Run`` by name.
        differentiated: The method by the name of each differentiated velocity.
        remarks: What was differentiated or left out, a sentence each.
    """

    signals: Mapping[str, Any]
    differentiated: Mapping[str, str]
    remarks: tuple[str, ...]


def motion_of(tracks: Sequence[ResampledTrack], time: Array, valid: Mask) -> Motion:
    """Signals by joint, with missing velocities differentiated.

    A signal that some of the joints lack, and that cannot be computed, is left out.

    Args:
        tracks: The signals.
        time: Uniform, shape (samples,), in [s].
        valid: False in gaps, shape (samples,).
    """
    signals: dict[str, Any] = {}
    differentiated: dict[str, str] = {}
    remarks: list[str] = []
    by_signal = {
        signal: _joined([track for track in tracks if track.signal == signal])
        for signal in dict.fromkeys(track.signal for track in tracks)
    }
    for suffix, names in (("", "joint_names"), ("_desired", "desired_joint_names")):
        velocity, position = f"velocity{suffix}", f"position{suffix}"
        known = [by_signal[signal] for signal in (velocity, position) if signal in by_signal]
        joints = tuple(dict.fromkeys(joint for track in known for joint in track.joints))
        if not joints:
            continue
        logged = by_signal[velocity].joints if velocity in by_signal else ()
        missing = tuple(joint for joint in joints if joint not in logged)
        if missing:
            slopes = joint_velocity(time, _ordered(by_signal[position], missing), valid)
            added = ResampledTrack(velocity, missing, slopes)
            by_signal[velocity] = _joined(
                [by_signal[velocity], added] if velocity in by_signal else [added]
            )
            of_joints = f" of {', '.join(missing)}" if logged else ""
            differentiated[velocity] = METHOD + of_joints
            remarks.append(f"{velocity}{of_joints}: differentiated from positions ({METHOD})")
        signals[names] = joints
        for signal in (velocity, position) if suffix else (velocity, position, "effort"):
            if signal not in by_signal:
                continue
            lacking = [joint for joint in joints if joint not in by_signal[signal].joints]
            if not lacking:
                signals[signal] = _ordered(by_signal[signal], joints)
            else:
                remarks.append(f"{signal}: left out, missing for {', '.join(lacking)}")
    signals |= {
        name: by_signal[name].values for name in ("base_pose", "base_velocity") if name in by_signal
    }
    if "base_pose" in signals and "base_velocity" not in signals:
        signals["base_velocity"] = base_velocity(time, signals["base_pose"], valid)
        differentiated["base_velocity"] = METHOD
        remarks.append(f"base_velocity: differentiated from poses ({METHOD})")
    return Motion(signals, differentiated, tuple(remarks))


def _joined(tracks: Sequence[ResampledTrack]) -> ResampledTrack:
    if len(tracks) == 1:
        return tracks[0]
    joints = tuple(joint for track in tracks for joint in track.joints)
    return ResampledTrack(tracks[0].signal, joints, np.hstack([track.values for track in tracks]))


def _ordered(track: ResampledTrack, joints: Sequence[str]) -> Real:
    """Columns of some joints; no copy if these are all, in order."""
    if tuple(joints) == track.joints:
        return track.values
    return track.values[:, [track.joints.index(joint) for joint in joints]]
