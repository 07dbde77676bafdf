"""Stages of the control flow, in the order in which a motion passes them."""

from dataclasses import dataclass

import numpy as np

from noisemodel import Run
from noisemodel.types import Array, Mask

DESIRED, MEASURED = "desired", "measured"


@dataclass(frozen=True, eq=False)
class Flow:
    """The velocities of a stretch of a run at each stage of the control flow.

    Attributes:
        names: Of the stages: those that the run names, in its order, then desired and measured.
        joints: Their names.
        velocity: Shape (stages, samples, joints), in [rad/s] or [m/s].
        time: Shape (samples,), in [s].
        valid: False in gaps, shape (samples,).
        rate: Samples per second, in [Hz].
    """

    names: tuple[str, ...]
    joints: tuple[str, ...]
    velocity: Array
    time: Array
    valid: Mask
    rate: float

    def samples(self, seconds: float) -> int:
        """Number of samples in a time, at least one."""
        return max(1, round(seconds * self.rate))


def flow(run: Run, part: slice) -> Flow:
    """Gather the stages of a run, for the joints that all of them have."""
    own = list(range(len(run.joint_names)))
    stages = [(name, signal, own) for name, signal in run.stages.items()]
    joints = own
    if run.velocity_desired is not None:
        places = {name: index for index, name in enumerate(run.desired_joint_names)}
        joints = [index for index in own if run.joint_names[index] in places]
        wanted = [places[run.joint_names[index]] for index in joints]
        stages.append((DESIRED, run.velocity_desired, wanted))
    stages.append((MEASURED, run.velocity, own))
    return Flow(
        names=tuple(name for name, _, _ in stages),
        joints=tuple(run.joint_names[index] for index in joints),
        velocity=np.array(
            [
                signal[part][:, columns if name == DESIRED else joints]
                for name, signal, columns in stages
            ],
            dtype=np.float64,
        ),
        time=run.time[part],
        valid=run.mask[part],
        rate=run.rate,
    )
