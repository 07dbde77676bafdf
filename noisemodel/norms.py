"""Norms of a run's velocities: the simplified noise, and its parts kept apart."""

import numpy as np

from noisemodel.run import Run
from noisemodel.simplified import simplified
from noisemodel.types import Array, Real

NORMS = ("noise", "measured", "desired", "error")
"""What `norms` can give."""


def norms(run: Run) -> dict[str, Array]:
    """Reduce the velocities of a run to a few signals.

    Args:
        run: The run.

    Returns:
        Signals by name, each of shape (samples,), in [rad/s]: ``measured``, a floating base's
        velocities among them, and ``noise``, the simplified estimate; with desired velocities also
        ``desired`` and ``error``, the difference of desired and measured velocities of the joints
        that have both, if there are any.
    """
    signals = {
        "noise": simplified(run.motion, run.velocity_desired),
        "measured": simplified(run.motion),
    }
    if run.velocity_desired is not None:
        signals["desired"] = simplified(run.velocity_desired)
        if (error := _error(run, run.velocity_desired)).shape[1]:
            signals["error"] = simplified(error)
    return signals


def by_joint(run: Run) -> dict[str, Array]:
    """Take the velocities of those joints that are desired as well as measured.

    Args:
        run: The run.

    Returns:
        ``desired_joints``, ``measured_joints`` and ``error_joints``, their difference, each of
        shape (joints, samples), in [rad/s]; without desired velocities, ``measured_joints`` of all
        joints; with efforts, also ``effort_joints``, in their unit; nothing if no desired joint is
        measured.
    """
    names = [name for name in run.joint_names if name in run.desired_joint_names]
    if run.velocity_desired is None:
        names = list(run.joint_names)
    if not names:
        return {}
    own = [run.joint_names.index(name) for name in names]
    effort = (
        {} if run.effort is None else {"effort_joints": run.effort[:, own].T.astype(np.float64)}
    )
    measured = run.velocity[:, own].T
    if run.velocity_desired is None:
        return {"measured_joints": measured.astype(np.float64, copy=False), **effort}
    desired = run.velocity_desired[:, [run.desired_joint_names.index(name) for name in names]].T
    measured, desired = (each.astype(np.float64, copy=False) for each in (measured, desired))
    return {
        "desired_joints": desired,
        "measured_joints": measured,
        "error_joints": desired - measured,
        **effort,
    }


def _error(run: Run, desired: Real) -> Real:
    if run.desired_joint_names == run.joint_names:
        return np.asarray(desired - run.velocity)
    both = [name for name in run.joint_names if name in run.desired_joint_names]
    measured = [run.joint_names.index(name) for name in both]
    wanted = [run.desired_joint_names.index(name) for name in both]
    return np.asarray(desired[:, wanted] - run.velocity[:, measured])
