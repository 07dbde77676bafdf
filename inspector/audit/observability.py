"""Observability of the failure classes in a log, and the sample rate that each requires.

The limits:

- *The bands of a class.* The paper puts oscillations at 20 to 1000 Hz (its table of scenarios:
  multi-sines of 20-30 up to 900-1000 Hz). It gives no band for impacts and high accelerations,
  which are short and broad: theirs is that of the model, from its first band to its last.
- *The model.* A run is labelled by the general model at the rate of its values, or by the model of
  the nearest rate at or below. Outside of its bands nothing is observable; below all models the
  status is *cannot tell*.
- *The log.* Its bandwidth: the Nyquist frequency, or less with a zero-order hold, differentiation
  or a filter.
- *Two bands.* Fewer than two of the model's bands are no spectrum; `LogBands` has the same limit.
- *The frame.* A model labels frames (the paper's 0.4 s) that touch no gap; there has to be one.

A class is observable if all of its band is, partly if two bands of the model or more are, or if
some are at the quantisation floor: then a failure must exceed that.
"""

from collections.abc import Collection
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

import noiseclassifier as nc
from inspector.audit.bandwidth import Bandwidth
from inspector.library import Library, nearest
from inspector.text import plain
from noiseclassifier import Profile
from noiseclassifier.logbands import FEWEST, HIGHEST, LOWEST
from noisemodel.types import Array, Mask

OSCILLATIONS = (20.0, 1000.0)
"""The paper's band of oscillations (table of scenarios, 11 to 19), in [Hz]."""

MASKED = "quantisation masks amplitudes"
"""What the reason begins with where a class is observable in all of its band, if it is loud."""


class Observability(StrEnum):
    """Degrees to which a class is observable."""

    OBSERVABLE = "observable"
    PARTLY = "partly"
    CANNOT_TELL = "cannot tell"


@dataclass(frozen=True)
class ClassObservability:
    """Observability of one failure class.

    Attributes:
        label: The class.
        observability: The degree.
        low: Lowest frequency at which it is observable, in [Hz]; 0 if there is none.
        high: Highest frequency at which it is observable, in [Hz]; 0 if there is none.
        needed: Sample rate that makes all of it observable, or any of it, in [Hz]; None where a
            higher one would not help.
        reason: Cause of the limit, a clause; empty for what is observable.
    """

    label: str
    observability: Observability
    low: float = 0.0
    high: float = 0.0
    needed: float | None = None
    reason: str = ""

    def __str__(self) -> str:
        """Format as a line."""
        band = f", {plain(self.low)} to {plain(self.high, 4)} Hz" if self.high else ""
        reason = f": {self.reason}" if self.reason else ""
        needed = f"; needs {self.needed:g} Hz" if self.needed else ""
        return f"{self.label}: {self.observability}{band}{reason}{needed}"


def observable_classes(
    bandwidth: Bandwidth,
    valid: Mask,
    library: Library,
    signals: Collection[str],
    *,
    rate: float,
) -> tuple[ClassObservability, ...]:
    """Determine the observability of each failure class.

    Args:
        bandwidth: Of the log.
        valid: False in gaps, shape (samples,).
        library: Models to choose from.
        signals: Names of the signals that the run has.
        rate: Rate of its values, in [Hz]: lower than that of the log where they are held.

    Returns:
        One for each class of the model that would label the run, without `ok`.
    """
    logged = 2 * bandwidth.nyquist
    try:
        name, chosen = nearest(library, rate, signals, logged=logged)
    except nc.ModelsError as error:
        classes = dict.fromkeys(name for model in library.values() for name in _failures(model))
        if isinstance(error, nc.MissingSignalError):
            return tuple(
                ClassObservability(label, Observability.CANNOT_TELL, reason=str(error))
                for label in classes
            )
        slowest = min(map(_lowest, library.values()), default=None)
        reason = f"{rate:g} Hz is below the rate of every model"
        return tuple(
            ClassObservability(label, Observability.CANNOT_TELL, needed=slowest, reason=reason)
            for label in classes
        )
    profile = chosen.profile
    labels = [label for label in chosen.classes if label != "ok"]
    if not has_frame(valid, profile.duration * logged):
        reason = f"no stretch of {profile.duration:g} s without a gap"
        return tuple(
            ClassObservability(label, Observability.CANNOT_TELL, reason=reason) for label in labels
        )
    general = isinstance(library[name], nc.General)
    return tuple(
        _observability(label, bandwidth, profile, library, general=general) for label in labels
    )


def has_frame(valid: Mask, length: float) -> bool:
    """Whether a stretch without a gap is as long as a frame.

    Args:
        valid: False in gaps, shape (samples,).
        length: Of a frame, in samples.
    """
    gaps = np.flatnonzero(np.concatenate(([True], ~valid, [True])))
    return bool((np.diff(gaps) - 1).max() >= length * (1 - 1e-3))


def _observability(
    label: str,
    bandwidth: Bandwidth,
    profile: Profile,
    library: Library,
    *,
    general: bool,
) -> ClassObservability:
    edges = band_edges(profile)
    wanted = OSCILLATIONS if label == "oscillations" else (edges[0], edges[-1])
    low, high = max(wanted[0], edges[0]), min(wanted[1], edges[-1], bandwidth.usable)
    if np.sum((edges[:-1] < high) & (edges[1:] <= high) & (edges[1:] > low)) < FEWEST:
        needed = _rate_for(low, library) if bandwidth.usable >= bandwidth.nyquist else None
        return ClassObservability(
            label, Observability.CANNOT_TELL, needed=needed, reason=bandwidth.limit
        )
    if high < wanted[1]:
        # A general model has the bands that the log has.
        by_model = edges[-1] <= bandwidth.usable and not general
        reason = f"the model of {profile.rate:g} Hz ends there" if by_model else bandwidth.limit
        needed = _rate_for(wanted[1], library)
        helps = bandwidth.usable >= bandwidth.nyquist and needed > 2 * bandwidth.nyquist
        return ClassObservability(
            label, Observability.PARTLY, low, high, needed if helps else None, reason
        )
    if bandwidth.floor_from is not None and bandwidth.floor_from < high:
        reason = (
            f"{MASKED} below {bandwidth.floor_amplitude:.2g} rad/s"
            f" above {plain(bandwidth.floor_from)} Hz"
        )
        return ClassObservability(label, Observability.PARTLY, low, high, reason=reason)
    return ClassObservability(label, Observability.OBSERVABLE, low, high)


def band_edges(profile: Profile) -> Array:
    """Edges of the frequency bands of a profile, shape (edges,), in [Hz]."""
    if profile.bands == "log":
        return np.array(profile.edges)
    # Bin 0 is the mean; the first after it is the paper's f_min (Sec. III-A).
    bin_width = profile.rate / profile.window
    return np.arange(1.0, profile.bins, 3.0) * bin_width


def _failures(model: nc.Model) -> tuple[str, ...]:
    """All classes of a model but the first, which is `ok`."""
    known = model.recipe if isinstance(model, nc.General) else model.profile
    return known.classes[1:]


def _lowest(model: nc.Model) -> float:
    """Lowest rate that a model takes, in [Hz]."""
    return LOWEST if isinstance(model, nc.General) else model.rate


def _rate_for(frequency: float, library: Library) -> float:
    """Lowest rate at which a model has a band up to a frequency; without one, twice the latter."""
    reaching = []
    for model in library.values():
        if isinstance(model, nc.General):
            edges = band_edges(model.recipe.bound(HIGHEST))
            # A band is there from twice its upper edge on.
            above = edges[edges >= frequency]
            reaching += [max(LOWEST, float(np.ceil(2 * each))) for each in above[:1]]
        elif band_edges(model.profile)[-1] >= frequency:
            reaching.append(model.rate)
    return min(reaching, default=2 * frequency)
