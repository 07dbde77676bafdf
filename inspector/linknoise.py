"""The extended noise of a run, link by link, in bins of time."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import noisemodel as nm
from models import Event
from noisemodel.differentiate import stretches
from noisemodel.kinematics import CHUNK
from noisemodel.types import Array, Mask

BIN = 0.01
"""Shortest bin, in [s]."""
BINS = 4000
"""Most bins that a run is divided into."""
FAST = 10.0
"""Motion below this moves the robot and is not heard, in [Hz]."""
CULPRITS = 3


@dataclass(frozen=True, eq=False)
class LinkNoise:
    """Sound power of each link.

    Attributes:
        kind: How the mean speed of a surface was taken.
        links: Names of the links, shape (links,).
        time: Centres of the bins, shape (bins,), in [s].
        power: Mean power in each bin, shape (bins, links), in [W].
        vibration: That of the measured motion above 10 Hz alone, normal to the surface,
            shape (bins, links), in [W].
        terms: Total power by each of the paper's terms A, B and C, shape (bins,), in [W]; empty
            unless asked for.
        remarks: What the surface lacks, a sentence each.
    """

    kind: str
    links: tuple[str, ...]
    time: Array
    power: Array
    vibration: Array
    terms: dict[str, Array]
    remarks: tuple[str, ...]

    @property
    def total(self) -> Array:
        """Power of the whole robot, shape (bins,), in [W]."""
        return np.asarray(self.power.sum(axis=1))

    @property
    def loudest(self) -> list[int]:
        """Indices of the links, the one that vibrates with the largest peak first."""
        return [int(i) for i in np.argsort(-self.vibration.max(axis=0), kind="stable")]

    def culprits(
        self, failure: Event | nm.Block, others: Sequence[Event | nm.Block]
    ) -> tuple[tuple[str, float], ...]:
        """Name the links in which a failure shows most.

        A link's excess is its power above 10 Hz during the failure, less its median outside of
        all failures; shares are of the robot's whole excess.

        Args:
            failure: A finding, or an annotated block.
            others: All failures of the run, found and annotated.

        Returns:
            Up to three links and their shares, the largest first.
        """
        inside = (self.time >= failure.start) & (self.time < failure.stop)
        busy = np.any([(self.time >= e.start) & (self.time < e.stop) for e in others], axis=0)
        if not inside.any():
            return ()
        quiet = np.median(self.vibration[~busy], axis=0) if not busy.all() else 0.0
        excess = np.maximum(self.vibration[inside].mean(axis=0) - quiet, 0.0)
        if not excess.sum() > 0.0:
            return ()
        ranked = np.argsort(-excess, kind="stable")[:CULPRITS]
        shares = excess / excess.sum()
        return tuple((self.links[i], float(shares[i])) for i in ranked if shares[i] > 0.0)


def link_noise(
    run: nm.Run, kind: str = "normal", *, geometry: str = "auto", terms: bool = False
) -> LinkNoise:
    """Compute the extended noise of a run.

    Args:
        run: A run of a robot that is known, with positions.
        kind: "paper", "A", "B", "C", "mean", "rms" or "normal", as ``noisemodel.extended`` has
            them.
        geometry: "visual", "collision", "hull" or "auto".
        terms: Whether to add up the paper's terms A, B and C, one by one.

    Returns:
        The noise; measured and desired motion add up.

    Raises:
        RobotError: If the robot cannot be read, or lacks one of the run's joints.
        GeometryError: If its surface cannot be had.
    """
    assert run.robot is not None
    floating = True if run.base_pose is not None else None
    robot = nm.Robot.load(run.robot, floating_base=floating)
    surface = nm.Surface.of(robot, geometry)
    motion = Motion(*robot.configuration(run), robot.desired(run))
    vibration = Motion(motion.q, vibrating(motion.v, run.mask, run.rate), None)
    bins = _edges(run)

    def power(motion: Motion, kind: str) -> Array:
        return _binned(robot, surface, motion, kind, run.mask, bins)

    return LinkNoise(
        kind=kind,
        links=surface.names,
        time=run.time[bins[:-1]] + np.diff(bins) / 2 / run.rate,
        power=power(motion, kind),
        vibration=power(vibration, "normal"),
        terms={term: power(motion, term).sum(axis=1) for term in "ABC"} if terms else {},
        remarks=tuple(_remarks(run, robot, surface)),
    )


class Motion(NamedTuple):
    """A motion in Pinocchio's order, and the desired one that is added."""

    q: Array
    v: Array
    desired: tuple[Array, Array] | None


def vibrating(velocity: Array, valid: Mask, rate: float) -> Array:
    """Leave the slow part of a motion out: its running mean over a tenth of a second.

    Args:
        velocity: Shape (samples, nv).
        valid: False in gaps, shape (samples,); no mean reaches over one.
        rate: Samples per second, in [Hz].

    Returns:
        What vibrates at 10 Hz and above, and little of what is slower, shape (samples, nv).
    """
    fast = np.zeros(velocity.shape[::-1])
    half = max(1, round(rate / FAST / 2))
    for stretch in stretches(valid, len(velocity)):
        part = velocity[stretch].T
        sums = np.cumsum(np.pad(part, ((0, 0), (1, 0))), axis=1)
        centre = np.arange(part.shape[1])
        # Towards the ends the mean is taken over less, so that it stays in the middle.
        reach = np.minimum(np.minimum(centre, centre[::-1]), half)
        first, last = centre - reach, centre + reach + 1
        whole = np.take(sums, last, axis=1) - np.take(sums, first, axis=1)
        fast[:, stretch] = part - whole / (last - first)
    return fast.T


def _edges(run: nm.Run) -> NDArray[np.intp]:
    """First sample of each bin, and the end."""
    size = max(1, round(BIN * run.rate), -(-len(run.time) // BINS))
    return np.append(np.arange(0, len(run.time), size), len(run.time))


def _binned(
    robot: nm.Robot,
    surface: nm.Surface,
    motion: Motion,
    kind: str,
    valid: Mask,
    bins: NDArray[np.intp],
) -> Array:
    """Mean power of each link in each bin, shape (bins, links); gaps count as silent."""
    size = int(bins[1])
    q_desired, v_desired = motion.desired or (None, None)
    chunks = nm.extended_chunks(
        robot,
        surface,
        motion.q,
        motion.v,
        kind,
        q_desired=q_desired,
        v_desired=v_desired,
        chunk=size * max(1, CHUNK // size),
    )
    means, start = [], 0
    for chunk in chunks:
        heard = valid[start : start + len(chunk.power), None]
        firsts = np.arange(0, len(heard), size)
        energy = np.add.reduceat(chunk.power * heard, firsts, axis=0)
        means.append(energy / np.maximum(np.add.reduceat(heard.astype(float), firsts), 1.0))
        start += len(heard)
    return np.concatenate(means)


def _remarks(run: nm.Run, robot: nm.Robot, surface: nm.Surface) -> Iterator[str]:
    resting = [name for name in robot.joint_names if name not in run.joint_names]
    if resting:
        yield f"The run does not name {', '.join(resting)}: they rest."
    if surface.bare:
        yield f"Links without geometry make no noise: {', '.join(surface.bare)}."
    if robot.floating_base and run.base_velocity is None:
        yield "The run has no base velocity: the link noise is that of a base at rest."
