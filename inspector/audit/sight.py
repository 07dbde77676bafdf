"""Which failure classes can be seen in a log, and what it takes to see them.

Where the limits come from:

- *The bands of a class.* The paper puts oscillations at 20 to 1000 Hz (its table of scenarios:
  multi-sines of 20-30 up to 900-1000 Hz). It gives no band for impacts and high accelerations,
  which are short and broad: they ask for what the model looks at, from its first band to its last.
- *The model.* A run is labelled by the model of the nearest rate at or below its own. What that
  one does not look at, nobody sees; below all models the answer is *cannot tell*.
- *The log.* Its bandwidth: half its rate, or less where values are held, differentiated, filtered.
- *Three bands.* Fewer than three of the model's bands are no spectrum: `models.LogBands` draws the
  line there too.
- *The frame.* A model labels frames (the paper's 0.4 s) that touch no gap; without one nothing is.

A class is observable if all of its band can be seen, partly if three bands of the model or more
can, and if rounding is all there is in some of them: then a failure must be louder than that.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

import models
from inspector.audit.bandwidth import Bandwidth
from models import Profile
from noisemodel.types import Array, Mask

OSCILLATIONS = (20.0, 1000.0)
"""The paper's band of oscillations (table of scenarios, 11 to 19), in [Hz]."""

FEWEST = 3
"""Bands of a model that make a spectrum."""


class Sight(StrEnum):
    """How well a class can be seen."""

    OBSERVABLE = "observable"
    PARTLY = "partly"
    CANNOT_TELL = "cannot tell"


@dataclass(frozen=True)
class ClassSight:
    """How well one failure class can be seen.

    Attributes:
        label: The class.
        sight: How well.
        low: Where what can be seen of it begins, in [Hz]; 0 if nothing can.
        high: Where that ends, in [Hz]; 0 if nothing can.
        needed: The sample rate that would show all of it, or show it at all, in [Hz]; None where
            a higher one would not help.
        reason: What stands in the way, a clause; empty for what is observable.
    """

    label: str
    sight: Sight
    low: float = 0.0
    high: float = 0.0
    needed: float | None = None
    reason: str = ""

    def __str__(self) -> str:
        """Say it in a line."""
        seen = f", {self.low:.3g} to {self.high:.4g} Hz" if self.high else ""
        reason = f": {self.reason}" if self.reason else ""
        needed = f"; needs {self.needed:g} Hz" if self.needed else ""
        return f"{self.label}: {self.sight}{seen}{reason}{needed}"


def sights(
    bandwidth: Bandwidth,
    valid: Mask,
    library: Mapping[str, models.Classifier],
    signals: Collection[str],
) -> tuple[ClassSight, ...]:
    """Tell how well each failure class can be seen.

    Args:
        bandwidth: How far up the log reaches.
        valid: False in gaps, shape (samples,).
        library: Models to choose from.
        signals: Names of the signals that a model can listen to.

    Returns:
        One for each class of the model that would look, `ok` left out.
    """
    rate = 2 * bandwidth.nyquist
    profiles = [model.profile for model in library.values()]
    try:
        chosen = models.nearest(tuple(library.values()), rate, signals)
    except models.ModelsError as error:
        classes = dict.fromkeys(name for profile in profiles for name in profile.classes[1:])
        if isinstance(error, models.MissingSignalError):
            return tuple(
                ClassSight(label, Sight.CANNOT_TELL, reason=str(error)) for label in classes
            )
        slowest = min((profile.rate for profile in profiles), default=None)
        reason = f"{rate:g} Hz is slower than every model"
        return tuple(
            ClassSight(label, Sight.CANNOT_TELL, needed=slowest, reason=reason) for label in classes
        )
    profile = chosen.profile
    labels = [label for label in chosen.classes if label != "ok"]
    if not has_frame(valid, profile.duration * rate):
        reason = f"no stretch of {profile.duration:g} s without a gap"
        return tuple(ClassSight(label, Sight.CANNOT_TELL, reason=reason) for label in labels)
    return tuple(_sight(label, bandwidth, profile, profiles) for label in labels)


def has_frame(valid: Mask, length: float) -> bool:
    """Whether some stretch without a gap is as long as a frame.

    Args:
        valid: False in gaps, shape (samples,).
        length: Of a frame, in samples.
    """
    gaps = np.flatnonzero(np.concatenate(([True], ~valid, [True])))
    return bool((np.diff(gaps) - 1).max() >= length * (1 - 1e-3))


def _sight(
    label: str, bandwidth: Bandwidth, profile: Profile, profiles: list[Profile]
) -> ClassSight:
    edges = band_edges(profile)
    wanted = OSCILLATIONS if label == "oscillations" else (edges[0], edges[-1])
    low, high = max(wanted[0], edges[0]), min(wanted[1], edges[-1], bandwidth.usable)
    if np.sum((edges[:-1] < high) & (edges[1:] <= high) & (edges[1:] > low)) < FEWEST:
        needed = _rate_for(low, profiles) if bandwidth.usable >= bandwidth.nyquist else None
        return ClassSight(label, Sight.CANNOT_TELL, needed=needed, reason=bandwidth.limit)
    if high < wanted[1]:
        by_model = edges[-1] <= bandwidth.usable
        reason = f"the model of {profile.rate:g} Hz ends there" if by_model else bandwidth.limit
        needed = _rate_for(wanted[1], profiles)
        helps = bandwidth.usable >= bandwidth.nyquist and needed > 2 * bandwidth.nyquist
        return ClassSight(label, Sight.PARTLY, low, high, needed if helps else None, reason)
    if bandwidth.drowned is not None and bandwidth.drowned < high:
        reason = (
            f"rounding hides what is quieter than {bandwidth.hidden:.2g} rad/s"
            f" above {bandwidth.drowned:.3g} Hz"
        )
        return ClassSight(label, Sight.PARTLY, low, high, reason=reason)
    return ClassSight(label, Sight.OBSERVABLE, low, high)


def band_edges(profile: Profile) -> Array:
    """List the edges of the frequency bands that a profile looks at, shape (edges,), in [Hz]."""
    if profile.bands == "log":
        return np.array(profile.edges)
    # Bin 0 is the mean; the first that can tell anything is the paper's f_min (Sec. III-A).
    bin_width = profile.rate / profile.window
    return np.arange(1.0, profile.bins, 3.0) * bin_width


def _rate_for(frequency: float, profiles: list[Profile]) -> float:
    """Find the lowest rate of a model that reaches a frequency; failing that, twice the latter."""
    reaching = [each.rate for each in profiles if band_edges(each)[-1] >= frequency]
    return min(reaching, default=2 * frequency)
