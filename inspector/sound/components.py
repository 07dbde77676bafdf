"""The signed signals of a run whose squares add up to its noise.

The estimate itself cannot be played. It is a norm, p_hat = sqrt(sum of v²), and always positive: a
joint that oscillates about zero at 100 Hz would sound at 200 Hz, and one that oscillates about a
steady motion at 100 Hz. The signals under the root are played instead, with their signs:

- *simplified*: the velocities of the joints, measured and desired, and of a floating base;
- *rms*, *normal*: a link's power is a quadratic form of its twist, P = rho c S nu' M nu. With
  M = W' W the six signals sqrt(rho c S) W nu have squares that add up to it.

The other kinds of the extended noise are sums of norms and have no such signals.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

import noisemodel as nm
from inspector.analysis.analyse import robot_known
from inspector.errors import InspectorError, OptionError
from noisemodel.noise import DENSITY, SOUND_SPEED
from noisemodel.types import Array

PLAYABLE = ("simplified", "normal", "rms")
CHUNK = 65_536
"""Number of samples whose twists are computed at once."""
LINKS_AT_ONCE = 4
"""Number of links whose signals are in memory at once: all of 60 links would not fit."""


@dataclass(frozen=True, eq=False)
class Components:
    """Signals whose squares add up to a noise.

    Attributes:
        what: Short description.
        unit: Unit of each signal.
        signals: Each of shape (samples,), computed one by one.
    """

    what: str
    unit: str
    signals: Iterator[Array]


def components(
    run: nm.Run, *, kind: str = "simplified", joint: str = "", link: str = ""
) -> Components:
    """Signed signals under the root of a noise.

    Args:
        run: The run.
        kind: "simplified", "normal" or "rms".
        joint: One joint, of the simplified noise; all and the base if empty.
        link: One link, of the extended noise; all if empty.

    Returns:
        The signals.

    Raises:
        OptionError: If the kind cannot be played, or not of a joint, or not of a link.
        InspectorError: If the run has no such joint or link.
        RobotError: If the kind needs a robot and the run has no known one.
    """
    if kind not in PLAYABLE:
        raise OptionError(
            f"kind {kind!r} has no signed signals to play; there are {', '.join(PLAYABLE)}"
        )
    if link and (joint or kind == "simplified"):
        raise OptionError(f"link {link!r} is of the kinds normal and rms; name no joint with it")
    if joint and kind != "simplified":
        raise OptionError(f"kind {kind!r} is of links, not of joints; name a link")
    if kind == "simplified":
        what = f"simplified noise of {joint}" if joint else "simplified noise"
        return Components(what, "rad/s", _velocities(run, joint))
    return _of_links(run, kind, link)


def _velocities(run: nm.Run, joint: str) -> Iterator[Array]:
    named = [
        (name, signal[:, column])
        for names, signal in (
            (run.joint_names, run.velocity),
            (run.desired_joint_names, run.velocity_desired),
        )
        if signal is not None
        for column, name in enumerate(names)
    ]
    known = [name for name, _ in named]
    if joint and joint not in known:
        raise InspectorError(
            f"no joint {joint!r} in the run; it has {', '.join(dict.fromkeys(known))}"
        )
    base = () if joint or run.base_velocity is None else run.base_velocity.T
    chosen = [signal for name, signal in named if joint in ("", name)]
    return (np.asarray(signal, dtype=np.float64) for signal in (*chosen, *base))


def _of_links(run: nm.Run, kind: str, link: str) -> Components:
    if run.robot is None or not robot_known(run):
        raise nm.RobotError(f"kind {kind!r} needs a robot, the run names {run.robot!r}")
    robot = nm.Robot.load(run.robot, floating_base=True if run.base_pose is not None else None)
    surface = nm.Surface.of(robot, "auto")
    noisy = [name for name in surface.names if name not in surface.without_geometry]
    if link and link not in noisy:
        raise InspectorError(f"no link {link!r} that makes noise; there are {', '.join(noisy)}")
    chosen = [surface.names.index(name) for name in ([link] if link else noisy)]
    motions = [robot.configuration(run)]
    if (desired := robot.desired(run)) is not None:
        motions.append(desired)
    what = f"{kind} noise of {link}" if link else f"{kind} noise of all links"
    return Components(what, "√W", _weighted_twists(robot, surface, kind, chosen, motions))


def _weighted_twists(
    robot: nm.Robot,
    surface: nm.Surface,
    kind: str,
    links: Sequence[int],
    motions: Sequence[tuple[Array, Array]],
) -> Iterator[Array]:
    """Twists of links, weighted so that their squares are powers."""
    forms = surface.mean_square if kind == "rms" else surface.mean_square_normal
    for first in range(0, len(links), LINKS_AT_ONCE):
        group = links[first : first + LINKS_AT_ONCE]
        joints = surface.joint[group]
        for q, v in motions:
            twists = np.concatenate(
                [
                    nm.link_twists(robot, q[start : start + CHUNK], v[start : start + CHUNK])[
                        :, joints
                    ]
                    for start in range(0, len(q), CHUNK)
                ]
            )
            for place, link in enumerate(group):
                weights = _root(forms[link]) * np.sqrt(DENSITY * SOUND_SPEED * surface.area[link])
                yield from weights @ twists[:, place].T


def _root(form: Array) -> Array:
    """Matrix W with W' W = M for a form M that may be singular, shape (6, 6)."""
    values, vectors = np.linalg.eigh(form)
    root: Array = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    return root
