"""The extended noise of a run, link by link, in bins of time."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from noisemodel.linkpower import QUADRATIC, Index, by_moments, by_samples, second_moments
from noisemodel.robot import Robot
from noisemodel.run import Run, stretches
from noisemodel.runfile import AT_ONCE, pieces
from noisemodel.surface import Surface
from noisemodel.types import Array, Mask, Real

BIN = 0.01
"""Shortest bin, in [s]."""
BINS = 4000
"""Most bins that a run is divided into."""
BLOCK = 2**16
"""Samples whose running mean is taken at once."""
FAST = 10.0
"""Motion below this frequency moves the robot and does not vibrate, in [Hz]."""


@dataclass(frozen=True, eq=False)
class LinkNoise:
    """Sound power of each link.

    Attributes:
        kind: How the mean speed of a surface was taken.
        links: Names of the links, shape (links,).
        movers: Names of the joints that move each link, shape (links,).
        time: Centres of the bins, shape (bins,), in [s].
        power: Mean power in each bin, shape (bins, links), in [W].
        vibration: That of the measured motion above 10 Hz alone, normal to the surface,
            shape (bins, links), in [W].
        terms: Total power by each of the paper's terms A, B and C, shape (bins,), in [W]; empty
            unless they are requested.
        remarks: What is missing or assumed, a sentence each.
    """

    kind: str
    links: tuple[str, ...]
    movers: tuple[frozenset[str], ...]
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


def link_noise(
    run: Run, kind: str = "normal", *, geometry: str = "auto", terms: bool = False
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
        GeometryError: If its surface cannot be read.
    """
    assert run.robot is not None
    floating = True if run.base_pose is not None else None
    robot = Robot.load(run.robot, floating_base=floating)
    surface = Surface.of(robot, geometry)
    bins = _edges(run)
    middles = _middles(run, bins)

    q, wanted = robot.configuration(middles)[0], robot.desired(middles)
    motion, wanted_motion = run.motion, run.velocity_desired

    def fast_part(first: int, stop: int) -> Array:
        return _vibrating_part(motion, run.mask, run.rate, first, stop)

    fast = _moments(robot, run, fast_part, bins)
    motions, desired = [("normal", fast)], []
    if kind in QUADRATIC:
        motions.append((kind, _moments(robot, run, lambda a, b: motion[a:b], bins)))
        if wanted_motion is not None:
            by_part = lambda a, b: wanted_motion[a:b]  # noqa: E731
            desired = [(kind, _moments(robot, run, by_part, bins, desired=True))]
    if run.position_desired is None:  # desired velocities at measured positions: one pose for all
        motions, desired = [*motions, *desired], []
    vibration, *power = by_moments(robot, surface, q, motions)
    if desired and wanted is not None:
        power += by_moments(robot, surface, wanted[0], desired)
    if kind not in QUADRATIC:
        power = [by_samples(robot, surface, run, kind, bins)]
    return LinkNoise(
        kind=kind,
        links=surface.names,
        movers=tuple(_movers(robot, joint) for joint in surface.joint.tolist()),
        time=run.time[bins[:-1]] + np.diff(bins) / 2 / run.rate,
        power=np.sum(power, axis=0),
        vibration=vibration,
        terms={
            term: by_samples(robot, surface, run, term, bins).sum(axis=1)
            for term in ("ABC" if terms else "")
        },
        remarks=tuple(_remarks(run, robot, surface)),
    )


def vibrating(velocity: Real, valid: Mask, rate: float) -> Array:
    """The fast part of a motion: without its running mean over a tenth of a second.

    Args:
        velocity: Shape (samples, nv).
        valid: False in gaps, shape (samples,); no mean reaches over one.
        rate: Samples per second, in [Hz].

    Returns:
        What vibrates at 10 Hz and above, and little of what is slower, shape (samples, nv).
    """
    fast = np.zeros(velocity.shape[::-1])
    half = _half(rate)
    for stretch in stretches(valid, len(velocity)):
        length = stretch.stop - stretch.start
        for begin in range(0, length, BLOCK):
            centre = np.arange(begin, min(begin + BLOCK, length))
            # Towards the ends the mean is taken over less, so that it stays in the middle.
            reach = np.minimum(np.minimum(centre, length - 1 - centre), half)
            low, high = max(0, begin - half), min(begin + BLOCK + half, length)
            first, last = centre - reach - low, centre + reach + 1 - low
            count = (last - first).astype(np.float64)
            sums = np.zeros(high - low + 1)
            inside = velocity[stretch.start + low : stretch.start + high]
            around = np.ascontiguousarray(inside.T, dtype=np.float64)
            rows = slice(stretch.start + begin, stretch.start + begin + len(centre))
            for part, found in zip(around, fast[:, rows], strict=True):  # each stays in the cache
                np.cumsum(part, out=sums[1:])
                found[:] = part[begin - low :][: len(centre)] - (sums[last] - sums[first]) / count
    return fast.T


def vibrating_pieces(
    velocity: Real, valid: Mask, rate: float, multiple: int = 1
) -> Iterator[tuple[slice, Array]]:
    """The fast part of a motion, see `vibrating`, piece by piece.

    Args:
        velocity: Shape (samples, nv); may stay in its file.
        valid: False in gaps, shape (samples,).
        rate: Samples per second, in [Hz].
        multiple: All pieces but the last have a multiple of so many samples.

    Yields:
        Samples of a piece, and what vibrates in it, shape (samples, nv).
    """
    for rows in pieces(velocity, multiple):
        yield rows, _vibrating_part(velocity, valid, rate, rows.start, rows.stop)


def _vibrating_part(velocity: Real, valid: Mask, rate: float, first: int, stop: int) -> Array:
    half = _half(rate)
    around = slice(max(0, first - half), stop + half)
    found = vibrating(velocity[around], valid[around], rate)
    return found[first - around.start :][: stop - first]


def _half(rate: float) -> int:
    """Samples on each side of the middle of the running mean."""
    return max(1, round(rate / FAST / 2))


def _edges(run: Run) -> Index:
    """First sample of each bin, and the end; there are two bins or more."""
    samples = len(run.time)
    size = max(1, min(round(BIN * run.rate), samples // 2), -(-samples // BINS))
    return np.append(np.arange(0, samples, size), samples)


def _middles(run: Run, bins: Index) -> Run:
    """Take one sample of each bin: the middle one of those that are valid."""
    samples = (bins[:-1] + bins[1:]) // 2
    for index in np.flatnonzero(~run.mask[samples]):
        valid = bins[index] + np.flatnonzero(run.mask[bins[index] : bins[index + 1]])
        if len(valid):
            samples[index] = valid[len(valid) // 2]

    def at(signal: Real | None) -> Real | None:
        return None if signal is None else signal[samples]

    return Run(
        time=np.arange(len(samples)) * int(bins[1]) / run.rate,
        velocity=run.velocity[samples],
        joint_names=run.joint_names,
        position=at(run.position),
        velocity_desired=at(run.velocity_desired),
        position_desired=at(run.position_desired),
        desired_joint_names=run.desired_joint_names,
        valid=run.mask[samples],
        base_pose=at(run.base_pose),
        robot=run.robot,
    )


def _moments(
    robot: Robot,
    run: Run,
    motion: Callable[[int, int], Real],
    bins: Index,
    *,
    desired: bool = False,
) -> Array:
    """Mean products of a run's velocities, in Pinocchio's order, shape (bins, nv, nv).

    ``motion`` gives them from a first sample to the one after the last.
    """
    first = {joint.name: joint.first_v for joint in robot.joints}
    names = run.desired_joint_names if desired else run.joint_names
    entries, chosen = [first[name] for name in names], slice(None)
    if not desired and run.base_velocity is not None:
        if robot.floating_base:
            entries = [*range(6), *entries]
        else:
            chosen = slice(6, None)
    size, width = int(bins[1]), len(entries) or 1
    many = size * max(1, AT_ONCE // (8 * size * width))
    # A bin that is shorter than the others is taken with those before it.
    starts = [start for start in range(0, len(run.time), many) if len(run.time) - start >= size]
    parts = pairwise([*starts, len(run.time)])
    products = np.concatenate(
        [
            second_moments(motion(*part)[:, chosen], run.mask[slice(*part)], size=size)
            for part in parts
        ]
    )
    moments = np.zeros((robot.nv, robot.nv, len(bins) - 1))  # in memory as `by_moments` reads it
    moments[np.array(entries)[:, None], entries] = products.transpose(1, 2, 0)
    return moments.transpose(2, 0, 1)


def _movers(robot: Robot, carrier: int) -> frozenset[str]:
    names = set[str]()
    while carrier:  # 0 is the universe
        joint = robot.joints[carrier - 1]
        names.add(joint.name)
        carrier = joint.parent
    return frozenset(names)


def _remarks(run: Run, robot: Robot, surface: Surface) -> Iterator[str]:
    missing = [name for name in robot.joint_names if name not in run.joint_names]
    if missing:
        yield f"Not in the log, assumed stationary: {', '.join(missing)}."
    if surface.without_geometry:
        yield f"Links without geometry make no noise: {', '.join(surface.without_geometry)}."
    if robot.floating_base and run.base_velocity is None:
        yield "The run has no base velocity: its base is assumed stationary."
