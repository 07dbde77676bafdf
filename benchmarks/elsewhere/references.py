"""Joint references of the domains elsewhere: four kinds of motion, smooth to jerky."""

from dataclasses import dataclass

import numpy as np

from noisemodel.types import Array

KINDS = ("minimum jerk", "spline", "trapezoid", "sine")


@dataclass(frozen=True, eq=False)
class Reference:
    """A motion in joint space."""

    kind: str
    position: Array  # shape (samples, joints), in [rad]
    velocity: Array  # its derivative, shape (samples, joints), in [rad/s]


def draw(
    rng: np.random.Generator,
    kind: str,
    home: Array,
    *,
    reach: float,
    duration: float,
    rate: float,
    fastest: float = 1.2,
) -> Reference:
    """A motion around a posture, which starts at rest there.

    Args:
        home: The posture, shape (joints,), in [rad].
        reach: Greatest distance from it, in [rad].
        duration: Duration, in [s].
        rate: Sample rate, in [Hz].
        fastest: Highest speed from place to place, in [rad/s].
    """
    time = np.arange(round(duration * rate)) / rate
    if kind == "sine":
        size = rng.uniform(0.2, 0.6, len(home)) * reach
        frequency = rng.uniform(0.1, 0.6, len(home))
        phase = 2 * np.pi * frequency * time[:, None]
        start = np.clip(time / 1.5, 0.0, 1.0)
        ramp = (start**2 * (3 - 2 * start))[:, None]
        return _differentiated(kind, home + ramp * size * np.sin(phase), rate)
    speed, pause = rng.uniform(0.25 * fastest, fastest), rng.uniform(0.0, 0.6)
    knots, places = [0.0, 0.3], [home, home]
    while knots[-1] < duration:
        place = home + rng.uniform(-reach, reach, len(home))
        knots.append(knots[-1] + 1.9 * np.abs(place - places[-1]).max() / speed)
        places.append(place)
        if kind != "spline" and pause > 0.1:
            knots.append(knots[-1] + pause)
            places.append(place)
    if kind == "spline":
        from scipy.interpolate import CubicSpline

        spline = CubicSpline(knots, places, bc_type="clamped")
        return Reference(kind, spline(time), spline(time, 1))
    part = np.searchsorted(knots, time, side="right") - 1
    share = (time - np.take(knots, part)) / np.diff(knots)[part]
    along = share**3 * (10 - 15 * share + 6 * share**2)  # Flash and Hogan, 1985
    if kind == "trapezoid":
        ramp = rng.uniform(0.1, 0.3)  # share of the time that accelerates, and that brakes
        along = (
            np.where(share < ramp, share**2 / (2 * ramp), share - ramp / 2)
            - np.maximum(share - 1 + ramp, 0.0) ** 2 / (2 * ramp)
        ) / (1 - ramp)
    steps = np.diff(places, axis=0)
    return _differentiated(kind, np.take(places, part, axis=0) + along[:, None] * steps[part], rate)


def _differentiated(kind: str, position: Array, rate: float) -> Reference:
    return Reference(kind, position, np.gradient(position, 1 / rate, axis=0))
