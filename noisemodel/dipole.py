"""Radiation of small bodies that oscillate: the lower the frequency, the less they radiate.

A sphere of radius a that oscillates at the frequency f radiates with the efficiency
x^4 / (4 + x^4), x = 2 pi f a / c. That is the squared magnitude of a Butterworth high-pass of
order 2 with its corner at f_c = sqrt(2) c / (2 pi a), so it acts on motions in time. A link counts
as the sphere of its area, a = sqrt(S / 4 pi); its frame hardly turns during 1 / f_c.
"""

import numpy as np

from noisemodel.errors import CornerError
from noisemodel.surface import Surface
from noisemodel.types import Array


def corner_frequencies(surface: Surface, *, sound_speed: float) -> Array:
    """Find the frequency above which each link radiates fully.

    Args:
        surface: The surface of a robot.
        sound_speed: In [m/s].

    Returns:
        Shape (links,), in [Hz]; inf for links without geometry.
    """
    radius = np.sqrt(surface.area / (4.0 * np.pi))
    with np.errstate(divide="ignore"):
        corners: Array = np.sqrt(2.0) * sound_speed / (2.0 * np.pi * radius)
    return corners


class Dipole:
    """The high-pass filter of every link, with its state from one chunk to the next.

    Before its first sample the robot counts as having moved as it does then.

    Args:
        surface: The surface of a robot.
        rate: Sample rate, in [Hz].
        sound_speed: In [m/s].

    Raises:
        CornerError: If the corner of a link is not below half the rate.
    """

    def __init__(self, surface: Surface, *, rate: float, sound_speed: float) -> None:
        from scipy.signal import butter

        corners = corner_frequencies(surface, sound_speed=sound_speed)
        sources = np.flatnonzero(surface.area)
        small = [link for link in sources if corners[link] >= 0.5 * rate]
        if small:
            raise CornerError([surface.names[i] for i in small], corners[small].tolist(), rate)
        self._filters = {
            int(link): butter(2, corners[link], "highpass", fs=rate, output="sos")
            for link in sources
        }
        self._states: dict[int, Array] = {}

    def __call__(self, link: int, motion: Array) -> Array:
        """Filter the next chunk of a link's motion.

        Args:
            link: Index of the link.
            motion: Signals that are linear in velocities, shape (signals, samples).

        Returns:
            The part of them that radiates, shape (signals, samples).
        """
        from scipy.signal import sosfilt, sosfilt_zi

        sections = self._filters[link]
        if link not in self._states:
            self._states[link] = sosfilt_zi(sections)[:, None, :] * motion[:, :1]
        radiating, self._states[link] = sosfilt(sections, motion, zi=self._states[link])
        return radiating
