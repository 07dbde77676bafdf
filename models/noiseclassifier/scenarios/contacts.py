"""Planned and unplanned contacts."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from noiseclassifier.scenarios.clock import STEP
from noiseclassifier.scenarios.events import Event
from noisemodel.types import Array

APART = 0.05
"""Contacts with a shorter pause are merged, in [s]."""
IMPACT = 0.02
"""Time over which the impulse of a contact is integrated, in [s]."""


@dataclass(frozen=True)
class Contact:
    """A planned contact.

    Attributes:
        start: When the effector may first touch, in [s].
        lift: When it is to lift off, in [s].
        stop: When it must have lifted off, in [s].
        place: x, y, z of the surface there, in [m].
        yaw: Direction of the effector there, in [rad].
        approach: When it starts to descend to the place, in [s]; 0 for the first contact.
    """

    start: float
    lift: float
    stop: float
    place: tuple[float, float, float]
    effector: int = 0
    yaw: float = 0.0
    approach: float = 0.0

    def later(self, delay: float) -> "Contact":
        """The contact with all times later by a delay, in [s]."""
        return Contact(
            self.start + delay,
            self.lift + delay,
            self.stop + delay,
            self.place,
            self.effector,
            self.yaw,
            self.approach + delay,
        )


def unplanned(force: Array, planned: Sequence[Contact]) -> tuple[Event, ...]:
    """Unplanned contacts, as events.

    Args:
        force: Contact force of each effector, shape (samples, effectors), in [N].

    Returns:
        One event per contact that begins outside of the planned ones of its effector, with its
        impulse in [N s] and its largest force in [N].
    """
    events = []
    for effector, measured in enumerate(force.T):
        own = [contact for contact in planned if contact.effector == effector]
        for first, last in _contacts(measured):
            onset = first * STEP
            if any(contact.start <= onset < contact.stop for contact in own):
                continue
            onset_force = measured[first : first + round(IMPACT / STEP)]
            facts = {
                "effector": effector,
                "impulse": float(onset_force.sum() * STEP),
                "force": float(onset_force.max()),
            }
            # The impact is the cause; leaning on the obstacle afterwards is not.
            stop = min(last * STEP, onset + IMPACT)
            events.append(
                Event("impact", "unplanned contact", onset, max(stop, onset + STEP), facts)
            )
    return tuple(events)


def _contacts(force: Array) -> list[tuple[int, int]]:
    """First and last sample of each contact."""
    touching = np.flatnonzero(force > 0)
    if not touching.size:
        return []
    pauses = np.flatnonzero(np.diff(touching) > APART / STEP)
    firsts = touching[np.concatenate(([0], pauses + 1))]
    lasts = touching[np.concatenate((pauses, [-1]))]
    return list(zip(firsts.tolist(), lasts.tolist(), strict=True))
