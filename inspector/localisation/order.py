"""Order of a finding: the periods per turn of a joint of a vibration that goes with its speed.

Teeth, balls or poles that pass n times per turn of a joint shake it at n |w| / 2 pi: a frequency
that goes with the joint's speed w, but one line at order n in the spectrum over the joint's angle
(computed order tracking, Fyfe & Munck 1997, Mechanical Systems and Signal Processing 11(2)). A
vibration of fixed frequency is a line over time, and smears over angle.

Both are measured by the share of the energy that one line explains. The vibration e is cut into
pieces of at most `LONGEST`, and where the joint stops or turns back. In each piece, with Hann
weights h, a line at order n is a sqrt|w| cos(n theta + phi), with amplitude a and phase phi by
least squares, for each piece its own; n is common to all. A line at frequency f is the same of a
joint that turns at 1 rad/s throughout. The factor sqrt|w| lies between a ripple of constant
amplitude and one that grows with the speed, and conserves energy from time to angle: sum h e
sqrt|w| exp(-i n theta) over time is the integral of h e / sqrt|w| exp(-i n theta) over angle, thus
a Fourier transform of samples at equal steps of it.

While the speed hardly varies, the best lines at an order and at a frequency explain the same. The
limits `LEAST` and `MARGIN` were chosen on simulated findings.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from noiseclassifier import Event
from noisemodel import Block, Run
from noisemodel.noise import in_both
from noisemodel.types import Array, Real

LOWEST = 10.0  # lowest frequency, in [Hz]; what is slower is motion
HIGHEST = 0.4  # highest frequency, by the sample rate: interpolation loses 3 % of its amplitude
# Length of each of two moving means, in [s], of which the frequency response is 0 at 10 Hz.
SMOOTH = 0.1
SHORTEST, LONGEST = 0.8, 1.6  # duration of a part, in [s]: as long as the finding, between these
MOST = 16  # most parts of a finding
SLOWEST = 0.05  # a joint is at rest below this, in [rad/s]
# Steps of time and angle per sample, the latter where the joint is fastest. Where it is slower by
# more than this factor, spectra over angle would alias: there it counts as at rest.
FINER = 4
PADDED = 4  # factor by which spectra are padded, so that peaks can be interpolated
# Least number of periods of an order in a piece, else it explains nothing there, and in all of
# them, by Hann weights: 10 in a lone piece of steady motion.
FEWEST, PERIODS = 4.0, 5.0
LEAST = 0.25  # least share of the energy that an order explains
MARGIN = 0.15  # least excess of that over the share that a fixed frequency explains


@dataclass(frozen=True)
class Order:
    """An order: what goes with a joint's speed."""

    joint: str
    periods_per_turn: float  # periods of the vibration per turn of the joint

    def __str__(self) -> str:
        return f"goes with the speed of {self.joint}: {self.periods_per_turn:.0f} periods per turn"


class Piece(NamedTuple):
    """Motion of a joint in one direction, or its rest; arrays have shape (samples,)."""

    wave: Array  # vibration, in [rad/s]
    angle: Array  # since the start of the piece, increasing, in [rad]
    speed: Array  # its derivative, in [rad/s]; 0 at rest
    weight: Array  # Hann weights, of which none is 0


def order(run: Run, failure: Event | Block) -> Order | None:
    """Order of the vibration of the joint that vibrates most; None if none explains it best."""
    best, over_angle, over_time = best_lines(run, failure, least=LEAST)
    return best if over_angle >= max(LEAST, over_time + MARGIN) else None


def best_lines(
    run: Run, failure: Event | Block, *, least: float = 0.0
) -> tuple[Order | None, float, float]:
    """The best order of the joint that vibrates most, and what it and a frequency explain.

    Both are shares of the joint's vibration above 10 Hz: of the velocity, less the desired one if
    there is one. No frequency is sought if an order explains less than ``least``; without joints,
    vibration or motion there is none.
    """
    parts = _parts(run, failure)
    if not parts or not run.joint_names:
        return None, 0.0, 0.0
    half = max(1, round(SMOOTH * run.rate / 2))  # samples beside the middle of a moving mean
    waves = []
    for part in parts:
        wave = _around(run, part, 4 * half, run.velocity)
        if run.velocity_desired is not None:
            measured, desired = in_both(run)
            wave[:, measured] -= _around(run, part, 4 * half, run.velocity_desired)[:, desired]
        waves.append(_fast(wave, half))
    weight = np.hanning(len(waves[0]) + 2)[1:-1]
    joint = int(np.argmax(np.sum([weight @ np.square(wave) for wave in waves], axis=0)))
    motions = [_motion(run, part, joint, half) for part in parts]
    fastest = max(float(np.abs(speed).max()) for _, speed in motions)
    pieces = [
        piece
        for wave, motion in zip(waves, motions, strict=True)
        for piece in _pieces(wave[:, joint], *motion, max(SLOWEST, fastest / FINER))
    ]
    energy = sum(float(piece.weight @ np.square(piece.wave)) for piece in pieces)
    if fastest <= SLOWEST or not energy > 0.0:
        return None, 0.0, 0.0
    found, rest = _best_line(pieces, fastest, run.rate, fewest=FEWEST, periods=PERIODS)
    over_angle = 1.0 - rest / energy
    if over_angle < least:
        return None, over_angle, 0.0
    # Time is the angle of a joint that turns at 1 rad/s throughout. Few periods count too: a tone
    # that is called ripple is worse than the reverse.
    uniform = [
        piece._replace(angle=np.arange(len(piece.wave)) / run.rate, speed=np.ones(len(piece.wave)))
        for piece in pieces
    ]
    _, rest = _best_line(uniform, 1.0, run.rate)
    return Order(run.joint_names[joint], found), over_angle, 1.0 - rest / energy


def _parts(run: Run, failure: Event | Block) -> list[slice]:
    """Parts of a failure without gaps, half of each in the next, spread evenly over it."""
    length = min(max(failure.stop - failure.start, SHORTEST), LONGEST, run.duration)
    size = round(length * run.rate)
    first, last = np.searchsorted(run.time, (failure.start, failure.stop)).tolist()
    if last - first < size:  # the part of a shorter failure extends beyond it
        first = min(max(0, (first + last - size) // 2), len(run.time) - size)
        last = first + size
    count = min(MOST, 1 + math.ceil(2 * (last - first - size) / size))
    starts = np.round(np.linspace(first, last - size, count)).astype(int)
    parts = [slice(start, start + size) for start in starts.tolist()]
    return [part for part in parts if run.mask[part].all()]


def _around(
    run: Run, part: slice, margin: int, signal: Real, column: int | slice = slice(None)
) -> Array:
    """A signal of a part and ``margin`` samples on each side, mirrored about gaps and ends."""
    before = run.mask[max(0, part.start - margin) : part.start][::-1]
    after = run.mask[part.stop : part.stop + margin]
    sides = [int(np.append(side, False).argmin()) for side in (before, after)]
    inside = signal[part.start - sides[0] : part.stop + sides[1]][:, column].astype(np.float64)
    pad = [(margin - sides[0], margin - sides[1]), *[(0, 0)] * (inside.ndim - 1)]
    return np.pad(inside, pad, mode="reflect", reflect_type="odd")


def _fast(signal: Array, half: int) -> Array:
    """Signal above 10 Hz, shorter by ``4 half`` on each side.

    Twice, a moving mean of a moving mean is subtracted: what the first time leaves of a steady
    jerk is constant, and what is subtracted differs from slow motion in the fourth order only.
    """
    size, fast = 2 * half + 1, signal
    for _ in range(2):
        slow = fast
        for _ in range(2):
            sums = np.concatenate((np.zeros_like(slow[:1]), np.cumsum(slow, axis=0)))
            slow = (sums[size:] - sums[:-size]) / size
        fast = fast[2 * half : -2 * half] - slow
    return fast


def _motion(run: Run, part: slice, joint: int, half: int) -> tuple[Array, Array]:
    """Angle, in [rad], and speed, in [rad/s], of a joint without its vibration."""
    signal = run.velocity if run.position is None else run.position
    whole = _around(run, part, 4 * half, signal, joint)
    whole = whole if run.position is None else np.unwrap(whole)
    slow = whole[4 * half : -4 * half] - _fast(whole, half)
    if run.position is not None:
        return slow, np.gradient(slow) * run.rate
    steps = (slow[1:] + slow[:-1]) / 2.0 / run.rate
    return np.concatenate(([0.0], np.cumsum(steps))), slow


def _pieces(wave: Array, angle: Array, speed: Array, slowest: float) -> Iterator[Piece]:
    """Cut a part where the joint stops, starts or turns back; pieces of 4 samples or more."""
    direction = np.where(np.abs(speed) > slowest, np.sign(speed), 0.0)
    edges = [0, *(np.flatnonzero(np.diff(direction)) + 1).tolist(), len(speed)]
    for first, last in pairwise(edges):
        if last - first >= 4:
            sign = direction[first]
            turned = sign * (angle[first:last] - angle[first])
            weight = np.hanning(last - first + 2)[1:-1]
            yield Piece(wave[first:last], turned, sign * speed[first:last], weight)


def _best_line(
    pieces: list[Piece], fastest: float, rate: float, *, fewest: float = 0.0, periods: float = 0.0
) -> tuple[float, float]:
    """The order that explains most, in periods per turn, and the energy that it leaves.

    The order is 0 without periods enough.
    """
    step = fastest / rate / FINER
    longest = max(piece.angle[-1] for piece in pieces)
    size = 1 << math.ceil(math.log2(PADDED * longest / step + 1.0))
    orders = 2.0 * np.pi / (size * step) * np.arange(size // 2 + 1)
    energy, counted = np.zeros(len(orders)), np.zeros(len(orders))
    for wave, angle, speed, weight in pieces:
        if not speed.any():
            continue
        sample = np.arange(len(wave))
        at = np.interp(np.arange(0.0, angle[-1], step), angle, sample)
        # Values between samples: the weighted wave begins and ends near 0, as if it were periodic.
        many = FINER * len(wave)
        finer = FINER * np.fft.irfft(np.fft.rfft(weight * wave), many)
        line = np.interp(FINER * at, np.arange(many), finer)
        line /= np.sqrt(np.interp(at, sample, speed))
        enough = orders * angle[-1] >= 2.0 * np.pi * fewest
        energy += enough * np.square(np.abs(np.fft.rfft(line, size))) / (weight @ speed)
        counted += enough * orders * (weight @ speed) / (2.0 * np.pi * rate)
    frequency = orders * fastest / (2.0 * np.pi)
    known = (frequency >= LOWEST) & (frequency <= HIGHEST * rate) & (counted >= periods)
    lines = energy * known
    top = int(np.argmax(lines))
    best = float(orders[top])
    if 0 < top < len(lines) - 1:  # the top of the parabola through it and its neighbours
        before, highest, after = lines[top - 1 : top + 2].tolist()
        offset = (before - after) / (before - 2.0 * highest + after) / 2.0
        best = float(best + offset * (orders[1] - orders[0]))
    rest = 0.0  # energy less the least-squares fit, where it has periods enough
    for wave, angle, speed, weight in pieces:
        left = wave
        if speed.any() and best * angle[-1] >= 2.0 * np.pi * fewest:
            line = np.sqrt(speed) * np.exp(1j * best * angle)
            size = 2.0 * (weight * wave) @ line.conj() / (weight @ speed)
            left = wave - (size * line).real
        rest += float(weight @ np.square(left))
    return best, rest
