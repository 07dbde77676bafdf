"""Mean sound power of links in bins of time."""

from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from noisemodel.extended import extended_chunks
from noisemodel.kinematics import CHUNK, link_twists
from noisemodel.noise import sound_power
from noisemodel.robot import Robot
from noisemodel.run import Run
from noisemodel.surface import Surface
from noisemodel.types import Array, Mask, Real

Index: TypeAlias = NDArray[np.intp]

QUADRATIC = ("rms", "normal")
"""The kinds whose square is a quadratic form of a link's twist."""


def by_samples(robot: Robot, surface: Surface, run: Run, kind: str, bins: Index) -> Array:
    """Average the power of each link over bins, of any kind; gaps do not count.

    Args:
        robot: The robot.
        surface: Its surface.
        run: Its motion; the desired one is added.
        kind: One of the kinds of ``noisemodel.extended``.
        bins: First sample of each bin, and the end; all but the last are of one size.

    Returns:
        Shape (bins, links), in [W]; 0 for a bin without a sample.
    """
    size = int(bins[1])
    q_desired, v_desired = robot.desired(run) or (None, None)
    chunks = extended_chunks(
        robot,
        surface,
        *robot.configuration(run),
        kind,
        q_desired=q_desired,
        v_desired=v_desired,
        chunk=size * max(1, CHUNK // size),
    )
    means, start = [], 0
    for chunk in chunks:
        counted = run.mask[start : start + len(chunk.power), None]
        firsts = np.arange(0, len(counted), size)
        energy = np.add.reduceat(chunk.power * counted, firsts, axis=0)
        means.append(energy / np.maximum(np.add.reduceat(counted.astype(float), firsts), 1.0))
        start += len(counted)
    return np.concatenate(means)


def by_moments(
    robot: Robot, surface: Surface, q: Array, motions: Sequence[tuple[str, Array]]
) -> list[Array]:
    """Average powers that are quadratic in velocities, from second moments instead of samples.

    Within a bin of some ten milliseconds the robot hardly moves. With a link's Jacobian J as it
    is in the middle of the bin, < nu' M nu > = < v' J' M J v > = sum_jk (J' M J)_jk < v_j v_k >.

    Args:
        robot: The robot.
        surface: Its surface.
        q: Configuration in the middle of each bin, shape (bins, nq).
        motions: The motions that take place there: one of ``QUADRATIC``, and mean products of
            velocities over each bin, shape (bins, nv, nv).

    Returns:
        For each motion, shape (bins, links), in [W].
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
        projected = {
            kind: _projected(forms[kind], jacobian) for kind in {kind for kind, _ in motions}
        }
        for total, (kind, _), product in zip(power, motions, products, strict=True):
            square = np.einsum("jkb,jkb->b", projected[kind], product[entries[:, None], entries])
            # Rounding may make a square negative.
            total[:, place] = sound_power(np.maximum(square, 0.0), link.area)
    return power


def _projected(form: Array, jacobian: Array) -> Array:
    """J' M J, shape (entries, entries, bins)."""
    pushed = (form @ jacobian.reshape(6, -1)).reshape(jacobian.shape)
    return np.asarray(np.einsum("ajb,akb->jkb", pushed, jacobian))


def second_moments(velocity: Real, valid: Mask, *, size: int) -> Array:
    """Average the products of velocities over each bin; the last bin may be shorter.

    Args:
        velocity: Shape (samples, nv).
        valid: False in gaps, which do not count, shape (samples,).
        size: Samples in a bin.

    Returns:
        Shape (bins, nv, nv); 0 for a bin without a sample.
    """
    if not valid.all():
        velocity = np.where(valid[:, None], velocity, 0.0)
    parts = np.lib.stride_tricks.sliding_window_view(velocity, size, axis=0)[::size]
    rest = velocity[None, len(parts) * size :].transpose(0, 2, 1)
    products = [part @ part.transpose(0, 2, 1) for part in (parts, rest) if part.size]
    counts = np.add.reduceat(valid.astype(float), np.arange(0, len(valid), size))
    return np.asarray(np.concatenate(products) / np.maximum(counts, 1.0)[:, None, None])


def _jacobians(robot: Robot, q: Array) -> Callable[[int], tuple[Index, Array]]:
    """Move the joints one after the other, those on different branches at once.

    Args:
        robot: The robot.
        q: Configurations, shape (bins, nq).

    Returns:
        What gives, for the index of a joint, the entries of v that move its link, and the twists
        that they cause at unit velocity, shape (6, entries, bins).
    """
    chains: dict[int, list[int]] = {0: []}
    for index, joint in enumerate(robot.joints, start=1):
        chains[index] = [*chains[joint.parent], *range(joint.first_v, joint.first_v + joint.nv)]
    # Each entry's turn is its place in the chain from the root: none in a chain share one.
    turn = np.zeros(robot.nv, dtype=np.intp)
    for chain in chains.values():
        turn[chain] = np.arange(len(chain))
    unit = (turn == np.arange(turn.max(initial=0) + 1)[:, None]).astype(np.float64)
    v = np.repeat(unit, len(q), axis=0)
    twists = link_twists(robot, np.tile(q, (len(unit), 1)), v)
    twists = twists.transpose(1, 2, 0).reshape(-1, 6, len(unit), len(q))

    def jacobian(joint: int) -> tuple[Index, Array]:
        entries = np.array(chains[joint], dtype=np.intp)
        return entries, twists[joint].take(turn[entries], axis=1)

    return jacobian
