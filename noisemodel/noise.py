"""Noise of motions: the simplified estimate, and the sound power of every link.

The extended estimate is that power: a link radiates by its surface and the mean speed of it.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from noisemodel.robot import Joint, Robot, chunk_twists, link_twists
from noisemodel.run import Run, rows_of, stretches
from noisemodel.runfile import AT_ONCE, OnDemand, pieces
from noisemodel.surface import TINY, LinkSurface, Surface, point_speeds, turning_speed
from noisemodel.types import Array, GeometryError, Mask, NoiseModelError, Real, UnknownKindError

Index: TypeAlias = NDArray[np.intp]

DENSITY = 1.204  # of air at 20 °C, in [kg/m³]
SOUND_SPEED = 343.2  # in air at 20 °C, in [m/s]
REFERENCE_POWER = 1e-12  # 0 dB of sound power, in [W]
CHUNK = 4096  # samples worked on at once: few enough for the cache, with little overhead of Python

KINDS = ("paper", "A", "B", "C", "mean", "rms", "normal")  # the kinds of mean speed
QUADRATIC = ("rms", "normal")  # their squares are quadratic forms of a link's twist

BLOCK_OF_POINTS = 256  # samples of all points of a link that fit into the cache
BIN, BINS = 0.01, 4000  # shortest bin, in [s], and most bins that a run is divided into
BLOCK = 2**16  # samples whose running mean is taken at once
FAST = 10.0  # motion below this frequency moves the robot and does not vibrate, in [Hz]


# The simplified estimate, and sound power.


def simplified(velocity: Real, velocity_desired: Real | None = None) -> Array:
    """Estimate a robot's noise pressure from its joint velocities, all constants 1.

    Args:
        velocity: Measured velocities, a floating base's included,
            shape (samples, n), in [rad/s] and [m/s].
        velocity_desired: Desired joint velocities, shape (samples, m); none counts as zero.

    Returns:
        The noise estimate p_hat, shape (samples,), in [rad/s].
    """
    power = _squared(velocity)
    if velocity_desired is not None:
        if len(velocity_desired) != len(velocity):
            raise NoiseModelError(
                f"velocity has {len(velocity)} samples, velocity_desired {len(velocity_desired)}"
            )
        power = power + _squared(velocity_desired)
    return np.sqrt(power)  # p_hat = sqrt(|qd|^2 + |qd_desired|^2), Sygulla & Rixen, Sec. II-A


def _squared(velocity: Real) -> Array:
    if velocity.ndim != 2:
        raise NoiseModelError(f"velocities of shape {velocity.shape}, expected (samples, joints)")
    power = np.empty(len(velocity))
    for start in range(0, len(velocity), CHUNK):
        part = slice(start, start + CHUNK)
        exact = velocity[part].astype(np.float64, copy=False)
        np.einsum("sj,sj->s", exact, exact, out=power[part])
    return power


def norms(run: Run) -> dict[str, Array]:
    """Reduce the velocities of a run to signals by name, each of shape (samples,), in [rad/s].

    They are ``measured``, a floating base's velocities among them, and ``noise``, the simplified
    estimate; with desired velocities also ``desired`` and ``error``, the difference of desired and
    measured velocities of the joints that have both, if there are any.
    """
    motion, desired = run.motion, run.velocity_desired
    signals = {"noise": simplified(motion, desired), "measured": simplified(motion)}
    if desired is not None:
        signals["desired"] = simplified(desired)
        measured = run.velocity
        if run.desired_joint_names != run.joint_names:
            own, wanted = in_both(run)
            measured, desired = measured[:, own], desired[:, wanted]
        if desired.shape[1]:
            signals["error"] = simplified(np.asarray(desired - measured))
    return signals


def by_joint(run: Run) -> dict[str, Array]:
    """Take the velocities of joints, by name of the signal, each (joints, samples), in [rad/s].

    They are ``desired_joints``, ``measured_joints`` and ``error_joints``, their difference, of the
    joints that are desired as well as measured; without desired velocities, ``measured_joints`` of
    all joints; with efforts, also ``effort_joints``, in their unit.
    """
    found = {}
    own = list(range(len(run.joint_names)))
    if run.velocity_desired is not None:
        own, wanted = in_both(run)
        found["desired_joints"] = _rows(run.velocity_desired, wanted)
    if not own:
        return {}
    found["measured_joints"] = _rows(run.velocity, own)
    if run.velocity_desired is not None:
        found["error_joints"] = found["desired_joints"] - found["measured_joints"]
    if run.effort is not None:
        found["effort_joints"] = _rows(run.effort, own)
    return found


def in_both(run: Run) -> tuple[list[int], list[int]]:
    """Columns of the joints that are measured and desired, in both signals."""
    names = [name for name in run.joint_names if name in run.desired_joint_names]
    measured = [run.joint_names.index(name) for name in names]
    return measured, [run.desired_joint_names.index(name) for name in names]


def _rows(signal: Real, columns: list[int]) -> Array:
    every = columns == list(range(signal.shape[1]))  # no copy more
    rows = np.asarray(signal)[:, slice(None) if every else columns].T
    return np.ascontiguousarray(rows, dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Noise:
    """The sound that a robot's links radiate."""

    power: Array  #: sound power of each link, shape (samples, links), in [W]
    names: tuple[str, ...]  #: of the links

    @property
    def total(self) -> Array:
        """Sound power of the robot, shape (samples,), in [W]."""
        return np.asarray(self.power.sum(axis=1))

    @property
    def level(self) -> Array:
        """Level of the total power, shape (samples,), in [dB re 1 pW]; -inf in silence."""
        return decibel(self.total / REFERENCE_POWER)

    def pressure(self, distance: float) -> Array:
        """Sound pressure in [Pa] at a distance in [m] from a robot that is a point, (samples,)."""
        if not 0.0 < distance < np.inf:
            raise NoiseModelError(f"distance is {distance:g} m, expected a positive number")
        impedance = DENSITY * SOUND_SPEED
        # p = sqrt(P rho c / (4 pi d²)), Sygulla & Rixen, Sec. II-A
        return np.asarray(np.sqrt(self.total * impedance / (4.0 * np.pi * distance**2)))

    @property
    def shares(self) -> Array:
        """Share of each link in the energy, shape (links,), of sum 1; all 0 in silence."""
        energy = self.power.sum(axis=0)
        return np.asarray(energy / max(energy.sum(), TINY))


def sound_power(mean_square: Array, area: Array | float) -> Array:
    """Sound power in [W] of surfaces, by mean-square speeds in [m²/s²] and areas in [m²]."""
    # P_i = rho c sigma_i S_i v_i² with sigma_i = 1, Sygulla & Rixen, Sec. II-A
    return np.asarray(DENSITY * SOUND_SPEED * area * mean_square)


def decibel(ratio: Array) -> Array:
    """Express ratios of powers in [dB]; 0 is -inf."""
    with np.errstate(divide="ignore"):
        return np.asarray(10.0 * np.log10(ratio))


# Mean speeds of a link's surface: the paper's equation and its alternatives.


def chunk_speeds(robot: Robot, surface: Surface, q: Real, v: Real, kind: str) -> Array:
    """Mean speeds of all links in a few thousand samples, shape (links, samples)."""
    twists = np.empty((len(robot.joints) + 1, 6, len(q)))
    chunk_twists(robot.joints, q, v, out=twists)
    velocities = np.ascontiguousarray(v.T, dtype=np.float64)
    speeds = np.zeros((len(surface.links), len(q)))
    for place, (link, index) in enumerate(zip(surface.links, surface.joint, strict=True)):
        if link.area:
            joint = robot.joints[index - 1]
            velocity = velocities[joint.first_v : joint.first_v + joint.nv]
            speeds[place] = _link_speed(kind, link, joint, twists[index], velocity)
    return speeds


def _link_speed(kind: str, link: LinkSurface, joint: Joint, twist: Array, velocity: Array) -> Array:
    """Mean speed of a link by its twist, shape (6, samples), and its joint's, (nv, samples)."""
    if kind == "mean":
        starts = range(0, twist.shape[1], BLOCK_OF_POINTS)
        blocks = (twist[:, start : start + BLOCK_OF_POINTS] for start in starts)
        points, weights = link.points.points, link.points.weights
        return np.concatenate([weights @ point_speeds(points, block) for block in blocks])
    if kind in QUADRATIC:
        form = link.mean_square if kind == "rms" else link.mean_square_normal
        squares = np.einsum("is,is->s", form @ twist, twist)
        return np.asarray(np.sqrt(np.maximum(squares, 0.0)))  # rounding, where nothing moves out
    own = joint.subspace @ velocity
    carried = twist - own
    terms = []  # of the paper's mean speed, Sec. II-A
    if kind in ("paper", "A"):
        terms.append(_length(carried[:3]))  # |v_O|
    if kind in ("paper", "B"):
        terms.append(turning_speed(link.turning, link.rounding, carried[3:]))  # <|w_parent x r|>
    if kind in ("paper", "C"):  # |v_rel| + <|w_rel x r|>; about one axis the latter is |qdot| G
        if np.isnan(link.lever):
            turning = turning_speed(link.turning, link.rounding, own[3:])
        else:
            turning = _length(own[3:]) * link.lever
        terms.append(_length(own[:3]) + turning)
    return sum(terms[1:], terms[0])


def _length(vectors: Array) -> Array:
    return np.asarray(np.sqrt(np.einsum("is,is->s", vectors, vectors)))


def _check_motion(robot: Robot, q: Real, v: Real, names: tuple[str, str]) -> None:
    for name, array, width in zip(names, (q, v), (robot.nq, robot.nv), strict=True):
        if array.shape != (len(q), width):
            raise NoiseModelError(f"{name} has shape {array.shape}, expected ({len(q)}, {width})")
        finite = np.isfinite(array)
        if not finite.all():
            row, column = np.argwhere(~finite)[0]
            raise NoiseModelError(
                f"{name}: {array[row, column]} in row {row}, column {column}; cut gaps out"
            )


def extended(
    robot: Robot,
    surface: Surface,
    q: Real,
    v: Real,
    kind: str = "paper",
    *,
    q_desired: Real | None = None,
    v_desired: Real | None = None,
) -> Noise:
    """Estimate the sound power that each link radiates, with a radiation efficiency of 1.

    Args:
        robot: The robot.
        surface: Its surface.
        q: Configurations as Pinocchio has them, shape (samples, nq).
        v: Velocities as Pinocchio has them, shape (samples, nv).
        kind: How the mean speed of a surface is taken: "paper", the sum of the paper's terms "A",
            "B" and "C", or one of these; "mean", the exact mean that the sum is an upper bound of;
            "rms", the root of the mean-square speed; "normal", the same normal to the surface.
        q_desired: Desired configurations, shape (samples, nq); ``q`` unless given.
        v_desired: Desired velocities, shape (samples, nv); the power of this motion is added.
            A floating base is stationary in it, whatever is given.

    Raises:
        UnknownKindError: If the kind does not exist.
        GeometryError: If the surface belongs to another robot.
        NoiseModelError: If a motion is of another shape than the robot's, or not finite.
    """
    if kind not in KINDS:
        raise UnknownKindError(kind, KINDS)
    if len(surface.names) != len(robot.joints):
        raise GeometryError(
            f"a surface of {len(surface.names)} links for {robot.name!r}, which has"
            f" {len(robot.joints)}; expected Surface.of(robot)"
        )
    _check_motion(robot, q, v, ("q", "v"))
    motions = _motions(robot, q, v, q_desired, v_desired)
    power, stop = np.empty((len(surface.links), len(q))), 0
    for part in _powers(robot, surface, motions, kind, CHUNK):
        start, stop = stop, stop + len(part)
        power[:, start:stop] = part.T
    return Noise(power.T, surface.names)


def _motions(
    robot: Robot, q: Real, v: Real, q_desired: Real | None, v_desired: Real | None
) -> list[tuple[Real, Real]]:
    """The measured motion, and the desired one if there is one, whose base is stationary."""
    if v_desired is None:
        if q_desired is not None:
            raise NoiseModelError(
                "q_desired is given and v_desired is not; positions alone radiate nothing"
            )
        return [(q, v)]
    wanted = q if q_desired is None else q_desired
    _check_motion(robot, wanted, v_desired, ("q_desired", "v_desired"))
    if len(v_desired) != len(v):
        raise NoiseModelError(f"v has {len(v)} samples, v_desired {len(v_desired)}")
    if robot.floating_base:
        v_desired = np.hstack((np.zeros((len(v), 6)), v_desired[:, 6:]))
    return [(q, v), (wanted, v_desired)]


def _powers(
    robot: Robot, surface: Surface, motions: Sequence[tuple[Real, Real]], kind: str, chunk: int
) -> Iterator[Array]:
    """Power of links, summed over motions, chunk by chunk: (samples, links)."""
    for start in range(0, len(motions[0][0]), chunk):
        rows = slice(start, start + chunk)
        first, *more = (
            chunk_speeds(robot, surface, q[rows], v[rows], kind) ** 2 for q, v in motions
        )
        yield sound_power(sum(more, first), surface.area[:, None]).T


# The noise of a run, link by link, in bins of time.


@dataclass(frozen=True, eq=False)
class LinkNoise:
    """Sound power of each link."""

    kind: str  # how the mean speed of a surface was taken
    links: tuple[str, ...]  # names
    movers: tuple[frozenset[str], ...]  # names of the joints that move each link
    time: Array  # centres of the bins, shape (bins,), in [s]
    power: Array  # mean in each bin, shape (bins, links), in [W]
    vibration: Array  # of the measured motion above 10 Hz alone, normal to the surface, as power
    remarks: tuple[str, ...]  # what is missing or assumed, a sentence each

    @property
    def total(self) -> Array:
        """Power of the whole robot, shape (bins,), in [W]."""
        return np.asarray(self.power.sum(axis=1))

    @property
    def loudest(self) -> list[int]:
        """Indices of the links, the one that vibrates with the largest peak first."""
        return [int(i) for i in np.argsort(-self.vibration.max(axis=0), kind="stable")]


def link_noise(run: Run, kind: str = "normal") -> LinkNoise:
    """The extended noise of a run with a robot and positions, in bins, by one of ``KINDS``."""
    robot = Robot.of(run)
    surface = Surface.of(robot, "auto")
    samples = len(run.time)
    size = max(1, min(round(BIN * run.rate), samples // 2), -(-samples // BINS))
    bins = np.append(np.arange(0, samples, size), samples)  # two or more
    middles = _middles(run, bins)
    q, wanted = robot.configuration(middles)[0], robot.desired(middles)
    motion, desired_motion = run.motion, run.velocity_desired
    fast_part = partial(_vibrating_part, motion, run.mask, run.rate)
    fast = OnDemand(motion.shape, np.float64, fast_part)

    motions, desired = [("normal", _moments(robot, run, fast, bins))], []
    if kind in QUADRATIC:
        motions.append((kind, _moments(robot, run, motion, bins)))
        if desired_motion is not None:
            desired = [(kind, _moments(robot, run, desired_motion, bins, desired=True))]
    if run.position_desired is None:  # desired velocities at measured positions: one pose for all
        motions, desired = [*motions, *desired], []
    vibration, *power = by_moments(robot, surface, q, motions)
    if desired and wanted is not None:
        power += by_moments(robot, surface, wanted[0], desired)
    if kind not in QUADRATIC:
        power = [by_samples(robot, surface, run, kind, bins)]
    movers = {0: frozenset[str]()}  # of the universe
    leaders = _leaders(robot)
    for index, joint in enumerate(robot.joints, start=1):
        movers[index] = movers[joint.parent] | {leaders[joint.first_v]}
    return LinkNoise(
        kind=kind,
        links=surface.names,
        movers=tuple(movers[joint] for joint in surface.joint.tolist()),
        time=run.time[bins[:-1]] + np.diff(bins) / 2 / run.rate,
        power=np.sum(power, axis=0),
        vibration=vibration,
        remarks=tuple(assumed(run, robot, surface)),
    )


def vibrating(velocity: Real, valid: Mask, rate: float) -> Array:
    """The fast part of a motion, shape (samples, nv): without its mean over a tenth of a second.

    It holds what vibrates at 10 Hz and above. ``valid`` is False in gaps: no mean reaches over.
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
    """The fast part of a motion, see `vibrating`, piece by piece."""
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


def _middles(run: Run, bins: Index) -> Run:
    """Take one sample of each bin: the middle one of those that are valid."""
    samples = (bins[:-1] + bins[1:]) // 2
    for index in np.flatnonzero(~run.mask[samples]):
        valid = bins[index] + np.flatnonzero(run.mask[bins[index] : bins[index + 1]])
        if len(valid):
            samples[index] = valid[len(valid) // 2]

    time = np.arange(len(samples)) * int(bins[1]) / run.rate
    return rows_of(run, samples, time=time, stages={}, effort=None)


def _moments(
    robot: Robot, run: Run, motion: Real | OnDemand, bins: Index, *, desired: bool = False
) -> Array:
    """Mean products of a run's velocities, in Pinocchio's order, shape (bins, nv, nv)."""
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
    parts = [slice(*each) for each in pairwise([*starts, len(run.time)])]
    means = [second_moments(motion[p][:, chosen], run.mask[p], size=size) for p in parts]
    products = np.concatenate(means)
    moments = np.zeros((robot.nv, robot.nv, len(bins) - 1))  # in memory as `by_moments` reads it
    moments[np.array(entries)[:, None], entries] = products.transpose(1, 2, 0)
    return moments.transpose(2, 0, 1)


def _leaders(robot: Robot) -> dict[int, str]:
    """The joint that each first entry of the velocity belongs to, and that others may follow."""
    return {each.first_v: each.name for each in robot.joints if each.name not in robot.mimics}


def assumed(run: Run, robot: Robot, surface: Surface | None = None) -> Iterator[str]:
    """What the noise of a run lacks or assumes, a sentence each."""
    leaders, known = _leaders(robot), run.joint_names
    ones = [joint for joint in robot.joints if joint.nv == 1]
    if missing := [one.name for one in ones if leaders[one.first_v] not in known]:
        yield f"Not in the log, assumed stationary: {', '.join(missing)}."
    if surface is not None and surface.without_geometry:
        yield f"Links without geometry make no noise: {', '.join(surface.without_geometry)}."
    if robot.floating_base and run.base_velocity is None:
        yield "The run has no base velocity: its base is assumed stationary."


def by_samples(robot: Robot, surface: Surface, run: Run, kind: str, bins: Index) -> Array:
    """Average the power of each link over bins, of any kind; gaps do not count."""
    size = int(bins[1])
    motions = [robot.configuration(run)]
    if (wanted := robot.desired(run)) is not None:
        motions.append(wanted)
    means, start = [], 0
    chunk = size * max(1, CHUNK // size)
    for power in _powers(robot, surface, motions, kind, chunk):
        counted = run.mask[start : start + len(power), None]
        firsts = np.arange(0, len(counted), size)
        energy = np.add.reduceat(power * counted, firsts, axis=0)
        means.append(energy / np.maximum(np.add.reduceat(counted.astype(float), firsts), 1.0))
        start += len(counted)
    return np.concatenate(means)


def by_moments(
    robot: Robot, surface: Surface, q: Array, motions: Sequence[tuple[str, Array]]
) -> list[Array]:
    """Average powers that are quadratic in velocities, from second moments instead of samples.

    Within some ten milliseconds the robot hardly moves. With a link's Jacobian J in the middle of a
    bin, < nu' M nu > = < v' J' M J v > = sum_jk (J' M J)_jk < v_j v_k >. ``q``, (bins, nq), and
    mean products, (bins, nv, nv), of each of ``QUADRATIC`` give powers, (bins, links), in [W].
    """
    jacobians = _jacobians(robot, q)
    # Bins lie next to each other in memory: all of them are worked on at once.
    products = [np.ascontiguousarray(moments.transpose(1, 2, 0)) for _, moments in motions]
    power = [np.zeros((len(q), len(surface.links))) for _ in motions]
    for place, (link, joint) in enumerate(zip(surface.links, surface.joint, strict=True)):
        if not link.area:
            continue
        entries, jacobian = jacobians(int(joint))
        forms = {"normal": link.mean_square_normal, "rms": link.mean_square}
        projected = {}  # J' M J, shape (entries, entries, bins)
        for kind in {kind for kind, _ in motions}:
            pushed = (forms[kind] @ jacobian.reshape(6, -1)).reshape(jacobian.shape)
            projected[kind] = np.einsum("ajb,akb->jkb", pushed, jacobian)
        for total, (kind, _), product in zip(power, motions, products, strict=True):
            square = np.einsum("jkb,jkb->b", projected[kind], product[entries[:, None], entries])
            # Rounding may make a square negative.
            total[:, place] = sound_power(np.maximum(square, 0.0), link.area)
    return power


def second_moments(velocity: Real, valid: Mask, *, size: int) -> Array:
    """Average the products of velocities over each bin; the last bin may be shorter."""
    if not valid.all():
        velocity = np.where(valid[:, None], velocity, 0.0)
    parts = np.lib.stride_tricks.sliding_window_view(velocity, size, axis=0)[::size]
    rest = velocity[None, len(parts) * size :].transpose(0, 2, 1)
    products = [part @ part.transpose(0, 2, 1) for part in (parts, rest) if part.size]
    counts = np.add.reduceat(valid.astype(float), np.arange(0, len(valid), size))
    return np.asarray(np.concatenate(products) / np.maximum(counts, 1.0)[:, None, None])


def _jacobians(robot: Robot, q: Array) -> Callable[[int], tuple[Index, Array]]:
    """Move the joints one after the other, those on different branches at once."""
    moves = np.zeros((len(robot.joints) + 1, robot.nv))  # the entries that move each joint
    for index, joint in enumerate(robot.joints, start=1):
        moves[index] = moves[joint.parent]
        moves[index, joint.first_v : joint.first_v + joint.nv] = 1.0
    together = moves.T @ moves > 0.0
    turn = np.zeros(robot.nv, dtype=np.intp)  # of each entry: none that move a joint share one
    for entry in range(robot.nv):
        taken = turn[:entry][together[entry, :entry]]
        turn[entry] = np.setdiff1d(np.arange(entry + 1), taken)[0]
    unit = (turn == np.arange(turn.max(initial=0) + 1)[:, None]).astype(np.float64)
    v = np.repeat(unit, len(q), axis=0)
    twists = link_twists(robot, np.tile(q, (len(unit), 1)), v)
    twists = twists.transpose(1, 2, 0).reshape(-1, 6, len(unit), len(q))

    def jacobian(joint: int) -> tuple[Index, Array]:
        entries = np.flatnonzero(moves[joint])
        return entries, twists[joint].take(turn[entries], axis=1)

    return jacobian
