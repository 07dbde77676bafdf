"""Labels of motion while it comes in, by the model that fits its rate."""

import numpy as np

import models
from inspector.library import Library
from inspector.live.decimator import Slower
from inspector.live.norms import Norms
from models.profile import TOLERANCE
from noisemodel.decimation import EDGE
from noisemodel.types import Array, Mask


class Ear:
    """Hears what a classifier hears, and says so when it hears nothing.

    Args:
        library: Models to choose from.
        rate: Samples per second, in [Hz].
        norms: What makes which noise signal.

    Attributes:
        model: Name of the model that hears; empty without one.
        remark: Why nothing is heard, or at which other rate; empty if there is nothing to say.
    """

    def __init__(self, library: Library, rate: float, norms: Norms) -> None:
        self.rate, self.remark, self.model = rate, "", ""
        self._stream: models.Stream | None = None
        self._slower: Slower | None = None
        self._norms, self._names = norms, tuple[str, ...]()
        self._ratio, self._heard = 1, 0
        try:
            chosen = models.nearest(tuple(library.values()), rate, norms.names)
        except models.ModelsError as error:
            self.remark = f"No labels: {error}."
            return
        ratio = round(rate / chosen.rate)
        if abs(rate / ratio / chosen.rate - 1.0) > TOLERANCE:
            self.remark = (
                f"No labels: {rate:g} Hz is no multiple of the {chosen.rate:g} Hz of the nearest"
                " model, as is needed while samples come in."
            )
            return
        self.model = next(name for name, model in library.items() if model is chosen)
        self._ratio, self._names = ratio, chosen.profile.signals
        self._stream = models.Stream(chosen, rate=rate / ratio, joints=norms.joints)
        if ratio > 1:
            self._slower = Slower(ratio, norms.columns)
            self.remark = f"Labelled at {rate / ratio:g} Hz, the rate of model {self.model}."

    @property
    def length(self) -> float:
        """Duration of a frame, in [s]."""
        return 0.0 if self._stream is None else self._stream.classifier.profile.duration

    @property
    def hop(self) -> float:
        """Time from one frame to the next, in [s]."""
        return (
            0.0
            if self._stream is None
            else self._stream.classifier.profile.hop / self.rate * self._ratio
        )

    @property
    def classes(self) -> tuple[str, ...]:
        """What can be heard; nothing without a model."""
        return () if self._stream is None else self._stream.classifier.classes

    @property
    def elapsed(self) -> float:
        """Time since the first sample, lost ones counted, in [s]: the clock of the labels."""
        return self._heard / self.rate

    def hear(self, motion: Array, valid: Mask) -> models.Labels | None:
        """Take samples.

        Args:
            motion: All velocities that the noise is made of, shape (samples, columns).
            valid: False where there is none, shape (samples,).

        Returns:
            Labels that are complete now, on the clock that starts with the first sample; None
            without a model.
        """
        self._heard += len(motion)
        if self._stream is None:
            return None
        if self._slower is not None:
            motion, valid = self._slower.push(motion, valid)
        return self._stream.push(self._norms.of(motion, self._names), valid)

    def skip(self, samples: int) -> None:
        """Pass over samples that were lost."""
        self._heard += samples
        if self._stream is None:
            return
        if self._slower is None:
            self._stream.skip(samples)
            return
        # Samples in a gap are all alike: enough of them to fill the filter are looked at.
        whole = max(samples - 4 * self._ratio * EDGE, 0) // self._ratio
        self._stream.skip(whole)
        rest = samples - whole * self._ratio
        lower, valid = self._slower.push(
            np.zeros((rest, self._slower.columns)), np.zeros(rest, dtype=bool)
        )
        self._stream.push(self._norms.of(lower, self._names), valid)
